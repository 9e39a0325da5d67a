/* SPDX-License-Identifier: BSD-3-Clause */
/* call.c: see call.h. */
#include "call.h"

#include "available.h"
#include "convert.h"
#include "environment.h"
#include "threads.h"

#define MOST_THREADS 1024 /* an explicit wish, but not any */

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
    options->memory_limit = PyFloat_AsDouble(object);
    if (PyErr_Occurred()) {
        if (!PyErr_ExceptionMatches(PyExc_TypeError)) {
            return false;
        }
        PyErr_Clear();
        PyErr_Format(PyExc_TypeError, "memory_limit must be a number of bytes, got %s",
                     Py_TYPE(object)->tp_name);
        return false;
    }
    if (!(options->memory_limit >= 0.0)) {
        PyErr_Format(PyExc_ValueError, "memory_limit must be a number of bytes, got %R", object);
        return false;
    }
    return true;
}

static bool
take_threads(PyObject *object, int64_t n_points, hs_options *options)
{
    if (object == Py_None) {
        /* Where the core would use one thread in any case, the system need not be asked. */
        options->threads = n_points < HS_POINTS_FOR_THREADS ? 1 : -hs_default_threads();
        return true;
    }
    const long n = PyBool_Check(object) ? -1 : PyLong_AsLong(object);
    if (n == -1 && PyErr_Occurred()) {
        if (PyErr_ExceptionMatches(PyExc_TypeError)) {
            PyErr_Format(PyExc_TypeError, "threads must be a whole number or None, got %s",
                         Py_TYPE(object)->tp_name);
        }
        return false;
    }
    if (n < 1 || n > MOST_THREADS) {
        PyErr_Format(PyBool_Check(object) ? PyExc_TypeError : PyExc_ValueError,
                     "threads must be a whole number from 1 to %d or None, got %R", MOST_THREADS,
                     object);
        return false;
    }
    options->threads = (int)n;
    return true;
}

static bool
take_queries(PyObject *object, hs_call *call)
{
    const hs_points *points = &call->points, *queries = &call->queries;
    call->has_queries = object != Py_None;
    if (!call->has_queries) {
        return true;
    }
    if (!hs_points_of(object, "queries", &call->queries)) {
        return false;
    }
    if (queries->ndim != points->ndim) {
        PyErr_Format(PyExc_ValueError,
                     "queries and points must have the same number of columns, got shapes "
                     "(%lld, %d) and (%lld, %d)",
                     (long long)queries->n, queries->ndim, (long long)points->n, points->ndim);
        return false;
    }
    return true;
}

static int64_t
count_points(const hs_call *call)
{
    return call->points.n + (call->has_queries ? call->queries.n : 0);
}

bool
hs_call_init(hs_call *call, PyObject *const *arguments)
{
    return hs_call_init_sets(call, arguments, Py_None);
}

bool
hs_call_init_sets(hs_call *call, PyObject *const *arguments, PyObject *queries)
{
    call->options = hs_options_default();
    call->thread = NULL;
    hs_options *options = &call->options;
    const int   inclusive = PyObject_IsTrue(arguments[4]);
    if (inclusive < 0 || !hs_points_of(arguments[0], "points", &call->points) ||
        !take_queries(queries, call) ||
        !hs_cutoff_of(arguments[1], &options->cutoff) ||
        !hs_box_of(arguments[2], arguments[3], call->points.ndim, &call->box, &call->has_box) ||
        !hs_precision_of(arguments[5], &options->precision) ||
        !hs_kernel_of(arguments[6], &options->kernel) ||
        !take_memory_limit(arguments[7], options) ||
        !take_threads(arguments[9], count_points(call), options)) {
        return false;
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
    if (count_points(call) >= FEW_POINTS) {
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
