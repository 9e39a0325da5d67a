/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_EXACT_FILTER_H
#define HS_EXACT_FILTER_H

#include "../base/base.h"

/*
 * filter.h: the two thresholds of a gathered neighbourhood. A kernel computes, in float32, an s of
 * candidates y and points q given relative to a common centre: s = sum_k fl(y_k - q_k)^2. With
 * s > out the pair is surely beyond the cutoff, with s < in surely within it; what lies between is
 * decided by metric.h. docs/exactness.md derives the bounds.
 */

typedef struct hs_thresholds {
    float in;  /* rounded down; -1 when nothing is sure */
    float out; /* rounded up; +infinity when nothing is sure */
} hs_thresholds;

/*
 * ndim     number of squares in the sum
 * cutoff   R > 0 or 0, a finite double
 * extent   largest |y_k| plus largest |q_k|, over all components, as the floats that the kernel
 *          reads; may be infinite or NaN (then nothing is sure)
 * error    bound on how far each component of y and q, before it was rounded to float32, was from
 *          the true value: |y64_k - Y_k| <= error for y and for q alike. Up to 2048 float64
 *          roundings of y64 itself need not be counted
 */
hs_thresholds hs_thresholds_of(int ndim, double cutoff, double extent, double error);

/* The bounds of hs_thresholds_of for arithmetic with unit roundoff `unit` and smallest normal
 * number `tiny`, before they are rounded to float32. The product uses 2^-24 and 2^-126; the tests
 * also try every number of a tiny floating-point system. */
void hs_threshold_bounds(int ndim, double cutoff, double extent, double error, double unit,
                         double tiny, double *in, double *out);

/*
 * Thresholds for a cutoff R that kernels have as a float r, the sum of two radii
 * or one of them: in = (r * in_factor - in_less)^2, 0 where that would be negative, and
 * out = (r * out_factor + out_more)^2, fused or not.
 */
typedef struct hs_limit_form {
    float in_factor, in_less, out_factor, out_more;
} hs_limit_form;

/* For radii that are each rounded to float32 once, and flushed to zero perhaps. */
hs_limit_form hs_limit_form_of(int ndim, double extent, double error);

/*
 * For supports (ellipsoid.h) over their extent: N = H / extent, rounded to float32, with which
 * kernels compute s = sum_k (sum_l N_kl (y_l - q_l))^2. Thresholds for |N D| against 1 are those of
 * a limit, r being not below the size of N (hs_support_size), nor below HS_LEAST_NEAR_SIZE.
 */
#define HS_LEAST_NEAR_SIZE 0x1p-60f
hs_limit_form hs_support_form_of(int ndim, double extent, double error);

/* The part of a term of that sum, from N and y - q as real numbers, that all its roundings change,
 * for a unit roundoff. */
double hs_support_roundings(int ndim, double unit);

/* For points of which no |q_k| passes `largest`: no |y_k| plus |q_k| of a pair within the cutoff
 * passes this. It is an extent for the pairs of candidates that are not known yet. */
double hs_reach_extent(double cutoff, double largest, double error);

/* The bounds of hs_reach_extent for other arithmetic, as in hs_threshold_bounds. */
double hs_reach_bound(double cutoff, double largest, double error, double unit, double tiny);

#endif
