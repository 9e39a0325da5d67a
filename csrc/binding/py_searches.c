/* SPDX-License-Identifier: BSD-3-Clause */
/* py_searches.c: functions of the module that look for pairs and return all of them, or numbers of
 * them. */
#include "py_functions.h"

#include "errors.h"
#include "outputs.h"
#include "system.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- pairs and rows ----------------------------------------------------------------------- */

typedef hs_status find_fn(const hs_among *among, const hs_options *options, hs_pairs **found,
                          hs_failure *failure);

static PyObject *
find(hs_py_call *call, find_fn *find_all, bool is_table)
{
    hs_pairs *found = NULL;
    hs_py_call_release(call);
    const hs_status status = find_all(&call->among, &call->options, &found, &call->failure);
    return hs_py_call_pairs(call, status, found, is_table);
}

PyObject *
hs_py_pairs(hs_py_call *call)
{
    return find(call, hs_pairs_find, false);
}

PyObject *
hs_py_pairs_between(hs_py_call *call)
{
    return find(call, hs_neighbors_find, false);
}

PyObject *
hs_py_neighbors(hs_py_call *call)
{
    return find(call, hs_neighbors_find, true);
}

/* Rows have k entries: what they need is known, and fewer would do. */
static PyObject *
raise_memory_of_rows(const hs_failure *failure)
{
    char text[320], needed[32], limit[48];
    hs_format_limit(failure->limit_bytes, limit, sizeof limit);
    if (isinf(failure->expected_bytes) && failure->row >= 0) {
        snprintf(text, sizeof text,
                 "too many images are about as near to %s[%lld] for any search to compare: it is "
                 "too far from the points, or the box is too small; use a cutoff or a smaller k",
                 failure->in_queries ? "queries" : "points", (long long)failure->row);
    } else if (failure->expected_bytes > 0.0 && !isinf(failure->expected_bytes)) {
        hs_format_bytes(failure->expected_bytes, needed, sizeof needed);
        snprintf(text, sizeof text,
                 "the result would not fit: %.3g entries (%s), %s%s; use a smaller k, fewer "
                 "quantities, or fewer queries at a time",
                 failure->expected_pairs, needed, limit,
                 hs_took_more(failure) ? " for them and the search" : "");
    } else {
        snprintf(text, sizeof text, "no memory for the search: %s", limit);
    }
    PyErr_SetString(PyExc_MemoryError, text);
    return NULL;
}

PyObject *
hs_py_nearest(hs_py_call *call)
{
    hs_pairs *rows = NULL;
    hs_py_call_release(call);
    const hs_status status =
        hs_nearest_find(&call->among, call->integer, &call->options, &rows, &call->failure);
    if (status == HS_ERR_MEMORY) {
        hs_py_call_acquire(call);
        return raise_memory_of_rows(&call->failure);
    }
    return hs_py_call_pairs(call, status, rows, false);
}

/* ---- counts ------------------------------------------------------------------------------- */

/* A number, or that of each system. */
PyObject *
hs_py_count_pairs(hs_py_call *call)
{
    const bool is_batch = call->among.each != NULL;
    npy_intp   n_systems = (npy_intp)call->points.n_systems;
    int64_t    n = 0;
    PyObject  *counts = is_batch ? PyArray_ZEROS(1, &n_systems, NPY_INT64, 0) : NULL;
    if (is_batch && counts == NULL) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status = hs_pairs_count(&call->among, &call->options,
                                            is_batch ? PyArray_DATA((PyArrayObject *)counts) : &n,
                                            &call->failure);
    if (is_batch) {
        return hs_py_call_filled(call, status, counts);
    }
    return hs_py_call_done(call, status) ? PyLong_FromLongLong(n) : NULL;
}

PyObject *
hs_py_coordination(hs_py_call *call)
{
    const hs_set *asking = call->among.queries != NULL ? &call->queries : &call->points;
    npy_intp      n_rows = (npy_intp)asking->at.n;
    PyObject     *counts = PyArray_SimpleNew(1, &n_rows, NPY_INT64);
    if (counts == NULL) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status = hs_neighbors_count(
        &call->among, &call->options, PyArray_DATA((PyArrayObject *)counts), &call->failure);
    return hs_py_call_filled(call, status, counts);
}

/* ---- pairs by distance -------------------------------------------------------------------- */

/* Counts, or sums where there are weights, of shape (n_types, n_types, n_edges), before these the
 * systems if there is a batch. */
PyObject *
hs_py_histogram(hs_py_call *call)
{
    const void *edges;
    const bool  sums = call->points.weights != NULL || call->queries.weights != NULL;
    const int   type = sums ? NPY_DOUBLE : NPY_INT64;
    if (!hs_entries_of(call->own[0], NPY_DOUBLE, 1, -1, 0, &edges) || edges == NULL ||
        call->integer < 1 || call->integer > INT32_MAX) {
        return NULL;
    }
    const npy_intp n = (npy_intp)call->integer;
    const npy_intp n_edges = (npy_intp)hs_length_of(call->own[0]);
    npy_intp       shape[4] = {(npy_intp)call->points.n_systems, n, n, n_edges};
    const int      is_one = call->among.each == NULL;
    PyObject      *array = PyArray_ZEROS(4 - is_one, shape + is_one, type, 0);
    if (array == NULL) {
        return NULL;
    }
    void              *data = PyArray_DATA((PyArrayObject *)array);
    const hs_histogram wanted = {.n_edges = n_edges,
                                 .edges = edges,
                                 .inclusive = call->options.inclusive,
                                 .last_inclusive = call->flag,
                                 .n_types = (int32_t)n,
                                 .counts = sums ? NULL : data,
                                 .sums = sums ? data : NULL};
    hs_py_call_release(call);
    const hs_status status =
        hs_pairs_histogram(&call->among, &call->options, &wanted, &call->failure);
    return hs_py_call_filled(call, status, array);
}

/* ---- clusters ----------------------------------------------------------------------------- */

PyObject *
hs_py_clusters(hs_py_call *call)
{
    const void *core;
    int64_t     n_clusters = 0;
    PyObject   *result = NULL;
    if (!hs_entries_of(call->own[0], NPY_BOOL, 1, call->points.at.n, 0, &core)) {
        return NULL;
    }
    npy_intp  n = (npy_intp)call->points.at.n;
    PyObject *labels = PyArray_SimpleNew(1, &n, NPY_INT64);
    PyObject *winding = call->flag ? PyArray_SimpleNew(1, &n, NPY_UINT8) : Py_NewRef(Py_None);
    if (labels != NULL && winding != NULL) {
        int64_t *to = PyArray_DATA((PyArrayObject *)labels);
        uint8_t *bits = call->flag ? PyArray_DATA((PyArrayObject *)winding) : NULL;
        hs_py_call_release(call);
        const hs_status status = hs_clusters_find(&call->among, &call->options, core, to, bits,
                                                  &n_clusters, &call->failure);
        if (hs_py_call_done(call, status)) {
            result = Py_BuildValue("LOO", (long long)n_clusters, labels, winding);
        }
    }
    Py_XDECREF(labels);
    Py_XDECREF(winding);
    return result;
}

/* ---- pairs that are known ----------------------------------------------------------------- */

/* What is said of a pair, and not of a point. */
static PyObject *
raise_of_pair(hs_py_call *call, hs_status status)
{
    const long long row = (long long)call->failure.row;
    hs_py_call_acquire(call);
    if (row >= 0 && status == HS_ERR_SHIFT_RANGE) {
        PyErr_Format(PyExc_OverflowError,
                     "pair %lld: a point lies too many box vectors away: they are counted up to "
                     "2**51, and S holds 2**31; wrap the points first",
                     row);
    } else if (row >= 0 && status == HS_ERR_FAR) {
        PyErr_Format(PyExc_OverflowError, "pair %lld: the vector is too long for float64", row);
    } else if (row >= 0 && status == HS_ERR_ARGUMENT) {
        PyErr_Format(PyExc_ValueError,
                     "pair %lld: i and j must be numbers of points, and S whole numbers below "
                     "2**62, 0 along axes that do not repeat",
                     row);
    } else {
        (void)hs_py_call_done(call, status);
    }
    return NULL;
}

/* i, j, S or None. */
static bool
take_numbers(const hs_py_call *call, hs_pair_numbers *pairs)
{
    PyObject *const *own = call->own + 1;
    const void      *i, *j, *shift;
    pairs->n = PyArray_Check(own[0]) ? hs_length_of(own[0]) : 0;
    if (!hs_entries_of(own[0], NPY_INT64, 1, pairs->n, 0, &i) || i == NULL ||
        !hs_entries_of(own[1], NPY_INT64, 1, pairs->n, 0, &j) || j == NULL ||
        !hs_entries_of(own[2], NPY_INT64, 2, pairs->n, call->points.at.ndim, &shift)) {
        return false;
    }
    pairs->i = i;
    pairs->j = j;
    pairs->shift = shift;
    return true;
}

PyObject *
hs_py_measure(hs_py_call *call)
{
    hs_pair_numbers pairs;
    hs_pairs       *measured = NULL;
    if (!take_numbers(call, &pairs) || call->among.cells != NULL ||
        call->options.want & HS_WANT_J) {
        return NULL;
    }
    if (call->of[9] == Py_None && pairs.n >= HS_POINTS_FOR_THREADS) { /* however few points */
        call->options.threads = -hs_default_threads();
    }
    hs_py_call_release(call);
    const hs_status status = hs_measure(&call->points.at, call->among.box, &pairs, &call->options,
                                        &measured, &call->failure);
    return status != HS_OK ? raise_of_pair(call, status)
                           : hs_py_call_pairs(call, status, measured, false);
}

/* ---- what would be done, and what was done ------------------------------------------------ */

/* The bytes that a search took, by purpose; a new dictionary, or NULL. */
static PyObject *
bytes_as_dict(const hs_counters *counters)
{
    static const char *const names[HS_PURPOSE_END] = {
        [HS_FOR_POINTS] = "points",         [HS_FOR_ORIGINALS] = "originals",
        [HS_FOR_WRAPS] = "wraps",           [HS_FOR_ORDER] = "order",
        [HS_FOR_CELLS] = "cells",           [HS_FOR_STENCIL] = "stencil",
        [HS_FOR_CANDIDATES] = "candidates", [HS_FOR_INDICES] = "indices",
        [HS_FOR_DISTANCES] = "distances",   [HS_FOR_VECTORS] = "vectors",
        [HS_FOR_SHIFTS] = "shifts",         [HS_FOR_SORTING] = "sorting",
        [HS_FOR_SUPPORTS] = "supports",
    };
    PyObject *dict = PyDict_New();
    for (int p = 0; dict != NULL && p < HS_PURPOSE_END; p++) {
        if (!hs_dict_put(dict, names[p], PyLong_FromLongLong(counters->bytes[p]))) {
            Py_CLEAR(dict);
        }
    }
    return dict;
}

/* What is planned, and what was counted: nothing for NULL. A new dictionary, or NULL. */
static PyObject *
plan_as_dict(const hs_plan *plan, const hs_counters *counted)
{
    const int d = plan->ndim;
    PyObject *measured =
        counted == NULL
            ? PyDict_New()
            : Py_BuildValue("{sNsLsLsLsLsLsLsLsL}", "bytes", bytes_as_dict(counted), "bytes_peak",
                            (long long)counted->bytes_peak, "groups", (long long)counted->groups,
                            "candidates", (long long)counted->candidates, "pairs",
                            (long long)counted->pairs, "ambiguous", (long long)counted->ambiguous,
                            "by_float64", (long long)counted->by_float64, "by_double_word",
                            (long long)counted->by_double_word, "by_integers",
                            (long long)counted->by_integers);
    return Py_BuildValue(
        "{sisisNsNsssLsLsNsNsNsNsNsLsdsisssN}", "ndim", d, "n_periodic", plan->n_periodic,
        "aligned", PyBool_FromLong(plan->aligned), "keeps_originals",
        PyBool_FromLong(plan->keeps_originals), "algorithm", hs_algorithm_names[plan->algorithm],
        "n_searches", (long long)plan->n_searches, "n_cells", (long long)plan->n_cells, "all_pairs",
        PyBool_FromLong(plan->all_pairs), "sparse", PyBool_FromLong(plan->sparse), "shape",
        hs_tuple_of_integers(plan->shape, d), "cell_sizes", hs_tuple_of_reals(plan->cell_size, d),
        "images", hs_tuple_of_integers(plan->images, d), "stencil_rows",
        (long long)plan->stencil_rows, "expected_pairs", plan->expected_pairs, "threads",
        plan->threads, "kernel", plan->kernel, "measured", measured);
}

PyObject *
hs_py_explain(hs_py_call *call)
{
    hs_plan     plan;
    hs_counters counters = {0};
    hs_pairs   *pairs = NULL;
    hs_py_call_release(call);
    hs_among all = call->among; /* what is left out changes no plan */
    all.selection = NULL;
    hs_status status = hs_plan_make(&all, &call->options, &plan, &call->failure);
    if (status == HS_OK && call->flag) {
        call->options.counters = &counters;
        status = hs_pairs_find(&call->among, &call->options, &pairs, &call->failure);
    }
    hs_pairs_free(pairs);
    return hs_py_call_done(call, status) ? plan_as_dict(&plan, call->flag ? &counters : NULL)
                                         : NULL;
}
