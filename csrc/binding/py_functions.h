/* SPDX-License-Identifier: BSD-3-Clause */
/* py_functions.h: the functions of the module; METH_FASTCALL, positional arguments only. The Python
 * layer has the signatures, defaults and docstrings. */
#ifndef HS_PY_FUNCTIONS_H
#define HS_PY_FUNCTIONS_H

#include "numpy_api.h"

/* py_pairs.c. The arguments of call.h, then quantities, sort, index_bytes. */
PyObject *hs_py_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* The arguments of call.h. */
PyObject *hs_py_count_pairs(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

/* py_explain.c. The arguments of call.h, then quantities, sort, index_bytes, measure. */
PyObject *hs_py_explain(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
PyObject *hs_py_kernels(PyObject *module, PyObject *ignored);
PyObject *hs_py_build_info(PyObject *module, PyObject *ignored);
PyObject *hs_py_available_memory(PyObject *module, PyObject *ignored);

/* py_box.c. box, periodic -> (heights, volume). */
PyObject *hs_py_box_measure(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);
/* points, box, periodic -> (wrapped, shifts). */
PyObject *hs_py_box_wrap(PyObject *module, PyObject *const *arguments, Py_ssize_t n_arguments);

#endif
