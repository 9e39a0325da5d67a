/* SPDX-License-Identifier: BSD-3-Clause */
/* py_dynamic_balls.c: the methods of _core.DynamicCells that ask what lies in a ball, and return
 * arrays. */
#include "py_dynamic.h"

#include "convert.h"
#include "foreign.h"
#include "py_call.h"
#include "tuples.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

/* The GIL is taken, to look for signals, so often; the clock is read after so many rows. */
#define CLOCK_ROWS         32
#define SIGNALS_PER_SECOND 20

/* What visits have found, in memory that is not Python's: it grows without the GIL. */
typedef struct gathered {
    const py_dynamic *self;
    hs_key           *keys;
    int32_t          *shifts; /* ndim each; NULL where they are not wanted */
    int64_t           n, capacity;
    bool              with_shift;
    hs_status         status; /* why the visit ended, if early */
    PyThreadState    *thread; /* NULL: this thread has the GIL */
    clock_t           looked; /* for signals, where it has not */
} gathered;

/* An hs_poll_fn: false on Ctrl-C. No handler is run, as that might use the list: it is left first.
 * user: a gathered, or NULL. */
static bool
poll_signals(void *user, double fraction)
{
    gathered *found = user;
    (void)fraction;
    if (found != NULL && found->thread != NULL) {
        if (clock() - found->looked < CLOCKS_PER_SEC / SIGNALS_PER_SECOND) {
            return true;
        }
        found->looked = clock();
        PyEval_RestoreThread(found->thread);
    }
    const bool is_interrupted = PyOS_InterruptOccurred() != 0;
    if (is_interrupted) {
        PyErr_SetInterrupt(); /* for the look at signals that follows */
    }
    if (found != NULL && found->thread != NULL) {
        found->thread = PyEval_SaveThread();
    }
    return !is_interrupted;
}

static void *
give_up_gil(void)
{
    return PyEval_SaveThread();
}

static void
take_gil(void *thread)
{
    PyEval_RestoreThread(thread);
}

const hs_dynamic_hooks hs_py_dynamic_hooks = {poll_signals, give_up_gil, take_gil};

bool
hs_py_dynamic_again(hs_status status)
{
    return status == HS_ERR_INTERRUPTED && PyErr_CheckSignals() == 0;
}

static bool
grow(gathered *found)
{
    const int64_t capacity = found->capacity * 2 + 64;
    hs_key       *keys = realloc(found->keys, (size_t)capacity * sizeof *keys);
    found->keys = keys != NULL ? keys : found->keys;
    if (keys != NULL && found->with_shift) {
        const size_t width = (size_t)found->self->ndim * sizeof *found->shifts;
        int32_t     *shifts = realloc(found->shifts, (size_t)capacity * width);
        found->shifts = shifts != NULL ? shifts : found->shifts;
        if (shifts == NULL) {
            return false;
        }
    }
    found->capacity = keys != NULL ? capacity : found->capacity;
    return keys != NULL;
}

static int
take(hs_key key, const double *position, const int64_t *shift, void *user)
{
    gathered *found = user;
    (void)position;
    if (found->n == found->capacity && !grow(found)) {
        found->status = HS_ERR_MEMORY;
        return 1;
    }
    for (int k = 0; found->with_shift && k < found->self->ndim; k++) {
        if (shift[k] < INT32_MIN || shift[k] > INT32_MAX) {
            found->status = HS_ERR_SHIFT_RANGE;
            return 1;
        }
        found->shifts[found->n * found->self->ndim + k] = (int32_t)shift[k];
    }
    found->keys[found->n++] = key;
    return 0;
}

static void
free_found(gathered *found)
{
    free(found->keys);
    free(found->shifts);
}

static PyObject *
shifts_array(const gathered *found)
{
    npy_intp  shape[2] = {(npy_intp)found->n, found->self->ndim};
    PyObject *array = PyArray_SimpleNew(2, shape, NPY_INT32);
    if (array != NULL && found->n > 0) {
        memcpy(PyArray_DATA((PyArrayObject *)array), found->shifts,
               (size_t)(found->n * found->self->ndim) * sizeof *found->shifts);
    }
    return array;
}

/* Keys, or keys and shifts. */
static PyObject *
arrays_of(const gathered *found)
{
    PyObject *keys = hs_keys_array(found->self, found->keys, found->n);
    if (!found->with_shift || keys == NULL) {
        return keys;
    }
    PyObject *both = PyTuple_New(2);
    hs_tuple_put(&both, 0, keys);
    if (both != NULL) {
        hs_tuple_put(&both, 1, shifts_array(found));
    }
    return both;
}

/* The arrays, or what ended the visits: a status, or that of `take`. */
static PyObject *
result_of(const gathered *found, hs_status status, const hs_failure *failure)
{
    if (status == HS_OK && found->status == HS_ERR_SHIFT_RANGE) {
        PyErr_SetString(PyExc_OverflowError,
                        "S holds 2**31 boxes, and a point in the ball lies further from the centre "
                        "as it was given: wrap both into the box first");
        return NULL;
    }
    status = status == HS_OK ? found->status : status;
    return status == HS_OK ? arrays_of(found)
                           : hs_raise_dynamic(found->self, status, failure, NULL);
}

/* position, radius, and whether shifts are wanted. */
static PyObject *
ask(const py_dynamic *self, PyObject *const *arguments, bool is_near, bool with_shift)
{
    gathered   found = {.self = self, .with_shift = with_shift, .status = HS_OK};
    double     position[HS_MAX_DIM], radius;
    hs_failure failure;
    if (!hs_real_of(arguments[1], "radius must be a number", &radius) ||
        !hs_position_of(self, arguments[0], position)) {
        return NULL;
    }
    hs_status status;
    do {
        found.n = 0;
        status = is_near ? hs_dynamic_near(self->list, position, radius, take, &found, &failure)
                         : hs_dynamic_within(self->list, position, radius, with_shift, take, &found,
                                             &failure);
    } while (hs_py_dynamic_again(status));
    PyObject *result = result_of(&found, status, &failure);
    free_found(&found);
    return result;
}

PyObject *
hs_py_dynamic_near(PyObject *self, PyObject *const *arguments, Py_ssize_t n)
{
    return hs_expect_arguments("near", n, 2) ? ask((py_dynamic *)self, arguments, true, false)
                                             : NULL;
}

PyObject *
hs_py_dynamic_within(PyObject *self, PyObject *const *arguments, Py_ssize_t n)
{
    return hs_expect_arguments("within", n, 3)
               ? ask((py_dynamic *)self, arguments, false, arguments[2] == Py_True)
               : NULL;
}

/* The balls around rows of float64, one after another, without the GIL but for a look at signals.
 * HS_ERR_INTERRUPTED has an exception set. */
static hs_status
ask_rows(const py_dynamic *self, const double *rows, int64_t n, double radius, int64_t *offsets,
         gathered *found, hs_failure *failure)
{
    hs_status status = HS_OK;
    found->looked = clock();
    found->thread = PyEval_SaveThread();
    offsets[0] = 0;
    for (int64_t q = 0; q < n && status == HS_OK && found->status == HS_OK; q++) {
        status = hs_dynamic_within(self->list, rows + q * self->ndim, radius, found->with_shift,
                                   take, found, failure);
        failure->row = status != HS_OK ? q : failure->row;
        offsets[q + 1] = found->n;
        const bool is_time = q % CLOCK_ROWS == CLOCK_ROWS - 1 &&
                             clock() - found->looked > CLOCKS_PER_SEC / SIGNALS_PER_SECOND;
        if (is_time || status == HS_ERR_INTERRUPTED) {
            found->looked = clock();
            PyEval_RestoreThread(found->thread);
            if (PyErr_CheckSignals() != 0) {
                status = HS_ERR_INTERRUPTED;
            } else if (status == HS_ERR_INTERRUPTED) { /* this row once more */
                status = HS_OK;
                found->n = offsets[q--];
            }
            found->thread = PyEval_SaveThread();
        }
    }
    PyEval_RestoreThread(found->thread);
    return status;
}

/* positions (q, ndim) of float64, radius, whether shifts are wanted -> offsets, keys[, shifts]. */
PyObject *
hs_py_dynamic_within_many(PyObject *object, PyObject *const *arguments, Py_ssize_t n)
{
    const py_dynamic *self = (const py_dynamic *)object;
    gathered          found = {.self = self, .with_shift = n == 3 && arguments[2] == Py_True};
    hs_failure        failure = {.row = -1};
    double            radius;
    if (n != 3 || !hs_is_array(arguments[0], NPY_DOUBLE, 2) ||
        PyArray_DIM((PyArrayObject *)arguments[0], 1) != self->ndim) {
        PyErr_SetString(PyExc_TypeError, "within_many takes positions, a radius and a bool");
        return NULL;
    }
    if (!hs_real_of(arguments[1], "radius must be a number", &radius)) {
        return NULL;
    }
    PyArrayObject *positions = (PyArrayObject *)arguments[0];
    npy_intp       rows = PyArray_DIM(positions, 0), ends = rows + 1;
    PyObject      *offsets = PyArray_SimpleNew(1, &ends, NPY_INT64);
    if (offsets == NULL) {
        return NULL;
    }
    const hs_status status = ask_rows(self, PyArray_DATA(positions), rows, radius,
                                      PyArray_DATA((PyArrayObject *)offsets), &found, &failure);
    PyObject       *arrays = result_of(&found, status, &failure);
    free_found(&found);
    if (arrays == NULL) {
        Py_DECREF(offsets);
        return NULL;
    }
    PyObject *result = PyTuple_New(2);
    hs_tuple_put(&result, 0, offsets);
    if (result != NULL) {
        hs_tuple_put(&result, 1, arrays);
    } else {
        Py_DECREF(arrays);
    }
    return result;
}
