/* SPDX-License-Identifier: BSD-3-Clause */
/* py_call.c: numbers first, views last: numbers may run code of their own. */
#include "py_call.h"

#include "available.h"
#include "convert.h"
#include "environment.h"
#include "foreign.h"
#include "threads.h"

#include <math.h>

#define MOST_THREADS    1024 /* an explicit wish, but not any */
#define THREADS_MUST_BE "threads must be a whole number from 1 to 1024 or None"

/* Points below which a search is expected to be over before another thread could take the GIL: it
 * is kept until the first poll. */
#define FEW_POINTS 256

/* An hs_poll_fn: lets signals be handled and reports progress; false when either raised. From the
 * first poll on the GIL is free: the search is not so small after all. */
static bool
poll_python(void *context, double fraction)
{
    hs_py_call *call = context;
    hs_py_call_acquire(call);
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
    options->memory_limit = fabs(options->memory_limit); /* -0.0 is 0 in messages, too */
    return true;
}

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
    if (n > HS_THREADS_PER_CORE) {
        const int most = hs_most_threads();
        options->threads = n > most ? most : (int)n;
    }
    return true;
}

static bool
take_queries(PyObject *object, hs_py_call *call)
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
count_points(const hs_py_call *call)
{
    return call->points.n + (call->has_queries ? call->queries.n : 0);
}

bool
hs_expect_arguments(const char *name, Py_ssize_t n_arguments, int expected)
{
    if (n_arguments != expected) {
        PyErr_Format(PyExc_TypeError, "%s takes %d arguments", name, expected);
    }
    return n_arguments == expected;
}

bool
hs_py_call_init(hs_py_call *call, PyObject *const *arguments)
{
    return hs_py_call_init_sets(call, arguments, Py_None);
}

/* Points and box: arrays, or what cells hold. */
static bool
take_scene(PyObject *points, PyObject *box, PyObject *periodic, hs_py_call *call)
{
    call->cells = hs_cells_of(points);
    if (call->cells != NULL) {
        const hs_box *of_cells = hs_cells_box(call->cells);
        hs_cells_points(call->cells, &call->points);
        call->has_box = of_cells != NULL;
        if (call->has_box) {
            call->box = *of_cells;
        }
        return true;
    }
    return hs_points_of(points, "points", &call->points) &&
           hs_box_of(box, periodic, call->points.ndim, &call->box, &call->has_box);
}

bool
hs_py_call_init_sets(hs_py_call *call, PyObject *const *arguments, PyObject *queries)
{
    call->options = hs_options_default();
    call->thread = NULL;
    hs_options *options = &call->options;
    const int   inclusive = PyObject_IsTrue(arguments[4]);
    /* Numbers may run code of their own, which may give an array another shape or other memory:
     * views are taken after them. */
    if (inclusive < 0 || !take_memory_limit(arguments[7], options) ||
        !take_threads(arguments[9], options) || !hs_cutoff_of(arguments[1], &options->cutoff) ||
        !take_scene(arguments[0], arguments[2], arguments[3], call) ||
        !take_queries(queries, call) || !hs_precision_of(arguments[5], &options->precision) ||
        !hs_kernel_of(arguments[6], &options->kernel)) {
        return false;
    }
    if (options->threads == 0) {
        /* Where the core would use one thread in any case, the system need not be asked. */
        const bool few = count_points(call) < HS_POINTS_FOR_THREADS;
        options->threads = few ? 1 : -hs_default_threads();
    }
    options->inclusive = inclusive != 0;
    call->progress = arguments[8] == Py_None ? NULL : arguments[8];
    options->poll = poll_python;
    options->poll_context = call;
    return true;
}

void
hs_py_call_release(hs_py_call *call)
{
    if (count_points(call) >= FEW_POINTS) {
        call->thread = PyEval_SaveThread();
    }
}

void
hs_py_call_acquire(hs_py_call *call)
{
    if (call->thread != NULL) {
        PyEval_RestoreThread(call->thread);
        call->thread = NULL;
    }
}

hs_among
hs_py_call_among(const hs_py_call *call)
{
    const bool has_cells = call->cells != NULL;
    return (hs_among){.points = has_cells ? NULL : &call->points,
                      .box = has_cells ? NULL : hs_py_call_box(call),
                      .queries = hs_py_call_queries(call),
                      .cells = call->cells};
}
