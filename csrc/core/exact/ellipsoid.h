/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_EXACT_ELLIPSOID_H
#define HS_EXACT_ELLIPSOID_H

#include "../base/base.h"
#include "metric.h"

/*
 * ellipsoid.h: supports: symmetric positive definite matrices H, with abs(H D) at most the extent
 * as the test of a pair.
 */

/*
 * Ellipsoids that points reach. The support of a point is a symmetric positive definite
 * matrix H, and D is within it if |H D| is at most an extent: for H = I / h that is a ball of
 * radius h times the extent. Whether a matrix is positive definite, and how far its ellipsoid
 * reaches, is certain: decided with every step rounded to the safe side, else exactly.
 */

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

/* Not below the root of the sum of all squares of the matrix, and so |H D| <= size |D|; may be
 * infinite. */
double hs_support_size(int ndim, const double *entries);

/* How far a support reaches along a direction: less than a ball around it, where it is narrow
 * there. */

/* Not below |normal . D| of any D within the support, and near to the most that it can be.
 * size: of hs_support_size; reach: of hs_support_reach. */
double hs_support_width(int ndim, const double *entries, double size, double extent, double reach,
                        const double *normal);

/*
 * Is D within a support, |H D| <= extent (or <), for the real numbers that these floats are? The
 * stages are those of metric.h, for z = H D in place of D: each computes z with a proven bound on
 * its error, in float64 or in double-words, and the verdict on |z| is that of metric.h. What they
 * leave is decided by exact numbers, for every finite input.
 *
 * Callers must have set round to nearest without flushing.
 */

/* What all supports of a search are compared with; plain values. */
typedef struct hs_support_metric {
    hs_metric limit;    /* its cutoff is the extent, and it has no rows */
    int       exponent; /* D is what the supports are for times 2^exponent */
    double    unscale;  /* 2^-exponent; 0 where that is far from 1: then floats are not used */
} hs_support_metric;

/* D of one pair, and what bounds it. */
typedef struct hs_support_span {
    hs_difference difference;
    bool          usable; /* else the float stages are left out */
    double        size;   /* of D: the sum of the sizes of its components */
} hs_support_span;

void hs_support_metric_init(int ndim, double extent, bool inclusive, int exponent,
                            hs_support_metric *metric);

/* D as metric.h measures it; shift may be NULL. Watched. */
void hs_support_span_of(const hs_metric *metric, const hs_span *span, hs_support_span *of);

/* In float64 and double-words. size: of hs_support_size. Adds to *stages where it decides. */
hs_verdict hs_support_decide_double(const hs_support_metric *metric, const double *entries,
                                    double size, const hs_support_span *of, hs_stages *stages);

/* For spans that hs_support_decide_double has left undecided: sign of |H D| - extent. */
int hs_support_compare(const hs_support_metric *metric, const double *entries,
                       const hs_metric *measure, const hs_span *span);

/*
 * precision="double" and, is_single, "single": D_k as in hs_metric_within_double, then H, D and the
 * extent as they are, or each rounded to float32, and all further steps so: z_k = (H_k0 D_0 + H_k1
 * D_1) + ..., then ((z_0^2 + z_1^2) + ...) compared with extent * extent.
 */
bool hs_support_within_rounded(const hs_support_metric *metric, const double *entries,
                               const hs_metric *measure, const hs_span *span, bool is_single);

/* ---- the stages, for tests as well ---- */

/* z in float64; returns how far it may be from H D, Euclidean. */
HS_ALWAYS_INLINE double
hs_support_product(const double *h, double size, const hs_support_span *of, const int ndim,
                   double *z)
{
    for (int k = 0; k < ndim; k++) {
        z[k] = h[hs_support_at(k, 0)] * of->difference.component[0].hi;
        for (int l = 1; l < ndim; l++) {
            z[k] += h[hs_support_at(k, l)] * of->difference.component[l].hi;
        }
    }
    const double roundings = HS_SUPPORT_ROUNDINGS + HS_SUPPORT_ROUNDINGS_PER_AXIS * ndim;
    return size * (roundings * HS_FLOAT64_UNIT * of->size + of->difference.error);
}

/* A float64 times a double-word. *lost grows unless the product is exact. */
HS_ALWAYS_INLINE hs_dw
hs_support_term(double entry, hs_dw component, double *lost)
{
    const hs_dw  product = hs_two_product(entry, component.hi);
    const double rest = entry * component.lo;
    const bool   is_zero = entry == 0.0 || component.hi == 0.0;
    *lost += fabs(component.lo);
    if (!is_zero && !(fabs(product.hi) >= ldexp(1.0, -HS_SAFE_EXPONENT))) {
        *lost += 1.0;
    }
    return hs_fast_two_sum(product.hi, product.lo + rest);
}

/* z in double-words, as a watched difference. */
HS_ALWAYS_INLINE void
hs_support_wide_product(const double *h, double size, const hs_support_span *of, const int ndim,
                        hs_difference *z)
{
    const hs_difference *d = &of->difference;
    z->lost = d->lost;
    for (int k = 0; k < ndim; k++) {
        hs_dw sum = hs_support_term(h[hs_support_at(k, 0)], d->component[0], &z->lost);
        for (int l = 1; l < ndim; l++) {
            const hs_dw term = hs_support_term(h[hs_support_at(k, l)], d->component[l], &z->lost);
            sum = hs_dw_add_watched(sum, term, &z->lost);
        }
        z->component[k] = sum;
    }
    const double roundings = HS_SUPPORT_DW_ERROR + HS_DW_ADD_ERROR * (ndim - 1);
    z->error = size * (roundings * (HS_FLOAT64_UNIT * HS_FLOAT64_UNIT) * of->size + d->error);
}

#endif
