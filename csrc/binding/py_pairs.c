/* SPDX-License-Identifier: BSD-3-Clause */
/* py_pairs.c: _core.pairs and _core.count_pairs. */
#include "py_functions.h"

#include "py_call.h"
#include "errors.h"
#include "py_result.h"

PyObject *
hs_py_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_result  result;
    hs_failure failure;
    hs_pairs  *pairs = NULL;
    (void)module;
    if (!hs_expect_arguments("pairs", n_arguments, HS_CALL_ARGUMENTS + 4)) {
        return NULL;
    }
    if (!hs_py_call_init(&call, arguments) ||
        !hs_result_init(&result, arguments + HS_CALL_ARGUMENTS, &call) ||
        !hs_result_is_apart(&result, arguments[0], "points") ||
        !hs_result_is_apart(&result, arguments[2], "box")) {
        return NULL;
    }
    const hs_among among = hs_py_call_among(&call);
    hs_py_call_release(&call);
    const hs_status status = hs_pairs_find(&among, &call.options, &pairs, &failure);
    hs_py_call_acquire(&call);
    if (status != HS_OK) {
        return hs_raise(status, &failure, &call.options);
    }
    PyObject *arrays = hs_result_of(&result, pairs, &call);
    hs_pairs_free(pairs);
    return arrays;
}

PyObject *
hs_py_count_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_failure failure;
    int64_t    count = 0;
    (void)module;
    if (!hs_expect_arguments("count_pairs", n_arguments, HS_CALL_ARGUMENTS)) {
        return NULL;
    }
    if (!hs_py_call_init(&call, arguments)) {
        return NULL;
    }
    const hs_among among = hs_py_call_among(&call);
    hs_py_call_release(&call);
    const hs_status status = hs_pairs_count(&among, &call.options, &count, &failure);
    hs_py_call_acquire(&call);
    if (status != HS_OK) {
        return hs_raise(status, &failure, &call.options);
    }
    return PyLong_FromLongLong(count);
}
