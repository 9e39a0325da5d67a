/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_QUICK_H
#define HS_QUICK_H

#include "numpy_api.h"

/*
 * quick(name) -> attempt, for a function of the table that users call. attempt(arguments, options)
 * returns what that function returns for a tuple and a dict of arguments as users give them. They
 * are converted here, without a line of Python; NotImplemented, and no exception, where an argument
 * needs more than that, or is wrong in a way that _convert/ has words for.
 */
PyObject *hs_py_quick(PyObject *module, PyObject *name);

/* scene(points, box, periodic) -> the same as (points, rows of the box or None, bits); or
 * NotImplemented. */
PyObject *hs_py_scene(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* Adds the functions of the table; -1 with an exception set. */
int hs_py_add_functions(PyObject *module);

/* know(name, object): makes an object of the Python layer known here: the types "Box" and "Points",
 * and "settings", a context variable with its usual value. */
PyObject *hs_py_know(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* table() -> the arguments of each function that users call, by its name: of each argument its
 * name, what it is where it is left out, as Python writes it, or None, and whether it is
 * positional. */
PyObject *hs_py_table(PyObject *module, PyObject *ignored);

#endif
