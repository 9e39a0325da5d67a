/* SPDX-License-Identifier: BSD-3-Clause */
/* metric_decide.c: whether a pair is within the cutoff, by the cheapest stage that can tell. */
#include "metric.h"

#include "metric_float.h"
#include "metric_integer.h"
#include "doubleword.h"

/* Whether the float stages may use this number: squares of it neither overflow nor underflow. */
static bool
is_safe(double x)
{
    return fabs(x) >= ldexp(1.0, -HS_SAFE_EXPONENT) && fabs(x) <= ldexp(1.0, HS_SAFE_EXPONENT);
}

/* The double next to x.hi + x.lo on the given side, or itself. */
static double
round_down(hs_dw x)
{
    return x.lo < 0.0 ? hs_next_down(x.hi) : x.hi;
}

static double
round_up(hs_dw x)
{
    return x.lo > 0.0 ? hs_next_up(x.hi) : x.hi;
}

void
hs_metric_init(hs_metric *metric, int ndim, int n_rows, const double rows[][HS_MAX_DIM],
               double cutoff, bool inclusive)
{
    HS_ASSERT(ndim >= 1 && ndim <= HS_MAX_DIM && n_rows >= 0 && n_rows <= HS_MAX_DIM);
    HS_ASSERT(cutoff >= 0.0);
    metric->ndim = ndim;
    metric->n_rows = n_rows;
    metric->inclusive = inclusive;
    metric->cutoff = cutoff;
    metric->floats_usable = is_safe(cutoff);
    for (int l = 0; l < n_rows; l++) {
        for (int k = 0; k < ndim; k++) {
            metric->rows[l][k] = rows[l][k];
            if (rows[l][k] != 0.0 && !is_safe(rows[l][k])) {
                metric->floats_usable = false;
            }
        }
    }
    metric->square_hi = metric->square_lo = metric->sure_in = metric->sure_out = 0.0;
    if (!metric->floats_usable) {
        return;
    }

    const hs_dw  square = hs_two_square(cutoff);
    const double roundings = HS_FLOAT64_ROUNDINGS + HS_FLOAT64_ROUNDINGS_PER_AXIS * ndim;
    const hs_dw  width = hs_two_product(roundings * HS_FLOAT64_UNIT, square.hi);
    metric->square_hi = square.hi;
    metric->square_lo = square.lo;
    metric->sure_in = round_down(hs_dw_add(square, (hs_dw){-width.hi, -width.lo}));
    metric->sure_out = round_up(hs_dw_add(square, width));
}

/* The float stages, for a constant ndim where the compiler can be given one. */
HS_ALWAYS_INLINE hs_verdict
judge_in_floats(const hs_metric *metric, const double *p, const double *q, const int64_t *shift,
                int ndim, hs_stages *stages)
{
    hs_difference difference;
    hs_verdict    verdict;
    if (shift == NULL) {
        hs_difference_plain(&difference, p, q, ndim);
    } else if (!hs_difference_shifted(&difference, metric, p, q, shift, ndim, false)) {
        return HS_UNDECIDED;
    }

    const double square = hs_float64_square(&difference, ndim);
    verdict = hs_float64_verdict(metric, square, difference.error);
    if (verdict != HS_UNDECIDED) {
        stages->by_float64++;
        return verdict;
    }
    if (shift != NULL) {
        (void)hs_difference_shifted(&difference, metric, p, q, shift, ndim, true);
    }
    verdict = hs_double_word_verdict(metric, &difference, ndim);
    stages->by_double_word += verdict != HS_UNDECIDED;
    return verdict;
}

bool
hs_metric_within(const hs_metric *metric, const double *p, const double *q, const int64_t *shift,
                 hs_stages *stages)
{
    if (!hs_is_shifted(metric, shift)) {
        shift = NULL;
    }
    if (metric->floats_usable) {
        hs_verdict verdict;
        switch (metric->ndim) {
        case 2: verdict = judge_in_floats(metric, p, q, shift, 2, stages); break;
        case 3: verdict = judge_in_floats(metric, p, q, shift, 3, stages); break;
        default: verdict = judge_in_floats(metric, p, q, shift, metric->ndim, stages);
        }
        if (verdict != HS_UNDECIDED) {
            return verdict == HS_WITHIN;
        }
    }
    return hs_metric_settle(metric, p, q, shift, stages);
}

/* Long integers take ten times as long. */
static hs_verdict
judge_by_a_hair(const hs_metric *metric, const double *p, const double *q, const int64_t *shift)
{
    hs_difference difference;
    return hs_difference_watched(&difference, metric, p, q, shift)
               ? hs_hair_verdict(metric, &difference, metric->ndim)
               : HS_UNDECIDED;
}

bool
hs_metric_settle(const hs_metric *metric, const double *p, const double *q, const int64_t *shift,
                 hs_stages *stages)
{
    if (metric->floats_usable) {
        const hs_verdict verdict = judge_by_a_hair(metric, p, q, shift);
        if (verdict != HS_UNDECIDED) {
            stages->by_double_word++;
            return verdict == HS_WITHIN;
        }
    }
    stages->by_integers++;
    const int sign = hs_integer_compare(metric, p, q, shift);
    return sign < 0 || (sign == 0 && metric->inclusive);
}

bool
hs_metric_within_double(const hs_metric *metric, const double *p, const double *q,
                        const int64_t *shift)
{
    const double limit = metric->cutoff * metric->cutoff;
    double       square = 0.0;
    for (int k = 0; k < metric->ndim; k++) {
        double difference = q[k] - p[k];
        if (shift != NULL && metric->n_rows > 0) {
            double offset = (double)shift[0] * metric->rows[0][k];
            for (int l = 1; l < metric->n_rows; l++) {
                offset += (double)shift[l] * metric->rows[l][k];
            }
            difference += offset;
        }
        square += difference * difference;
    }
    return metric->inclusive ? square <= limit : square < limit;
}
