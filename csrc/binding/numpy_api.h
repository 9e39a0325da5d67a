/* SPDX-License-Identifier: BSD-3-Clause */
/* numpy_api.h: Python and NumPy, included the same way in every file of the binding. module.c
 * defines HS_IMPORTS_NUMPY and owns the API table; the others refer to it. */
#ifndef HS_NUMPY_API_H
#define HS_NUMPY_API_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#define NPY_NO_DEPRECATED_API  NPY_2_0_API_VERSION
#define NPY_TARGET_VERSION     NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL halfshell_array_api
#ifndef HS_IMPORTS_NUMPY
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

#endif
