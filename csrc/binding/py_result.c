/* SPDX-License-Identifier: BSD-3-Clause */
/* py_result.c: arrays take over the memory of a result. */
#include "py_result.h"

#include "convert.h"
#include "outputs.h"

bool
hs_result_init(hs_result *result, PyObject *const *arguments, hs_py_call *call)
{
    hs_options *options = &call->options;
    if (!hs_quantities_of(arguments[0], HS_LETTERS, &result->letters, &options->want)) {
        return false;
    }
    const int sorted = PyObject_IsTrue(arguments[1]);
    options->sorted = sorted > 0;
    options->index_bytes = (int)PyLong_AsLong(arguments[2]);
    if (sorted < 0 || PyErr_Occurred()) {
        return false;
    }
    result->out = arguments[3] == Py_None ? NULL : arguments[3];
    if (result->out != NULL) {
        options->out = &result->arrays;
        return hs_out_of(result->out, result->letters, call->points.ndim, options->index_bytes,
                         &result->arrays);
    }
    return true;
}

bool
hs_result_is_apart(const hs_result *result, PyObject *input, const char *name)
{
    return result->out == NULL || hs_out_is_apart(result->out, result->letters, input, name);
}

PyObject *
hs_result_of(const hs_result *result, hs_pairs *pairs, const hs_py_call *call)
{
    if (result->out != NULL) {
        return hs_out_filled(result->out, result->letters, hs_pairs_length(pairs));
    }
    return hs_arrays_of(pairs, result->letters, call->points.ndim, call->options.index_bytes);
}
