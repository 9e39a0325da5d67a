/* SPDX-License-Identifier: BSD-3-Clause */
/* py_streams.c: pairs that are never stored all at once: _core.iter_pairs, and the next block of
 * what it returns; _core.for_each_pair, which calls a function of C or of Python. */
#include "py_functions.h"

#include "errors.h"
#include "outputs.h"

#include <stdio.h>
#include <string.h>

/* ---- blocks ------------------------------------------------------------------------------- */

/* Owns the stream, and a reference to the cells that it borrows from. */
typedef struct pair_stream {
    hs_stream *stream;     /* NULL after the last block */
    PyObject  *cells;      /* or NULL */
    hs_py_call call;       /* points: their number only */
    char       letters[8]; /* of the quantities */
} pair_stream;

#define STREAM "halfshell._core.stream"

static void
free_stream(PyObject *capsule)
{
    pair_stream *self = PyCapsule_GetPointer(capsule, STREAM);
    hs_stream_free(self->stream);
    Py_XDECREF(self->cells);
    PyMem_Free(self);
}

static PyObject *
raise_block_too_large(const pair_stream *self, const hs_failure *failure)
{
    char text[192], limit[48];
    snprintf(text, sizeof text,
             "no memory for blocks of max_pairs = %lld pairs: %s; use a smaller max_pairs or "
             "fewer quantities",
             (long long)self->call.integer,
             hs_format_limit(failure->limit_bytes, limit, sizeof limit));
    PyErr_SetString(PyExc_MemoryError, text);
    return NULL;
}

PyObject *
hs_py_next_block(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_pairs *block = NULL;
    (void)module;
    pair_stream *self = hs_expect("next_block", n_arguments == 2)
                            ? PyCapsule_GetPointer(arguments[0], STREAM)
                            : NULL;
    if (self == NULL || PyErr_CheckSignals() != 0) {
        return NULL;
    }
    if (self->stream == NULL) {
        Py_RETURN_NONE;
    }
    hs_py_call *call = &self->call;
    call->progress = arguments[1] != Py_None ? arguments[1] : NULL;
    hs_py_call_release(call);
    const hs_status status =
        hs_stream_next(self->stream, call->options.poll, call, &block, &call->failure);
    hs_py_call_acquire(call);
    if (status == HS_ERR_MEMORY) {
        return raise_block_too_large(self, &call->failure);
    }
    if (status == HS_OK && block == NULL) {
        Py_RETURN_NONE;
    }
    PyObject *arrays = hs_py_call_pairs(call, status, block, false);
    if (status == HS_OK && arrays == NULL) { /* nothing may follow one that is lost */
        hs_stream_free(self->stream);
        self->stream = NULL;
    }
    return arrays;
}

PyObject *
hs_py_iter_pairs(hs_py_call *call)
{
    pair_stream *self = PyMem_Calloc(1, sizeof *self);
    PyObject *capsule = self != NULL ? PyCapsule_New(self, STREAM, free_stream) : PyErr_NoMemory();
    if (capsule == NULL) {
        PyMem_Free(self);
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status =
        hs_stream_open(&call->among, &call->options, call->integer, &self->stream, &call->failure);
    if (!hs_py_call_done(call, status)) {
        Py_DECREF(capsule);
        return NULL;
    }
    self->call = *call;
    self->call.n_made = 0; /* what is made is the caller's again */
    self->call.points.at.data = NULL;
    self->call.options.kernel = NULL;
    strcpy(self->letters, call->letters); /* seven different ones at most */
    self->call.letters = self->letters;
    self->cells = call->among.cells != NULL ? Py_NewRef(call->positions) : NULL;
    return Py_BuildValue("(NO)", capsule, call->progress != NULL ? call->progress : Py_None);
}

/* ---- functions that are called ------------------------------------------------------------ */

/* A Python callable that several threads may call, and the exception that stopped it. */
typedef struct callable {
    PyObject *function; /* borrowed */
    int       ndim;
    bool      stops; /* it wants to, or has failed; guarded by the lock of the function */
    PyObject *type, *value, *traceback; /* owned; of the first failure */
} callable;

static bool
has_stopped(callable *to_call)
{
    bool stops;
    Py_BEGIN_CRITICAL_SECTION(to_call->function);
    stops = to_call->stops;
    Py_END_CRITICAL_SECTION();
    return stops;
}

/* With or without an exception, which is kept unless there is one. */
static void
stop(callable *to_call)
{
    PyObject *type, *value, *traceback;
    PyErr_Fetch(&type, &value, &traceback);
    Py_BEGIN_CRITICAL_SECTION(to_call->function);
    to_call->stops = true;
    if (to_call->type == NULL) {
        to_call->type = type;
        to_call->value = value;
        to_call->traceback = traceback;
        type = value = traceback = NULL;
    }
    Py_END_CRITICAL_SECTION();
    Py_XDECREF(type);
    Py_XDECREF(value);
    Py_XDECREF(traceback);
}

/* A new reference or NULL. */
static PyObject *
tuple_of_shift(const int32_t *S, int ndim)
{
    int64_t wide[HS_MAX_DIM];
    for (int k = 0; k < ndim; k++) {
        wide[k] = S[k];
    }
    return hs_tuple_of_integers(wide, ndim);
}

/* Whether to go on after pair e; false also with an exception set. */
static bool
call_with(const callable *to_call, const hs_pair_arrays *pairs, int64_t e)
{
    const int    ndim = to_call->ndim;
    const double d = pairs->distance[e];
    PyObject    *arguments[5] = {PyLong_FromLongLong(((const int64_t *)pairs->i)[e]),
                                 PyLong_FromLongLong(((const int64_t *)pairs->j)[e]),
                                 tuple_of_shift(pairs->shift + e * ndim, ndim),
                                 hs_tuple_of_reals(pairs->vector + e * ndim, ndim),
                                 PyFloat_FromDouble(d * d)};
    bool         complete = true;
    for (int k = 0; k < 5; k++) {
        complete = complete && arguments[k] != NULL;
    }
    PyObject *result = complete ? PyObject_Vectorcall(to_call->function, arguments, 5, NULL) : NULL;
    for (int k = 0; k < 5; k++) {
        Py_XDECREF(arguments[k]);
    }
    const int stops = result == NULL ? -1 : PyObject_IsTrue(result);
    Py_XDECREF(result);
    return stops == 0;
}

/* An hs_pairs_fn: takes the lock of the interpreter once for all of them. */
static int
call_python(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    callable              *to_call = user;
    const PyGILState_STATE state = PyGILState_Ensure();
    bool                   stops = has_stopped(to_call);
    int64_t                e = 0;
    while (!stops && e < n) {
        stops = !call_with(to_call, pairs, e++);
        if (stops) {
            stop(to_call);
        }
    }
    *n_taken = e;
    PyGILState_Release(state);
    return stops;
}

/* What shall be called, by the address of a function or a callable. */
static bool
take_function(PyObject *const *arguments, callable *to_call, hs_visit *visit)
{
    if (PyLong_Check(arguments[0])) {
        const uintptr_t address = (uintptr_t)PyLong_AsVoidPtr(arguments[0]);
        visit->pair = (hs_pair_fn)address;
        visit->user = PyLong_AsVoidPtr(arguments[1]);
    } else {
        visit->pairs = call_python;
        visit->user = to_call;
    }
    return !PyErr_Occurred();
}

PyObject *
hs_py_for_each_pair(hs_py_call *call)
{
    callable to_call = {0};
    hs_visit visit = {0};
    int64_t  n = 0;
    if (!take_function(call->own, &to_call, &visit)) {
        return NULL;
    }
    visit.thread_safe = call->flag;
    to_call.function = call->own[0];
    to_call.ndim = call->points.at.ndim;
    call->thread = PyEval_SaveThread(); /* also with few points: other threads may need it */
    const hs_status status =
        hs_pairs_visit(&call->among, &call->options, &visit, &n, &call->failure);
    hs_py_call_acquire(call);
    if (to_call.type != NULL && !PyErr_Occurred()) {
        PyErr_Restore(to_call.type, to_call.value, to_call.traceback);
        return NULL;
    }
    Py_XDECREF(to_call.type);
    Py_XDECREF(to_call.value);
    Py_XDECREF(to_call.traceback);
    return hs_py_call_done(call, status) ? PyLong_FromLongLong(n) : NULL;
}
