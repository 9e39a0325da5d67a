/* SPDX-License-Identifier: BSD-3-Clause */
/* py_verlet.c: _core.verlet_*: a list of pairs that is used for many steps, in a capsule. */
#include "py_functions.h"

#include "py_call.h"
#include "errors.h"
#include "py_result.h"
#include "threads.h"

#define CAPSULE "halfshell._core.verlet"

static void
free_list(PyObject *capsule)
{
    hs_verlet_free(PyCapsule_GetPointer(capsule, CAPSULE));
}

PyObject *
hs_py_verlet_new(PyObject *module, PyObject *ignored)
{
    (void)module;
    (void)ignored;
    hs_verlet *list = hs_verlet_new();
    if (list == NULL) {
        return PyErr_NoMemory();
    }
    PyObject *capsule = PyCapsule_New(list, CAPSULE, free_list);
    if (capsule == NULL) {
        hs_verlet_free(list);
    }
    return capsule;
}

/* The list of the first argument, of which there must be n in all; NULL with an exception set. */
static hs_verlet *
list_of(PyObject *const *arguments, Py_ssize_t n_arguments, int n, const char *name)
{
    return hs_expect_arguments(name, n_arguments, n) ? PyCapsule_GetPointer(arguments[0], CAPSULE)
                                                     : NULL;
}

PyObject *
hs_py_verlet_update(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_failure failure;
    bool       rebuilt = false;
    (void)module;
    hs_verlet *list = list_of(arguments, n_arguments, HS_CALL_ARGUMENTS + 3, "verlet_update");
    if (list == NULL || !hs_py_call_init(&call, arguments + 1)) {
        return NULL;
    }
    const double skin = PyFloat_AsDouble(arguments[HS_CALL_ARGUMENTS + 1]);
    const int    rebuild = PyObject_IsTrue(arguments[HS_CALL_ARGUMENTS + 2]);
    if (PyErr_Occurred()) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status = hs_verlet_update(list, &call.points, hs_py_call_box(&call),
                                              &call.options, skin, rebuild != 0, &rebuilt,
                                              &failure);
    hs_py_call_acquire(&call);
    if (status != HS_OK) {
        return hs_raise(status, &failure, &call.options);
    }
    return PyBool_FromLong(rebuilt);
}

PyObject *
hs_py_verlet_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_result  result;
    hs_failure failure;
    hs_pairs  *pairs = NULL;
    (void)module;
    hs_verlet *list = list_of(arguments, n_arguments, HS_CALL_ARGUMENTS + 5, "verlet_pairs");
    if (list == NULL || !hs_py_call_init(&call, arguments + 1)) {
        return NULL;
    }
    const hs_verlet_state state = hs_verlet_look(list);
    if (call.points.ndim != state.ndim) {
        PyErr_Format(PyExc_ValueError, "points must have %d dimensions here", state.ndim);
        return NULL;
    }
    call.points.n = state.n_points; /* those given are none: the list has its own */
    if (arguments[HS_CALL_ARGUMENTS] == Py_None) {
        call.options.threads = -hs_default_threads();
    }
    if (!hs_result_init(&result, arguments + HS_CALL_ARGUMENTS + 1, &call)) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status = hs_verlet_find(list, &call.options, &pairs, &failure);
    hs_py_call_acquire(&call);
    if (status != HS_OK) {
        return hs_raise(status, &failure, &call.options);
    }
    PyObject *arrays = hs_result_of(&result, pairs, &call);
    hs_pairs_free(pairs);
    return arrays;
}

PyObject *
hs_py_verlet_look(PyObject *module, PyObject *capsule)
{
    (void)module;
    hs_verlet *list = PyCapsule_GetPointer(capsule, CAPSULE);
    if (list == NULL) {
        return NULL;
    }
    const hs_verlet_state state = hs_verlet_look(list);
    return Py_BuildValue("{s:O,s:i,s:L,s:L,s:d,s:d,s:d,s:d}", "has_list",
                         state.has_list ? Py_True : Py_False, "ndim", state.ndim, "n_points",
                         (long long)state.n_points, "n_listed", (long long)state.n_listed, "cutoff",
                         state.cutoff, "radius", state.radius, "margin", state.margin, "tried",
                         state.tried);
}
