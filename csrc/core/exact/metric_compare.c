/* SPDX-License-Identifier: BSD-3-Clause */
/* metric_compare.c: double-words first, then integers. docs/exactness.md derives the bounds. */
#include "metric.h"

#include "metric_float.h"
#include "metric_integer.h"

/* Squares in this range are far from overflow, and what their terms lose to underflow, 2^-1074
 * each, is nothing beside 2^-106 of them. */
#define LEAST_SQUARE 0x1p-800
#define MOST_SQUARE  0x1p800

/* D in double-words, with what was lost. False where floats cannot hold it. */
static bool
subtract(const hs_metric *metric, const hs_span *span, hs_difference *difference)
{
    return (metric->floats_usable || !hs_is_shifted(metric, span->shift)) &&
           hs_difference_watched(difference, metric, span->p, span->q, span->shift);
}

/* How far hs_float64_square may be from |D|^2. */
static double
float64_error(double square, double error, int ndim)
{
    const double roundings = HS_FLOAT64_ROUNDINGS + HS_FLOAT64_ROUNDINGS_PER_AXIS * ndim;
    const double rounding = roundings * HS_FLOAT64_UNIT * square;
    return error > 0.0 ? rounding + 2.001 * error * (sqrt(square) + error) : rounding;
}

static int
sign_of(double x)
{
    return (x > 0.0) - (x < 0.0);
}

/* Compares both differences by their double-word squares; false when these cannot tell. */
static bool
compare_double_words(const hs_difference *one, const hs_difference *other, int ndim, int *sign)
{
    bool         one_exact, other_exact;
    const hs_dw  a = hs_double_word_square_watched(one, ndim, &one_exact);
    const hs_dw  b = hs_double_word_square_watched(other, ndim, &other_exact);
    const hs_dw  excess = hs_dw_add(a, (hs_dw){-b.hi, -b.lo});
    const double bound = hs_double_word_error(a.hi, one->error, ndim) +
                         hs_double_word_error(b.hi, other->error, ndim);
    *sign = sign_of(excess.hi);
    return fabs(excess.hi) > bound || (one_exact && other_exact);
}

int
hs_metric_compare(const hs_metric *metric, const hs_span *one, const hs_span *other,
                  hs_stages *stages)
{
    const int     ndim = metric->ndim;
    hs_difference a, b;
    int           sign;
    if (subtract(metric, one, &a) && subtract(metric, other, &b)) {
        const double first = hs_float64_square(&a, ndim), second = hs_float64_square(&b, ndim);
        if (hs_smaller(first, second) >= LEAST_SQUARE && hs_larger(first, second) <= MOST_SQUARE) {
            if (fabs(first - second) >
                float64_error(first, a.error, ndim) + float64_error(second, b.error, ndim)) {
                stages->by_float64++;
                return sign_of(first - second);
            }
            if (compare_double_words(&a, &b, ndim, &sign)) {
                stages->by_double_word++;
                return sign;
            }
        }
    }
    stages->by_integers++;
    return hs_integer_compare_two(metric, one, other);
}
