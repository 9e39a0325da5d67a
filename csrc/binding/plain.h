/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * plain.h: the usual arguments, taken as users give them. A small search is over sooner than the
 * Python layer has looked at every argument; where all of them are plain there is nothing to
 * convert, and one function call does it (quick.h).
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
 */

/* Added to the number of arguments that a function gets: they are to be plain. */
#define HS_PLAIN ((Py_ssize_t)1 << 16)

/* Whether the shared arguments are plain and the function's own, which letters describe as in
 * py_call.h; then bit l is set where box vector l repeats. */
bool hs_plain_repeats(PyObject *const *arguments, const char *more, PyObject *const *own,
                      unsigned long *repeats);

/* 4 or 8 for NumPy's types, or native dtypes of them, else -1. */
int hs_plain_index_bytes(PyObject *object);

#endif
