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

/* Arrays for twice as many systems, or for the first. */
static bool
grow(hs_batch *batch, bool has_queries)
{
    const int64_t capacity = batch->capacity > 0 ? 2 * batch->capacity : FIRST_CAPACITY;
    if (!grow_one(&batch->first, capacity + 1) || !grow_one(&batch->number, capacity) ||
        (has_queries && !grow_one(&batch->first_query, capacity + 1))) {
        return false;
    }
    batch->capacity = capacity;
    return true;
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

/* Systems that have points, or queries. */
static bool
find_occupied(numbered *points, numbered *queries, hs_batch *batch)
{
    const bool has_queries = queries->number != NULL;
    int64_t    n = 0, number = -1;
    if (!begin(points, MOST_NUMBER) || !begin(queries, MOST_NUMBER)) {
        return false;
    }
    while (points->next < MOST_NUMBER || queries->next < MOST_NUMBER) {
        if (n == batch->capacity && !grow(batch, has_queries)) {
            return false;
        }
        number = points->next < queries->next ? points->next : queries->next;
        batch->first[n] = points->at;
        if (has_queries) {
            batch->first_query[n] = queries->at;
        }
        batch->number[n++] = number;
        if (!pass(points, number, MOST_NUMBER) || !pass(queries, number, MOST_NUMBER)) {
            return false;
        }
    }
    if (batch->first == NULL && !grow(batch, has_queries)) {
        return false;
    }
    batch->first[n] = points->n;
    if (has_queries) {
        batch->first_query[n] = queries->n;
    }
    batch->systems.n = n;
    batch->n_numbers = number + 1;
    return true;
}

/* Where each of n_systems begins in a set, with or without points. */
static bool
find_all(numbered *set, int64_t n_systems, int64_t **first)
{
    if (!grow_one(first, n_systems + 1) || !begin(set, n_systems)) {
        return false;
    }
    for (int64_t s = 0; s < n_systems; s++) {
        (*first)[s] = set->at;
        if (!pass(set, s, n_systems)) {
            return false;
        }
    }
    (*first)[n_systems] = set->n;
    return true;
}

static bool
find_systems(numbered *points, numbered *queries, int64_t n_systems, hs_batch *batch)
{
    if (n_systems == MOST_NUMBER) {
        return find_occupied(points, queries, batch);
    }
    batch->systems.n = batch->n_numbers = n_systems;
    return find_all(points, n_systems, &batch->first) &&
           (queries->number == NULL || find_all(queries, n_systems, &batch->first_query));
}

/* A C-contiguous float64 array with so many axes, or None: its length, else -1. */
static int64_t
length_of(PyObject *object, int n_axes, int64_t otherwise, const double **data)
{
    *data = NULL;
    if (object == Py_None) {
        return otherwise;
    }
    if (!hs_is_array(object, NPY_DOUBLE, n_axes)) {
        PyErr_Format(PyExc_TypeError, "a float64 array with %d axes is expected", n_axes);
        return -1;
    }
    *data = PyArray_DATA((PyArrayObject *)object);
    return PyArray_DIM((PyArrayObject *)object, 0);
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

/* Boxes fit the points and the call's box; else an exception is set. */
static bool
boxes_fit(PyObject *boxes, const hs_py_call *call)
{
    const npy_intp *shape = PyArray_DIMS((PyArrayObject *)boxes);
    if (call->among.box == NULL || shape[1] != call->points.ndim || shape[2] != shape[1]) {
        PyErr_SetString(PyExc_ValueError, "boxes do not fit points, box and cutoffs");
        return false;
    }
    return true;
}

/* Bits of the axes that repeat, or None. */
static bool
take_bits(PyObject *object, const hs_py_call *call, hs_systems *systems)
{
    if (object == Py_None) {
        return true;
    }
    if (!hs_is_array(object, NPY_UINT8, 1) || call->among.box == NULL) {
        PyErr_SetString(PyExc_TypeError, "axes that repeat must be uint8, beside a box");
        return false;
    }
    systems->periodic = PyArray_DATA((PyArrayObject *)object);
    return true;
}

/* What systems have of their own; returns how many there are, MOST_NUMBER where all share it, or -1
 * with an exception set. */
static int64_t
take_own(PyObject *const *given, const hs_py_call *call, hs_systems *systems)
{
    PyObject     *bits = given[4];
    const int64_t n_cutoffs = length_of(given[1], 1, MOST_NUMBER, &systems->cutoffs);
    const int64_t n_boxes = length_of(given[2], 3, MOST_NUMBER, &systems->rows);
    if (n_cutoffs < 0 || n_boxes < 0 || (systems->rows != NULL && !boxes_fit(given[2], call)) ||
        !take_bits(bits, call, systems)) {
        return -1;
    }
    const int64_t lengths[] = {n_cutoffs, n_boxes,
                               systems->periodic != NULL ? PyArray_DIM((PyArrayObject *)bits, 0)
                                                         : MOST_NUMBER};
    int64_t       n = MOST_NUMBER;
    for (int k = 0; k < 3; k++) {
        if (lengths[k] != MOST_NUMBER && n != MOST_NUMBER && lengths[k] != n) {
            PyErr_SetString(PyExc_ValueError, "boxes do not fit points, box and cutoffs");
            return -1;
        }
        n = lengths[k] < n ? lengths[k] : n;
    }
    return n;
}

bool
hs_batch_take(PyObject *given, const hs_py_call *call, hs_batch *batch)
{
    static const char *const names[] = {"batch", "cutoff", "box", "query_batch", "periodic"};
    hs_systems              *systems = &batch->systems;
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
    if (!take_numbers(parts[0], call->points.n, "batch", &points) ||
        ((call->among.queries != NULL || parts[3] != Py_None) &&
         !take_numbers(parts[3], call->queries.n, "query_batch", &queries))) {
        return false;
    }
    systems->box = call->among.box;
    systems->reach = call->among.reach;
    systems->selection = call->among.selection;
    const int64_t n_systems = take_own(parts, call, systems);
    if (n_systems < 0 || !find_systems(&points, &queries, n_systems, batch)) {
        hs_batch_free(batch);
        return false;
    }
    systems->first = batch->first;
    systems->first_query = batch->first_query;
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
