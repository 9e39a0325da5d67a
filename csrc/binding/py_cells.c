/* SPDX-License-Identifier: BSD-3-Clause */
/* py_cells.c: cells that are kept: building them, looking at them. Searches take them in place of
 * points. */
#include "py_functions.h"

#include "py_call.h"
#include "convert.h"
#include "errors.h"
#include "tuples.h"

static void
free_cells(PyObject *capsule)
{
    hs_cells_free(hs_cells_of(capsule));
}

PyObject *
hs_py_cells_build(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_cells  *cells = NULL;
    (void)module;
    if (!hs_py_call_take(&call, "cells_build", "x", arguments, n_arguments)) {
        return NULL;
    }
    call.options.cell_size = call.real;
    hs_py_call_release(&call);
    const hs_status status =
        hs_cells_build(&call.points, call.among.box, &call.options, &cells, &call.failure);
    hs_py_call_acquire(&call);
    if (status != HS_OK) {
        return hs_raise(status, &call.failure, &call.options);
    }
    PyObject *capsule = PyCapsule_New(cells, HS_CELLS_NAME, free_cells);
    if (capsule == NULL) {
        hs_cells_free(cells);
    }
    return capsule;
}

/* A read-only array of n rows, or of n numbers if `width` is 0, that borrows from the cells and
 * keeps them alive. */
static PyObject *
view_of(PyObject *capsule, int type, const void *data, int64_t n, int width)
{
    npy_intp  shape[2] = {(npy_intp)n, width};
    const int ndim = width > 0 ? 2 : 1;
    PyObject *array = PyArray_SimpleNewFromData(ndim, shape, type, (void *)(uintptr_t)data);
    if (array == NULL) {
        return NULL;
    }
    PyArray_CLEARFLAGS((PyArrayObject *)array, NPY_ARRAY_WRITEABLE);
    Py_INCREF(capsule);
    if (PyArray_SetBaseObject((PyArrayObject *)array, capsule) < 0) {
        Py_DECREF(array);
        return NULL;
    }
    return array;
}

/* Indices of occupied cells along the axes; None where all cells have an id. */
static PyObject *
indices_of(const hs_cells *cells, const hs_layout *layout)
{
    npy_intp shape[2] = {(npy_intp)layout->n_cells, layout->ndim};
    if (!layout->occupied_only) {
        Py_RETURN_NONE;
    }
    PyObject *array = PyArray_SimpleNew(2, shape, NPY_INT64);
    if (array != NULL) {
        hs_cells_indices(cells, PyArray_DATA((PyArrayObject *)array));
        PyArray_CLEARFLAGS((PyArrayObject *)array, NPY_ARRAY_WRITEABLE);
    }
    return array;
}

static bool
expect_cells(const hs_cells *cells)
{
    if (cells == NULL) {
        PyErr_SetString(PyExc_TypeError, "expected what cells_build returns");
    }
    return cells != NULL;
}

PyObject *
hs_py_cells_layout(PyObject *module, PyObject *capsule)
{
    const hs_cells *cells = hs_cells_of(capsule);
    hs_layout       layout;
    hs_points       points;
    (void)module;
    if (!expect_cells(cells)) {
        return NULL;
    }
    hs_cells_layout(cells, &layout);
    hs_cells_points(cells, &points);
    const int64_t n_starts = layout.n_cells + 1;
    return Py_BuildValue("{s:N,s:N,s:N,s:N,s:N,s:N}", /* takes the references */
                         "shape", hs_tuple_of_integers(layout.shape, layout.ndim), "cell_sizes",
                         hs_tuple_of_reals(layout.cell_size, layout.ndim), "cell_start",
                         view_of(capsule, NPY_INT32, layout.start, n_starts, 0), "order",
                         view_of(capsule, NPY_INT32, layout.order, layout.n_points, 0), "cell_ids",
                         indices_of(cells, &layout), "points",
                         view_of(capsule, NPY_DOUBLE, points.data, points.n, points.ndim));
}

PyObject *
hs_py_cells_find(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    const hs_cells *cells = n_arguments == 2 ? hs_cells_of(arguments[0]) : NULL;
    hs_points       points, own;
    hs_failure      failure;
    (void)module;
    if (!expect_cells(cells) || !hs_points_of(arguments[1], "points", &points)) {
        return NULL;
    }
    hs_cells_points(cells, &own);
    if (points.ndim != own.ndim) {
        PyErr_Format(PyExc_ValueError, "points must have %d columns, got %d", own.ndim,
                     points.ndim);
        return NULL;
    }
    npy_intp  n = (npy_intp)points.n;
    PyObject *found = PyArray_SimpleNew(1, &n, NPY_INT64);
    if (found == NULL) {
        return NULL;
    }
    hs_status status;
    Py_BEGIN_ALLOW_THREADS
    status = hs_cells_find(cells, &points, PyArray_DATA((PyArrayObject *)found), &failure);
    Py_END_ALLOW_THREADS
    if (status != HS_OK) {
        Py_DECREF(found);
        return hs_raise(status, &failure, NULL);
    }
    return found;
}

PyObject *
hs_py_cells_candidates(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_pairs  *ranges = NULL;
    (void)module;
    if (!hs_py_call_take(&call, "cells_candidates", "Q", arguments, n_arguments) ||
        !expect_cells(call.among.cells)) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status = hs_cells_candidates(call.among.cells, call.among.queries,
                                                 &call.options, &ranges, &call.failure);
    hs_py_call_acquire(&call);
    return hs_py_call_table(&call, status, ranges); /* "ij": where each begins and ends */
}
