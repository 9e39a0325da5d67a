/* SPDX-License-Identifier: BSD-3-Clause */
/* node_call.c: views are taken after all numbers, as in every search. */
#include "node_call.h"

#include "convert.h"
#include "errors.h"
#include "outputs.h"

/* The bits of `flags`. */
enum { GHOST_ROWS = 1, GHOST_PAIRS = 2, ROWS_ONLY = 4 };

const void *
hs_entries_of(PyObject *object, int type, int64_t n, int64_t *length)
{
    PyArrayObject *array = (PyArrayObject *)object;
    if (!hs_is_array(object, type, 1) || (n >= 0 && PyArray_DIM(array, 0) != n)) {
        PyErr_SetString(PyExc_TypeError, "expected arrays of the types and lengths of node lists");
        return NULL;
    }
    if (length != NULL) {
        *length = PyArray_DIM(array, 0);
    }
    return PyArray_DATA(array);
}

bool
hs_entries_or_none(PyObject *object, int type, int64_t n, const void **entries)
{
    *entries = object != Py_None ? hs_entries_of(object, type, n, NULL) : NULL;
    return object == Py_None || *entries != NULL;
}

bool
hs_take_shifts(PyObject *object, int64_t n, const int32_t **shift, int *ndim)
{
    PyArrayObject *array = (PyArrayObject *)object;
    *shift = NULL;
    *ndim = 1;
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, NPY_INT32, 2) || PyArray_DIM(array, 0) != n ||
        PyArray_DIM(array, 1) < 1 || PyArray_DIM(array, 1) > HS_MAX_DIM) {
        PyErr_SetString(PyExc_TypeError, "shifts must be an int32 array of a row for each pair");
        return false;
    }
    *shift = PyArray_DATA(array);
    *ndim = (int)PyArray_DIM(array, 1);
    return true;
}

bool
hs_take_half(PyObject *const *arguments, PyObject *shift, hs_half_list *half)
{
    *half = (hs_half_list){.ndim = 1};
    half->i = hs_entries_of(arguments[0], NPY_INT32, -1, &half->n);
    half->j = half->i != NULL ? hs_entries_of(arguments[1], NPY_INT32, half->n, NULL) : NULL;
    return half->j != NULL && hs_take_shifts(shift, half->n, &half->shift, &half->ndim);
}

bool
hs_take_rows(PyObject *const *arguments, int64_t n_lists, hs_list_rows *rows)
{
    int64_t n_offsets = 0;
    *rows = (hs_list_rows){.n_lists = (int32_t)n_lists};
    rows->offsets = hs_entries_of(arguments[0], NPY_INT64, -1, &n_offsets);
    rows->indices =
        rows->offsets != NULL ? hs_entries_of(arguments[1], NPY_INT32, -1, &rows->n_indices) : NULL;
    if (rows->indices == NULL) {
        return false;
    }
    if (n_lists < 0 || n_lists > INT32_MAX || n_offsets < 1 ||
        (n_lists > 0 ? (n_offsets - 1) % n_lists != 0 : n_offsets != 1)) {
        PyErr_SetString(PyExc_TypeError, "offsets must have an entry for each row and list");
        return false;
    }
    rows->n = n_lists > 0 ? (n_offsets - 1) / n_lists : 0;
    return hs_take_shifts(arguments[2], rows->n_indices, &rows->shift, &rows->ndim);
}

/* n_nodes, n_ghosts, number, for n points; flags are those of the call. */
static bool
take_lists(PyObject *const *arguments, const hs_py_call *call, hs_node_lists *lists)
{
    int64_t     n_lists = 0;
    const void *number = NULL;
    *lists = (hs_node_lists){.ghost_rows = (call->integer & GHOST_ROWS) != 0,
                             .ghost_pairs = (call->integer & GHOST_PAIRS) != 0,
                             .rows_only = (call->integer & ROWS_ONLY) != 0};
    lists->n_nodes = hs_entries_of(arguments[0], NPY_INT64, -1, &n_lists);
    if (lists->n_nodes == NULL) {
        return false;
    }
    if (n_lists > INT32_MAX) {
        PyErr_SetString(PyExc_OverflowError, "there must be fewer than 2**31 lists");
        return false;
    }
    lists->n_lists = (int32_t)n_lists;
    lists->n_ghosts = hs_entries_of(arguments[1], NPY_INT64, n_lists, NULL);
    if (lists->n_ghosts == NULL ||
        !hs_entries_or_none(arguments[2], NPY_INT32, call->points.n, &number)) {
        return false;
    }
    lists->number = number;
    return true;
}

bool
hs_node_call_take(hs_node_call *call, const char *name, const char *more, int lists_at,
                  PyObject *const *arguments, Py_ssize_t n_arguments)
{
    call->own = arguments + HS_CALL_ARGUMENTS;
    call->lists = (hs_node_lists){.n_lists = 0};
    return hs_py_call_take(&call->call, name, more, arguments, n_arguments) &&
           (lists_at < 0 || take_lists(call->own + lists_at, &call->call, &call->lists));
}

/* Arrays that cannot be written to, as a tuple; takes the reference. */
static PyObject *
read_only(PyObject *arrays)
{
    for (Py_ssize_t k = 0; arrays != NULL && k < PyTuple_GET_SIZE(arrays); k++) {
        PyArray_CLEARFLAGS((PyArrayObject *)PyTuple_GET_ITEM(arrays, k), NPY_ARRAY_WRITEABLE);
    }
    return arrays;
}

static bool
has_shifts(const hs_pairs *pairs)
{
    return hs_pairs_array(pairs, HS_WANT_SHIFT) != NULL;
}

static PyObject *
rows_of(hs_pairs *rows, int ndim)
{
    return hs_table_of(rows, has_shifts(rows) ? "jS" : "j", ndim, 4);
}

/* Nodes and lists of pairs. */
static PyObject *
pairs_of(hs_connectivity *made, int ndim)
{
    hs_pairs *const nodes = hs_connectivity_pairs(made);
    PyObject *of_nodes = read_only(hs_arrays_of(nodes, has_shifts(nodes) ? "ijS" : "ij", ndim, 4));
    PyObject *of_lists = read_only(hs_arrays_of(hs_connectivity_lists(made), "ij", ndim, 4));
    if (of_nodes == NULL || of_lists == NULL) {
        Py_XDECREF(of_nodes);
        Py_XDECREF(of_lists);
        return NULL;
    }
    return Py_BuildValue("(NN)", of_nodes, of_lists);
}

PyObject *
hs_node_call_rows(hs_node_call *call, hs_status status, hs_pairs *rows, int ndim)
{
    if (status != HS_OK) {
        return hs_raise(status, &call->call.failure, &call->call.options);
    }
    PyObject *arrays = rows_of(rows, ndim);
    hs_pairs_free(rows);
    return arrays;
}

PyObject *
hs_node_call_parts(hs_node_call *call, hs_status status, hs_connectivity *made, int wanted,
                   int ndim)
{
    if (status != HS_OK) {
        return hs_raise(status, &call->call.failure, &call->call.options);
    }
    PyObject *rows = wanted & HS_ROWS_WANTED ? rows_of(hs_connectivity_rows(made), ndim)
                                             : Py_NewRef(Py_None);
    PyObject *pairs = wanted & HS_PAIRS_WANTED ? pairs_of(made, ndim) : Py_NewRef(Py_None);
    hs_connectivity_free(made);
    if (rows == NULL || pairs == NULL) {
        Py_XDECREF(rows);
        Py_XDECREF(pairs);
        return NULL;
    }
    return Py_BuildValue("(NN)", rows, pairs);
}
