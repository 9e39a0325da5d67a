/* SPDX-License-Identifier: BSD-3-Clause */
/* py_stream.c: _core.iter_pairs and the type of the iterators that it returns. */
#include "py_functions.h"

#include "py_call.h"
#include "convert.h"
#include "errors.h"
#include "outputs.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Owns the stream, and references to the cells that it borrows from and to the progress hook. */
typedef struct pair_stream {
    PyObject_HEAD
    hs_stream *stream;     /* NULL: over */
    PyObject  *cells;      /* or NULL; as long as there is a stream */
    hs_py_call call;       /* points: their number only */
    PyObject  *progress;   /* or NULL */
    char       letters[8]; /* of the quantities */
    int64_t    max_pairs;
    bool       is_running; /* a thread is in a call of the core */
} pair_stream;

/* Marks it as running; false with an exception set when it is already: a hook that asks for the
 * next block, or another thread. */
static bool
enter(pair_stream *self)
{
    bool is_free;
    Py_BEGIN_CRITICAL_SECTION(self);
    is_free = !self->is_running;
    self->is_running = true;
    Py_END_CRITICAL_SECTION();
    if (!is_free) {
        PyErr_SetString(PyExc_ValueError, "iter_pairs is already looking for the next block");
    }
    return is_free;
}

static void
leave(pair_stream *self)
{
    Py_BEGIN_CRITICAL_SECTION(self);
    self->is_running = false;
    Py_END_CRITICAL_SECTION();
}

/* Gives back all memory: no block follows. */
static void
end(pair_stream *self)
{
    hs_stream_free(self->stream);
    self->stream = NULL;
    Py_CLEAR(self->cells);
}

static PyObject *
raise_block_too_large(const pair_stream *self, const hs_failure *failure)
{
    char text[192], limit[32];
    snprintf(text, sizeof text,
             "no memory for blocks of max_pairs = %lld pairs: %s %s; use a smaller max_pairs or "
             "fewer quantities",
             (long long)self->max_pairs, hs_format_bytes(failure->limit_bytes, limit, sizeof limit),
             isinf(failure->limit_bytes) ? "is to be had" : "are allowed");
    PyErr_SetString(PyExc_MemoryError, text);
    return NULL;
}

/* While it is marked as running: the next block, or NULL, with an exception unless it is over. */
static PyObject *
next_block(pair_stream *self)
{
    hs_failure failure;
    hs_pairs  *block = NULL;
    if (self->stream == NULL || PyErr_CheckSignals() != 0) {
        return NULL;
    }
    hs_py_call_release(&self->call);
    const hs_status status = hs_stream_next(self->stream, self->call.options.poll,
                                            self->call.options.poll_context, &block, &failure);
    hs_py_call_acquire(&self->call);
    if (status == HS_ERR_MEMORY) {
        return raise_block_too_large(self, &failure);
    }
    if (status != HS_OK) {
        return hs_raise(status, &failure, &self->call.options);
    }
    PyObject *arrays = block == NULL ? NULL
                                     : hs_arrays_of(block, self->letters, self->call.points.ndim,
                                                    self->call.options.index_bytes);
    hs_pairs_free(block);
    if (arrays == NULL) { /* the last one, or one that is lost: nothing may follow it */
        end(self);
    }
    return arrays;
}

static PyObject *
stream_next(PyObject *object)
{
    pair_stream *self = (pair_stream *)object;
    if (!enter(self)) {
        return NULL;
    }
    PyObject *block = next_block(self);
    leave(self);
    return block;
}

static PyObject *
stream_close(PyObject *object, PyObject *ignored)
{
    pair_stream *self = (pair_stream *)object;
    (void)ignored;
    if (!enter(self)) {
        return NULL;
    }
    end(self);
    leave(self);
    Py_RETURN_NONE;
}

static int
stream_traverse(PyObject *object, visitproc visit, void *arg)
{
    Py_VISIT(Py_TYPE(object));
    Py_VISIT(((pair_stream *)object)->progress);
    return 0;
}

static int
stream_clear(PyObject *object)
{
    pair_stream *self = (pair_stream *)object;
    self->call.progress = NULL;
    Py_CLEAR(self->progress);
    return 0;
}

static void
stream_dealloc(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    PyObject_GC_UnTrack(object);
    end((pair_stream *)object);
    (void)stream_clear(object);
    type->tp_free(object);
    Py_DECREF(type);
}

static PyMethodDef stream_methods[] = {
    {"close", stream_close, METH_NOARGS, "Give back all memory; no block follows."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot stream_slots[] = {
    {Py_tp_doc, "Blocks of pairs; see halfshell.iter_pairs."},
    {Py_tp_iter, PyObject_SelfIter},
    {Py_tp_iternext, stream_next},
    {Py_tp_methods, stream_methods},
    {Py_tp_traverse, stream_traverse},
    {Py_tp_clear, stream_clear},
    {Py_tp_dealloc, stream_dealloc},
    {0, NULL},
};

static PyType_Spec stream_spec = {
    .name = "halfshell._core.PairBlocks",
    .basicsize = sizeof(pair_stream),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_HAVE_GC | Py_TPFLAGS_DISALLOW_INSTANTIATION |
             Py_TPFLAGS_IMMUTABLETYPE,
    .slots = stream_slots,
};

PyObject *
hs_py_stream_type(PyObject *module)
{
    return PyType_FromModuleAndSpec(module, &stream_spec, NULL);
}

/* The arguments but for the stream itself. */
static bool
take_arguments(pair_stream *self, PyObject *const *arguments)
{
    hs_options *options = &self->call.options;
    const char *letters;
    if (!hs_py_call_init(&self->call, arguments) ||
        !hs_quantities_of(arguments[HS_CALL_ARGUMENTS], HS_LETTERS, &letters, &options->want)) {
        return false;
    }
    strcpy(self->letters, letters); /* six different ones at most */
    options->index_bytes = (int)PyLong_AsLong(arguments[HS_CALL_ARGUMENTS + 1]);
    self->max_pairs = PyLong_AsLongLong(arguments[HS_CALL_ARGUMENTS + 2]);
    self->progress = self->call.progress;
    Py_XINCREF(self->progress);
    self->cells = self->call.cells != NULL ? Py_NewRef(arguments[0]) : NULL;
    return !PyErr_Occurred();
}

PyObject *
hs_py_iter_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_failure failure;
    if (!hs_expect_arguments("iter_pairs", n_arguments, HS_CALL_ARGUMENTS + 3)) {
        return NULL;
    }
    PyTypeObject *type = *(PyTypeObject **)PyModule_GetState(module);
    pair_stream  *self = (pair_stream *)type->tp_alloc(type, 0); /* zeros */
    if (self == NULL || !take_arguments(self, arguments)) {
        Py_XDECREF(self);
        return NULL;
    }
    hs_py_call *call = &self->call;
    self->is_running = true; /* the hook can get hold of it */
    const hs_among among = hs_py_call_among(call);
    hs_py_call_release(call);
    const hs_status status =
        hs_stream_open(&among, &call->options, self->max_pairs, &self->stream, &failure);
    hs_py_call_acquire(call);
    leave(self);
    if (status != HS_OK) {
        PyObject *nothing = hs_raise(status, &failure, &call->options);
        Py_DECREF(self);
        return nothing;
    }
    call->points.data = NULL; /* these are the caller's again */
    call->options.kernel = NULL;
    return (PyObject *)self;
}
