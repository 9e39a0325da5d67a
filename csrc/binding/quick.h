/* SPDX-License-Identifier: BSD-3-Clause */
/* quick.h: calls whose arguments are the usual ones, as users give them (plain.h). */
#ifndef HS_QUICK_H
#define HS_QUICK_H

#include "numpy_api.h"

/*
 * plain(function, *arguments): what the function of this module returns for these, with periodic in
 * place of bits and index_dtype in place of index_bytes. NotImplemented, and no exception, where an
 * argument is not plain.
 */
PyObject *hs_py_plain(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/*
 * quick(function, usual, places, points, cutoff, options): plain() of the arguments in `usual`, a
 * tuple, with points and cutoff as its first two and the values of `options` at the places that the
 * dict `places` has for their names. NotImplemented also for a name that it does not have.
 */
PyObject *hs_py_quick(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

#endif
