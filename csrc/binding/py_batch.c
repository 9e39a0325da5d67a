/* SPDX-License-Identifier: BSD-3-Clause */
/* py_batch.c: _core.batch_pairs and _core.batch_count: many systems in one call. */
#include "py_functions.h"

#include "convert.h"
#include "py_call.h"
#include "errors.h"

#define FIRST_CAPACITY 1024               /* systems; doubled as needed */
#define MOST_NUMBER    (INT64_C(1) << 62) /* so that counting on from it is safe */
#define MOST_COUNTS    (INT64_C(1) << 48) /* no memory holds them; NumPy cannot even say so */

/*
 * The systems as the core takes them. Where all share box and cutoff, those without points are left
 * out: numbers may be as far apart as users like. Otherwise each has its place.
 */
typedef struct batch {
    hs_systems systems;
    int64_t   *first;     /* owned */
    int64_t   *number;    /* owned: of each system; NULL where that is its place */
    int64_t    capacity;  /* of both */
    int64_t    n_numbers; /* systems, those without points counted */
} batch;

static void
free_batch(batch *given)
{
    PyMem_Free(given->first);
    PyMem_Free(given->number);
}

/* Arrays for twice as many systems, or for the first. */
static bool
grow(batch *given)
{
    const int64_t capacity = given->capacity > 0 ? 2 * given->capacity : FIRST_CAPACITY;
    int64_t      *first = PyMem_Realloc(given->first, (size_t)(capacity + 1) * sizeof *first);
    given->first = first != NULL ? first : given->first;
    int64_t *number = PyMem_Realloc(given->number, (size_t)capacity * sizeof *number);
    given->number = number != NULL ? number : given->number;
    if (first == NULL || number == NULL) {
        PyErr_NoMemory();
        return false;
    }
    given->capacity = capacity;
    return true;
}

static bool
refuse_number(int64_t i, int64_t number, int64_t before, int64_t n_systems)
{
    if (number < 0) {
        PyErr_Format(PyExc_ValueError, "batch must not be negative, got batch[%lld] = %lld",
                     (long long)i, (long long)number);
    } else if (number < before) {
        PyErr_Format(PyExc_ValueError,
                     "batch must be ascending, got batch[%lld] = %lld before batch[%lld] = %lld",
                     (long long)(i - 1), (long long)before, (long long)i, (long long)number);
    } else if (number >= n_systems && n_systems < MOST_NUMBER) {
        PyErr_Format(PyExc_ValueError,
                     "batch must be less than the number of systems that box or cutoff is given "
                     "for, %lld, got batch[%lld] = %lld",
                     (long long)n_systems, (long long)i, (long long)number);
    } else {
        PyErr_Format(PyExc_ValueError, "batch must be less than 2**62, got batch[%lld] = %lld",
                     (long long)i, (long long)number);
    }
    return false;
}

/* Systems that have points. Each number is read once: another thread may write meanwhile. */
static bool
find_occupied(const int64_t *numbers, int64_t n_points, batch *given)
{
    int64_t n = 0, before = -1;
    for (int64_t i = 0; i < n_points; i++) {
        const int64_t number = numbers[i];
        if (number == before && i > 0) {
            continue;
        }
        if (number < before || number < 0 || number >= MOST_NUMBER) {
            return refuse_number(i, number, before, MOST_NUMBER);
        }
        if (n == given->capacity && !grow(given)) {
            return false;
        }
        given->first[n] = i;
        given->number[n++] = before = number;
    }
    if (given->first == NULL && !grow(given)) {
        return false;
    }
    given->first[n] = n_points;
    given->systems.n = n;
    given->n_numbers = before + 1;
    return true;
}

/* All of n_systems, with or without points. */
static bool
find_all(const int64_t *numbers, int64_t n_points, int64_t n_systems, batch *given)
{
    int64_t before = -1;
    given->first = PyMem_Malloc((size_t)(n_systems + 1) * sizeof *given->first);
    if (given->first == NULL) {
        PyErr_NoMemory();
        return false;
    }
    for (int64_t i = 0; i < n_points; i++) {
        const int64_t number = numbers[i];
        if (number < before || number < 0 || number >= n_systems) {
            return refuse_number(i, number, before, n_systems);
        }
        while (before < number) {
            given->first[++before] = i;
        }
    }
    while (before < n_systems) {
        given->first[++before] = n_points;
    }
    given->systems.n = given->n_numbers = n_systems;
    return true;
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

/* Three arguments: batch, int64 (n,); cutoffs, None or float64 (s,); boxes, None or float64
 * (s, d, d), for which the call's box has the axes that repeat. */
static bool
take_batch(PyObject *const *arguments, const hs_py_call *call, batch *given)
{
    PyArrayObject *numbers = (PyArrayObject *)arguments[0];
    hs_systems    *systems = &given->systems;
    *given = (batch){.first = NULL};
    if (!hs_is_array(arguments[0], NPY_INT64, 1) || PyArray_DIM(numbers, 0) != call->points.n) {
        PyErr_SetString(PyExc_TypeError, "batch must be an int64 array with a number a point");
        return false;
    }
    const int64_t n_cutoffs = length_of(arguments[1], 1, MOST_NUMBER, &systems->cutoffs);
    const int64_t n_boxes = length_of(arguments[2], 3, MOST_NUMBER, &systems->rows);
    if (n_cutoffs < 0 || n_boxes < 0) {
        return false;
    }
    systems->box = call->among.box;
    systems->reach = call->among.reach;
    systems->selection = call->among.selection;
    if (systems->rows != NULL) {
        const npy_intp *shape = PyArray_DIMS((PyArrayObject *)arguments[2]);
        if (systems->box == NULL || shape[1] != call->points.ndim || shape[2] != shape[1] ||
            (systems->cutoffs != NULL && n_cutoffs != n_boxes)) {
            PyErr_SetString(PyExc_ValueError, "boxes do not fit points, box and cutoffs");
            return false;
        }
    }
    const int64_t n_systems = n_boxes < n_cutoffs ? n_boxes : n_cutoffs;
    const bool    found = n_systems < MOST_NUMBER
                              ? find_all(PyArray_DATA(numbers), call->points.n, n_systems, given)
                              : find_occupied(PyArray_DATA(numbers), call->points.n, given);
    systems->first = given->first;
    if (!found) {
        free_batch(given);
    }
    return found;
}

/* Systems are named where each has something of its own. */
static void
forget_system(const batch *given, hs_failure *failure)
{
    if (given->number != NULL) {
        failure->system = -1;
    }
}

PyObject *
hs_py_batch_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call       call;
    hs_pairs        *pairs = NULL;
    batch            given;
    PyObject *const *more = arguments + HS_CALL_ARGUMENTS + 4;
    (void)module;
    if (!hs_py_call_take(&call, "batch_pairs", "qsboaaahgc", arguments, n_arguments) ||
        !hs_py_call_is_apart(&call, more[0], "batch") ||
        !hs_py_call_is_apart(&call, more[1], "cutoff") ||
        !hs_py_call_is_apart(&call, more[2], "box") || !take_batch(more, &call, &given)) {
        return NULL;
    }
    if (!hs_py_call_make_room(&call)) {
        free_batch(&given);
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status =
        hs_systems_find(&call.points, &given.systems, &call.options, &pairs, &call.failure);
    hs_py_call_acquire(&call);
    forget_system(&given, &call.failure);
    free_batch(&given);
    return hs_py_call_pairs(&call, status, pairs);
}

/* Zeros, one for each number up to the largest. */
static PyObject *
new_counts(const batch *given)
{
    npy_intp length = (npy_intp)given->n_numbers;
    if (given->n_numbers > MOST_COUNTS) {
        return PyErr_Format(PyExc_MemoryError,
                            "the result would not fit: there would be %lld counts, one for each "
                            "number up to the largest in batch",
                            (long long)given->n_numbers);
    }
    return PyArray_ZEROS(1, &length, NPY_INT64, 0);
}

static void
put_counts(const batch *given, const int64_t *counts, int64_t *to)
{
    for (int64_t s = 0; s < given->systems.n; s++) {
        to[given->number != NULL ? given->number[s] : s] = counts[s];
    }
}

PyObject *
hs_py_batch_count(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    batch      given;
    (void)module;
    if (!hs_py_call_take(&call, "batch_count", "aaahg", arguments, n_arguments) ||
        !take_batch(arguments + HS_CALL_ARGUMENTS, &call, &given)) {
        return NULL;
    }
    PyObject *array = new_counts(&given);
    int64_t  *counts = PyMem_Malloc((size_t)given.systems.n * sizeof *counts + 1);
    if (array != NULL && counts == NULL) {
        PyErr_NoMemory();
        Py_CLEAR(array);
    }
    if (array != NULL) {
        hs_py_call_release(&call);
        const hs_status status =
            hs_systems_count(&call.points, &given.systems, &call.options, counts, &call.failure);
        hs_py_call_acquire(&call);
        if (status == HS_OK) {
            put_counts(&given, counts, PyArray_DATA((PyArrayObject *)array));
        } else {
            forget_system(&given, &call.failure);
            Py_CLEAR(array);
            (void)hs_raise(status, &call.failure, &call.options);
        }
    }
    PyMem_Free(counts);
    free_batch(&given);
    return array;
}
