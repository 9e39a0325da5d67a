/* SPDX-License-Identifier: BSD-3-Clause */
/* many_systems.c: finds where each system begins. Each number is read once: another thread may
 * write meanwhile. */
#include "arguments.h"

#include "outputs.h"

#define FIRST_CAPACITY 1024               /* systems; doubled as needed */
#define MOST_NUMBER    (INT64_C(1) << 62) /* so that counting on from it is safe */
#define MOST_COUNTS    (INT64_C(1) << 48) /* no memory holds them; NumPy cannot even say so */

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

/* Room for so many entries in place of those before. */
static bool
grow_one(int64_t **array, int64_t n)
{
    int64_t *grown = PyMem_Realloc(*array, (size_t)n * sizeof *grown);
    if (grown == NULL) {
        PyErr_NoMemory();
        return false;
    }
    *array = grown;
    return true;
}

/* Arrays for so many systems. */
static bool
grow(hs_batch *batch, int64_t capacity, bool has_queries)
{
    batch->capacity = capacity;
    return grow_one(&batch->first, capacity + 1) && grow_one(&batch->number, capacity + 1) &&
           (!has_queries || grow_one(&batch->first_query, capacity + 1));
}

static bool
refuse_number(const numbered *set, int64_t number, int64_t n_systems)
{
    const char     *name = set->name;
    const long long i = set->at, got = number, before = set->before;
    if (number < 0) {
        PyErr_Format(PyExc_ValueError, "%s must not be negative, got %s[%lld] = %lld", name, name,
                     i, got);
    } else if (number < before) {
        PyErr_Format(PyExc_ValueError,
                     "%s must be ascending, got %s[%lld] = %lld before %s[%lld] = %lld", name, name,
                     i - 1, before, name, i, got);
    } else if (number >= n_systems && n_systems < MOST_NUMBER) {
        PyErr_Format(PyExc_ValueError,
                     "%s must be less than the number of systems that box, periodic or cutoff is "
                     "given for, %lld, got %s[%lld] = %lld",
                     name, (long long)n_systems, name, i, got);
    } else {
        PyErr_Format(PyExc_ValueError, "%s must be less than 2**62, got %s[%lld] = %lld", name,
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
    if (!grow(batch, are_all ? n_systems : FIRST_CAPACITY, has_queries) ||
        !begin(points, n_systems) || !begin(queries, n_systems)) {
        return false;
    }
    while (are_all ? n < n_systems : points->at < points->n || queries->at < queries->n) {
        if (n == batch->capacity && !grow(batch, 2 * n, has_queries)) {
            return false;
        }
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
    PyArrayObject *array = (PyArrayObject *)object;
    *set = (numbered){.n = n, .name = name};
    if (!hs_is_array(object, NPY_INT64, 1) || PyArray_DIM(array, 0) != n) {
        PyErr_Format(PyExc_TypeError, "%s must be an int64 array with a number for each", name);
        return false;
    }
    set->number = PyArray_DATA(array);
    return true;
}

/* What systems have of their own; returns how many there are, MOST_NUMBER where all share it, or -1
 * with an exception set. */
static int64_t
take_own(PyObject *const *given, const hs_py_call *call, hs_each_system *each)
{
    static const struct {
        int         at, type, n_axes;
        const char *name;
    } own[] = {
        {1, NPY_DOUBLE, 1, "float64"}, {2, NPY_DOUBLE, 3, "float64"}, {4, NPY_UINT8, 1, "uint8"}};
    const void *data[3] = {NULL, NULL, NULL};
    int64_t     n = MOST_NUMBER;
    for (int k = 0; k < 3; k++) {
        PyArrayObject *array = (PyArrayObject *)given[own[k].at];
        if (given[own[k].at] == Py_None) {
            continue;
        }
        if (!hs_is_array(given[own[k].at], own[k].type, own[k].n_axes)) {
            PyErr_Format(PyExc_TypeError, "a %s array with %d axes is expected", own[k].name,
                         own[k].n_axes);
            return -1;
        }
        const npy_intp *shape = PyArray_DIMS(array), d = call->points.at.ndim;
        if ((n != MOST_NUMBER && shape[0] != n) || (k == 1 && call->among.box == NULL) ||
            (k == 1 && (shape[1] != d || shape[2] != d))) {
            PyErr_SetString(PyExc_ValueError, "boxes do not fit points, box and cutoffs");
            return -1;
        }
        n = shape[0];
        data[k] = PyArray_DATA(array);
    }
    /* In open space the axes only tell how many systems there are. */
    *each = (hs_each_system){
        .cutoffs = data[0], .rows = data[1], .periodic = call->among.box != NULL ? data[2] : NULL};
    return n;
}

bool
hs_batch_take(PyObject *given, hs_py_call *call)
{
    static const char *const names[] = {"batch", "cutoff", "box", "query_batch", "periodic"};
    hs_batch                *batch = &call->batch;
    numbered                 points, queries = {.name = "query_batch"};
    *batch = (hs_batch){.is_given = true};
    if (!PyTuple_CheckExact(given) || PyTuple_GET_SIZE(given) != 5 || call->among.cells != NULL) {
        PyErr_SetString(PyExc_TypeError, "a batch of points must be a tuple of five");
        return false;
    }
    PyObject *const *parts = &PyTuple_GET_ITEM(given, 0);
    for (int k = 0; k < 5 && call->out != NULL; k++) {
        if (parts[k] != Py_None && !hs_out_is_apart(call->out, call->letters, parts[k], names[k])) {
            return false;
        }
    }
    if (!take_numbers(parts[0], call->points.at.n, "batch", &points) ||
        ((call->among.queries != NULL || parts[3] != Py_None) &&
         !take_numbers(parts[3], call->queries.at.n, "query_batch", &queries))) {
        return false;
    }
    const int64_t n_systems = take_own(parts, call, &call->each);
    if (n_systems < 0 || !find_systems(&points, &queries, n_systems, batch)) {
        hs_batch_free(batch);
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
