/* SPDX-License-Identifier: BSD-3-Clause */
/* py_streams.c: pairs that are never stored all at once: _core.iter_pairs, and the next block of
 * what it returns; _core.for_each_pair, which calls a compiled function. */
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

PyObject *
hs_py_for_each_pair(hs_py_call *call)
{
    const hs_visit visit = {.pair = (hs_pair_fn)(uintptr_t)PyLong_AsVoidPtr(call->own[0]),
                            .user = PyLong_AsVoidPtr(call->own[1]),
                            .thread_safe = call->flag};
    int64_t        n = 0;
    if (PyErr_Occurred()) {
        return NULL;
    }
    call->thread = PyEval_SaveThread(); /* also with few points: the function may take the GIL */
    const hs_status status =
        hs_pairs_visit(&call->among, &call->options, &visit, &n, &call->failure);
    return hs_py_call_done(call, status) ? PyLong_FromLongLong(n) : NULL;
}
