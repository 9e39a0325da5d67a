/* SPDX-License-Identifier: BSD-3-Clause */
/* py_visit.c: _core.for_each_pair: pairs handed to a function, of C or of Python. */
#include "py_functions.h"

#include "py_call.h"
#include "errors.h"
#include "tuples.h"

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
hs_py_for_each_pair(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    callable   to_call = {0};
    hs_visit   visit = {0};
    int64_t    n = 0;
    (void)module;
    if (!hs_py_call_take(&call, "for_each_pair", "aafhg", arguments, n_arguments) ||
        !take_function(arguments + HS_CALL_ARGUMENTS, &to_call, &visit)) {
        return NULL;
    }
    visit.thread_safe = call.flag;
    to_call.function = arguments[HS_CALL_ARGUMENTS];
    to_call.ndim = call.points.ndim;
    call.thread = PyEval_SaveThread(); /* also with few points: other threads may need it */
    const hs_status status = hs_pairs_visit(&call.among, &call.options, &visit, &n, &call.failure);
    hs_py_call_acquire(&call);
    if (to_call.type != NULL && !PyErr_Occurred()) {
        PyErr_Restore(to_call.type, to_call.value, to_call.traceback);
        return NULL;
    }
    Py_XDECREF(to_call.type);
    Py_XDECREF(to_call.value);
    Py_XDECREF(to_call.traceback);
    return status == HS_OK ? PyLong_FromLongLong(n)
                           : hs_raise(status, &call.failure, &call.options);
}
