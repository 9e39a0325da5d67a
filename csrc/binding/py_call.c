/* SPDX-License-Identifier: BSD-3-Clause */
/* py_call.c: numbers first, views last. What is taken when is the order of hs_py_call_take. */
#include "py_call.h"

#include "available.h"
#include "convert.h"
#include "environment.h"
#include "foreign.h"
#include "outputs.h"
#include "plain.h"
#include "reach.h"
#include "selection.h"
#include "threads.h"

#include <math.h>
#include <string.h>

#define AS_TEXT(number)      #number
#define MUST_BE_UP_TO(limit) "threads must be a whole number from 1 to " AS_TEXT(limit) " or None"
#define THREADS_MUST_BE      MUST_BE_UP_TO(HS_MOST_THREADS)

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
    if (!(n >= 1.0 && n <= HS_MOST_THREADS)) {
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

/* The shared arguments that are numbers or names. */
static bool
take_shared(PyObject *const *arguments, hs_py_call *call)
{
    hs_options *options = &call->options;
    const int   inclusive = PyObject_IsTrue(arguments[4]);
    options->inclusive = inclusive > 0;
    call->progress = arguments[8] == Py_None ? NULL : arguments[8];
    return inclusive >= 0 && take_memory_limit(arguments[7], options) &&
           take_threads(arguments[9], options) && hs_cutoff_of(arguments[1], &options->cutoff) &&
           hs_precision_of(arguments[5], &options->precision) &&
           hs_kernel_of(arguments[6], &options->kernel);
}

static bool
take_truth(PyObject *object, bool *value)
{
    const int truth = PyObject_IsTrue(object);
    *value = truth > 0;
    return truth >= 0;
}

static bool
take_index_bytes(PyObject *object, bool is_plain, hs_options *options)
{
    options->index_bytes = is_plain ? hs_plain_index_bytes(object) : (int)PyLong_AsLong(object);
    return options->index_bytes != -1 || !PyErr_Occurred();
}

static bool
take_capacity(PyObject *object, int64_t *capacity)
{
    *capacity = PyLong_AsLongLong(object);
    return *capacity != -1 || !PyErr_Occurred();
}

/* A number of the function's own, by its letter; true for what is none. */
static bool
take_number(char letter, PyObject *object, bool is_plain, hs_py_call *call)
{
    hs_options *options = &call->options;
    switch (letter) {
    case 'q': return hs_quantities_of(object, HS_ALL_LETTERS, &call->letters, &options->want);
    case 'k': return hs_quantities_of(object, HS_LETTERS, &call->letters, &options->want);
    case 'r': return hs_quantities_of(object, HS_ROW_LETTERS, &call->letters, &options->want);
    case 's': return take_truth(object, &options->sorted);
    case 'b': return take_index_bytes(object, is_plain, options);
    case 'f': return take_truth(object, &call->flag);
    case 'i': call->integer = PyLong_AsLongLong(object); return !PyErr_Occurred();
    case 'g': return hs_algorithm_of(object, &options->algorithm);
    case 'c': return object == Py_None || take_capacity(object, &call->capacity);
    case 'x': call->real = PyFloat_AsDouble(object); return !PyErr_Occurred();
    default: return true;
    }
}

/* Points and box: arrays, or what cells hold. */
static bool
take_scene(PyObject *points, PyObject *box, unsigned long repeats, hs_py_call *call)
{
    hs_among *among = &call->among;
    bool      has_box;
    among->cells = hs_cells_of(points);
    if (among->cells != NULL) {
        hs_cells_points(among->cells, &call->points);
        return true;
    }
    if (!hs_points_of(points, "points", &call->points) ||
        !hs_box_of(box, repeats, call->points.ndim, &call->box, &has_box)) {
        return false;
    }
    among->points = &call->points;
    among->box = has_box ? &call->box : NULL;
    return true;
}

static bool
take_queries(PyObject *object, hs_py_call *call)
{
    const hs_points *points = &call->points, *queries = &call->queries;
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
    call->among.queries = queries;
    return true;
}

static bool
take_out(PyObject *object, hs_py_call *call)
{
    hs_options *options = &call->options;
    call->out = object;
    options->out = &call->arrays;
    return hs_out_of(object, call->letters, call->points.ndim, options->index_bytes, &call->arrays);
}

/* A reach, or a tuple of two: that or None, and a selection. */
static bool
take_reach(PyObject *object, hs_py_call *call)
{
    const int64_t n_queries = call->among.queries != NULL ? call->queries.n : 0;
    if (PyTuple_CheckExact(object) && PyTuple_GET_SIZE(object) == 2) {
        call->among.selection = &call->selection;
        if (!hs_selection_of(PyTuple_GET_ITEM(object, 1), call->points.n, n_queries,
                             &call->selection)) {
            return false;
        }
        object = PyTuple_GET_ITEM(object, 0);
        if (object == Py_None) {
            return true;
        }
    }
    call->among.reach = &call->reach;
    return hs_reach_of(object, call->points.n, n_queries, call->points.ndim, &call->reach);
}

/* The cutoffs of shells, which go with their letter; NULL: one cutoff. */
static bool
take_shells(PyObject *object, hs_options *options)
{
    const bool is_wanted = options->want & HS_WANT_SHELL;
    if (object == NULL) {
        if (is_wanted) {
            PyErr_SetString(PyExc_ValueError,
                            "the letter k in quantities needs several cutoffs, got one");
        }
        return !is_wanted;
    }
    if (!is_wanted || !hs_is_array(object, NPY_DOUBLE, 1)) {
        PyErr_SetString(PyExc_TypeError, "several cutoffs must be a float64 array, with letter k");
        return false;
    }
    options->n_shells = PyArray_DIM((PyArrayObject *)object, 0);
    options->shells = PyArray_DATA((PyArrayObject *)object);
    return true;
}

/* What else is a view: queries, reach, and `out`, which comes last and is compared with others. */
static bool
take_more_views(PyObject *queries, PyObject *out, PyObject *reach, PyObject *const *arguments,
                hs_py_call *call)
{
    if ((queries != NULL && !take_queries(queries, call)) ||
        (reach != NULL && !take_reach(reach, call))) {
        return false;
    }
    if (out == NULL) {
        return true;
    }
    return take_out(out, call) &&
           (queries == NULL || hs_py_call_is_apart(call, queries, "queries")) &&
           hs_py_call_is_apart(call, arguments[0], "points") &&
           hs_py_call_is_apart(call, arguments[2], "box");
}

static int64_t
count_points(const hs_py_call *call)
{
    return call->points.n + (call->among.queries != NULL ? call->queries.n : 0);
}

bool
hs_expect_arguments(const char *name, Py_ssize_t n_arguments, int expected)
{
    if (n_arguments != expected) {
        PyErr_Format(PyExc_TypeError, "%s takes %d arguments", name, expected);
    }
    return n_arguments == expected;
}

/* Letters of arguments that cannot be left out. */
static int
count_needed(const char *more, int n_letters)
{
    int n = n_letters;
    while (n > 0 && strchr("hgecm", more[n - 1]) != NULL) {
        n--;
    }
    return n;
}

bool
hs_py_call_take(hs_py_call *call, const char *name, const char *more, PyObject *const *arguments,
                Py_ssize_t n_arguments)
{
    const bool is_plain = (n_arguments & HS_PLAIN) != 0;
    const int  n_given = (int)((n_arguments & ~HS_PLAIN) - HS_CALL_ARGUMENTS);
    const int  n_letters = (int)strlen(more), n_needed = count_needed(more, n_letters);
    const int  n_more = n_given < n_needed ? n_needed : n_given < n_letters ? n_given : n_letters;
    PyObject *const *own = arguments + HS_CALL_ARGUMENTS;
    PyObject        *queries = NULL, *out = NULL, *reach = NULL, *shells = NULL;
    hs_options      *options = &call->options;
    unsigned long    repeats;
    if (!hs_expect_arguments(name, n_arguments & ~HS_PLAIN, HS_CALL_ARGUMENTS + n_more) ||
        !(is_plain ? hs_plain_repeats(arguments, more, own, &repeats)
                   : hs_repeats_of(arguments[3], &repeats))) {
        return false;
    }
    *options = hs_options_default();
    call->among = (hs_among){.points = NULL};
    call->letters = "ij";
    call->out = call->room = call->batch = NULL;
    call->capacity = 0;
    call->thread = NULL;
    if (!take_shared(arguments, call)) {
        return false;
    }
    for (int k = 0; k < n_more; k++) {
        if (!take_number(more[k], own[k], is_plain, call)) {
            return false;
        }
        queries = more[k] == 'R' || (more[k] == 'Q' && own[k] != Py_None) ? own[k] : queries;
        out = more[k] == 'o' && own[k] != Py_None ? own[k] : out;
        reach = more[k] == 'h' && own[k] != Py_None ? own[k] : reach;
        call->batch = more[k] == 'm' && own[k] != Py_None ? own[k] : call->batch;
        shells = more[k] == 'e' && own[k] != Py_None ? own[k] : shells;
    }
    if (!take_shells(shells, options) || !take_scene(arguments[0], arguments[2], repeats, call) ||
        !take_more_views(queries, out, reach, arguments, call)) {
        return false;
    }
    if (options->threads == 0) {
        /* Where the core would use one thread in any case, the system need not be asked. */
        const bool few = count_points(call) < HS_POINTS_FOR_THREADS;
        options->threads = few ? 1 : -hs_default_threads();
    }
    options->poll = poll_python;
    options->poll_context = call;
    return true;
}

bool
hs_py_call_is_apart(const hs_py_call *call, PyObject *input, const char *name)
{
    return call->out == NULL || hs_out_is_apart(call->out, call->letters, input, name);
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
