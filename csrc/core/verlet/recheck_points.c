/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck_points.c: the points of a step in the order of the list, as floats, and the thresholds
 * that hold for them. */
#include "recheck.h"

#include <math.h>

#define UNIT 0x1p-53
/* Points ahead whose numbers are fetched: they lie anywhere in memory. */
#define AHEAD 16
/* Points that the middle of all is guessed from. */
#define SAMPLE 1024
/* Cutoffs between 2^-20 and 2^20 are not scaled: float32 has room for their squares. */
#define ORDINARY_EXPONENT 20

/* Counts of the step: those of the list and the jumps since then. */
static hs_status
add_counts(hs_refilter *refilter)
{
    const hs_verlet  *list = refilter->list;
    const hs_listing *listing = &list->listing;
    const int64_t     n = refilter->now->points.n;
    const int         m = refilter->m;
    const int64_t    *jumps = list->jumps_now >= 0 ? list->jumps[list->jumps_now].data : NULL;
    if (listing->counts == NULL && jumps == NULL) {
        return HS_OK;
    }
    refilter->counts =
        hs_alloc(&refilter->call->account, HS_FOR_WRAPS, n * m, sizeof *refilter->counts);
    if (refilter->counts == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t a = 0; a < n; a++) {
        const int64_t *jump = jumps != NULL ? jumps + (int64_t)listing->order[a] * m : NULL;
        if (jumps != NULL && a + AHEAD < n) {
            HS_PREFETCH(jumps + (int64_t)listing->order[a + AHEAD] * m);
        }
        for (int r = 0; r < m; r++) {
            const int64_t count = (listing->counts != NULL ? listing->counts[a * m + r] : 0) +
                                  (jump != NULL ? jump[r] : 0);
            refilter->counts[a * m + r] = count;
            refilter->most_counts = hs_larger(fabs((double)count), refilter->most_counts);
        }
    }
    return HS_OK;
}

/* Point number `a` of the list in the frame of its images, in float64: r - count h. */
HS_ALWAYS_INLINE void
place_of(const hs_refilter *refilter, const hs_real real, int64_t a, const int d, const int m,
         double *z)
{
    const int64_t i = refilter->list->listing.order[a];
    for (int k = 0; k < d; k++) {
        z[k] = hs_frame_entry(refilter->now->rows, real, i * d + k);
    }
    for (int r = 0; r < m; r++) {
        const double count = (double)refilter->counts[a * m + r];
        for (int k = 0; k < d; k++) {
            z[k] -= count * refilter->given.rows[r][k];
        }
    }
}

/* The middle of some points: floats lose least around it. */
static void
find_centre(const hs_refilter *refilter, double *centre)
{
    const int     m = refilter->counts != NULL ? refilter->m : 0;
    const int64_t n = refilter->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    double        lower[HS_MAX_DIM], upper[HS_MAX_DIM], z[HS_MAX_DIM];
    for (int k = 0; k < refilter->d; k++) {
        lower[k] = upper[k] = 0.0;
    }
    for (int64_t a = 0; a < n; a += step) {
        place_of(refilter, refilter->now->points.real, a, refilter->d, m, z);
        for (int k = 0; k < refilter->d; k++) {
            lower[k] = a == 0 ? z[k] : hs_smaller(z[k], lower[k]);
            upper[k] = a == 0 ? z[k] : hs_larger(z[k], upper[k]);
        }
    }
    for (int k = 0; k < refilter->d; k++) {
        centre[k] = 0.5 * lower[k] + 0.5 * upper[k];
    }
}

/* Rows of floats; returns the largest, infinity or NaN included. */
HS_ALWAYS_INLINE double
put_floats(const hs_refilter *refilter, hs_scale scale, const double *centre, const hs_real real,
           const int d, const int m)
{
    const int      stride = hs_sift_stride(d);
    double         largest[HS_MAX_DIM] = {0.0}, poison[HS_MAX_DIM] = {0.0}, most = 0.0;
    const int32_t *order = refilter->list->listing.order;
    const int64_t  n = refilter->now->points.n;
    for (int64_t a = 0; a < n; a++) {
        double z[HS_MAX_DIM];
        float *y = refilter->y + a * stride;
        if (a + AHEAD < n) {
            HS_PREFETCH((const char *)refilter->now->rows +
                        order[a + AHEAD] * refilter->now->points.row_stride);
        }
        place_of(refilter, real, a, d, m, z);
        for (int k = 0; k < stride; k++) {
            const float entry = k < d ? (float)hs_scale_apply(scale, z[k] - centre[k]) : 0.0f;
            y[k] = entry;
            largest[k] = hs_larger(fabs((double)entry), largest[k]);
            poison[k] += (double)(entry - entry);
        }
    }
    for (int k = 0; k < d; k++) {
        most = hs_larger(largest[k], most) + poison[k];
    }
    return most;
}

/* put_floats, with constants where that pays. */
static double
put_points(const hs_refilter *refilter, hs_scale scale, const double *centre)
{
    const hs_real real = refilter->now->points.real;
    const int     d = refilter->d, m = refilter->counts != NULL ? refilter->m : 0;
    const bool    narrow = real == HS_FLOAT32;
    if (d == 3 && m == 0) {
        return narrow ? put_floats(refilter, scale, centre, HS_FLOAT32, 3, 0)
                      : put_floats(refilter, scale, centre, HS_FLOAT64, 3, 0);
    }
    if (d == 3 && m == 3) {
        return narrow ? put_floats(refilter, scale, centre, HS_FLOAT32, 3, 3)
                      : put_floats(refilter, scale, centre, HS_FLOAT64, 3, 3);
    }
    return put_floats(refilter, scale, centre, real, d, m);
}

/* Images as floats. *largest: their largest component; *size: at least the sum of absolute terms of
 * any. */
static void
put_offsets(const hs_refilter *refilter, hs_scale scale, double *largest, double *size)
{
    const hs_images *images = &refilter->list->listing.images;
    const int        stride = hs_sift_stride(refilter->d);
    *largest = *size = 0.0;
    for (int64_t image = 0; image < images->n; image++) {
        for (int k = 0; k < stride; k++) {
            double sum = 0.0, terms = 0.0;
            for (int r = 0; k < refilter->d && r < refilter->m; r++) {
                const double term = images->of[image * refilter->m + r] *
                                    hs_scale_apply(scale, refilter->given.rows[r][k]);
                sum += term;
                terms += fabs(term);
            }
            const float offset = (float)sum;
            refilter->offset[image * stride + k] = offset;
            *largest = hs_larger(fabs((double)offset), *largest);
            *size = hs_larger(terms, *size);
        }
    }
}

/* How far the counted-off coordinates may be from the true ones: m products and sums. */
static double
bound_counts(const hs_refilter *refilter, hs_scale scale)
{
    const double most = refilter->most_counts;
    double       size = 0.0;
    if (refilter->counts == NULL) {
        return 0.0;
    }
    for (int r = 0; r < refilter->m; r++) {
        double longest = 0.0;
        for (int k = 0; k < refilter->d; k++) {
            longest = hs_larger(fabs(refilter->given.rows[r][k]), longest);
        }
        size += longest;
    }
    return (2 * refilter->m + 4) * UNIT *
           (hs_scale_apply(scale, refilter->now->largest) + most * hs_scale_apply(scale, size));
}

/*
 * Thresholds of filter.h, whose direct form has a candidate y = y_j + offset and a point q = y_i.
 * Beside what it knows of: y_j - y_i is rounded before the offset is added (u of twice the
 * largest), the offset is rounded to a float (u of it), and was summed in float64.
 */
static void
set_thresholds(hs_refilter *refilter, hs_scale scale, double largest, double error)
{
    const double cutoff = hs_scale_apply(scale, refilter->given.cutoff);
    const double u = 0x1p-24, tiny = 0x1p-100; /* more than scaling and flushing lose */
    double       offset, size;
    refilter->plain = hs_thresholds_of(refilter->d, cutoff, 2.0 * largest, error + tiny);
    put_offsets(refilter, scale, &offset, &size);
    const double more =
        u * (2.0 * largest + offset) * (1.0 + 0x1p-20) + (2 * refilter->m + 2) * UNIT * size;
    refilter->shifted =
        hs_thresholds_of(refilter->d, cutoff, 2.0 * largest + offset, error + tiny + more);
}

hs_status
hs_refilter_prepare(hs_refilter *refilter)
{
    hs_account    *account = &refilter->call->account;
    const int      stride = hs_sift_stride(refilter->d);
    const double   cutoff = refilter->given.cutoff;
    const int      exponent = cutoff > 0.0 ? ilogb(cutoff) : 0;
    const bool     ordinary = exponent >= -ORDINARY_EXPONENT && exponent <= ORDINARY_EXPONENT;
    const hs_scale scale = hs_scale_of(ordinary ? 0 : exponent);
    double         centre[HS_MAX_DIM];
    refilter->y = hs_alloc(account, HS_FOR_POINTS, refilter->now->points.n * stride, sizeof(float));
    refilter->offset =
        hs_alloc(account, HS_FOR_STENCIL, refilter->list->listing.images.n * stride, sizeof(float));
    if (refilter->y == NULL || refilter->offset == NULL || add_counts(refilter) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    find_centre(refilter, centre);
    const double largest = put_points(refilter, scale, centre);
    set_thresholds(refilter, scale, largest, bound_counts(refilter, scale));
    return HS_OK;
}
