/* SPDX-License-Identifier: BSD-3-Clause */
/* py_neighbors.c: full searches: _core.pairs_between and count_between of two sets, and the rows of
 * each point or query, _core.neighbors and coordination. */
#include "py_functions.h"

#include "py_call.h"
#include "convert.h"
#include "errors.h"
#include "outputs.h"
#include "py_result.h"

/* Where two sets are asked for, None is none of them. */
static bool
expect_queries(PyObject *queries)
{
    if (queries == Py_None) {
        PyErr_SetString(PyExc_TypeError, "queries must be an array, got NoneType");
    }
    return queries != Py_None;
}

/* Rows of all neighbours, or NULL with an exception set. */
static hs_pairs *
find_rows(hs_py_call *call)
{
    hs_failure     failure;
    hs_pairs      *rows = NULL;
    const hs_among among = hs_py_call_among(call);
    hs_py_call_release(call);
    const hs_status status = hs_neighbors_find(&among, &call->options, &rows, &failure);
    hs_py_call_acquire(call);
    if (status != HS_OK) {
        (void)hs_raise(status, &failure, &call->options);
    }
    return rows;
}

PyObject *
hs_py_pairs_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    PyObject *const *more = arguments + HS_CALL_ARGUMENTS;
    hs_py_call       call;
    hs_result        result;
    (void)module;
    if (!hs_expect_arguments("pairs_between", n_arguments, HS_CALL_ARGUMENTS + 5) ||
        !expect_queries(more[4]) || !hs_py_call_init_sets(&call, arguments, more[4]) ||
        !hs_result_init(&result, more, &call) || !hs_result_is_apart(&result, more[4], "queries") ||
        !hs_result_is_apart(&result, arguments[0], "points") ||
        !hs_result_is_apart(&result, arguments[2], "box")) {
        return NULL;
    }
    hs_pairs *rows = find_rows(&call);
    PyObject *arrays = rows != NULL ? hs_result_of(&result, rows, &call) : NULL;
    hs_pairs_free(rows);
    return arrays;
}

PyObject *
hs_py_count_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_failure failure;
    int64_t    count = 0;
    (void)module;
    if (!hs_expect_arguments("count_between", n_arguments, HS_CALL_ARGUMENTS + 1) ||
        !expect_queries(arguments[HS_CALL_ARGUMENTS]) ||
        !hs_py_call_init_sets(&call, arguments, arguments[HS_CALL_ARGUMENTS])) {
        return NULL;
    }
    const hs_among among = hs_py_call_among(&call);
    hs_py_call_release(&call);
    const hs_status status = hs_pairs_count(&among, &call.options, &count, &failure);
    hs_py_call_acquire(&call);
    return status == HS_OK ? PyLong_FromLongLong(count) : hs_raise(status, &failure, &call.options);
}

PyObject *
hs_py_neighbors(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    PyObject *const *more = arguments + HS_CALL_ARGUMENTS;
    hs_py_call       call;
    const char      *letters;
    (void)module;
    if (!hs_expect_arguments("neighbors", n_arguments, HS_CALL_ARGUMENTS + 3) ||
        !hs_py_call_init_sets(&call, arguments, more[2]) ||
        !hs_quantities_of(more[0], HS_ROW_LETTERS, &letters, &call.options.want)) {
        return NULL;
    }
    call.options.index_bytes = (int)PyLong_AsLong(more[1]);
    if (PyErr_Occurred()) {
        return NULL;
    }
    hs_pairs *rows = find_rows(&call);
    PyObject *table = rows != NULL
                          ? hs_table_of(rows, letters, call.points.ndim, call.options.index_bytes)
                          : NULL;
    hs_pairs_free(rows);
    return table;
}

PyObject *
hs_py_coordination(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_failure failure;
    (void)module;
    if (!hs_expect_arguments("coordination", n_arguments, HS_CALL_ARGUMENTS + 1) ||
        !hs_py_call_init_sets(&call, arguments, arguments[HS_CALL_ARGUMENTS])) {
        return NULL;
    }
    npy_intp  n_rows = (npy_intp)(call.has_queries ? call.queries.n : call.points.n);
    PyObject *counts = PyArray_SimpleNew(1, &n_rows, NPY_INT64);
    if (counts == NULL) {
        return NULL;
    }
    const hs_among among = hs_py_call_among(&call);
    hs_py_call_release(&call);
    const hs_status status =
        hs_neighbors_count(&among, &call.options, PyArray_DATA((PyArrayObject *)counts), &failure);
    hs_py_call_acquire(&call);
    if (status != HS_OK) {
        Py_DECREF(counts);
        return hs_raise(status, &failure, &call.options);
    }
    return counts;
}
