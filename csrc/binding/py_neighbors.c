/* SPDX-License-Identifier: BSD-3-Clause */
/* py_neighbors.c: full lists: pairs of two sets, and the rows of each point or query. */
#include "py_functions.h"

#include "errors.h"
#include "py_call.h"

/* Rows of all neighbours, or NULL. */
static hs_status
find_rows(hs_py_call *call, hs_pairs **rows)
{
    *rows = NULL;
    hs_py_call_release(call);
    const hs_status status = hs_neighbors_find(&call->among, &call->options, rows, &call->failure);
    hs_py_call_acquire(call);
    return status;
}

PyObject *
hs_py_pairs_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_pairs  *rows;
    (void)module;
    if (!hs_py_call_take(&call, "pairs_between", "qsboRhgc", arguments, n_arguments) ||
        !hs_py_call_make_room(&call)) {
        return NULL;
    }
    const hs_status status = find_rows(&call, &rows);
    return hs_py_call_pairs(&call, status, rows);
}

PyObject *
hs_py_neighbors(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_pairs  *rows;
    (void)module;
    if (!hs_py_call_take(&call, "neighbors", "rbQhg", arguments, n_arguments)) {
        return NULL;
    }
    const hs_status status = find_rows(&call, &rows);
    return hs_py_call_table(&call, status, rows);
}

PyObject *
hs_py_coordination(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    (void)module;
    if (!hs_py_call_take(&call, "coordination", "Qhg", arguments, n_arguments)) {
        return NULL;
    }
    npy_intp  n_rows = (npy_intp)(call.among.queries != NULL ? call.queries.n : call.points.n);
    PyObject *counts = PyArray_SimpleNew(1, &n_rows, NPY_INT64);
    if (counts == NULL) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status = hs_neighbors_count(
        &call.among, &call.options, PyArray_DATA((PyArrayObject *)counts), &call.failure);
    hs_py_call_acquire(&call);
    if (status != HS_OK) {
        Py_DECREF(counts);
        return hs_raise(status, &call.failure, &call.options);
    }
    return counts;
}
