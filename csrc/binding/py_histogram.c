/* SPDX-License-Identifier: BSD-3-Clause */
/* py_histogram.c: _core.histogram: pairs by distance, counted or weighted. */
#include "py_functions.h"

#include "convert.h"
#include "py_call.h"
#include "errors.h"

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

/* Zeros of shape (n_types, n_types, n_edges); of float64 where there are weights. */
static PyObject *
new_result(hs_histogram *wanted)
{
    npy_intp   shape[3] = {wanted->n_types, wanted->n_types, (npy_intp)wanted->n_edges};
    const bool sums = wanted->of_points.weights != NULL || wanted->of_queries.weights != NULL;
    PyObject  *array = PyArray_ZEROS(3, shape, sums ? NPY_DOUBLE : NPY_INT64, 0);
    if (array != NULL && sums) {
        wanted->sums = PyArray_DATA((PyArrayObject *)array);
    } else if (array != NULL) {
        wanted->counts = PyArray_DATA((PyArrayObject *)array);
    }
    return array;
}

PyObject *
hs_py_histogram(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call   call;
    hs_histogram wanted;
    (void)module;
    if (!hs_py_call_take(&call, "histogram", "afQiaaaagh", arguments, n_arguments) ||
        !take_histogram(arguments + HS_CALL_ARGUMENTS, &call, &wanted)) {
        return NULL;
    }
    PyObject *array = new_result(&wanted);
    if (array == NULL) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status = hs_pairs_histogram(&call.among, &call.options, &wanted, &call.failure);
    hs_py_call_acquire(&call);
    if (status != HS_OK) {
        Py_DECREF(array);
        return hs_raise(status, &call.failure, &call.options);
    }
    return array;
}
