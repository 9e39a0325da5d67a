/* SPDX-License-Identifier: BSD-3-Clause */
/* few.c: pairs of few points, one by one. Squares in float64 leave out what is surely beyond the
 * cutoff; metric.h decides on the others, and measures them. */
#include "../../halfshell.h"

#include "../base/os.h"
#include "../exact/metric.h"

#include <float.h>

/* Rounding errors of a square over up to 8 axes, and of an image up to 1.5 periods away, are below
 * 2^-48 of it and of the sum of the periods; this bound is wider. */
#define ROUNDING_ERROR 0x1p-40

/* The square of the least cutoff is far from underflow. */
#define LEAST_CUTOFF 0x1p-400

/* What pairs are compared with. */
typedef struct bounds {
    hs_metric metric;
    double    period[HS_MAX_DIM], half[HS_MAX_DIM]; /* half: infinite where nothing repeats */
    double    within, beyond; /* squares up to `within`, or above `beyond`, need no decision */
} bounds;

/* False where two images of a pair may be within the cutoff, or squares overflow or underflow. */
static bool
set_bounds(bounds *by, const hs_few *few)
{
    double rows[HS_MAX_DIM][HS_MAX_DIM] = {{0.0}}, all_periods = 0.0;
    bool   has_one_image = true;
    for (int k = 0; k < few->ndim; k++) {
        const double period = few->period != NULL && few->period[k] > 0.0 ? few->period[k] : 0.0;
        by->period[k] = rows[k][k] = period;
        by->half[k] = period > 0.0 ? 0.5 * period : INFINITY;
        has_one_image = has_one_image && few->cutoff < by->half[k];
        all_periods += period;
    }
    const double error = ROUNDING_ERROR * (few->cutoff + all_periods);
    const double outer = few->cutoff + error, inner = few->cutoff - error;
    by->beyond = outer * outer * (1.0 + ROUNDING_ERROR);
    by->within = inner > 0.0 ? inner * inner * (1.0 - ROUNDING_ERROR) : -1.0;
    if (!has_one_image || !(few->cutoff >= LEAST_CUTOFF && by->beyond <= DBL_MAX)) {
        return false;
    }
    hs_metric_init(&by->metric, few->ndim, all_periods > 0.0 ? few->ndim : 0,
                   (const double(*)[HS_MAX_DIM])rows, few->cutoff, true);
    return true;
}

/* The square of the distance of two points in their nearest image, rounded; infinite or NaN where
 * one is not finite, NaN if they are too far apart for this. */
HS_ALWAYS_INLINE double
square_of(const bounds *by, const double *p, const double *q, int ndim, bool repeats)
{
    double square = 0.0;
    for (int k = 0; k < ndim; k++) {
        double size = fabs(q[k] - p[k]);
        if (repeats && size > by->half[k]) {
            size = size > 1.5 * by->period[k] ? NAN : by->period[k] - size;
        }
        square += size * size;
    }
    return square;
}

/* The shift to the nearest image, *shift NULL if it is zero; false if two images are as near. */
static bool
find_shift(const bounds *by, const double *p, const double *q, int64_t *entries, int64_t **shift)
{
    *shift = NULL;
    for (int k = 0; k < by->metric.ndim; k++) {
        const double across = q[k] - p[k];
        if (fabs(across) == by->half[k]) {
            return false;
        }
        entries[k] = across > by->half[k] ? -1 : across < -by->half[k];
        *shift = entries[k] != 0 ? entries : *shift;
    }
    return true;
}

/* Whether coordinates are finite; asked where there is no pair, whose square would show it. */
static bool
are_finite(const double *x, int64_t n)
{
    for (int64_t k = 0; k < n; k++) {
        if (!isfinite(x[k])) {
            return false;
        }
    }
    return true;
}

int
hs_few_pairs(const hs_few *few, int32_t *i, int32_t *j, double *d)
{
    const bool    is_half = few->queries == NULL, is_open = few->period == NULL;
    const double *asking = is_half ? few->points : few->queries;
    const int64_t n_asking = is_half ? few->n_points : few->n_queries;
    const int     ndim = few->ndim;
    hs_stages     stages = {0, 0, 0};
    bounds        by;
    int           n = 0;
    if (ndim < 1 || ndim > HS_MAX_DIM || few->n_points > HS_FEW_PAIRS || n_asking > HS_FEW_PAIRS ||
        few->n_points * n_asking > (is_half ? 2 : 1) * HS_FEW_PAIRS) {
        return -1;
    }
    const hs_fpenv saved = hs_fpenv_enter();
    bool           are_sure = set_bounds(&by, few);
    if (few->n_points * n_asking <= (is_half ? 1 : 0)) { /* no pairs */
        are_sure = are_sure && are_finite(few->points, few->n_points * ndim) &&
                   are_finite(asking, n_asking * ndim);
    }
    for (int64_t a = 0; are_sure && a < n_asking; a++) {
        const double *p = asking + a * ndim;
        for (int64_t b = is_half ? a + 1 : 0; b < few->n_points; b++) {
            const double *q = few->points + b * ndim;
            const double  square = ndim == 3 && is_open ? square_of(&by, p, q, 3, false)
                                   : ndim == 3          ? square_of(&by, p, q, 3, true)
                                                        : square_of(&by, p, q, ndim, true);
            int64_t       entries[HS_MAX_DIM], *shift;
            if (square > by.beyond && square <= DBL_MAX) {
                continue;
            }
            const bool is_within = square <= by.within;
            if (!is_within || d != NULL) {
                are_sure = square <= DBL_MAX && find_shift(&by, p, q, entries, &shift);
                if (!are_sure) {
                    break;
                }
            }
            if (!is_within && !hs_metric_within(&by.metric, p, q, shift, &stages)) {
                continue;
            }
            i[n] = (int32_t)a;
            j[n] = (int32_t)b;
            if (d != NULL) {
                d[n] = hs_keep_within(hs_metric_measure(&by.metric, p, q, shift, NULL), few->cutoff,
                                      true);
            }
            n++;
        }
    }
    hs_fpenv_leave(saved);
    return are_sure ? n : -1;
}
