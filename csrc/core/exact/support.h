/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * support.h: ellipsoids that points reach. The support of a point is a symmetric positive definite
 * matrix H, and D is within it if |H D| is at most an extent: for H = I / h that is a ball of
 * radius h times the extent. Whether a matrix is positive definite, and how far its ellipsoid
 * reaches, is certain: decided with every step rounded to the safe side, else exactly.
 */
#ifndef HS_SUPPORT_H
#define HS_SUPPORT_H

#include "../base/base.h"

/* Most dimensions of points with supports, and entries of one: its lower triangle, row by row. */
#define HS_SUPPORT_DIM     3
#define HS_SUPPORT_ENTRIES 6

HS_ALWAYS_INLINE int
hs_support_entries(int ndim)
{
    return ndim * (ndim + 1) / 2;
}

/* Which of the entries stands in this row and column, of either triangle. */
HS_ALWAYS_INLINE int
hs_support_at(int row, int column)
{
    return row >= column ? row * (row + 1) / 2 + column : column * (column + 1) / 2 + row;
}

/* Numbers of one support as searches keep it: its entries, then its size. */
HS_ALWAYS_INLINE int
hs_support_numbers(int ndim)
{
    return hs_support_entries(ndim) + 1;
}

/* Entries that were multiplied by a power of two, are smaller than this and not zero may have lost
 * digits. */
#define HS_SMALLEST_SCALED 0x1p-900

/* How far a support may reach, so that a float64 holds it and the doubled one. */
#define HS_LONGEST_SUPPORT 0x1p1022

typedef enum hs_support_state {
    HS_SUPPORT_FITS,
    HS_SUPPORT_NOT_DEFINITE, /* an eigenvalue is negative or zero */
    HS_SUPPORT_TOO_LONG      /* it reaches further than HS_LONGEST_SUPPORT */
} hs_support_state;

/* *reach: no D within the support is longer; larger than the longest one by less than a millionth
 * where the axes differ by less than a factor of 100, by less than 2 % up to one of 2^1000, and for
 * still longer needles, as far as they fit, by less than twice. The entries are finite, the extent
 * as well, and it is not negative. */
hs_support_state hs_support_reach(int ndim, const double *entries, double extent, double *reach);

/* About the entries of the cofactors of three rows, in float64; returns about the determinant. */
double hs_support_cofactors(const double *entries, double *cofactors);

/* Not below the root of the sum of all squares of the matrix, and so |H D| <= size |D|; may be
 * infinite. */
double hs_support_size(int ndim, const double *entries);

#endif
