/* SPDX-License-Identifier: BSD-3-Clause */
/* reach.c: types and lengths of the arrays; the core looks at their values. */
#include "reach.h"

#include "convert.h"

enum { RULE, RADII, QUERY_RADII, TYPES, QUERY_TYPES, TABLE, N_FIELDS };

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

bool
hs_reach_of(PyObject *object, int64_t n_points, int64_t n_queries, hs_reach *reach)
{
    const void *radii, *query_radii, *types, *query_types;
    *reach = (hs_reach){.n_types = 0};
    if (!PyTuple_CheckExact(object) || PyTuple_GET_SIZE(object) != N_FIELDS ||
        !PyLong_CheckExact(PyTuple_GET_ITEM(object, RULE))) {
        PyErr_SetString(PyExc_TypeError, "reach must be None or a tuple of six");
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
    return take_table(PyTuple_GET_ITEM(object, TABLE), reach);
}
