/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck_points.c: the points of a step in the order of the list, as floats, and the thresholds
 * that hold for them. */
#include "recheck.h"

#include <math.h>
#include <string.h>

#define UNIT 0x1p-53
/* Points ahead whose numbers are fetched: they lie anywhere in memory. */
#define AHEAD 16
/* Points that the middle of all is guessed from. */
#define SAMPLE 128
/* Cutoffs between 2^-20 and 2^20 are not scaled: float32 has room for their squares. */
#define ORDINARY_EXPONENT 20

/* Counts of the step: those of the list and the jumps since then. */
static hs_status
add_counts(hs_recheck *recheck)
{
    const hs_verlet  *list = recheck->list;
    const hs_listing *listing = &list->listing;
    const int64_t     n = recheck->now->points.n;
    const int         m = recheck->m;
    const int64_t    *jumps = list->jumps_now >= 0 ? list->jumps[list->jumps_now].data : NULL;
    if (listing->counts == NULL && jumps == NULL) {
        return HS_OK;
    }
    recheck->counts =
        hs_alloc(&recheck->call->account, HS_FOR_WRAPS, n * m, sizeof *recheck->counts);
    if (recheck->counts == NULL) {
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
            recheck->counts[a * m + r] = count;
            recheck->most_counts = hs_larger(fabs((double)count), recheck->most_counts);
        }
    }
    return HS_OK;
}

/* Point number `a` of the list in the frame of its images, in float64: r - count h. */
HS_ALWAYS_INLINE void
place_of(const hs_recheck *recheck, const hs_real real, int64_t a, const int d, const int m,
         double *z)
{
    const int64_t i = recheck->list->listing.order[a];
    for (int k = 0; k < d; k++) {
        z[k] = hs_frame_entry(recheck->now->rows, real, i * d + k);
    }
    for (int r = 0; r < m; r++) {
        const double count = (double)recheck->counts[a * m + r];
        for (int k = 0; k < d; k++) {
            z[k] -= count * recheck->given.rows[r][k];
        }
    }
}

/* The middle of some points: floats lose least around it. */
static void
find_centre(const hs_recheck *recheck, double *centre)
{
    const int     m = recheck->counts != NULL ? recheck->m : 0;
    const int64_t n = recheck->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    double        lower[HS_MAX_DIM], upper[HS_MAX_DIM], z[HS_MAX_DIM];
    for (int k = 0; k < recheck->d; k++) {
        lower[k] = upper[k] = 0.0;
    }
    for (int64_t a = 0; a < n; a += step) {
        place_of(recheck, recheck->now->points.real, a, recheck->d, m, z);
        for (int k = 0; k < recheck->d; k++) {
            lower[k] = a == 0 ? z[k] : hs_smaller(z[k], lower[k]);
            upper[k] = a == 0 ? z[k] : hs_larger(z[k], upper[k]);
        }
    }
    for (int k = 0; k < recheck->d; k++) {
        centre[k] = 0.5 * lower[k] + 0.5 * upper[k];
    }
}

/* Rows of floats; returns the largest, infinity or NaN included. */
HS_ALWAYS_INLINE double
put_floats(const hs_recheck *recheck, hs_scale scale, const double *centre, const hs_real real,
           const int d, const int m)
{
    const int      stride = hs_sift_stride(d);
    double         largest[HS_MAX_DIM] = {0.0}, poison[HS_MAX_DIM] = {0.0}, most = 0.0;
    const int32_t *order = recheck->list->listing.order;
    const int64_t  n = recheck->now->points.n;
    for (int64_t a = 0; a < n; a++) {
        double z[HS_MAX_DIM];
        float *y = recheck->y + a * stride;
        if (a + AHEAD < n) {
            HS_PREFETCH((const char *)recheck->now->rows +
                        order[a + AHEAD] * recheck->now->points.row_stride);
        }
        place_of(recheck, real, a, d, m, z);
        for (int k = d; k < stride; k++) {
            y[k] = 0.0f;
        }
        if (hs_sift_has_numbers(d)) {
            memcpy(y + stride - 1, order + a, sizeof *order);
        }
        for (int k = 0; k < d; k++) {
            const float entry = (float)hs_scale_apply(scale, z[k] - centre[k]);
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
put_points(const hs_recheck *recheck, hs_scale scale, const double *centre)
{
    const hs_real real = recheck->now->points.real;
    const int     d = recheck->d, m = recheck->counts != NULL ? recheck->m : 0;
    const bool    narrow = real == HS_FLOAT32;
    if (d == 3 && m == 0) {
        return narrow ? put_floats(recheck, scale, centre, HS_FLOAT32, 3, 0)
                      : put_floats(recheck, scale, centre, HS_FLOAT64, 3, 0);
    }
    if (d == 3 && m == 3) {
        return narrow ? put_floats(recheck, scale, centre, HS_FLOAT32, 3, 3)
                      : put_floats(recheck, scale, centre, HS_FLOAT64, 3, 3);
    }
    return put_floats(recheck, scale, centre, real, d, m);
}

/* Images as floats. *largest: their largest component; *size: at least the sum of absolute terms of
 * any. */
static void
put_offsets(const hs_recheck *recheck, hs_scale scale, double *largest, double *size)
{
    const hs_images *images = &recheck->list->listing.images;
    const int        stride = hs_sift_stride(recheck->d);
    *largest = *size = 0.0;
    for (int64_t image = 0; image < images->n; image++) {
        for (int k = 0; k < stride; k++) {
            double sum = 0.0, terms = 0.0;
            for (int r = 0; k < recheck->d && r < recheck->m; r++) {
                const double term = images->of[image * recheck->m + r] *
                                    hs_scale_apply(scale, recheck->given.rows[r][k]);
                sum += term;
                terms += fabs(term);
            }
            const float offset = (float)sum;
            recheck->offset[image * stride + k] = offset;
            *largest = hs_larger(fabs((double)offset), *largest);
            *size = hs_larger(terms, *size);
        }
    }
}

/* How far the counted-off coordinates may be from the true ones: m products and sums. */
static double
bound_counts(const hs_recheck *recheck, hs_scale scale)
{
    const double most = recheck->most_counts;
    double       size = 0.0;
    if (recheck->counts == NULL) {
        return 0.0;
    }
    for (int r = 0; r < recheck->m; r++) {
        double longest = 0.0;
        for (int k = 0; k < recheck->d; k++) {
            longest = hs_larger(fabs(recheck->given.rows[r][k]), longest);
        }
        size += longest;
    }
    return (2 * recheck->m + 4) * UNIT *
           (hs_scale_apply(scale, recheck->now->largest) + most * hs_scale_apply(scale, size));
}

/*
 * Thresholds of filter.h, whose direct form has a candidate y_j and a point q = y_i - offset, which
 * it knows to be rounded to a float. Before that, y_i and the offset were rounded, too (u of each),
 * and the offset was summed in float64.
 */
static void
set_thresholds(hs_recheck *recheck, hs_scale scale, double largest, double error)
{
    const double cutoff = hs_scale_apply(scale, recheck->given.cutoff);
    const double u = 0x1p-24, tiny = 0x1p-100; /* more than scaling and flushing lose */
    double       offset, size;
    recheck->plain = hs_thresholds_of(recheck->d, cutoff, 2.0 * largest, error + tiny);
    put_offsets(recheck, scale, &offset, &size);
    const double more =
        u * (largest + offset) * (1.0 + 0x1p-20) + (2 * recheck->m + 2) * UNIT * size;
    const double extent = (2.0 * largest + offset) * (1.0 + 0x1p-20);
    recheck->shifted = hs_thresholds_of(recheck->d, cutoff, extent, error + tiny + more);
}

hs_status
hs_recheck_prepare(hs_recheck *recheck)
{
    hs_account    *account = &recheck->call->account;
    const int      stride = hs_sift_stride(recheck->d);
    const double   cutoff = recheck->given.cutoff;
    const int      exponent = cutoff > 0.0 ? ilogb(cutoff) : 0;
    const bool     ordinary = exponent >= -ORDINARY_EXPONENT && exponent <= ORDINARY_EXPONENT;
    const hs_scale scale = hs_scale_of(ordinary ? 0 : exponent);
    double         centre[HS_MAX_DIM];
    recheck->y = hs_alloc(account, HS_FOR_POINTS, recheck->now->points.n * stride, sizeof(float));
    recheck->offset =
        hs_alloc(account, HS_FOR_STENCIL, recheck->list->listing.images.n * stride, sizeof(float));
    if (recheck->y == NULL || recheck->offset == NULL || add_counts(recheck) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    find_centre(recheck, centre);
    const double largest = put_points(recheck, scale, centre);
    set_thresholds(recheck, scale, largest, bound_counts(recheck, scale));
    return HS_OK;
}
