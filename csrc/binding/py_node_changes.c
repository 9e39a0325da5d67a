/* SPDX-License-Identifier: BSD-3-Clause */
/* py_node_changes.c: pairs of rows, and what is left of both when nodes or pairs go. */
#include "py_functions.h"

#include "node_call.h"

PyObject *
hs_py_pair_rows(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_node_call     c;
    hs_list_rows     rows;
    hs_connectivity *made = NULL;
    (void)module;
    if (!hs_node_call_take(&c, "pair_rows", "aaaaaai", 3, arguments, n_arguments) ||
        !hs_take_rows(c.own, c.lists.n_lists, &rows)) {
        return NULL;
    }
    hs_py_call_release(&c.call);
    const hs_status status =
        hs_connectivity_pair(&rows, &c.lists, &c.call.options, &made, &c.call.failure);
    hs_py_call_acquire(&c.call);
    return hs_node_call_parts(&c, status, made, HS_PAIRS_WANTED, rows.ndim);
}

/* n_nodes, target, place or None. */
static bool
take_change(PyObject *n_nodes, PyObject *target, PyObject *places, hs_node_change *change)
{
    int64_t     n_lists = 0, n = 0;
    const void *place = NULL;
    *change = (hs_node_change){.n_lists = 0};
    change->n_nodes = hs_entries_of(n_nodes, NPY_INT64, -1, &n_lists);
    change->target = change->n_nodes != NULL ? hs_entries_of(target, NPY_INT32, -1, &n) : NULL;
    if (change->target == NULL || !hs_entries_or_none(places, NPY_INT32, n, &place)) {
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
        PyErr_SetString(PyExc_TypeError, "target must have an entry for each node");
        return false;
    }
    change->place = place;
    change->n_lists = (int32_t)n_lists;
    return true;
}

PyObject *
hs_py_keep_rows(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_node_call   c;
    hs_node_change change;
    hs_list_rows   rows;
    const int64_t *source = NULL;
    int64_t        n = 0;
    hs_pairs      *result = NULL;
    (void)module;
    if (!hs_node_call_take(&c, "keep_rows", "aaaaaaa", -1, arguments, n_arguments) ||
        !take_change(c.own[3], c.own[4], c.own[5], &change) ||
        !hs_take_rows(c.own, change.n_lists, &rows)) {
        return NULL;
    }
    n = rows.n;
    if (c.own[6] != Py_None) {
        source = hs_entries_of(c.own[6], NPY_INT64, -1, &n);
        if (source == NULL) {
            return NULL;
        }
    }
    hs_py_call_release(&c.call);
    const hs_status status =
        hs_rows_keep(&rows, &change, source, n, &c.call.options, &result, &c.call.failure);
    hs_py_call_acquire(&c.call);
    return hs_node_call_rows(&c, status, result, rows.ndim);
}

PyObject *
hs_py_rows_without(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_node_call c;
    hs_list_rows rows, without;
    hs_pairs    *result = NULL;
    (void)module;
    if (!hs_node_call_take(&c, "rows_without", "aaaaaaif", -1, arguments, n_arguments) ||
        !hs_take_rows(c.own, c.call.integer, &rows) ||
        !hs_take_rows(c.own + 3, c.call.integer, &without)) {
        return NULL;
    }
    hs_py_call_release(&c.call);
    const hs_status status =
        hs_rows_without(&rows, &without, c.call.flag, &c.call.options, &result, &c.call.failure);
    hs_py_call_acquire(&c.call);
    return hs_node_call_rows(&c, status, result, rows.ndim);
}

/* i_node, i_list, j_node, j_list, shifts or None. */
static bool
take_pairs(PyObject *const *arguments, hs_node_pairs *pairs)
{
    const int32_t **const columns[] = {&pairs->i_node, &pairs->i_list, &pairs->j_node,
                                       &pairs->j_list};
    int64_t               n = -1;
    for (int k = 0; k < 4; k++) {
        *columns[k] = hs_entries_of(arguments[k], NPY_INT32, n, &n);
        if (*columns[k] == NULL) {
            return false;
        }
    }
    pairs->n = n;
    return hs_take_shifts(arguments[4], n, &pairs->shift, &pairs->ndim);
}

PyObject *
hs_py_keep_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_node_call     c;
    hs_node_change   change;
    hs_node_pairs    pairs;
    const void      *keep = NULL;
    hs_connectivity *made = NULL;
    (void)module;
    if (!hs_node_call_take(&c, "keep_pairs", "aaaaaaaa", -1, arguments, n_arguments) ||
        !take_pairs(c.own, &pairs) ||
        (c.own[5] != Py_None && !take_change(c.own[5], c.own[6], Py_None, &change)) ||
        !hs_entries_or_none(c.own[7], NPY_BOOL, pairs.n, &keep)) {
        return NULL;
    }
    hs_py_call_release(&c.call);
    const hs_status status = hs_node_pairs_keep(&pairs, c.own[5] != Py_None ? &change : NULL, keep,
                                                &c.call.options, &made, &c.call.failure);
    hs_py_call_acquire(&c.call);
    return hs_node_call_parts(&c, status, made, HS_PAIRS_WANTED, pairs.ndim);
}
