/* SPDX-License-Identifier: BSD-3-Clause */
/* tuples.h: what the core knows as small objects of Python: tuples, entries of dictionaries. */
#ifndef HS_TUPLES_H
#define HS_TUPLES_H

#include "numpy_api.h"

#include <stdbool.h>

/* Puts entry k into the tuple and gives it up; where it is NULL, the tuple is given up instead, and
 * *tuple is NULL. */
void hs_tuple_put(PyObject **tuple, Py_ssize_t k, PyObject *entry);

/* n numbers, or names; a new reference, or NULL with an exception set. */
PyObject *hs_tuple_of_integers(const int64_t *values, int n);
PyObject *hs_tuple_of_reals(const double *values, int n);
PyObject *hs_tuple_of_names(const char *const *names, int n);

/* Puts a new reference into a dictionary and gives it up; false with an exception set, also where
 * `value` is NULL. */
bool hs_dict_put(PyObject *dict, const char *key, PyObject *value);

#endif
