/* SPDX-License-Identifier: BSD-3-Clause */
/* reach.c: types and lengths of the arrays; the core looks at their values. */
#include "reach.h"

#include "convert.h"

enum {
    RULE,
    RADII,
    QUERY_RADII,
    TYPES,
    QUERY_TYPES,
    TABLE,
    SUPPORTS,
    QUERY_SUPPORTS,
    EXTENT,
    N_FIELDS
};

/* The entries of a C-contiguous array of this type and length, or NULL for None. */
static bool
take_entries(PyObject *object, int type, int64_t length, const void **entries)
{
    *entries = NULL;
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, type, 1) || PyArray_DIM((PyArrayObject *)object, 0) != length) {
        PyErr_SetString(PyExc_TypeError,
                        "radii and types must be arrays of one entry for each point or query");
        return false;
    }
    *entries = PyArray_DATA((PyArrayObject *)object);
    return true;
}

static bool
take_table(PyObject *object, hs_reach *reach)
{
    PyArrayObject *array = (PyArrayObject *)object;
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, NPY_DOUBLE, 2) || PyArray_DIM(array, 0) != PyArray_DIM(array, 1) ||
        PyArray_DIM(array, 0) < 1 || PyArray_DIM(array, 0) > INT32_MAX) {
        PyErr_SetString(PyExc_TypeError, "the table of cutoffs must be a square float64 array");
        return false;
    }
    reach->n_types = (int32_t)PyArray_DIM(array, 0);
    reach->cutoffs = PyArray_DATA(array);
    return true;
}

/* The entries of a C-contiguous float64 array of so many square matrices, or NULL for None. */
static bool
take_matrices(PyObject *object, int64_t length, int ndim, const double **entries)
{
    PyArrayObject *array = (PyArrayObject *)object;
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, NPY_DOUBLE, 3) || PyArray_DIM(array, 0) != length ||
        PyArray_DIM(array, 1) != ndim || PyArray_DIM(array, 2) != ndim) {
        PyErr_SetString(PyExc_TypeError,
                        "supports must be float64 arrays of one matrix for each point or query");
        return false;
    }
    *entries = PyArray_DATA(array);
    return true;
}

static bool
take_supports(PyObject *object, int64_t n_points, int64_t n_queries, int ndim, hs_reach *reach)
{
    PyObject *extent = PyTuple_GET_ITEM(object, EXTENT);
    if (extent == Py_None) {
        return true;
    }
    if (!PyFloat_CheckExact(extent)) {
        PyErr_SetString(PyExc_TypeError, "extent must be a float");
        return false;
    }
    reach->has_supports = PyTuple_GET_ITEM(object, SUPPORTS) != Py_None ||
                          PyTuple_GET_ITEM(object, QUERY_SUPPORTS) != Py_None;
    reach->extent = PyFloat_AS_DOUBLE(extent);
    return take_matrices(PyTuple_GET_ITEM(object, SUPPORTS), n_points, ndim, &reach->supports) &&
           take_matrices(PyTuple_GET_ITEM(object, QUERY_SUPPORTS), n_queries, ndim,
                         &reach->query_supports);
}

bool
hs_reach_of(PyObject *object, int64_t n_points, int64_t n_queries, int ndim, hs_reach *reach)
{
    const void *radii, *query_radii, *types, *query_types;
    *reach = (hs_reach){.n_types = 0};
    if (!PyTuple_CheckExact(object) || PyTuple_GET_SIZE(object) != N_FIELDS ||
        !PyLong_CheckExact(PyTuple_GET_ITEM(object, RULE))) {
        PyErr_SetString(PyExc_TypeError, "reach must be None or a tuple of nine");
        return false;
    }
    const long rule = PyLong_AsLong(PyTuple_GET_ITEM(object, RULE));
    if (rule < 0 || rule >= HS_RULE_END) {
        PyErr_Clear(); /* of a number that is no long */
        PyErr_SetString(PyExc_ValueError, "there is no such rule");
        return false;
    }
    if (!take_entries(PyTuple_GET_ITEM(object, RADII), NPY_DOUBLE, n_points, &radii) ||
        !take_entries(PyTuple_GET_ITEM(object, QUERY_RADII), NPY_DOUBLE, n_queries, &query_radii) ||
        !take_entries(PyTuple_GET_ITEM(object, TYPES), NPY_INT32, n_points, &types) ||
        !take_entries(PyTuple_GET_ITEM(object, QUERY_TYPES), NPY_INT32, n_queries, &query_types)) {
        return false;
    }
    reach->rule = (hs_rule)rule;
    reach->radii = radii;
    reach->query_radii = query_radii;
    reach->types = types;
    reach->query_types = query_types;
    return take_table(PyTuple_GET_ITEM(object, TABLE), reach) &&
           take_supports(object, n_points, n_queries, ndim, reach);
}
