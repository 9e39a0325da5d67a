/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * plain.h: the usual arguments, taken as users give them. A small search is over sooner than the
 * Python layer has looked at every argument; where all of them are plain there is nothing to
 * convert, and one function call does it.
 */
#ifndef HS_PLAIN_H
#define HS_PLAIN_H

#include "numpy_api.h"

/*
 * Plain are: points, an ndarray (no subclass) of native float32 or float64, shape (n, d); cutoff, a
 * float; box, None or a C-contiguous ndarray of float64, shape (d,) or (d, d); periodic, None, a
 * bool, or a tuple or list of d bools; flags, True or False; index_dtype, numpy.int32 or
 * numpy.int64 itself; queries, None or as points, with as many columns. The rest is checked by the
 * core's functions whoever calls them.
 *
 * All return NotImplemented, and no exception, where an argument is not plain. Positional
 * arguments as in py_functions.h, but for periodic, and index_dtype in place of index_bytes.
 */
PyObject *hs_py_plain_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
PyObject *hs_py_plain_count(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
PyObject *hs_py_plain_between(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
PyObject *hs_py_plain_count_between(PyObject *module, PyObject *const *arguments,
                                    Py_ssize_t n_arguments);
PyObject *hs_py_plain_neighbors(PyObject *module, PyObject *const *arguments,
                                Py_ssize_t n_arguments);
PyObject *hs_py_plain_coordination(PyObject *module, PyObject *const *arguments,
                                   Py_ssize_t n_arguments);

#endif
