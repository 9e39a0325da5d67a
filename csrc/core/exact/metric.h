/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_EXACT_METRIC_H
#define HS_EXACT_METRIC_H

#include "../../halfshell.h"
#include "../base/base.h"
#include "bounds.h"
#include "arithmetic.h"

/*
 * metric.h: the decision. Is |q - p + s_0 a_0 + ... + s_{m-1} a_{m-1}| within the cutoff, for the
 * real numbers that these floats are? Answered for every finite float64, subnormals included,
 * and every int64 shift; no overflow, no rounding mode and no fused multiply-add can change it.
 *
 * The stages, cheapest first (docs/exactness.md derives each bound):
 *   float64       one squared distance with a proven error bound
 *   double-word   that square in pairs of doubles, then without what is too small to be summed
 *   integers      every input is an integer times a power of two: exact, always decides
 *
 * Callers must have set round to nearest without flushing (os.h) when calling in here.
 */

/* The box vectors that shifts multiply, as rows, and the cutoff to compare with; plain values,
 * nothing owned. */
typedef struct hs_metric {
    int    ndim;                         /* 1 ... HS_MAX_DIM */
    int    n_rows;                       /* 0 ... ndim; 0: shifts are ignored */
    bool   inclusive;                    /* |D| == cutoff is within */
    bool   floats_usable;                /* cutoff and rows lie where the float stages hold */
    double cutoff;                       /* finite, >= 0 */
    double rows[HS_MAX_DIM][HS_MAX_DIM]; /* rows[l][k], finite */
    double square_hi, square_lo;         /* cutoff^2 as an exact double-word */
    double sure_in, sure_out;            /* float64 thresholds on |D|^2 when there is no shift */
} hs_metric;

/* One vector D = q - p + shift * rows; all borrowed. shift: n_rows integers, or NULL for zeros. */
typedef struct hs_span {
    const double  *p, *q;
    const int64_t *shift;
} hs_span;

/* Which stage decided; added to, never reset. */
typedef struct hs_stages {
    int64_t by_float64;
    int64_t by_double_word;
    int64_t by_integers;
} hs_stages;

/* rows: n_rows rows of HS_MAX_DIM doubles, borrowed for the call; may be NULL when n_rows is 0. */
void hs_metric_init(hs_metric *metric, int ndim, int n_rows, const double rows[][HS_MAX_DIM],
                    double cutoff, bool inclusive);

/* p, q: ndim finite doubles. shift: n_rows integers, or NULL for all zero. */
bool hs_metric_within(const hs_metric *metric, const double *p, const double *q,
                      const int64_t *shift, hs_stages *stages);

/* hs_metric_within for pairs that the float64 and double-word stages have left undecided. */
bool hs_metric_decide_by_integers(const hs_metric *metric, const double *p, const double *q,
                                  const int64_t *shift, hs_stages *stages);

/*
 * D = q - p + shift * rows and |D|. vector: ndim doubles, each within 1 ulp of |D|, or NULL.
 * Returns |D| within 1 ulp; rounding may lift it onto the cutoff or beyond: see hs_keep_within.
 */
double hs_metric_measure(const hs_metric *metric, const double *p, const double *q,
                         const int64_t *shift, double *vector);

/* The distance of a pair that was decided to be within: at most the cutoff (inclusive), or below
 * it (strict). Still within 1 ulp, because the true distance is on that side too. */
double hs_keep_within(double distance, double cutoff, bool inclusive);

/*
 * precision="double": the fixed float64 formula that most libraries use, unfused and in this
 * order: D_k = (q_k - p_k) + ((s_0 a_0k + s_1 a_1k) + ...), then ((D_0^2 + D_1^2) + ...) compared
 * with cutoff * cutoff. With shift NULL or n_rows 0 the sum over rows is left out.
 */
bool hs_metric_within_double(const hs_metric *metric, const double *p, const double *q,
                             const int64_t *shift);

/* D_k of that formula. */
HS_ALWAYS_INLINE double
hs_rounded_component(const hs_metric *metric, const hs_span *span, int k)
{
    double component = span->q[k] - span->p[k];
    if (span->shift != NULL && metric->n_rows > 0) {
        double offset = (double)span->shift[0] * metric->rows[0][k];
        for (int l = 1; l < metric->n_rows; l++) {
            offset += (double)span->shift[l] * metric->rows[l][k];
        }
        component += offset;
    }
    return component;
}

/* Which of two points is nearer: the sign of |D1|^2 - |D2|^2 for two vectors of one metric, -1, 0
 * or 1; its cutoff plays no part, but for floats_usable. Callers must have set round to nearest
 * without flushing. */
int hs_metric_compare(const hs_metric *metric, const hs_span *one, const hs_span *other,
                      hs_stages *stages);

/*
 * The float stages of the decision, each a value with a proven bound on its error. For metric.c,
 * the batch kernels and tests only.
 *
 * ndim is passed beside the metric because callers that know it let the compiler unroll loops.
 */

#define HS_SAFE_EXPONENT (1024 - HS_RANGE_GUARD)

/* Whether the float stages may use numbers of this size: squares of it neither overflow nor
 * underflow. */
HS_ALWAYS_INLINE bool
hs_is_safe(double size)
{
    return size >= ldexp(1.0, -HS_SAFE_EXPONENT) && size <= ldexp(1.0, HS_SAFE_EXPONENT);
}

typedef enum hs_verdict { HS_UNDECIDED, HS_WITHIN, HS_BEYOND } hs_verdict;

/* D as computed; |computed D - D| <= error, Euclidean. */
typedef struct hs_difference {
    hs_dw  component[HS_MAX_DIM];
    double error;
    double lost; /* if watched: 0 only if the computed D is D */
} hs_difference;

/* q - p: exact as double-words. An overflow leaves infinity or NaN in a component. */
HS_ALWAYS_INLINE void
hs_difference_plain(hs_difference *difference, const double *p, const double *q, int ndim)
{
    int k = 0; /* ndim is at least 1: compilers warn without this */
    do
        difference->component[k] = hs_two_sum(q[k], -p[k]);
    while (++k < ndim);
    difference->error = 0.0;
    difference->lost = 0.0;
}

/* q - p + shift * rows; `watched`: find `lost` too. False where the bound would not hold: a shift
 * that float64 cannot hold, or terms too large. Needs metric->floats_usable. */
HS_ALWAYS_INLINE bool
hs_difference_shifted(hs_difference *difference, const hs_metric *metric, const double *p,
                      const double *q, const int64_t *shift, int ndim, bool watched)
{
    const int64_t shift_end = INT64_C(1) << 53; /* every integer up to here is a float64 */
    double        times[HS_MAX_DIM];
    double        magnitude = 0.0, weighted = 0.0, lost = 0.0;

    for (int l = 0; l < metric->n_rows; l++) {
        if (shift[l] > shift_end || shift[l] < -shift_end) {
            return false;
        }
        times[l] = (double)shift[l];
    }
    int k = 0;
    do {
        hs_dw  sum = hs_two_sum(q[k], -p[k]);
        double size = fabs(q[k]) + fabs(p[k]);
        double sums = 0.0;
        for (int l = 0; l < metric->n_rows; l++) {
            const double entry = metric->rows[l][k];
            if (times[l] == 0.0 || entry == 0.0) {
                continue;
            }
            const hs_dw product = hs_two_product(times[l], entry);
            sum = watched ? hs_dw_add_watched(sum, product, &lost) : hs_dw_add(sum, product);
            size += fabs(product.hi);
            sums += 1.0;
        }
        difference->component[k] = sum;
        magnitude += size;
        weighted += sums * size;
    } while (++k < ndim);
    difference->error = HS_DW_ADD_ERROR * (HS_FLOAT64_UNIT * HS_FLOAT64_UNIT) * weighted;
    difference->lost = lost;
    return magnitude <= ldexp(1.0, HS_SAFE_EXPONENT); /* also false for NaN */
}

/* Whether q is an image of itself that lies elsewhere; shift may be NULL. */
HS_ALWAYS_INLINE bool
hs_is_shifted(const hs_metric *metric, const int64_t *shift)
{
    uint64_t any = 0;
    for (int l = 0; shift != NULL && l < metric->n_rows; l++) {
        any |= (uint64_t)shift[l];
    }
    return any != 0;
}

/* D, watched, whatever the shift. False where floats cannot hold it. */
HS_ALWAYS_INLINE bool
hs_difference_watched(hs_difference *difference, const hs_metric *metric, const double *p,
                      const double *q, const int64_t *shift)
{
    if (!hs_is_shifted(metric, shift)) {
        hs_difference_plain(difference, p, q, metric->ndim);
        return true;
    }
    return metric->floats_usable &&
           hs_difference_shifted(difference, metric, p, q, shift, metric->ndim, true);
}

/* |D|^2 of the computed D in float64. */
HS_ALWAYS_INLINE double
hs_float64_square(const hs_difference *difference, int ndim)
{
    double square = difference->component[0].hi * difference->component[0].hi;
    for (int k = 1; k < ndim; k++) {
        square += difference->component[k].hi * difference->component[k].hi;
    }
    return square;
}

/*
 * First stage. The thresholds contain the rounding of `square`; an error e of D moves R^2 by at
 * most 2 R e + e^2 <= 2 e (R + e). Written as differences, because those are exact near zero. A
 * square on a threshold is decided: the thresholds are on the safe side of theirs.
 */
HS_ALWAYS_INLINE hs_verdict
hs_float64_verdict(const hs_metric *metric, double square, double error)
{
    const double slack = 2.0 * error * (metric->cutoff + error);
    if (metric->sure_in - square >= slack) {
        return HS_WITHIN;
    }
    if (square - metric->sure_out >= slack) {
        return HS_BEYOND;
    }
    return HS_UNDECIDED;
}

/* |D|^2 of the computed D as a double-word. */
HS_ALWAYS_INLINE hs_dw
hs_double_word_square(const hs_difference *difference, int ndim)
{
    hs_dw square = hs_dw_square(difference->component[0]);
    for (int k = 1; k < ndim; k++) {
        square = hs_dw_add(square, hs_dw_square(difference->component[k]));
    }
    return square;
}

/* How far hs_double_word_square may be from |D|^2. */
HS_ALWAYS_INLINE double
hs_double_word_error(double square, double error, int ndim)
{
    const double roundings = HS_DW_SQUARE_ERROR + HS_DW_ADD_ERROR * (ndim - 1);
    return roundings * (HS_FLOAT64_UNIT * HS_FLOAT64_UNIT) * square +
           error * (2.0 * sqrt(square) + error);
}

/*
 * hs_double_word_square of a watched difference. *exact: it is |D|^2, because D is one double per
 * component and nothing was lost in any sum. Squares are exact if they are not too small.
 */
HS_ALWAYS_INLINE hs_dw
hs_double_word_square_watched(const hs_difference *difference, int ndim, bool *exact)
{
    hs_dw  square = {0.0, 0.0};
    double lost = difference->lost;
    for (int k = 0; k < ndim; k++) {
        const hs_dw  component = difference->component[k];
        const double size = fabs(component.hi);
        const hs_dw  term = hs_dw_square(component);
        lost += fabs(component.lo) + (size < ldexp(1.0, -HS_SAFE_EXPONENT) ? size : 0.0);
        square = k == 0 ? term : hs_dw_add_watched(square, term, &lost);
    }
    *exact = lost == 0.0;
    return square;
}

/*
 * Second stage, from a watched difference. The difference to R^2 has itself a tiny relative error,
 * so its sign is right. If |D|^2 is exact, that sign decides, zero included: a tie.
 */
HS_ALWAYS_INLINE hs_verdict
hs_double_word_verdict(const hs_metric *metric, const hs_difference *difference, int ndim)
{
    bool         exact;
    const hs_dw  square = hs_double_word_square_watched(difference, ndim, &exact);
    const hs_dw  excess = hs_dw_add(square, (hs_dw){-metric->square_hi, -metric->square_lo});
    const double bound = hs_double_word_error(square.hi, difference->error, ndim);
    if (fabs(excess.hi) > bound || exact) {
        return excess.hi < 0.0 || (excess.hi == 0.0 && metric->inclusive) ? HS_WITHIN : HS_BEYOND;
    }
    return HS_UNDECIDED;
}

/* A hair: a component below this fraction of the cutoff. Eight squares of hairs sum to less than
 * 2^-125 of its square. */
#define HS_HAIR         0x1p-64
#define HS_HAIR_SQUARES 0x1p-120

/*
 * Third stage, from a watched difference: ties that are broken by a hair. The squares of components
 * so small cannot be summed with the others, and need not be: if |D|^2 without them is exact, then
 * its difference to R^2 decides, unless that is negative and as small as they are.
 */
HS_ALWAYS_INLINE hs_verdict
hs_hair_verdict(const hs_metric *metric, const hs_difference *difference, int ndim)
{
    hs_difference broad = *difference;
    double        hair = 0.0;
    bool          exact;
    for (int k = 0; k < ndim; k++) {
        const double size = fabs(difference->component[k].hi);
        if (size < HS_HAIR * metric->cutoff) {
            hair += size;
            broad.component[k] = (hs_dw){0.0, 0.0};
        }
    }
    if (hair == 0.0) {
        return HS_UNDECIDED;
    }
    const hs_dw  square = hs_double_word_square_watched(&broad, ndim, &exact);
    const hs_dw  excess = hs_dw_add(square, (hs_dw){-metric->square_hi, -metric->square_lo});
    const double sure = HS_HAIR_SQUARES * metric->square_hi;
    if (!exact || (excess.hi < 0.0 && excess.hi >= -sure)) {
        return HS_UNDECIDED;
    }
    return excess.hi < 0.0 ? HS_WITHIN : HS_BEYOND;
}

/*
 * The last stage. Every float is an integer times a power of two, so that, for a common power, D
 * and the cutoff are integers and compare exactly. No overflow, no rounding mode and no flushing
 * can touch this; it always decides.
 */

/* Sign of |D|^2 - limit^2, for the sum of both words, which must not be negative: -1, 0 or 1. shift
 * may be NULL. */
int hs_integer_compare(const hs_metric *metric, hs_dw limit, const double *p, const double *q,
                       const int64_t *shift);

/* Sign of |D1|^2 - |D2|^2. */
int hs_integer_compare_two(const hs_metric *metric, const hs_span *one, const hs_span *other);

/* D: component k is (value[k].hi + value[k].lo) * 2^*exponent within 2^-100 of the largest
 * component, the largest being at least 2^128 and below 2^192, or all of them 0. */
void hs_integer_difference(const hs_metric *metric, const double *p, const double *q,
                           const int64_t *shift, hs_dw *value, int *exponent);

/*
 * The decision for a limit that is the sum of two numbers, such as two radii, and often no float64.
 * What is compared is the real sum.
 */

/* Sets the cutoff of a metric, whose rows stay. */
void hs_metric_set_cutoff(double cutoff, hs_metric *metric);

/* hs_metric_within for limit.hi + limit.lo, not negative, hi being the sum rounded to nearest. The
 * cutoff of the metric plays no part. */
bool hs_metric_within_sum(const hs_metric *metric, hs_dw limit, const double *p, const double *q,
                          const int64_t *shift, hs_stages *stages);

/* Does the perpendicular from a point meet a segment, for the real numbers that these floats
 * are? */

/* Whether 0 <= (x - p).(q - p) <= |q - p|^2: the foot of the perpendicular from x on the line
 * through p and q lies on the closed segment between them, for x + of_x * rows and q + of_q * rows.
 * True where p and q are one point. images: ndim, and up to HS_MAX_DIM - 2 rows; shifts have n_rows
 * numbers, of at most 33 bits, and may be NULL if there are none. */
bool hs_foot_is_between(const hs_metric *images, const double *x, const int64_t *of_x,
                        const double *p, const double *q, const int64_t *of_q);

#endif
