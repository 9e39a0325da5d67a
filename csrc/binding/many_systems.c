/* SPDX-License-Identifier: BSD-3-Clause */
/* many_systems.c: finds where each system begins. Each number is read once: another thread may
 * write meanwhile. */
#include "arguments.h"

#include "outputs.h"

#define MOST_NUMBER (INT64_C(1) << 62) /* so that counting on from it is safe */
#define MOST_COUNTS (INT64_C(1) << 48) /* no memory holds them; NumPy cannot even say so */

/* Numbers of one set. */
typedef struct numbered {
    const int64_t *number;
    int64_t        n;
    const char    *name;
    int64_t        at;     /* those before have been read */
    int64_t        next;   /* the number there, or MOST_NUMBER at the end */
    int64_t        before; /* the one before */
} numbered;

void
hs_batch_free(hs_batch *batch)
{
    PyMem_Free(batch->first);
    PyMem_Free(batch->first_query);
    PyMem_Free(batch->number);
    batch->first = batch->first_query = batch->number = NULL;
}

/* Arrays for so many systems, of which only what is filled takes memory. */
static bool
make_room(hs_batch *batch, int64_t most, bool has_queries)
{
    const size_t bytes = (size_t)(most + 1) * sizeof *batch->first;
    batch->first = PyMem_Malloc(bytes);
    batch->number = PyMem_Malloc(bytes);
    batch->first_query = has_queries ? PyMem_Malloc(bytes) : NULL;
    if (batch->first == NULL || batch->number == NULL ||
        (has_queries && batch->first_query == NULL)) {
        PyErr_NoMemory();
        return false;
    }
    return true;
}

/* Python has looked at all but what the number of systems allows. */
static bool
refuse_number(const numbered *set, int64_t number, int64_t n_systems)
{
    const char     *name = set->name;
    const long long i = set->at, got = number;
    if (number >= n_systems && n_systems < MOST_NUMBER) {
        PyErr_Format(PyExc_ValueError,
                     "%s must be less than the number of systems that box, periodic or cutoff is "
                     "given for, %lld, got %s[%lld] = %lld",
                     name, (long long)n_systems, name, i, got);
    } else {
        PyErr_Format(PyExc_ValueError,
                     "%s must ascend from 0 on, to less than 2**62, got %s[%lld] = %lld", name,
                     name, i, got);
    }
    return false;
}

/* Reads the number at the present place, which is to be from that before it on. */
static bool
read_next(numbered *set, int64_t n_systems)
{
    if (set->at == set->n) {
        set->next = MOST_NUMBER;
        return true;
    }
    const int64_t number = set->number[set->at];
    if (number < set->before || number < 0 || number >= n_systems) {
        return refuse_number(set, number, n_systems);
    }
    set->next = number;
    return true;
}

static bool
begin(numbered *set, int64_t n_systems)
{
    set->at = 0;
    set->before = -1;
    return read_next(set, n_systems);
}

/* Goes on behind all points of this number. */
static bool
pass(numbered *set, int64_t number, int64_t n_systems)
{
    while (set->next == number) {
        set->before = number;
        set->at++;
        if (!read_next(set, n_systems)) {
            return false;
        }
    }
    return true;
}

/* Where each system begins: all of n_systems, or, where that is MOST_NUMBER, those that have points
 * or queries. */
static bool
find_systems(numbered *points, numbered *queries, int64_t n_systems, hs_batch *batch)
{
    const bool are_all = n_systems < MOST_NUMBER, has_queries = queries->number != NULL;
    int64_t    n = 0, number = -1;
    if (!make_room(batch, are_all ? n_systems : points->n + queries->n, has_queries) ||
        !begin(points, n_systems) || !begin(queries, n_systems)) {
        return false;
    }
    while (are_all ? n < n_systems : points->at < points->n || queries->at < queries->n) {
        number = are_all ? n : points->next < queries->next ? points->next : queries->next;
        batch->first[n] = points->at;
        if (has_queries) {
            batch->first_query[n] = queries->at;
        }
        batch->number[n++] = number;
        if (!pass(points, number, n_systems) || !pass(queries, number, n_systems)) {
            return false;
        }
    }
    batch->first[n] = points->n;
    if (has_queries) {
        batch->first_query[n] = queries->n;
    }
    batch->are_all = are_all;
    batch->n = n;
    batch->n_numbers = number + 1;
    return true;
}

/* An int64 array with a number for each of n. */
static bool
take_numbers(PyObject *object, int64_t n, const char *name, numbered *set)
{
    *set = (numbered){.n = n, .name = name};
    if (object == NULL || !hs_is_array(object, NPY_INT64, 1) || hs_length_of(object) != n) {
        PyErr_Format(PyExc_TypeError, "%s must be an int64 array with a number for each", name);
        return false;
    }
    set->number = PyArray_DATA((PyArrayObject *)object);
    return true;
}

/* How many systems have something of their own, MOST_NUMBER where all share it, or -1 with an
 * exception set. */
static int64_t
count_systems(const hs_py_call *call)
{
    int64_t n = MOST_NUMBER;
    for (int k = 1; k < 4; k++) { /* cutoffs, boxes, axes */
        PyArrayObject *array = (PyArrayObject *)call->of[k];
        if (!PyArray_Check(call->of[k]) || (k == 2 && PyArray_NDIM(array) != 3)) {
            continue;
        }
        if (n != MOST_NUMBER && PyArray_DIM(array, 0) != n) {
            PyErr_SetString(PyExc_ValueError, "cutoffs, boxes and axes are of as many systems");
            return -1;
        }
        n = PyArray_DIM(array, 0);
    }
    return n;
}

bool
hs_batch_take(PyObject *of_points, PyObject *of_queries, hs_py_call *call)
{
    hs_batch *batch = &call->batch;
    numbered  points, queries = {.name = "query_batch"};
    *batch = (hs_batch){.is_given = true};
    if (call->among.cells != NULL) {
        PyErr_SetString(PyExc_TypeError, "cells are of one system");
        return false;
    }
    if (!take_numbers(of_points, call->points.at.n, "batch", &points) ||
        ((call->among.queries != NULL || of_queries != NULL) &&
         !take_numbers(of_queries, call->queries.at.n, "query_batch", &queries))) {
        return false;
    }
    const int64_t n_systems = count_systems(call);
    if (n_systems < 0 || !find_systems(&points, &queries, n_systems, batch)) {
        return false;
    }
    call->among.each = &call->each;
    call->points.n_systems = call->queries.n_systems = batch->n;
    call->points.first = batch->first;
    call->queries.first = batch->first_query;
    return true;
}

PyObject *
hs_batch_zeros(const hs_batch *batch, int n_axes, const npy_intp *shape, int type)
{
    npy_intp whole[4] = {(npy_intp)batch->n_numbers};
    double   n = (double)batch->n_numbers;
    for (int k = 0; k < n_axes; k++) {
        whole[k + 1] = shape[k];
        n *= (double)shape[k];
    }
    if (n > (double)MOST_COUNTS) {
        return PyErr_Format(PyExc_MemoryError,
                            "the result would not fit: there would be %lld counts, one for each "
                            "number up to the largest in batch",
                            (long long)batch->n_numbers);
    }
    return PyArray_ZEROS(n_axes + 1, whole, type, 0);
}
