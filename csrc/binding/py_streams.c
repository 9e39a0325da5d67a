/* SPDX-License-Identifier: BSD-3-Clause */
/* py_streams.c: pairs that are never stored all at once: _core.iter_pairs and the type of the
 * iterators that it returns; _core.for_each_pair, which calls a function of C or of Python. */
#include "py_functions.h"

#include "errors.h"
#include "outputs.h"

#include <stdio.h>
#include <string.h>

/* ---- blocks ------------------------------------------------------------------------------- */

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

PyObject *
hs_py_iter_pairs(hs_py_call *call)
{
    PyTypeObject *type = ((PyTypeObject **)PyModule_GetState(call->module))[HS_STREAM_TYPE];
    pair_stream  *self = (pair_stream *)type->tp_alloc(type, 0); /* zeros */
    if (self == NULL) {
        return NULL;
    }
    hs_py_call_release(call);
    const hs_status status =
        hs_stream_open(&call->among, &call->options, call->integer, &self->stream, &call->failure);
    hs_py_call_acquire(call);
    if (status != HS_OK) {
        Py_DECREF(self);
        return hs_py_call_raise(call, status);
    }
    self->call = *call;
    self->call.n_made = 0; /* what is made, points and systems, are the caller's again */
    self->call.batch = (hs_batch){.is_given = call->batch.is_given, .are_all = call->batch.are_all};
    self->call.points.at.data = NULL;
    self->call.options.kernel = NULL;
    self->call.options.poll_context = &self->call;
    strcpy(self->letters, call->letters); /* seven different ones at most */
    self->call.letters = self->letters;
    self->progress = Py_XNewRef(call->progress);
    self->cells = call->among.cells != NULL ? Py_NewRef(call->positions) : NULL;
    return (PyObject *)self;
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

/* A compiled function, which several threads may call. */
typedef struct compiled {
    hs_pair_fn pair;
    void      *user;
    int        ndim;
} compiled;

/* An hs_pairs_fn. */
static int
call_compiled(const hs_pair_arrays *pairs, int64_t n, int64_t *n_taken, void *user)
{
    compiled      *to_call = user;
    const int64_t *i = pairs->i, *j = pairs->j;
    const int      ndim = to_call->ndim;
    for (int64_t e = 0; e < n; e++) {
        const double d = pairs->distance[e];
        if (to_call->pair(i[e], j[e], pairs->shift + e * ndim, pairs->vector + e * ndim, d * d,
                          to_call->user) != 0) {
            *n_taken = e + 1;
            return 1;
        }
    }
    return 0;
}

/* What shall be called, by the address of a function or a callable. */
static bool
take_function(PyObject *const *arguments, callable *to_call, compiled *to_run, hs_visit *visit)
{
    if (PyLong_Check(arguments[0])) {
        const uintptr_t address = (uintptr_t)PyLong_AsVoidPtr(arguments[0]);
        to_run->pair = (hs_pair_fn)address;
        to_run->user = PyLong_AsVoidPtr(arguments[1]);
        visit->pairs = call_compiled;
        visit->user = to_run;
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
    compiled to_run = {0};
    hs_visit visit = {0};
    int64_t  n = 0;
    if (!take_function(call->own, &to_call, &to_run, &visit)) {
        return NULL;
    }
    visit.thread_safe = call->flag;
    to_call.function = call->own[0];
    to_call.ndim = to_run.ndim = call->points.at.ndim;
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
    return status == HS_OK ? PyLong_FromLongLong(n) : hs_py_call_raise(call, status);
}
