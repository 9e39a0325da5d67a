/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * morton.h: the place of a point on the Z curve through a box: the bits of its coordinates, as
 * fractions of the box, in turns. Points that are close in this order are close in space, and the
 * order depends on nothing but the box.
 */
#ifndef HS_MORTON_H
#define HS_MORTON_H

#include "../base/base.h"

/* Bits of each of ndim coordinates: 63, 31, 21, 15, 12, 10, 9, 7. */
HS_ALWAYS_INLINE int
hs_morton_bits(int ndim)
{
    return 63 / ndim;
}

/* The number of the slice that x is in, of 2^bits equal ones from low to high; never descends with
 * x. low <= x <= high, finite; 0 where the box has no width. */
uint64_t hs_morton_slice(double x, double low, double high, int bits);

/* The bits of the slices in turns, those of the first axis lowest. */
uint64_t hs_morton_interleave(const uint64_t *slices, int ndim);

#endif
