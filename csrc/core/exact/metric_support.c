/* SPDX-License-Identifier: BSD-3-Clause */
/* metric_support.c: supports are brought to the unit of D by a power of two, so that the extent is
 * the number that was given. */
#include "metric_support.h"

#include <stdlib.h>

#include "dyadic.h"

/* Powers of two that supports are multiplied by in floats. */
#define MOST_SCALED 900

void
hs_support_metric_init(int ndim, double extent, bool inclusive, int exponent,
                       hs_support_metric *metric)
{
    hs_metric_init(&metric->limit, ndim, 0, NULL, extent, inclusive);
    metric->exponent = exponent;
    metric->unscale = abs(exponent) <= MOST_SCALED ? ldexp(1.0, -exponent) : 0.0;
}

void
hs_support_span_of(const hs_metric *metric, const hs_span *span, hs_support_span *of)
{
    of->usable = true;
    if (!hs_is_shifted(metric, span->shift)) {
        hs_difference_plain(&of->difference, span->p, span->q, metric->ndim);
    } else {
        of->usable = metric->floats_usable &&
                     hs_difference_shifted(&of->difference, metric, span->p, span->q, span->shift,
                                           metric->ndim, true);
    }
    of->size = 0.0;
    for (int k = 0; of->usable && k < metric->ndim; k++) {
        of->size += fabs(of->difference.component[k].hi);
    }
}

/* Products of this size, of a support and D, neither overflow nor underflow, nor do squares. */
static bool
is_safe(double size)
{
    return size >= ldexp(1.0, -HS_SAFE_EXPONENT) && size <= ldexp(1.0, HS_SAFE_EXPONENT);
}

/* The entries in the unit of D. False where digits were lost. */
HS_ALWAYS_INLINE bool
scale_entries(const hs_support_metric *metric, const double *entries, double *to)
{
    bool is_exact = true;
    for (int e = 0; e < hs_support_entries(metric->limit.ndim); e++) {
        to[e] = entries[e] * metric->unscale;
        is_exact = is_exact && (entries[e] == 0.0 || fabs(to[e]) >= HS_SMALLEST_SCALED);
    }
    return is_exact;
}

HS_ALWAYS_INLINE hs_verdict
judge(const hs_support_metric *metric, const double *h, double size, const hs_support_span *of,
      const int ndim, hs_stages *stages)
{
    double       z[HS_SUPPORT_DIM];
    const double error = hs_support_product(h, size, of, ndim, z);
    double       square = z[0] * z[0];
    for (int k = 1; k < ndim; k++) {
        square += z[k] * z[k];
    }
    hs_verdict verdict = hs_float64_verdict(&metric->limit, square, error);
    if (verdict != HS_UNDECIDED) {
        stages->by_float64++;
        return verdict;
    }
    hs_difference wide;
    hs_support_wide_product(h, size, of, ndim, &wide);
    verdict = hs_double_word_verdict(&metric->limit, &wide, ndim);
    stages->by_double_word += verdict != HS_UNDECIDED;
    return verdict;
}

hs_verdict
hs_support_judge(const hs_support_metric *metric, const double *entries, double size,
                 const hs_support_span *of, hs_stages *stages)
{
    const int    ndim = metric->limit.ndim;
    const double scaled = size * metric->unscale;
    double       h[HS_SUPPORT_ENTRIES];
    if (!of->usable || !metric->limit.floats_usable || !is_safe(scaled * of->size) ||
        !scale_entries(metric, entries, h)) {
        return HS_UNDECIDED;
    }
    switch (ndim) {
    case 1: return judge(metric, h, scaled, of, 1, stages);
    case 2: return judge(metric, h, scaled, of, 2, stages);
    default: return judge(metric, h, scaled, of, 3, stages);
    }
}

/* D, exactly, component by component. */
static void
find_difference(const hs_metric *measure, const hs_span *span, hs_dyadic *d)
{
    hs_dyadic one, other, product;
    for (int k = 0; k < measure->ndim; k++) {
        hs_dyadic_set(span->q[k], 0, &one);
        hs_dyadic_set(span->p[k], 0, &other);
        hs_dyadic_add(&one, &other, true, &d[k]);
        for (int l = 0; span->shift != NULL && l < measure->n_rows; l++) {
            hs_dyadic_set_integer(span->shift[l], &one);
            hs_dyadic_set(measure->rows[l][k], 0, &other);
            hs_dyadic_multiply(&one, &other, &product);
            hs_dyadic_copy(&d[k], &one);
            hs_dyadic_add(&one, &product, false, &d[k]);
        }
    }
}

/* a += b */
static void
add_to(hs_dyadic *a, const hs_dyadic *b)
{
    hs_dyadic sum;
    hs_dyadic_add(a, b, false, &sum);
    hs_dyadic_copy(&sum, a);
}

int
hs_support_compare(const hs_support_metric *metric, const double *entries, const hs_metric *measure,
                   const hs_span *span)
{
    hs_dyadic d[HS_SUPPORT_DIM], entry, term, z, square;
    find_difference(measure, span, d);
    hs_dyadic_set(0.0, 0, &square);
    for (int k = 0; k < measure->ndim; k++) {
        hs_dyadic_set(0.0, 0, &z);
        for (int l = 0; l < measure->ndim; l++) {
            hs_dyadic_set(entries[hs_support_at(k, l)], 0, &entry);
            hs_dyadic_multiply(&entry, &d[l], &term);
            add_to(&z, &term);
        }
        hs_dyadic_multiply(&z, &z, &term);
        add_to(&square, &term);
    }
    hs_dyadic_set(metric->limit.cutoff, metric->exponent, &entry);
    hs_dyadic_multiply(&entry, &entry, &term);
    return hs_dyadic_compare_sizes(&square, &term);
}

bool
hs_support_within(const hs_support_metric *metric, const double *entries, double size,
                  const hs_metric *measure, const hs_span *span, hs_stages *stages)
{
    hs_support_span of;
    hs_support_span_of(measure, span, &of);
    const hs_verdict verdict = hs_support_judge(metric, entries, size, &of, stages);
    if (verdict != HS_UNDECIDED) {
        return verdict == HS_WITHIN;
    }
    stages->by_integers++;
    const int sign = hs_support_compare(metric, entries, measure, span);
    return sign < 0 || (sign == 0 && metric->limit.inclusive);
}

/* As in hs_metric_within_double. */
static double
rounded_component(const hs_metric *measure, const hs_span *span, int k)
{
    double component = span->q[k] - span->p[k];
    if (span->shift != NULL && measure->n_rows > 0) {
        double offset = (double)span->shift[0] * measure->rows[0][k];
        for (int l = 1; l < measure->n_rows; l++) {
            offset += (double)span->shift[l] * measure->rows[l][k];
        }
        component += offset;
    }
    return component;
}

/* x, or what float32 makes of it. */
HS_ALWAYS_INLINE double
as_real(double x, const bool is_single)
{
    return is_single ? (double)(float)x : x;
}

/* Sums and products of two float32 numbers in float64, rounded to float32, are those of float32: 53
 * bits are more than twice 24 and two. */
HS_ALWAYS_INLINE bool
compare_rounded(const hs_support_metric *metric, const double *entries, const double *d,
                const bool is_single)
{
    const int    ndim = metric->limit.ndim;
    const double extent = as_real(metric->limit.cutoff, is_single);
    const double limit = as_real(extent * extent, is_single);
    double       square = 0.0;
    for (int k = 0; k < ndim; k++) {
        double z = 0.0;
        for (int l = 0; l < ndim; l++) {
            const double scaled = ldexp(entries[hs_support_at(k, l)], -metric->exponent);
            const double entry = as_real(scaled, is_single);
            z = as_real(z + as_real(entry * as_real(d[l], is_single), is_single), is_single);
        }
        square = as_real(square + as_real(z * z, is_single), is_single);
    }
    return metric->limit.inclusive ? square <= limit : square < limit;
}

bool
hs_support_within_rounded(const hs_support_metric *metric, const double *entries,
                          const hs_metric *measure, const hs_span *span, bool is_single)
{
    double d[HS_SUPPORT_DIM];
    for (int k = 0; k < measure->ndim; k++) {
        d[k] = rounded_component(measure, span, k);
    }
    return is_single ? compare_rounded(metric, entries, d, true)
                     : compare_rounded(metric, entries, d, false);
}
