/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * plain.h: the usual arguments, taken as users give them. A small search is over sooner than the
 * Python layer has looked at every argument; where all of them are plain there is nothing to
 * convert, and one function call does it.
 */
#ifndef HS_PLAIN_H
#define HS_PLAIN_H

#include "numpy_api.h"

#include <stdbool.h>

/*
 * Plain are: points, an ndarray (no subclass) of native float32 or float64, shape (n, d); cutoff, a
 * float; box, None or a C-contiguous ndarray of float64, shape (d,) or (d, d); periodic, None, a
 * bool, or a tuple or list of d bools; flags, True or False; index_dtype, numpy.int32 or
 * numpy.int64 itself; queries, None or as points, with as many columns. All else is checked where
 * it is taken, plain or not.
 *
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

/* Added to the number of arguments that a function gets: they are to be plain. */
#define HS_PLAIN ((Py_ssize_t)1 << 16)

/* Whether the shared arguments are plain and the function's own, which letters describe as in
 * py_call.h; then bit l is set where box vector l repeats. */
bool hs_plain_repeats(PyObject *const *arguments, const char *more, PyObject *const *own,
                      unsigned long *repeats);

/* 4 or 8 for NumPy's types, or native dtypes of them, else -1. */
int hs_plain_index_bytes(PyObject *object);

#endif
