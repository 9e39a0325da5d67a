/* SPDX-License-Identifier: BSD-3-Clause */
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
 * Callers must have set round to nearest without flushing (fpenv.h) when calling in here.
 */
#ifndef HS_METRIC_H
#define HS_METRIC_H

#include "../../halfshell.h"
#include "../base/base.h"

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
bool hs_metric_settle(const hs_metric *metric, const double *p, const double *q,
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

/* Which of two points is nearer: the sign of |D1|^2 - |D2|^2 for two vectors of one metric, -1, 0
 * or 1; its cutoff plays no part, but for floats_usable. Callers must have set round to nearest
 * without flushing. In metric_compare.c. */
int hs_metric_compare(const hs_metric *metric, const hs_span *one, const hs_span *other,
                      hs_stages *stages);

#endif
