/* SPDX-License-Identifier: BSD-3-Clause */
/* quick.c: calls a function of this module, told to take its arguments as they are. */
#include "quick.h"

#include "plain.h"

/* What a function of this module returns for these arguments, as they are if they are plain. */
static PyObject *
call_plainly(PyObject *module, PyObject *function, PyObject *const *arguments,
             Py_ssize_t n_arguments)
{
    typedef PyObject *(*search_fn)(PyObject *, PyObject *const *, Py_ssize_t);
    if (!PyCFunction_Check(function) || PyCFunction_GET_SELF(function) != module ||
        PyCFunction_GET_FLAGS(function) != METH_FASTCALL) {
        PyErr_SetString(PyExc_TypeError, "a function of this module is wanted");
        return NULL;
    }
    const search_fn search = (search_fn)(void (*)(void))PyCFunction_GET_FUNCTION(function);
    PyObject       *result = search(module, arguments, n_arguments | HS_PLAIN);
    if (result == NULL && !PyErr_Occurred()) {
        Py_RETURN_NOTIMPLEMENTED;
    }
    return result;
}

PyObject *
hs_py_plain(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    return call_plainly(module, n_arguments > 0 ? arguments[0] : Py_None, arguments + 1,
                        n_arguments - 1);
}

/* Puts what is given by name in the places of these names; false, perhaps with an exception set,
 * for another name. */
static bool
place_options(PyObject *options, PyObject *places, Py_ssize_t n, PyObject **arguments)
{
    PyObject  *name, *value;
    Py_ssize_t at = 0;
    while (PyDict_Next(options, &at, &name, &value)) {
        PyObject        *place = PyDict_GetItemWithError(places, name);
        const Py_ssize_t k = place != NULL ? PyLong_AsSsize_t(place) : -1;
        if (k < 0 || k >= n) {
            return false;
        }
        Py_INCREF(value);
        Py_SETREF(arguments[k], value);
    }
    return true;
}

PyObject *
hs_py_quick(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments)
{
    enum { MOST = 16 };
    PyObject *given[MOST], *result = NULL;
    if (n_arguments != 6 || !PyTuple_CheckExact(arguments[1]) || !PyDict_CheckExact(arguments[2]) ||
        !PyDict_CheckExact(arguments[5]) || PyTuple_GET_SIZE(arguments[1]) < 2 ||
        PyTuple_GET_SIZE(arguments[1]) > MOST) {
        PyErr_SetString(PyExc_TypeError, "quick takes what _convert/quick.py gives it");
        return NULL;
    }
    const Py_ssize_t n = PyTuple_GET_SIZE(arguments[1]);
    for (Py_ssize_t k = 0; k < n; k++) { /* held: a signal handler might change the options */
        given[k] = k < 2 ? arguments[3 + k] : PyTuple_GET_ITEM(arguments[1], k);
        Py_INCREF(given[k]);
    }
    if (place_options(arguments[5], arguments[2], n, given)) {
        result = call_plainly(module, arguments[0], given, n);
    } else if (!PyErr_Occurred()) {
        result = Py_NotImplemented;
        Py_INCREF(result);
    }
    for (Py_ssize_t k = 0; k < n; k++) {
        Py_DECREF(given[k]);
    }
    return result;
}
