/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * lattice_reduce.h: a short, nearly orthogonal basis of the lattice that the periodic box vectors
 * span. The search enumerates images in the reduced basis, where their number is small however
 * skewed the box is; shifts are mapped back to the box as given, exactly, through integers.
 */
#ifndef HS_LATTICE_REDUCE_H
#define HS_LATTICE_REDUCE_H

#include "../../halfshell.h"
#include "../base/base.h"

/* B = U A: row k of the reduced basis is sum_l U[k][l] * (row l of A), in real arithmetic. U has
 * determinant +1 or -1, so both bases span the same lattice. */
typedef struct hs_reduction {
    int     n_rows;
    bool    changed;                      /* U is not the identity */
    int64_t U[HS_MAX_DIM][HS_MAX_DIM];    /* |U[k][l]| <= 2^61 */
    double  rows[HS_MAX_DIM][HS_MAX_DIM]; /* B rounded to float64 ... */
    double  error[HS_MAX_DIM];            /* ... each entry of row k within this */
} hs_reduction;

/*
 * rows: n_rows linearly independent rows (see box_check.h) of ndim finite doubles. Any scale,
 * 1e-300 to 1e300, rows of very different length too. Where a row would need a coefficient beyond
 * 2^61, the reduction stops early: the result is always a valid basis, at worst the given one.
 */
void hs_reduce(int ndim, int n_rows, const double rows[][HS_MAX_DIM], hs_reduction *reduction);

#endif
