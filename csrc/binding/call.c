/* SPDX-License-Identifier: BSD-3-Clause */
/* call.c: see call.h. */
#include "call.h"

#include "available.h"
#include "convert.h"
#include "environment.h"
#include "foreign.h"
#include "threads.h"

#define MOST_THREADS 1024 /* an explicit wish, but not any */
#define THREADS_MUST_BE "threads must be a whole number from 1 to 1024 or None"

/* Points below which a search is expected to be over before another thread could take the GIL: it
 * is kept until the first poll. */
#define FEW_POINTS 256

/* An hs_poll_fn: lets signals be handled and reports progress; false when either raised. From the
 * first poll on the GIL is free: the search is not so small after all. */
static bool
poll_python(void *context, double fraction)
{
    hs_call *call = context;
    hs_call_acquire(call);
    bool go_on = PyErr_CheckSignals() == 0;
    if (go_on && call->progress != NULL) {
        PyObject *result = PyObject_CallFunction(call->progress, "d", fraction);
        go_on = result != NULL;
        Py_XDECREF(result);
    }
    call->thread = PyEval_SaveThread();
    return go_on;
}

static bool
take_memory_limit(PyObject *object, hs_options *options)
{
    if (object == Py_None) {
        options->find_limit = hs_available_memory;
        return true;
    }
    if (!hs_real_of(object, "memory_limit must be a number of bytes", &options->memory_limit)) {
        return false;
    }
    if (!(options->memory_limit >= 0.0)) {
        hs_refuse(PyExc_ValueError, "memory_limit must be a number of bytes", object);
        return false;
    }
    return true;
}

/* Fewer points are not worth asking for; the core would not use more than one thread for them. */
#define POINTS_FOR_THREADS 4096

/* A number, or 0 for None: what that means depends on the points. */
static bool
take_threads(PyObject *object, hs_options *options)
{
    options->threads = 0;
    if (object == Py_None) {
        return true;
    }
    double n;
    if (!hs_whole_of(object, THREADS_MUST_BE, &n)) {
        return false;
    }
    if (!(n >= 1.0 && n <= MOST_THREADS)) {
        hs_refuse(PyExc_ValueError, THREADS_MUST_BE, object);
        return false;
    }
    options->threads = (int)n;
    return true;
}

bool
hs_call_init(hs_call *call, PyObject *const *arguments)
{
    call->options = hs_options_default();
    call->thread = NULL;
    hs_options *options = &call->options;
    const int   inclusive = PyObject_IsTrue(arguments[4]);
    /* Numbers may run code of their own, which may give an array another shape or other memory:
     * views are taken after them. */
    if (inclusive < 0 || !take_memory_limit(arguments[7], options) ||
        !take_threads(arguments[9], options) ||
        !hs_points_of(arguments[0], &call->points) ||
        !hs_cutoff_of(arguments[1], &options->cutoff) ||
        !hs_box_of(arguments[2], arguments[3], call->points.ndim, &call->box, &call->has_box) ||
        !hs_precision_of(arguments[5], &options->precision) ||
        !hs_kernel_of(arguments[6], &options->kernel)) {
        return false;
    }
    if (options->threads == 0) {
        options->threads = call->points.n < POINTS_FOR_THREADS ? 1 : -hs_default_threads();
    }
    options->inclusive = inclusive != 0;
    call->progress = arguments[8] == Py_None ? NULL : arguments[8];
    options->poll = poll_python;
    options->poll_context = call;
    return true;
}

void
hs_call_release(hs_call *call)
{
    if (call->points.n >= FEW_POINTS) {
        call->thread = PyEval_SaveThread();
    }
}

void
hs_call_acquire(hs_call *call)
{
    if (call->thread != NULL) {
        PyEval_RestoreThread(call->thread);
        call->thread = NULL;
    }
}
