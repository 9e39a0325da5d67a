/* SPDX-License-Identifier: BSD-3-Clause */
/* py_stream.c: _core.iter_pairs and the type of the iterators that it returns. */
#include "py_functions.h"

#include "py_call.h"
#include "errors.h"

#include <stdio.h>
#include <string.h>

/* Owns the stream, and references to the cells that it borrows from and to the progress hook. */
typedef struct pair_stream {
    PyObject_HEAD
    hs_stream *stream;     /* NULL after the last block */
    PyObject  *cells;      /* or NULL; as long as there is a stream */
    hs_py_call call;       /* points: their number only */
    PyObject  *progress;   /* or NULL */
    char       letters[8]; /* of the quantities */
    bool       is_running; /* a thread is in a call of the core */
} pair_stream;

/* Marks it as running; false with an exception set when it is already: a hook that calls for
 * the next block, or another thread. */
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
    char text[192], limit[48];
    snprintf(text, sizeof text,
             "no memory for blocks of max_pairs = %lld pairs: %s; use a smaller max_pairs or "
             "fewer quantities",
             (long long)self->call.integer,
             hs_format_limit(failure->limit_bytes, limit, sizeof limit));
    PyErr_SetString(PyExc_MemoryError, text);
    return NULL;
}

/* While it is marked as running: the next block, or NULL, with an exception unless it is over. */
static PyObject *
next_block(pair_stream *self)
{
    hs_pairs *block = NULL;
    if (self->stream == NULL || PyErr_CheckSignals() != 0) {
        return NULL;
    }
    hs_py_call_release(&self->call);
    const hs_status status = hs_stream_next(self->stream, self->call.options.poll,
                                            self->call.options.poll_context, &block,
                                            &self->call.failure);
    hs_py_call_acquire(&self->call);
    if (status == HS_ERR_MEMORY) {
        return raise_block_too_large(self, &self->call.failure);
    }
    PyObject *arrays =
        status == HS_OK && block == NULL ? NULL : hs_py_call_pairs(&self->call, status, block);
    if (status == HS_OK && arrays == NULL) { /* the last one, or one that is lost */
        end(self);                           /* nothing may follow it */
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

/* The arguments but for the stream itself, and references to what it goes on to use. */
static bool
take_arguments(pair_stream *self, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call *call = &self->call;
    if (!hs_py_call_take(call, "iter_pairs", "kbihge", arguments, n_arguments)) {
        return false;
    }
    strcpy(self->letters, call->letters); /* six different ones at most */
    call->letters = self->letters;
    self->progress = Py_XNewRef(call->progress);
    self->cells = call->among.cells != NULL ? Py_NewRef(arguments[0]) : NULL;
    return true;
}

PyObject *
hs_py_iter_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    PyTypeObject *type = ((PyTypeObject **)PyModule_GetState(module))[HS_STREAM_TYPE];
    pair_stream  *self = (pair_stream *)type->tp_alloc(type, 0); /* zeros */
    if (self == NULL || !take_arguments(self, arguments, n_arguments)) {
        Py_XDECREF(self);
        return NULL;
    }
    hs_py_call *call = &self->call;
    self->is_running = true; /* the hook can get hold of it */
    hs_py_call_release(call);
    const hs_status status =
        hs_stream_open(&call->among, &call->options, call->integer, &self->stream, &call->failure);
    hs_py_call_acquire(call);
    leave(self);
    if (status != HS_OK) {
        PyObject *nothing = hs_raise(status, &call->failure, &call->options);
        Py_DECREF(self);
        return nothing;
    }
    call->points.data = NULL; /* these are the caller's again */
    call->options.kernel = NULL;
    return (PyObject *)self;
}
