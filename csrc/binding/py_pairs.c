/* SPDX-License-Identifier: BSD-3-Clause */
/* py_pairs.c: _core.pairs and _core.count_pairs. */
#include "py_functions.h"

#include "call.h"
#include "convert.h"
#include "errors.h"

#include <string.h>

/* One new array for a letter, and where the core shall write it. Returns a new reference or
 * NULL. */
static PyObject *
array_for(char letter, npy_intp m, int ndim, hs_pair_arrays *arrays)
{
    const int index_type = arrays->index_bytes == 8 ? NPY_INT64 : NPY_INT32;
    npy_intp  shape[2] = {m, letter == 'P' ? 2 : ndim};
    int       type = letter == 'S' ? NPY_INT32 : NPY_DOUBLE;
    if (strchr("ijP", letter) != NULL) {
        type = index_type;
    }
    PyObject *array = PyArray_SimpleNew(strchr("DSP", letter) != NULL ? 2 : 1, shape, type);
    if (array == NULL) {
        return NULL;
    }
    void *data = PyArray_DATA((PyArrayObject *)array);
    switch (letter) {
    case 'i': arrays->i = data; break;
    case 'j': arrays->j = data; break;
    case 'd': arrays->distance = data; break;
    case 'D': arrays->vector = data; break;
    case 'S': arrays->shift = data; break;
    default: arrays->both = data; break;
    }
    return array;
}

/* The arrays in the order of the letters: a tuple, or for one letter the array itself. */
static PyObject *
arrays_from_pairs(hs_call *call, hs_pairs *pairs, const char *letters)
{
    hs_pair_arrays   arrays = {.index_bytes = call->options.index_bytes};
    const Py_ssize_t n = (Py_ssize_t)strlen(letters);
    PyObject        *result = PyTuple_New(n);
    if (result == NULL) {
        return NULL;
    }
    for (Py_ssize_t k = 0; k < n; k++) {
        PyObject *array = array_for(letters[k], (npy_intp)hs_pairs_length(pairs),
                                    call->points.ndim, &arrays);
        if (array == NULL) {
            Py_DECREF(result);
            return NULL;
        }
        PyTuple_SET_ITEM(result, k, array);
    }
    hs_call_release(call);
    const hs_status status = hs_pairs_write(pairs, &arrays);
    hs_call_acquire(call);
    if (status != HS_OK) {
        Py_DECREF(result);
        return hs_raise(status, NULL, &call->options);
    }
    if (n == 1) {
        PyObject *only = Py_NewRef(PyTuple_GET_ITEM(result, 0));
        Py_DECREF(result);
        return only;
    }
    return result;
}

PyObject *
hs_py_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_call     call;
    hs_failure  failure;
    hs_pairs   *pairs = NULL;
    const char *letters;
    (void)module;
    if (n_arguments != HS_CALL_ARGUMENTS + 3) {
        PyErr_Format(PyExc_TypeError, "pairs takes %d arguments", HS_CALL_ARGUMENTS + 3);
        return NULL;
    }
    PyObject *const *more = arguments + HS_CALL_ARGUMENTS; /* quantities, sort, index_bytes */
    if (!hs_call_init(&call, arguments) ||
        !hs_quantities_of(more[0], &letters, &call.options.want)) {
        return NULL;
    }
    const int sorted = PyObject_IsTrue(more[1]);
    call.options.sorted = sorted > 0;
    call.options.index_bytes = (int)PyLong_AsLong(more[2]);
    if (sorted < 0 || PyErr_Occurred()) {
        return NULL;
    }
    hs_call_release(&call);
    const hs_status status =
        hs_pairs_find(&call.points, hs_call_box(&call), &call.options, &pairs, &failure);
    hs_call_acquire(&call);
    if (status != HS_OK) {
        return hs_raise(status, &failure, &call.options);
    }
    PyObject *result = arrays_from_pairs(&call, pairs, letters);
    hs_pairs_free(pairs);
    return result;
}

PyObject *
hs_py_count_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_call    call;
    hs_failure failure;
    int64_t    count = 0;
    (void)module;
    if (n_arguments != HS_CALL_ARGUMENTS) {
        PyErr_Format(PyExc_TypeError, "count_pairs takes %d arguments", HS_CALL_ARGUMENTS);
        return NULL;
    }
    if (!hs_call_init(&call, arguments)) {
        return NULL;
    }
    hs_call_release(&call);
    const hs_status status =
        hs_pairs_count(&call.points, hs_call_box(&call), &call.options, &count, &failure);
    hs_call_acquire(&call);
    if (status != HS_OK) {
        return hs_raise(status, &failure, &call.options);
    }
    return PyLong_FromLongLong(count);
}
