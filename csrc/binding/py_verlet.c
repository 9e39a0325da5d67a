/* SPDX-License-Identifier: BSD-3-Clause */
/* py_verlet.c: _core.verlet_*: a list of pairs that is used for many steps, in a capsule. */
#include "py_functions.h"

#include "py_call.h"
#include "errors.h"
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

/* A list, and the arguments of a search; false with an exception set. */
static bool
take_call(hs_py_call *call, hs_verlet **list, const char *name, const char *more,
          PyObject *const *arguments, Py_ssize_t n_arguments)
{
    *list = n_arguments > 0 ? PyCapsule_GetPointer(arguments[0], CAPSULE) : NULL;
    if (n_arguments == 0) {
        PyErr_Format(PyExc_TypeError, "%s takes a list", name);
    }
    return *list != NULL && hs_py_call_take(call, name, more, arguments + 1, n_arguments - 1);
}

PyObject *
hs_py_verlet_update(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_verlet *list;
    bool       rebuilt = false;
    (void)module;
    if (!take_call(&call, &list, "verlet_update", "xf", arguments, n_arguments)) {
        return NULL;
    }
    hs_py_call_release(&call);
    const hs_status status = hs_verlet_update(list, &call.points, call.among.box, &call.options,
                                              call.real, call.flag, &rebuilt, &call.failure);
    hs_py_call_acquire(&call);
    return status == HS_OK ? PyBool_FromLong(rebuilt)
                           : hs_raise(status, &call.failure, &call.options);
}

PyObject *
hs_py_verlet_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    hs_py_call call;
    hs_verlet *list;
    hs_pairs  *pairs = NULL;
    (void)module;
    if (!take_call(&call, &list, "verlet_pairs", "qsbo", arguments, n_arguments)) {
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
    hs_py_call_release(&call);
    const hs_status status = hs_verlet_find(list, &call.options, &pairs, &call.failure);
    hs_py_call_acquire(&call);
    return hs_py_call_pairs(&call, status, pairs);
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
