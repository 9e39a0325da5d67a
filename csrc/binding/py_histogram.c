/* SPDX-License-Identifier: BSD-3-Clause */
/* py_histogram.c: _core.histogram: pairs by distance, counted or weighted. */
#include "py_functions.h"

#include "many_systems.h"
#include "convert.h"
#include "errors.h"

#include <string.h>

/* A C-contiguous array of this type and length; None, where that may be, leaves *data alone. */
static bool
take_column(PyObject *object, int type, int64_t length, const char *name, const void **data)
{
    PyArrayObject *array = (PyArrayObject *)object;
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, type, 1) || (length >= 0 && PyArray_DIM(array, 0) != length)) {
        PyErr_Format(PyExc_TypeError, "%s is not an array of the expected type and length", name);
        return false;
    }
    *data = PyArray_DATA(array);
    return true;
}

static bool
take_marks(PyObject *types, PyObject *weights, const char *name, int64_t n, hs_marks *marks)
{
    const void *of_types = NULL, *of_weights = NULL;
    if (!take_column(types, NPY_INT32, n, name, &of_types) ||
        !take_column(weights, NPY_DOUBLE, n, name, &of_weights)) {
        return false;
    }
    *marks = (hs_marks){of_types, of_weights};
    return true;
}

/* The views among edges, last_inclusive, queries, n_types; types and weights of the points and of
 * the queries. */
static bool
take_histogram(PyObject *const *more, const hs_py_call *call, hs_histogram *wanted)
{
    const void *edges = NULL;
    if (!take_column(more[0], NPY_DOUBLE, -1, "edges", &edges)) {
        return false;
    }
    if (edges == NULL || call->integer < 1 || call->integer > INT32_MAX) {
        PyErr_SetString(PyExc_ValueError, "edges and a number of types are expected");
        return false;
    }
    *wanted = (hs_histogram){.n_edges = PyArray_DIM((PyArrayObject *)more[0], 0),
                             .edges = edges,
                             .inclusive = call->options.inclusive,
                             .last_inclusive = call->flag,
                             .n_types = (int32_t)call->integer};
    return take_marks(more[4], more[5], "types or weights", call->points.n, &wanted->of_points) &&
           take_marks(more[6], more[7], "types or weights of queries",
                      call->among.queries != NULL ? call->queries.n : 0, &wanted->of_queries);
}

/* Zeros of shape (n_types, n_types, n_edges), before these the systems if there is a batch; of
 * float64 where there are weights. */
static PyObject *
new_result(const hs_batch *batch, hs_histogram *wanted)
{
    npy_intp   shape[3] = {wanted->n_types, wanted->n_types, (npy_intp)wanted->n_edges};
    const bool sums = wanted->of_points.weights != NULL || wanted->of_queries.weights != NULL;
    const int  type = sums ? NPY_DOUBLE : NPY_INT64;
    PyObject  *array = batch->is_given ? hs_batch_zeros(batch, 3, shape, type)
                                       : PyArray_ZEROS(3, shape, type, 0);
    if (array != NULL && sums) {
        wanted->sums = PyArray_DATA((PyArrayObject *)array);
    } else if (array != NULL) {
        wanted->counts = PyArray_DATA((PyArrayObject *)array);
    }
    return array;
}

/* The results of systems that have points stand one behind the other: moves each to the place of
 * its number, the last one first. */
static void
spread(const hs_batch *batch, const hs_histogram *wanted)
{
    const size_t bytes = (size_t)wanted->n_types * (size_t)wanted->n_types *
                         (size_t)wanted->n_edges * sizeof(int64_t);
    char *data = wanted->sums != NULL ? (char *)wanted->sums : (char *)wanted->counts;
    for (int64_t s = batch->systems.n - 1; batch->number != NULL && s >= 0; s--) {
        if (batch->number[s] != s) {
            memcpy(data + (size_t)batch->number[s] * bytes, data + (size_t)s * bytes, bytes);
            memset(data + (size_t)s * bytes, 0, bytes);
        }
    }
}

/* False with an exception set. */
static bool
fill_result(hs_py_call *call, hs_batch *batch, const hs_histogram *wanted)
{
    hs_py_call_release(call);
    const hs_status status =
        batch->is_given ? hs_systems_histogram(&call->points, call->among.queries, &batch->systems,
                                               &call->options, wanted, &call->failure)
                        : hs_pairs_histogram(&call->among, &call->options, wanted, &call->failure);
    hs_py_call_acquire(call);
    if (status == HS_OK && batch->is_given) {
        spread(batch, wanted);
    }
    hs_batch_forget_system(batch, &call->failure);
    if (status != HS_OK) {
        (void)hs_raise(status, &call->failure, &call->options);
    }
    return status == HS_OK;
}

PyObject *
hs_py_histogram(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call   call;
    hs_histogram wanted;
    hs_batch     batch;
    (void)module;
    if (!hs_py_call_take(&call, "histogram", "afQiaaaaghm", arguments, n_arguments) ||
        !take_histogram(arguments + HS_CALL_ARGUMENTS, &call, &wanted) ||
        !hs_batch_take_optional(&call, &batch)) {
        return NULL;
    }
    PyObject *array = new_result(&batch, &wanted);
    if (array != NULL && !fill_result(&call, &batch, &wanted)) {
        Py_CLEAR(array);
    }
    hs_batch_free(&batch);
    return array;
}
