/* SPDX-License-Identifier: BSD-3-Clause */
/* py_batch.c: _core.batch_pairs and _core.batch_count: many systems in one call. */
#include "py_functions.h"

#include "many_systems.h"
#include "errors.h"

PyObject *
hs_py_batch_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_pairs  *pairs = NULL;
    hs_batch   batch;
    (void)module;
    if (!hs_py_call_take(&call, "batch_pairs", "qsboaaaaahgc", arguments, n_arguments) ||
        !hs_batch_take(arguments + HS_CALL_ARGUMENTS + 4, &call, &batch)) {
        return NULL;
    }
    if (!hs_py_call_make_room(&call)) {
        hs_batch_free(&batch);
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status =
        hs_systems_find(&call.points, &batch.systems, &call.options, &pairs, &call.failure);
    hs_py_call_acquire(&call);
    hs_batch_forget_system(&batch, &call.failure);
    hs_batch_free(&batch);
    return hs_py_call_pairs(&call, status, pairs);
}

static void
put_counts(const hs_batch *batch, const int64_t *counts, int64_t *to)
{
    for (int64_t s = 0; s < batch->systems.n; s++) {
        to[batch->number != NULL ? batch->number[s] : s] = counts[s];
    }
}

PyObject *
hs_py_batch_count(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_batch   batch;
    (void)module;
    if (!hs_py_call_take(&call, "batch_count", "aaaaahg", arguments, n_arguments) ||
        !hs_batch_take(arguments + HS_CALL_ARGUMENTS, &call, &batch)) {
        return NULL;
    }
    PyObject *array = hs_batch_zeros(&batch, 0, NULL, NPY_INT64);
    int64_t  *counts = PyMem_Malloc((size_t)batch.systems.n * sizeof *counts + 1);
    if (array != NULL && counts == NULL) {
        PyErr_NoMemory();
        Py_CLEAR(array);
    }
    if (array != NULL) {
        hs_py_call_release(&call);
        const hs_status status =
            hs_systems_count(&call.points, &batch.systems, &call.options, counts, &call.failure);
        hs_py_call_acquire(&call);
        if (status == HS_OK) {
            put_counts(&batch, counts, PyArray_DATA((PyArrayObject *)array));
        } else {
            hs_batch_forget_system(&batch, &call.failure);
            Py_CLEAR(array);
            (void)hs_raise(status, &call.failure, &call.options);
        }
    }
    PyMem_Free(counts);
    hs_batch_free(&batch);
    return array;
}
