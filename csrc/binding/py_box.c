/* SPDX-License-Identifier: BSD-3-Clause */
/* py_box.c: _core.box_measure, _core.box_wrap and _core.box_places. */
#include "py_functions.h"

#include "convert.h"
#include "errors.h"

#include <string.h>

/* Points between two looks for Ctrl-C: some hundredths of a second in the most skewed box. */
#define POINTS_PER_CALL 32768

static PyObject *
heights_and_volume(const double *heights, int ndim, double volume)
{
    npy_intp  shape[1] = {ndim};
    PyObject *array = PyArray_SimpleNew(1, shape, NPY_DOUBLE);
    if (array == NULL) {
        return NULL;
    }
    memcpy(PyArray_DATA((PyArrayObject *)array), heights, (size_t)ndim * sizeof(double));
    return Py_BuildValue("(Nd)", array, volume);
}

PyObject *
hs_py_box_measure(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_box        box;
    hs_failure    failure;
    bool          given;
    unsigned long repeats;
    double        heights[HS_MAX_DIM] = {0}, volume;
    (void)module;
    if (n_arguments != 2 || !PyArray_Check(arguments[0]) ||
        PyArray_NDIM((PyArrayObject *)arguments[0]) != 2) {
        PyErr_SetString(PyExc_TypeError, "box_measure takes a box (d, d) and periodic bits");
        return NULL;
    }
    const npy_intp ndim = PyArray_DIM((PyArrayObject *)arguments[0], 0);
    if (ndim < 1 || ndim > HS_MAX_DIM) {
        PyErr_Format(PyExc_ValueError, "box must have shape (d, d) with 1 <= d <= %d", HS_MAX_DIM);
        return NULL;
    }
    if (!hs_repeats_of(arguments[1], &repeats) ||
        !hs_box_of(arguments[0], repeats, (int)ndim, &box, &given)) {
        return NULL;
    }
    const hs_status status = hs_box_measure(&box, heights, &volume, &failure);
    if (status != HS_OK) {
        return hs_raise(status, &failure, NULL);
    }
    return heights_and_volume(heights, (int)ndim, volume);
}

/* Whether a failure's row is one of the points, and not of the box. */
static bool
is_of_point(hs_status status)
{
    return status == HS_ERR_NOT_FINITE || status == HS_ERR_SHIFT_RANGE;
}

/* Wraps some points after others; signals are handled in between. Returns false with an exception
 * set. */
static bool
wrap_in_parts(const hs_box *box, const hs_points *points, double *wrapped, int64_t *shifts)
{
    hs_points  part = *points;
    hs_failure failure;
    int64_t    first = 0;
    do {
        hs_status status;
        part.n = points->n - first < POINTS_PER_CALL ? points->n - first : POINTS_PER_CALL;
        part.data = (const char *)points->data + first * points->row_stride;
        Py_BEGIN_ALLOW_THREADS
        status = hs_box_wrap(box, &part, wrapped + first * points->ndim,
                             shifts + first * points->ndim, &failure);
        Py_END_ALLOW_THREADS
        if (status != HS_OK) {
            failure.row += failure.row >= 0 && is_of_point(status) ? first : 0;
            hs_raise(status, &failure, NULL);
            return false;
        }
        if (PyErr_CheckSignals() != 0) {
            return false;
        }
        first += part.n;
    } while (first < points->n);
    return true;
}

PyObject *
hs_py_box_wrap(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_points     points;
    hs_box        box;
    bool          given;
    unsigned long repeats;
    (void)module;
    if (n_arguments != 3) {
        PyErr_SetString(PyExc_TypeError, "box_wrap takes points, a box and periodic bits");
        return NULL;
    }
    if (!hs_repeats_of(arguments[2], &repeats) || !hs_points_of(arguments[0], "points", &points) ||
        !hs_box_of(arguments[1], repeats, points.ndim, &box, &given)) {
        return NULL;
    }
    if (!given) {
        PyErr_SetString(PyExc_TypeError, "box_wrap needs a box");
        return NULL;
    }
    npy_intp  shape[2] = {(npy_intp)points.n, points.ndim};
    PyObject *wrapped = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    PyObject *shifts = PyArray_SimpleNew(2, shape, NPY_INT64);
    if (wrapped == NULL || shifts == NULL ||
        !wrap_in_parts(&box, &points, PyArray_DATA((PyArrayObject *)wrapped),
                       PyArray_DATA((PyArrayObject *)shifts))) {
        Py_XDECREF(wrapped);
        Py_XDECREF(shifts);
        return NULL;
    }
    return Py_BuildValue("(NN)", wrapped, shifts);
}

/* As wrap_in_parts. Without points it is called once, for the axes. */
static bool
places_in_parts(const hs_box *box, const hs_points *points, double cutoff, double largest,
                double *places, hs_box_axes *axes)
{
    hs_points  part = *points;
    hs_failure failure;
    int64_t    first = 0;
    do {
        hs_status status;
        part.n = points->n - first < POINTS_PER_CALL ? points->n - first : POINTS_PER_CALL;
        part.data = (const char *)points->data + first * points->row_stride;
        Py_BEGIN_ALLOW_THREADS
        status =
            hs_box_places(box, &part, cutoff, largest, places + first, points->n, axes, &failure);
        Py_END_ALLOW_THREADS
        if (status != HS_OK) {
            const hs_options options = {.cutoff = cutoff};
            failure.row += failure.row >= 0 && is_of_point(status) ? first : 0;
            hs_raise(status, &failure, &options);
            return false;
        }
        if (PyErr_CheckSignals() != 0) {
            return false;
        }
        first += part.n;
    } while (first < points->n);
    return true;
}

PyObject *
hs_py_box_places(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_points     points;
    hs_box        box;
    hs_box_axes   axes;
    bool          given;
    unsigned long repeats;
    (void)module;
    if (n_arguments != 5) {
        PyErr_SetString(PyExc_TypeError,
                        "box_places takes points, a box, periodic bits, a cutoff and the largest "
                        "coordinate");
        return NULL;
    }
    const double cutoff = PyFloat_AsDouble(arguments[3]);
    const double largest = PyErr_Occurred() ? 0.0 : PyFloat_AsDouble(arguments[4]);
    if (PyErr_Occurred() || !hs_repeats_of(arguments[2], &repeats) ||
        !hs_points_of(arguments[0], "points", &points) ||
        !hs_box_of(arguments[1], repeats, points.ndim, &box, &given)) {
        return NULL;
    }
    npy_intp  shape[2] = {points.ndim, (npy_intp)points.n};
    PyObject *places = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
    if (places == NULL || !places_in_parts(given ? &box : NULL, &points, cutoff, largest,
                                           PyArray_DATA((PyArrayObject *)places), &axes)) {
        Py_XDECREF(places);
        return NULL;
    }
    PyObject *of_axes[3] = {PyTuple_New(points.ndim), PyTuple_New(points.ndim),
                            PyTuple_New(points.ndim)};
    bool      made = of_axes[0] != NULL && of_axes[1] != NULL && of_axes[2] != NULL;
    for (int k = 0; made && k < points.ndim; k++) {
        PyTuple_SET_ITEM(of_axes[0], k, PyBool_FromLong(axes.repeats[k]));
        PyTuple_SET_ITEM(of_axes[1], k, PyFloat_FromDouble(axes.reach[k]));
        PyTuple_SET_ITEM(of_axes[2], k, PyFloat_FromDouble(axes.width[k]));
        made = !PyErr_Occurred();
    }
    if (!made) {
        Py_DECREF(places);
        for (int k = 0; k < 3; k++) {
            Py_XDECREF(of_axes[k]);
        }
        return NULL;
    }
    return Py_BuildValue("(NNNN)", places, of_axes[0], of_axes[1], of_axes[2]);
}
