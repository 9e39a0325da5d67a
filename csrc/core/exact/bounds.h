/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_EXACT_BOUNDS_H
#define HS_EXACT_BOUNDS_H

/*
 * bounds.h: every error constant of the float stages, in one place, each with its reason.
 *
 * docs/exactness.md derives them. Each can be overridden from the command line, because
 * tests/c/halve_bounds.py halves them one after the other and demands that a test notices: a
 * constant that can be halved without a test failing is either not needed or not tested.
 *
 * u is the unit roundoff of float32, v that of float64: rounding to nearest changes a number by
 * at most that factor of itself.
 */

/* v. */
#ifndef HS_FLOAT64_UNIT
#define HS_FLOAT64_UNIT 0x1p-53
#endif

/* ---- float32 filter (filter.c) ---- */

/* u. */
#ifndef HS_FILTER_UNIT
#define HS_FILTER_UNIT 0x1p-24
#endif

/* Smallest normal float32: below it a flushing CPU reads and writes zero. */
#ifndef HS_FILTER_TINY
#define HS_FILTER_TINY 0x1p-126
#endif

/* Roundings of y, and of q, to float32: each moves a component by u times its size. */
#ifndef HS_FILTER_INPUT_ROUNDINGS
#define HS_FILTER_INPUT_ROUNDINGS 1.0
#endif

/* What float64 roundings may have added to y and to q before, in units of u: 2^-18 u is 2048 v,
 * room for the few sums that lead to y and far more. */
#ifndef HS_FILTER_SLACK
#define HS_FILTER_SLACK 0x1p-18
#endif

/* Both y and q may be wrong by the caller's `error`. */
#ifndef HS_FILTER_ERRORS
#define HS_FILTER_ERRORS 2.0
#endif

/* Flushes to zero that one component of y - q can meet: y and q both, or else the difference. */
#ifndef HS_FILTER_FLUSHES
#define HS_FILTER_FLUSHES 2.0
#endif

/* Roundings of y - q. */
#ifndef HS_FILTER_DIFFERENCE_ROUNDINGS
#define HS_FILTER_DIFFERENCE_ROUNDINGS 1.0
#endif

/* Roundings per axis of the sum of squares: d squares and d - 1 sums round the first term d times,
 * fused d times as well. */
#ifndef HS_FILTER_SQUARE_ROUNDINGS
#define HS_FILTER_SQUARE_ROUNDINGS 1.0
#endif

/* Flushes of a square, per axis: each loses less than the smallest normal number. */
#ifndef HS_FILTER_SQUARE_FLUSHES
#define HS_FILTER_SQUARE_FLUSHES 1.0
#endif

/* Roundings of a threshold that a kernel computes from two radii, as those of its root: each radius
 * once, their sum, the product or the sum that makes the root, and half of the square's. The .01
 * pays for the products of roundings. */
#ifndef HS_FILTER_LIMIT_ROUNDINGS
#define HS_FILTER_LIMIT_ROUNDINGS 4.51
#endif

/* Supports in float32: roundings of a term of H (y - q), in units of the term. The entry of H once,
 * y - q once; and for each axis, the product, and the sums that it goes to, which are one less. The
 * .01 pays for the products of roundings, and for the float64 rounding of the entry. */
#ifndef HS_SUPPORT_FILTER_ROUNDINGS
#define HS_SUPPORT_FILTER_ROUNDINGS 2.01
#endif
#ifndef HS_SUPPORT_FILTER_ROUNDINGS_PER_AXIS
#define HS_SUPPORT_FILTER_ROUNDINGS_PER_AXIS 1.0
#endif

/* ---- float64 stage (metric.h) ---- */

/* Roundings of |D|^2 in float64: the difference, twice as it is squared, and per axis one (the
 * square of the first axis, the sum of the others). The .001 pays for the products of roundings
 * and for working out the threshold. */
#ifndef HS_FLOAT64_ROUNDINGS
#define HS_FLOAT64_ROUNDINGS 2.001
#endif
#ifndef HS_FLOAT64_ROUNDINGS_PER_AXIS
#define HS_FLOAT64_ROUNDINGS_PER_AXIS 1.0
#endif

/* Supports in float64 (ellipsoid.h): roundings of a term of H D, in units of the term. D once;
 * and for each axis, the product, and the sums that it goes to, which are one less. The .001 pays
 * for the products of roundings and for working out the bound. */
#ifndef HS_SUPPORT_ROUNDINGS
#define HS_SUPPORT_ROUNDINGS 1.001
#endif
#ifndef HS_SUPPORT_ROUNDINGS_PER_AXIS
#define HS_SUPPORT_ROUNDINGS_PER_AXIS 1.0
#endif

/* ---- double-word stage (metric.h) ---- */

/* v^2 per sum of two double-words, relative to the sum of their magnitudes. The .01 pays for the
 * terms in v^3 and for working out the bound in float64. */
#ifndef HS_DW_ADD_ERROR
#define HS_DW_ADD_ERROR 3.01
#endif

/* v^2 per product of a float64 and a double-word: 1 for that with the low word, and 2 for its sum
 * with the low word of the other product. */
#ifndef HS_SUPPORT_DW_ERROR
#define HS_SUPPORT_DW_ERROR 3.01
#endif

/* v^2 per square of a double-word. */
#ifndef HS_DW_SQUARE_ERROR
#define HS_DW_SQUARE_ERROR 6.01
#endif

/* Binary orders that cutoff, rows and terms must keep from the ends of float64's range (2^1024),
 * so that squares and the low words of squares neither overflow nor underflow. */
#ifndef HS_RANGE_GUARD
#define HS_RANGE_GUARD 624
#endif

#endif
