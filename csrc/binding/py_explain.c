/* SPDX-License-Identifier: BSD-3-Clause */
/* py_explain.c: _core.explain: what would be done, and what was done. */
#include "py_functions.h"

#include "convert.h"
#include "py_call.h"
#include "errors.h"
#include "tuples.h"

static PyObject *
name_of(hs_algorithm algorithm)
{
    return PyUnicode_FromString(hs_algorithm_names[algorithm]);
}

static bool
put_plan(PyObject *dict, const hs_plan *plan)
{
    return hs_dict_put(dict, "ndim", PyLong_FromLong(plan->ndim)) &&
           hs_dict_put(dict, "n_periodic", PyLong_FromLong(plan->n_periodic)) &&
           hs_dict_put(dict, "aligned", PyBool_FromLong(plan->aligned)) &&
           hs_dict_put(dict, "reduced", PyBool_FromLong(plan->reduced)) &&
           hs_dict_put(dict, "keeps_originals", PyBool_FromLong(plan->keeps_originals)) &&
           hs_dict_put(dict, "algorithm", name_of(plan->algorithm)) &&
           hs_dict_put(dict, "n_searches", PyLong_FromLongLong(plan->n_searches)) &&
           hs_dict_put(dict, "n_cells", PyLong_FromLongLong(plan->n_cells)) &&
           hs_dict_put(dict, "all_pairs", PyBool_FromLong(plan->all_pairs)) &&
           hs_dict_put(dict, "sparse", PyBool_FromLong(plan->sparse)) &&
           hs_dict_put(dict, "shape", hs_tuple_of_integers(plan->shape, plan->ndim)) &&
           hs_dict_put(dict, "cell_sizes", hs_tuple_of_reals(plan->cell_size, plan->ndim)) &&
           hs_dict_put(dict, "reach", hs_tuple_of_integers(plan->reach, plan->ndim)) &&
           hs_dict_put(dict, "images", hs_tuple_of_integers(plan->images, plan->ndim)) &&
           hs_dict_put(dict, "stencil_rows", PyLong_FromLongLong(plan->stencil_rows)) &&
           hs_dict_put(dict, "expected_pairs", PyFloat_FromDouble(plan->expected_pairs)) &&
           hs_dict_put(dict, "threads", PyLong_FromLong(plan->threads)) &&
           hs_dict_put(dict, "kernel", PyUnicode_FromString(plan->kernel));
}

static bool
put_bytes(PyObject *dict, const hs_counters *counters)
{
    static const char *const names[HS_PURPOSE_END] = {
        [HS_FOR_POINTS] = "points",         [HS_FOR_ORIGINALS] = "originals",
        [HS_FOR_WRAPS] = "wraps",           [HS_FOR_ORDER] = "order",
        [HS_FOR_CELLS] = "cells",           [HS_FOR_STENCIL] = "stencil",
        [HS_FOR_CANDIDATES] = "candidates", [HS_FOR_INDICES] = "indices",
        [HS_FOR_DISTANCES] = "distances",   [HS_FOR_VECTORS] = "vectors",
        [HS_FOR_SHIFTS] = "shifts",         [HS_FOR_SORTING] = "sorting",
        [HS_FOR_SUPPORTS] = "supports",
    };
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        if (!hs_dict_put(dict, names[p], PyLong_FromLongLong(counters->bytes[p]))) {
            return false;
        }
    }
    return true;
}

static bool
put_counters(PyObject *dict, const hs_counters *counters)
{
    PyObject *bytes = PyDict_New();
    if (bytes == NULL || !put_bytes(bytes, counters)) {
        Py_XDECREF(bytes);
        return false;
    }
    return hs_dict_put(dict, "bytes", bytes) &&
           hs_dict_put(dict, "bytes_peak", PyLong_FromLongLong(counters->bytes_peak)) &&
           hs_dict_put(dict, "groups", PyLong_FromLongLong(counters->groups)) &&
           hs_dict_put(dict, "candidates", PyLong_FromLongLong(counters->candidates)) &&
           hs_dict_put(dict, "pairs", PyLong_FromLongLong(counters->pairs)) &&
           hs_dict_put(dict, "ambiguous", PyLong_FromLongLong(counters->ambiguous)) &&
           hs_dict_put(dict, "by_float64", PyLong_FromLongLong(counters->by_float64)) &&
           hs_dict_put(dict, "by_double_word", PyLong_FromLongLong(counters->by_double_word)) &&
           hs_dict_put(dict, "by_integers", PyLong_FromLongLong(counters->by_integers));
}

/* A new dictionary; NULL on failure. counters: NULL when nothing was measured. */
static PyObject *
dictionary_of(const hs_plan *plan, const hs_counters *counters)
{
    PyObject *dict = PyDict_New();
    if (dict == NULL || !put_plan(dict, plan) ||
        (counters != NULL && !put_counters(dict, counters))) {
        Py_XDECREF(dict);
        return NULL;
    }
    return dict;
}

PyObject *
hs_py_explain(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call  call;
    hs_plan     plan;
    hs_counters counters = {0};
    hs_pairs   *pairs = NULL;
    (void)module;
    if (!hs_py_call_take(&call, "explain", "qsbfhg", arguments, n_arguments)) {
        return NULL;
    }
    hs_py_call_release(&call);
    hs_status status = hs_plan_make(&call.among, &call.options, &plan, &call.failure);
    if (status == HS_OK && call.flag) {
        call.options.counters = &counters;
        status = hs_pairs_find(&call.among, &call.options, &pairs, &call.failure);
    }
    hs_py_call_acquire(&call);
    hs_pairs_free(pairs);
    return status == HS_OK ? dictionary_of(&plan, call.flag ? &counters : NULL)
                           : hs_raise(status, &call.failure, &call.options);
}
