/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * metric_support.h: is D within a support, |H D| <= extent (or <), for the real numbers that these
 * floats are? The stages are those of metric.h, for z = H D in place of D: each computes z with a
 * proven bound on its error, in float64 or in double-words, and the verdict on |z| is that of
 * metric_float.h. What they leave is decided by exact numbers, for every finite input.
 *
 * Callers must have set round to nearest without flushing.
 */
#ifndef HS_METRIC_SUPPORT_H
#define HS_METRIC_SUPPORT_H

#include "metric_float.h"
#include "support.h"

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
hs_verdict hs_support_judge(const hs_support_metric *metric, const double *entries, double size,
                            const hs_support_span *of, hs_stages *stages);

/* For spans that hs_support_judge has left undecided: sign of |H D| - extent. */
int hs_support_compare(const hs_support_metric *metric, const double *entries,
                       const hs_metric *measure, const hs_span *span);

/* The three stages one after the other. */
bool hs_support_within(const hs_support_metric *metric, const double *entries, double size,
                       const hs_metric *measure, const hs_span *span, hs_stages *stages);

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
