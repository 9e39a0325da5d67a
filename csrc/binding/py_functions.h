/* SPDX-License-Identifier: BSD-3-Clause */
/* py_functions.h: the functions of the module; METH_FASTCALL, positional arguments only. The Python
 * layer has the signatures, defaults and docstrings. */
#ifndef HS_PY_FUNCTIONS_H
#define HS_PY_FUNCTIONS_H

#include "numpy_api.h"

/* py_pairs.c. The arguments of call.h, then quantities, sort, index_bytes, out. */
PyObject *hs_py_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The arguments of call.h. */
PyObject *hs_py_count_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_batch.c. The arguments of call.h (where each system has a box of its own, any one of that
 * shape), quantities, sort, index_bytes, out; batch, cutoffs or None, boxes or None. */
PyObject *hs_py_batch_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The arguments of call.h, batch, cutoffs, boxes. */
PyObject *hs_py_batch_count(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_nearest.c. The arguments of call.h (cutoff: the largest distance), then quantities, sort,
 * index_bytes, out; queries or None, k. Arrays have k entries a query, one query after another. */
PyObject *hs_py_nearest(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_explain.c. The arguments of call.h, then quantities, sort, index_bytes, measure. */
PyObject *hs_py_explain(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_info.c. */
PyObject *hs_py_kernels(PyObject *module, PyObject *ignored);
PyObject *hs_py_default_kernel(PyObject *module, PyObject *ignored);
PyObject *hs_py_build_info(PyObject *module, PyObject *ignored);
PyObject *hs_py_available_memory(PyObject *module, PyObject *ignored);
PyObject *hs_py_clear_cache(PyObject *module, PyObject *ignored);
/* A number of bytes -> the limit before. */
PyObject *hs_py_set_cache_limit(PyObject *module, PyObject *limit);
PyObject *hs_py_cache_held(PyObject *module, PyObject *ignored);

/* py_box.c. box, periodic -> (heights, volume). */
PyObject *hs_py_box_measure(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* points, box, periodic -> (wrapped, shifts). */
PyObject *hs_py_box_wrap(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

#endif
