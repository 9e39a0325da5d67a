/* SPDX-License-Identifier: BSD-3-Clause */
/* py_nodes.c: rows and pairs of node lists, and what is made of them or left of them when nodes or
 * pairs go; and triplets of rows. The Python layer keeps the arrays, and puts what it gives in here
 * together from them. */
#include "py_functions.h"

#include "errors.h"
#include "outputs.h"

#include "../halfshell_nodes.h"

/* ---- arguments and results ---------------------------------------------------------------- */

/* The bits of `flags`. */
enum { GHOST_ROWS = 1, GHOST_PAIRS = 2, DIRECTED = 4 };

/* The entries of a C-contiguous array of this type with n entries, or with any number where n is
 * -1; *length, unless NULL, is that number. NULL, without an exception, for all else. */
static const void *
entries_of(PyObject *object, int type, int64_t n, int64_t *length)
{
    const void *entries = NULL;
    hs_entries_of(object, type, 1, n, 0, &entries);
    if (entries != NULL && length != NULL) {
        *length = hs_length_of(object);
    }
    return entries;
}

/* Shifts of n entries, or NULL and 1 dimension for None. */
static bool
take_shifts(PyObject *object, int64_t n, const int32_t **shift, int *ndim)
{
    PyArrayObject *array = (PyArrayObject *)object;
    *shift = NULL;
    *ndim = 1;
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, NPY_INT32, 2) || PyArray_DIM(array, 0) != n ||
        PyArray_DIM(array, 1) < 1 || PyArray_DIM(array, 1) > HS_MAX_DIM) {
        return false;
    }
    *shift = PyArray_DATA(array);
    *ndim = (int)PyArray_DIM(array, 1);
    return true;
}

/* i, j and shift of a half list. */
static bool
take_half(PyObject *const *arguments, PyObject *shift, hs_half_list *half)
{
    *half = (hs_half_list){.ndim = 1};
    half->i = entries_of(arguments[0], NPY_INT32, -1, &half->n);
    half->j = half->i != NULL ? entries_of(arguments[1], NPY_INT32, half->n, NULL) : NULL;
    return half->j != NULL && take_shifts(shift, half->n, &half->shift, &half->ndim);
}

/* offsets, indices, shifts or None of rows of n_lists lists. */
static bool
take_rows(PyObject *const *arguments, int64_t n_lists, hs_list_rows *rows)
{
    int64_t n_offsets = 0;
    *rows = (hs_list_rows){.n_lists = (int32_t)n_lists};
    rows->offsets = entries_of(arguments[0], NPY_INT64, -1, &n_offsets);
    rows->indices =
        rows->offsets != NULL ? entries_of(arguments[1], NPY_INT32, -1, &rows->n_indices) : NULL;
    if (rows->indices == NULL || n_lists < 0 || n_lists > INT32_MAX || n_offsets < 1 ||
        (n_lists > 0 ? (n_offsets - 1) % n_lists != 0 : n_offsets != 1)) {
        return false;
    }
    rows->n = n_lists > 0 ? (n_offsets - 1) / n_lists : 0;
    return take_shifts(arguments[2], rows->n_indices, &rows->shift, &rows->ndim);
}

/* n_nodes, n_ghosts, number, for n points; flags are those of the call. */
static bool
take_lists(PyObject *const *arguments, const hs_py_call *call, hs_node_lists *lists)
{
    int64_t     n_lists = 0;
    const void *number = NULL;
    *lists = (hs_node_lists){.ghost_rows = (call->integer & GHOST_ROWS) != 0,
                             .ghost_pairs = (call->integer & GHOST_PAIRS) != 0,
                             .directed = (call->integer & DIRECTED) != 0};
    lists->n_nodes = entries_of(arguments[0], NPY_INT64, -1, &n_lists);
    if (lists->n_nodes == NULL || n_lists > INT32_MAX) {
        return false;
    }
    lists->n_lists = (int32_t)n_lists;
    lists->n_ghosts = entries_of(arguments[1], NPY_INT64, n_lists, NULL);
    if (lists->n_ghosts == NULL ||
        !hs_entries_of(arguments[2], NPY_INT32, 1, call->points.at.n, 0, &number)) {
        return false;
    }
    lists->number = number;
    return true;
}

static bool
has_shifts(const hs_pairs *pairs)
{
    return hs_pairs_array(pairs, HS_WANT_SHIFT) != NULL;
}

static PyObject *
rows_of(hs_pairs *rows, int ndim)
{
    return hs_arrays_of(rows, has_shifts(rows) ? "jS" : "j", ndim, 4, true);
}

/* Nodes and lists of pairs. */
static PyObject *
pairs_of(hs_connectivity *made, int ndim)
{
    hs_pairs *const nodes = hs_connectivity_pairs(made);
    PyObject       *of_nodes =
        hs_read_only(hs_arrays_of(nodes, has_shifts(nodes) ? "ijS" : "ij", ndim, 4, false));
    PyObject *of_lists =
        hs_read_only(hs_arrays_of(hs_connectivity_lists(made), "ij", ndim, 4, false));
    if (of_nodes == NULL || of_lists == NULL) {
        Py_XDECREF(of_nodes);
        Py_XDECREF(of_lists);
        return NULL;
    }
    return Py_BuildValue("(NN)", of_nodes, of_lists);
}

/* What a function returns from a result that is freed: offsets and indices of rows, and shifts of
 * ndim components where there are any. NULL with an exception set for a status other than HS_OK. */
static PyObject *
give_rows(hs_py_call *call, hs_status status, hs_pairs *rows, int ndim)
{
    if (!hs_py_call_done(call, status)) {
        return NULL;
    }
    PyObject *arrays = rows_of(rows, ndim);
    hs_pairs_free(rows);
    return arrays;
}

/* The same of a connectivity; its rows, or nodes and lists of its pairs. */
static PyObject *
give_part(hs_py_call *call, hs_status status, hs_connectivity *made, bool pairs, int ndim)
{
    if (!hs_py_call_done(call, status)) {
        return NULL;
    }
    PyObject *part = pairs ? pairs_of(made, ndim) : rows_of(hs_connectivity_rows(made), ndim);
    hs_connectivity_free(made);
    return part;
}

/* ---- functions ---------------------------------------------------------------------------- */

PyObject *
hs_py_connect(hs_py_call *call)
{
    hs_node_lists    lists;
    hs_half_list     half;
    hs_connectivity *made = NULL;
    if (!take_lists(call->own + 3, call, &lists) || !take_half(call->own, call->own[2], &half)) {
        return NULL;
    }
    lists.rows_only = true;
    hs_py_call_release(call);
    const hs_status status =
        hs_connectivity_link(&half, &lists, &call->options, &made, &call->failure);
    return give_part(call, status, made, false, half.ndim);
}

PyObject *
hs_py_connect_search(hs_py_call *call)
{
    hs_node_lists    lists;
    hs_connectivity *made = NULL;
    if (!take_lists(call->own, call, &lists)) {
        return NULL;
    }
    lists.rows_only = true;
    hs_py_call_release(call);
    const hs_status status =
        hs_connectivity_build(&call->among, &lists, &call->options, &made, &call->failure);
    return give_part(call, status, made, false, call->points.at.ndim);
}

PyObject *
hs_py_overlap(hs_py_call *call)
{
    hs_node_lists lists;
    hs_index_rows gather;
    hs_pairs     *rows = NULL;
    if (!take_lists(call->own + 3, call, &lists)) {
        return NULL;
    }
    gather.n = call->points.at.n;
    gather.offsets = entries_of(call->own[0], NPY_INT64, gather.n + 1, NULL);
    gather.indices =
        gather.offsets != NULL ? entries_of(call->own[1], NPY_INT32, -1, &gather.n_indices) : NULL;
    if (gather.indices == NULL ||
        !take_shifts(call->own[2], gather.n_indices, &gather.shift, &gather.ndim)) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status = hs_connectivity_overlap(&call->points.at, &gather, &lists,
                                                     &call->options, &rows, &call->failure);
    return give_rows(call, status, rows, gather.ndim);
}

PyObject *
hs_py_intersect(hs_py_call *call)
{
    hs_node_lists lists;
    hs_half_list  half;
    hs_pairs     *result = NULL;
    if (!take_lists(call->own + 3, call, &lists) || !take_half(call->own, call->own[2], &half)) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status = hs_connectivity_intersect(
        &call->points.at, call->among.box, &half, &lists, &call->options, &result, &call->failure);
    return give_rows(call, status, result, half.ndim);
}

/* points and two of their kind -> a bool for each of whether its foot is between these, or a key on
 * the Z curve through their box. */
static PyObject *
of_each_point(PyObject *const *arguments, Py_ssize_t n_arguments, const char *name, bool keys)
{
    hs_points     points;
    hs_failure    failure;
    hs_status     status;
    const double *two[2];
    if (!hs_expect(name, n_arguments == 3 && hs_points_of(arguments[0], &points))) {
        return NULL;
    }
    for (int k = 0; k < 2; k++) {
        two[k] = entries_of(arguments[k + 1], NPY_DOUBLE, points.ndim, NULL);
        if (!hs_expect(name, two[k] != NULL)) {
            return NULL;
        }
    }
    npy_intp  n = (npy_intp)points.n;
    PyObject *array = PyArray_SimpleNew(1, &n, keys ? NPY_UINT64 : NPY_BOOL);
    if (array == NULL) {
        return NULL;
    }
    void *data = PyArray_DATA((PyArrayObject *)array);
    Py_BEGIN_ALLOW_THREADS
    status = keys ? hs_morton_keys(&points, two[0], two[1], data, &failure)
                  : hs_feet_between(&points, two[0], two[1], data, &failure);
    Py_END_ALLOW_THREADS
    if (status != HS_OK) {
        Py_DECREF(array);
        return hs_raise(status, &failure, NULL);
    }
    return array;
}

PyObject *
hs_py_feet_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    (void)module;
    return of_each_point(arguments, n_arguments, "feet_between", false);
}

PyObject *
hs_py_morton_keys(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    (void)module;
    return of_each_point(arguments, n_arguments, "morton_keys", true);
}

PyObject *
hs_py_pair_rows(hs_py_call *call)
{
    hs_node_lists    lists;
    hs_list_rows     rows;
    hs_connectivity *made = NULL;
    if (!take_lists(call->own + 3, call, &lists) || !take_rows(call->own, lists.n_lists, &rows)) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status =
        hs_connectivity_pair(&rows, &lists, &call->options, &made, &call->failure);
    return give_part(call, status, made, true, rows.ndim);
}

/* n_nodes, target, place or None. */
static bool
take_change(PyObject *n_nodes, PyObject *target, PyObject *places, hs_node_change *change)
{
    int64_t     n_lists = 0, n = 0;
    const void *place = NULL;
    *change = (hs_node_change){.n_lists = 0};
    change->n_nodes = entries_of(n_nodes, NPY_INT64, -1, &n_lists);
    change->target = change->n_nodes != NULL ? entries_of(target, NPY_INT32, -1, &n) : NULL;
    if (change->target == NULL || !hs_entries_of(places, NPY_INT32, 1, n, 0, &place)) {
        return false;
    }
    for (int64_t l = 0; l < n_lists; l++) {
        const int64_t count = change->n_nodes[l];
        n = count < 0 || count > n ? -1 : n - count;
        if (n < 0) {
            break;
        }
    }
    if (n_lists > INT32_MAX || n != 0) {
        return false;
    }
    change->place = place;
    change->n_lists = (int32_t)n_lists;
    return true;
}

PyObject *
hs_py_keep_rows(hs_py_call *call)
{
    hs_node_change change;
    hs_list_rows   rows;
    const int64_t *source = NULL;
    int64_t        n = 0;
    hs_pairs      *result = NULL;
    if (!take_change(call->own[3], call->own[4], call->own[5], &change) ||
        !take_rows(call->own, change.n_lists, &rows)) {
        return NULL;
    }
    n = rows.n;
    if (call->own[6] != Py_None) {
        source = entries_of(call->own[6], NPY_INT64, -1, &n);
        if (source == NULL) {
            return NULL;
        }
    }
    hs_py_call_release(call);
    const hs_status status =
        hs_rows_keep(&rows, &change, source, n, &call->options, &result, &call->failure);
    return give_rows(call, status, result, rows.ndim);
}

PyObject *
hs_py_rows_without(hs_py_call *call)
{
    hs_list_rows rows, without;
    hs_pairs    *result = NULL;
    if (!take_rows(call->own, call->integer, &rows) ||
        !take_rows(call->own + 3, call->integer, &without)) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status =
        hs_rows_without(&rows, &without, call->flag, &call->options, &result, &call->failure);
    return give_rows(call, status, result, rows.ndim);
}

/* More are for the Python layer, which asks first what the machine has left. */
#define MOST_TRIPLETS (INT64_C(1) << 23)

/* How many ordered pairs of entries all rows have; -1 for too many, or where starts descend. */
static int64_t
count_triplets(const int32_t *starts, npy_intp n_starts)
{
    int64_t total = 0;
    for (npy_intp row = 0; row + 1 < n_starts && total <= MOST_TRIPLETS; row++) {
        const int64_t first = starts[row] > 0 ? starts[row] : 0;
        const int64_t n = (starts[row + 1] > 0 ? starts[row + 1] : 0) - first;
        if (n < 0) {
            return -1;
        }
        total += n * (n - 1);
    }
    return total <= MOST_TRIPLETS ? total : -1;
}

PyObject *
hs_py_triplets(PyObject *module, PyObject *starts)
{
    (void)module;
    const bool     are_starts = hs_is_array(starts, NPY_INT32, 1);
    const int32_t *start = are_starts ? PyArray_DATA((PyArrayObject *)starts) : NULL;
    const npy_intp n_starts = are_starts ? (npy_intp)hs_length_of(starts) : 0;
    npy_intp       n = are_starts ? (npy_intp)count_triplets(start, n_starts) : -1;
    if (n < 0) {
        Py_RETURN_NONE;
    }
    PyObject *one = PyArray_SimpleNew(1, &n, NPY_INT32),
             *other = PyArray_SimpleNew(1, &n, NPY_INT32);
    if (one == NULL || other == NULL) {
        Py_XDECREF(one);
        Py_XDECREF(other);
        return NULL;
    }
    int32_t *ij = PyArray_DATA((PyArrayObject *)one), *ik = PyArray_DATA((PyArrayObject *)other);
    for (npy_intp row = 0; row + 1 < n_starts; row++) {
        const int32_t first = start[row] > 0 ? start[row] : 0;
        for (int32_t j = first; j < start[row + 1]; j++) {
            for (int32_t k = first; k < start[row + 1]; k++) {
                if (j != k) {
                    *ij++ = j;
                    *ik++ = k;
                }
            }
        }
    }
    return Py_BuildValue("(NN)", one, other);
}
