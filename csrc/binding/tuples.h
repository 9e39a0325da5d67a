/* SPDX-License-Identifier: BSD-3-Clause */
/* tuples.h: a few numbers of the core as a tuple of Python. */
#ifndef HS_TUPLES_H
#define HS_TUPLES_H

#include "numpy_api.h"

/* n numbers; a new reference, or NULL with an exception set. */
PyObject *hs_tuple_of_integers(const int64_t *values, int n);
PyObject *hs_tuple_of_reals(const double *values, int n);

#endif
