/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * box_check.h: are the periodic box vectors linearly independent? Decided exactly for the given
 * floats, by elimination modulo 62-bit primes: one prime of full rank proves independence, enough
 * primes to pass the Hadamard bound prove dependence. A rounded determinant can do neither.
 */
#ifndef HS_BOX_CHECK_H
#define HS_BOX_CHECK_H

#include "../../halfshell.h"
#include "../base/base.h"

/* rows: n_rows (0 ... ndim) rows of ndim finite doubles, of any magnitude. Allocates nothing. */
bool hs_rows_independent(int ndim, int n_rows, const double rows[][HS_MAX_DIM]);

/* The first of these rows that is zero, or n_rows. */
int hs_zero_row(int ndim, int n_rows, const double rows[][HS_MAX_DIM]);

/* The largest prime below p; p: odd, at most 2^62 and far above 2^61. A step of the above. */
uint64_t hs_prime_below(uint64_t p);

#endif
