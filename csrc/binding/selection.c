/* SPDX-License-Identifier: BSD-3-Clause */
/* selection.c: types and lengths of the arrays; the core looks at their values. */
#include "selection.h"

#include "convert.h"

enum {
    GROUPS,
    QUERY_GROUPS,
    LABELS,
    QUERY_LABELS,
    QUERY_NUMBERS,
    WITHIN,
    EXCLUDED,
    MIN_DISTANCE,
    N_FIELDS
};

/* The entries of a C-contiguous int64 array of this length, or NULL for None. */
static bool
take_labels(PyObject *object, int64_t length, const int64_t **entries)
{
    *entries = NULL;
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, NPY_INT64, 1) || PyArray_DIM((PyArrayObject *)object, 0) != length) {
        PyErr_SetString(PyExc_TypeError,
                        "labels must be int64 arrays of one entry for each point or query");
        return false;
    }
    *entries = PyArray_DATA((PyArrayObject *)object);
    return true;
}

static bool
take_excluded(PyObject *object, hs_selection *selection)
{
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, NPY_INT64, 2) || PyArray_DIM((PyArrayObject *)object, 1) != 2) {
        PyErr_SetString(PyExc_TypeError, "excluded must be an int64 array of two columns");
        return false;
    }
    selection->n_excluded = PyArray_DIM((PyArrayObject *)object, 0);
    selection->excluded = PyArray_DATA((PyArrayObject *)object);
    return true;
}

bool
hs_selection_of(PyObject *object, int64_t n_points, int64_t n_queries, hs_selection *selection)
{
    *selection = (hs_selection){.groups = NULL};
    if (!PyTuple_CheckExact(object) || PyTuple_GET_SIZE(object) != N_FIELDS ||
        !PyLong_CheckExact(PyTuple_GET_ITEM(object, WITHIN)) ||
        !PyFloat_CheckExact(PyTuple_GET_ITEM(object, MIN_DISTANCE))) {
        PyErr_SetString(PyExc_TypeError, "selection must be a tuple of eight");
        return false;
    }
    selection->within = PyLong_AsLongLong(PyTuple_GET_ITEM(object, WITHIN));
    selection->min_distance = PyFloat_AS_DOUBLE(PyTuple_GET_ITEM(object, MIN_DISTANCE));
    if (selection->within < 0) {
        PyErr_Clear(); /* of a number that is no long long */
        PyErr_SetString(PyExc_ValueError, "labels cannot differ by so much");
        return false;
    }
    return take_labels(PyTuple_GET_ITEM(object, GROUPS), n_points, &selection->groups) &&
           take_labels(PyTuple_GET_ITEM(object, QUERY_GROUPS), n_queries,
                       &selection->query_groups) &&
           take_labels(PyTuple_GET_ITEM(object, LABELS), n_points, &selection->labels) &&
           take_labels(PyTuple_GET_ITEM(object, QUERY_LABELS), n_queries,
                       &selection->query_labels) &&
           take_labels(PyTuple_GET_ITEM(object, QUERY_NUMBERS), n_queries,
                       &selection->query_numbers) &&
           take_excluded(PyTuple_GET_ITEM(object, EXCLUDED), selection);
}
