/* SPDX-License-Identifier: BSD-3-Clause */
/* outputs.h: the arrays that pairs and rows are returned in: new ones, or the caller's. */
#ifndef HS_OUTPUTS_H
#define HS_OUTPUTS_H

#include "numpy_api.h"

#include "../halfshell.h"

/*
 * The arrays of `out`, one for each letter, or for one letter the array itself, as the core takes
 * them: C-contiguous, writable, of the type and width that the letter needs. They are borrowed.
 * False with an exception set.
 */
bool hs_out_of(PyObject *out, const char *letters, int ndim, int index_bytes,
               hs_pair_arrays *arrays);

/* Whether the memory of these arrays lies apart from that of an input, which may be None or no
 * array: else false with an exception set that names it. Compares where they begin and end. */
bool hs_out_is_apart(PyObject *out, const char *letters, PyObject *input, const char *name);

/* The filled parts of these arrays, in the same form; a new reference or NULL. */
PyObject *hs_out_filled(PyObject *out, const char *letters, int64_t n_pairs);

/* Uninitialized arrays for so many pairs, as hs_out_of takes them; a new reference or NULL. */
PyObject *hs_out_new(const char *letters, int ndim, int index_bytes, int64_t capacity);

/* Bytes of such arrays. */
double hs_out_bytes(const char *letters, int ndim, int index_bytes, int64_t capacity);

/* Writes what is no pair into these arrays from row `first` on: `no_i` and `no_j` as i and j, an
 * infinite distance, zeros as vector and shift, `no_shell` as shell. */
void hs_out_pad(PyObject *out, const char *letters, int64_t first, int64_t no_i, int64_t no_j,
                int64_t no_shell);

/* New arrays in the order of the letters: a tuple, or for one letter the array itself. Takes
 * what it can from the pairs; a new reference or NULL. */
PyObject *hs_arrays_of(hs_pairs *pairs, const char *letters, int ndim, int index_bytes);

/* Rows of a full search: a tuple of the offsets and these arrays, all of them read-only. Takes what
 * it can from the rows; a new reference or NULL. */
PyObject *hs_table_of(hs_pairs *rows, const char *letters, int ndim, int index_bytes);

#endif
