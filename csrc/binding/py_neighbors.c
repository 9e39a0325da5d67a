/* SPDX-License-Identifier: BSD-3-Clause */
/* py_neighbors.c: full lists: pairs of two sets, and the rows of each point or query. */
#include "py_functions.h"

#include "many_systems.h"
#include "errors.h"

/* Rows of all neighbours, or NULL. */
static hs_status
find_rows(hs_py_call *call, hs_batch *batch, hs_pairs **rows)
{
    const hs_options *options = &call->options;
    *rows = NULL;
    hs_py_call_release(call);
    const hs_status status =
        batch->is_given ? hs_systems_neighbors(&call->points, call->among.queries, &batch->systems,
                                               options, rows, &call->failure)
                        : hs_neighbors_find(&call->among, options, rows, &call->failure);
    hs_py_call_acquire(call);
    hs_batch_forget_system(batch, &call->failure);
    hs_batch_free(batch);
    return status;
}

PyObject *
hs_py_pairs_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_pairs  *rows;
    hs_batch   batch;
    (void)module;
    if (!hs_py_call_take(&call, "pairs_between", "qsboRhgcm", arguments, n_arguments) ||
        !hs_batch_take_optional(&call, &batch)) {
        return NULL;
    }
    if (!hs_py_call_make_room(&call)) {
        hs_batch_free(&batch);
        return NULL;
    }
    const hs_status status = find_rows(&call, &batch, &rows);
    return hs_py_call_pairs(&call, status, rows);
}

PyObject *
hs_py_neighbors(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_pairs  *rows;
    hs_batch   batch;
    (void)module;
    if (!hs_py_call_take(&call, "neighbors", "rbQhgm", arguments, n_arguments) ||
        !hs_batch_take_optional(&call, &batch)) {
        return NULL;
    }
    const hs_status status = find_rows(&call, &batch, &rows);
    return hs_py_call_table(&call, status, rows);
}

PyObject *
hs_py_coordination(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_batch   batch;
    (void)module;
    if (!hs_py_call_take(&call, "coordination", "Qhgm", arguments, n_arguments) ||
        !hs_batch_take_optional(&call, &batch)) {
        return NULL;
    }
    npy_intp  n_rows = (npy_intp)(call.among.queries != NULL ? call.queries.n : call.points.n);
    PyObject *counts = PyArray_SimpleNew(1, &n_rows, NPY_INT64);
    if (counts == NULL) {
        hs_batch_free(&batch);
        return NULL;
    }
    int64_t *to = PyArray_DATA((PyArrayObject *)counts);
    hs_py_call_release(&call);
    const hs_status status =
        batch.is_given ? hs_systems_coordination(&call.points, call.among.queries, &batch.systems,
                                                 &call.options, to, &call.failure)
                       : hs_neighbors_count(&call.among, &call.options, to, &call.failure);
    hs_py_call_acquire(&call);
    hs_batch_forget_system(&batch, &call.failure);
    hs_batch_free(&batch);
    if (status != HS_OK) {
        Py_DECREF(counts);
        return hs_raise(status, &call.failure, &call.options);
    }
    return counts;
}
