/* SPDX-License-Identifier: BSD-3-Clause */
/* py_result.h: what functions that return pairs share: which quantities, and in which arrays. */
#ifndef HS_PY_RESULT_H
#define HS_PY_RESULT_H

#include "py_call.h"

typedef struct hs_result {
    const char    *letters; /* borrowed */
    PyObject      *out;     /* borrowed; NULL: new arrays */
    hs_pair_arrays arrays;  /* those of out */
} hs_result;

/* Four arguments: quantities, sort, index_bytes, out. Sets the options of the call, which borrow
 * from the result. False with an exception set. */
bool hs_result_init(hs_result *result, PyObject *const *arguments, hs_py_call *call);

/* Whether `out` lies apart from an input: else false with an exception set. */
bool hs_result_is_apart(const hs_result *result, PyObject *input, const char *name);

/* The arrays of these pairs; a new reference or NULL. */
PyObject *hs_result_of(const hs_result *result, hs_pairs *pairs, const hs_py_call *call);

#endif
