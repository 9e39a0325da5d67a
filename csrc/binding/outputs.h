/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_OUTPUTS_H
#define HS_OUTPUTS_H

#include "arguments.h"

/*
 * The arrays of `out`, one for each letter, or for one letter the array itself, as the core takes
 * them: C-contiguous, writable, of the type and width that the letter needs. They are borrowed.
 * False with an exception set.
 */
bool hs_out_of(PyObject *out, const char *letters, int ndim, int index_bytes,
               hs_pair_arrays *arrays);

/* Whether the memory of these arrays lies apart from that of an input, which may be None or no
 * array. Compares where they begin and end. */
bool hs_out_is_apart(PyObject *out, const char *letters, PyObject *input);

/* New arrays in the order of the letters: a tuple, or for one letter the array itself. As a table
 * it is a tuple with the offsets of rows before these, and nothing can be written to. Takes what it
 * can from the pairs; a new reference or NULL. */
PyObject *hs_arrays_of(hs_pairs *pairs, const char *letters, int ndim, int index_bytes,
                       bool is_table);

/* Arrays that cannot be written to, as a tuple, or NULL; takes the reference. */
PyObject *hs_read_only(PyObject *arrays);

/* What a function returns, the GIL taken: such arrays of the pairs, which are freed, or those of
 * `out`; NULL with an exception set for a status other than HS_OK. */
PyObject *hs_py_call_pairs(hs_py_call *call, hs_status status, hs_pairs *pairs, bool is_table);

/* The same for an array that the core has filled, or has failed to; takes the reference. */
PyObject *hs_py_call_filled(hs_py_call *call, hs_status status, PyObject *array);

/* An array with a copy of what is there; a new reference or NULL. */
PyObject *hs_array_like(const void *data, int n_dimensions, npy_intp *shape, int type);

/* n numbers; a new reference, or NULL with an exception set. */
PyObject *hs_tuple_of_integers(const int64_t *values, int n);
PyObject *hs_tuple_of_reals(const double *values, int n);

/* Puts a new reference into a dictionary and gives it up; false with an exception set, also where
 * `value` is NULL. */
bool hs_dict_put(PyObject *dict, const char *key, PyObject *value);

#endif
