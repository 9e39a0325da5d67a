/* SPDX-License-Identifier: BSD-3-Clause */
#include "recheck.h"
#include "../exact/metric.h"
#include "../collect/record.h"
#include "../base/status.h"
#include "../base/os.h"
#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"

#include <math.h>
#include <string.h>

/* recheck.c: slabs of the list, one after the other by one thread, or several at once by threads
 * that write what they find in turn. */

/* Room in the column of this HS_WANT_ bit for pair `at` of the output; NULL where not kept. */
HS_ALWAYS_INLINE void *
recheck_column(const hs_recheck *recheck, unsigned bit, int64_t at)
{
    char *column = hs_output_column(recheck->output, bit);
    return column == NULL ? NULL : column + (size_t)at * hs_output_width(recheck->output, bit);
}

/* Whether the bundles of a slab have images. */
HS_ALWAYS_INLINE bool
slab_has_images(const hs_recheck *recheck, const hs_slab_hits *slab)
{
    return slab->first >= recheck->list->listing.n_plain;
}

/* The image of a bundle, over the box vectors that repeat; NULL: none. */
HS_ALWAYS_INLINE const int32_t *
recheck_image(const hs_recheck *recheck, const hs_slab_hits *slab, int32_t bundle)
{
    return slab_has_images(recheck, slab) ? recheck->list->listing.images.of +
                                                (int64_t)slab->bundles[bundle].image * recheck->m
                                          : NULL;
}

/* S from a to b over the box vectors that repeat. image: NULL if they have none. */
HS_ALWAYS_INLINE void
recheck_shift(const hs_recheck *recheck, int64_t a, int64_t b, const int32_t *image, int64_t *shift)
{
    const int m = recheck->m;
    for (int r = 0; r < m; r++) {
        shift[r] = image == NULL ? 0 : image[r];
        if (recheck->counts != NULL) { /* modulo 2^64: exact, for the sum fits */
            shift[r] =
                (int64_t)((uint64_t)shift[r] + (uint64_t)recheck->counts[(int64_t)a * m + r] -
                          (uint64_t)recheck->counts[(int64_t)b * m + r]);
        }
    }
}

/* The points of a step in the order of the list, as floats, and the thresholds
 * that hold for them. */

#define UNIT 0x1p-53
/* Points ahead whose numbers are fetched: they lie anywhere in memory. */
#define POINTS_AHEAD 16
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
        if (jumps != NULL && a + POINTS_AHEAD < n) {
            HS_PREFETCH(jumps + (int64_t)listing->order[a + POINTS_AHEAD] * m);
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
    const int      stride = hs_slab_stride(d);
    double         largest[HS_MAX_DIM] = {0.0}, poison[HS_MAX_DIM] = {0.0}, most = 0.0;
    const int32_t *order = recheck->list->listing.order;
    const int64_t  n = recheck->now->points.n;
    for (int64_t a = 0; a < n; a++) {
        double z[HS_MAX_DIM];
        float *y = recheck->y + a * stride;
        if (a + POINTS_AHEAD < n) {
            HS_PREFETCH((const char *)recheck->now->rows +
                        order[a + POINTS_AHEAD] * recheck->now->points.row_stride);
        }
        place_of(recheck, real, a, d, m, z);
        for (int k = d; k < stride; k++) {
            y[k] = 0.0f;
        }
        if (hs_slab_has_numbers(d)) {
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
    const int        stride = hs_slab_stride(recheck->d);
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

/* The points as floats, their counts and thresholds. */
static hs_status
recheck_prepare(hs_recheck *recheck)
{
    hs_account    *account = &recheck->call->account;
    const int      stride = hs_slab_stride(recheck->d);
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

/* The exact decision of the listed pairs that float32 cannot tell, from the
 * points as given and S. */

/* Pairs of a batch that are to be decided, as the kernels take them. */
typedef struct open_batch {
    double  p[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    double  q[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    double  times[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    int64_t shift[HS_BATCH][HS_MAX_DIM];
    bool    is_shifted, is_wide;
} open_batch;

static void
fill_open(const hs_recheck *recheck, const hs_slab_hits *slab, const hs_open_pair *pairs, int32_t n,
          open_batch *open)
{
    const hs_listing *listing = &recheck->list->listing;
    const hs_frame   *now = recheck->now;
    open->is_shifted = open->is_wide = false;
    for (int32_t e = 0; e < n; e++) {
        const int64_t a = slab->bundles[pairs[e].bundle].point;
        const int64_t b = listing->j[slab->first + pairs[e].pair];
        const int64_t i = listing->order[a], j = listing->order[b];
        recheck_shift(recheck, a, b, recheck_image(recheck, slab, pairs[e].bundle), open->shift[e]);
        for (int k = 0; k < recheck->d; k++) {
            open->p[k][e] = hs_frame_entry(now->rows, now->points.real, i * recheck->d + k);
            open->q[k][e] = hs_frame_entry(now->rows, now->points.real, j * recheck->d + k);
        }
        for (int r = 0; r < recheck->m; r++) {
            const int64_t shift = open->shift[e][r];
            open->times[r][e] = (double)shift;
            open->is_shifted = open->is_shifted || shift != 0;
            open->is_wide = open->is_wide || shift > INT64_C(1) << 53 ||
                            shift < -(INT64_C(1) << 53);
        }
    }
}

/* Whether each of n pairs is within the cutoff: by the kernel, and what that leaves one by one. */
static void
decide_open(const hs_recheck *recheck, const open_batch *open, int32_t n, hs_stages *stages,
            uint8_t *within)
{
    const hs_metric *metric = &recheck->given;
    uint8_t          verdict[HS_BATCH + HS_BATCH_PADDING] = {0};
    hs_batch         batch = {.n = n};
    for (int k = 0; k < recheck->d; k++) {
        batch.p[k] = open->p[k];
        batch.q[k] = open->q[k];
    }
    for (int r = 0; open->is_shifted && r < recheck->m; r++) {
        batch.shift[r] = open->times[r];
    }
    if (!open->is_wide) {
        recheck->call->kernel->decide_batch(metric, &batch, verdict, stages);
    }
    for (int32_t b = 0; b < n; b++) {
        double p[HS_MAX_DIM], q[HS_MAX_DIM];
        if (verdict[b] != HS_UNDECIDED) {
            within[b] = verdict[b] == HS_WITHIN;
            continue;
        }
        for (int k = 0; k < recheck->d; k++) {
            p[k] = open->p[k][b];
            q[k] = open->q[k][b];
        }
        within[b] = open->is_wide
                        ? hs_metric_within(metric, p, q, open->shift[b], stages)
                        : hs_metric_decide_by_integers(metric, p, q, open->shift[b], stages);
    }
}

/* Takes the hits whose numbers are in `gone`, ascending, from a slab. */
static void
drop_hits(hs_slab_hits *slab, const int32_t *gone, int32_t n)
{
    int32_t to = gone[0], before = 0;
    for (int32_t g = 0; g < n; g++) {
        const int32_t from = gone[g] + 1, end = g + 1 < n ? gone[g + 1] : slab->n_hits;
        memmove(slab->hits + to, slab->hits + from, (size_t)(end - from) * sizeof *slab->hits);
        to += end - from;
    }
    for (int32_t t = 0; t < slab->n_bundles; t++) {
        while (before < n && gone[before] < slab->hits_end[t]) {
            before++;
        }
        slab->hits_end[t] -= before;
    }
    slab->n_hits -= n;
}

/* Decides the hits of a slab that float32 cannot tell, of which there are some, and takes those
 * that are beyond the cutoff from the hits. */
static void
recheck_decide_unsure(const hs_recheck *recheck, hs_slab_hits *slab)
{
    int32_t    gone[HS_SLAB], n_gone = 0;
    open_batch open;
    memset(&open, 0, sizeof open); /* kernels read a little beyond the last pair */
    for (int32_t u = 0; u < slab->n_open; u += HS_BATCH) {
        const int32_t n = slab->n_open - u < HS_BATCH ? slab->n_open - u : HS_BATCH;
        uint8_t       within[HS_BATCH];
        fill_open(recheck, slab, slab->open + u, n, &open);
        decide_open(recheck, &open, n, &slab->stages, within);
        for (int32_t b = 0; b < n; b++) {
            gone[n_gone] = slab->open[u + b].at;
            n_gone += !within[b];
        }
    }
    if (n_gone > 0) {
        drop_hits(slab, gone, n_gone);
    }
}

/*
 * Hits in 2-D and 3-D are measured while they are written, by the writer of a
 * search (kernels/write.h), where a thread writes to memory of ours. Its shift is the one that
 * the metric multiplies: the lag of b, and for each bundle image less the lag of a.
 */

/* Lags and images up to here: their sums fit. */
#define MOST_SHIFT (INT64_C(1) << 29)

/* Whether a point may be its own neighbour: then the writer would go by the sign of its shift,
 * which is not that of S. B is diagonal here. */
static bool
has_own_images(const hs_recheck *recheck)
{
    const hs_metric *metric = &recheck->scene.metric;
    for (int r = 0; r < recheck->m; r++) {
        double longest = 0.0;
        for (int k = 0; k < recheck->d; k++) {
            longest = hs_larger(fabs(metric->rows[r][k]), longest);
        }
        if (!(longest > metric->cutoff)) {
            return true;
        }
    }
    return false;
}

static bool
are_small(const int64_t *shifts, int64_t n)
{
    uint64_t any = 0;
    for (int64_t e = 0; e < n; e++) {
        any |= (uint64_t)shifts[e] + (uint64_t)MOST_SHIFT;
    }
    return any < 2 * (uint64_t)MOST_SHIFT;
}

/* Records of lags, unless all are zero. */
static bool
set_few(hs_recheck *recheck)
{
    const int64_t n = recheck->now->points.n;
    const int     m = recheck->m;
    unsigned      any = 0;
    for (int64_t a = 0; m > 0 && a < n; a++) {
        any |= recheck->lagging[a];
    }
    if (any == 0) {
        return true;
    }
    recheck->few =
        hs_alloc(&recheck->call->account, HS_FOR_WRAPS, n * HS_RECORD, sizeof *recheck->few);
    for (int64_t a = 0; recheck->few != NULL && a < n; a++) {
        for (int r = 0; r < HS_RECORD; r++) {
            recheck->few[a * HS_RECORD + r] = r < m ? (int32_t)recheck->lag[a * m + r] : 0;
        }
    }
    return recheck->few != NULL;
}

hs_status
hs_recheck_plan_write(hs_recheck *recheck)
{
    const hs_scene *scene = &recheck->scene;
    const int       d = recheck->d, m = recheck->m;
    const bool      is_ours = !recheck->output->fixed || recheck->shared;
    recheck->writes = recheck->call->kernel->write != NULL && d >= 2 && d <= HS_WRITE_MOST_DIM &&
                      is_ours && !(recheck->output->columns & HS_WANT_BOTH) &&
                      !scene->keeps_originals && !scene->extreme && scene->metric.floats_usable &&
                      !has_own_images(recheck) &&
                      are_small(recheck->lag, recheck->now->points.n * m) &&
                      are_small(recheck->image, recheck->list->listing.images.n * m);
    if (!recheck->writes) {
        return HS_OK;
    }
    return set_few(recheck) ? HS_OK : HS_ERR_MEMORY;
}

/* What the writer is told of the point a of each bundle. */
static void
describe_points(const hs_recheck *recheck, const hs_slab_hits *slab, bool shifted, hs_write *write)
{
    hs_bundle_points *of = recheck->of_a;
    const bool        has_images = slab_has_images(recheck, slab);
    for (int32_t t = 0; t < slab->n_bundles; t++) {
        const hs_bundle *bundle = &slab->bundles[t];
        const int64_t    a = bundle->point;
        of->number[t] = recheck->list->listing.order[a];
        for (int k = 0; k < recheck->d; k++) {
            of->p[k][t] = recheck->x[a * HS_RECORD + k];
        }
        for (int r = 0; shifted && r < recheck->m; r++) {
            const int64_t image =
                has_images ? recheck->image[(int64_t)bundle->image * recheck->m + r] : 0;
            of->turns[r][t] = (int32_t)(image - recheck->lag[a * recheck->m + r]);
        }
    }
    for (int k = 0; k < recheck->d; k++) {
        write->p[k] = of->p[k];
    }
    for (int r = 0; shifted && r < recheck->m; r++) {
        write->turns[r] = of->turns[r];
    }
}

/* Writes i, j, d and D; false: it cannot, and what it has written does not count. */
static bool
recheck_write(const hs_recheck *recheck, hs_slab_hits *slab)
{
    const bool shifted = slab_has_images(recheck, slab) || recheck->few != NULL;
    hs_write   write = {
          .ndim = recheck->d,
          .is_half = true,
          .is_shifted = shifted,
          .by_S = true,
          .metric = &recheck->scene.metric,
          .q = recheck->x,
          .few = recheck->few,
          .index_bytes = recheck->output->index_bytes,
          .i = recheck_column(recheck, HS_WANT_I, slab->at),
          .j = recheck_column(recheck, HS_WANT_J, slab->at),
          .distance = recheck_column(recheck, HS_WANT_DISTANCE, slab->at),
          .vector = recheck_column(recheck, HS_WANT_VECTOR, slab->at),
    };
    const hs_hits hits = {.n = slab->n_bundles,
                          .point = recheck->of_a->number,
                          .end = slab->hits_end,
                          .label = slab->hits};
    hs_measures_tell(&recheck->scene, &recheck->call->options, &write);
    describe_points(recheck, slab, shifted, &write);
    memset(slab->hits + slab->n_hits, 0, HS_PADDING * sizeof *slab->hits);
    return recheck->call->kernel->write(&write, &hits);
}

/*
 * d and D of hits. They are measured in the scene of a search of these points,
 * so that they have its bits: between the wrapped points with shifts over the reduced box, or
 * between the points as given.
 */

/* Points ahead whose numbers are fetched: they lie anywhere in memory. */
#define MEASURE_AHEAD 16

/* A double that is an integer, modulo 2^64. */
static int64_t
integer_of(double x)
{
    int           exponent;
    const int64_t significand = (int64_t)ldexp(frexp(x, &exponent), 53);
    exponent -= 53;
    if (exponent < 0) { /* -53 at least: it is an integer */
        return significand / (INT64_C(1) << -exponent);
    }
    return exponent < 64 ? (int64_t)((uint64_t)significand << exponent) : 0;
}

/* over[l][r]: given box vector l is made of so many times row r of B. B is diagonal here, so that
 * is a given entry over a period: a quotient of doubles that is an integer, hence a double. */
static void
divide_rows(const hs_lattice *lattice, int64_t over[][HS_MAX_DIM])
{
    for (int k = 0; k < lattice->ndim; k++) {
        const int r = lattice->row_of_axis[k];
        for (int l = 0; r >= 0 && l < lattice->n_periodic; l++) {
            over[l][r] = integer_of(lattice->scaled[l][k] / lattice->rows[r][k]);
        }
    }
}

/* A shift over the given box vectors to one over B, modulo 2^64. */
HS_ALWAYS_INLINE void
reduce_shift(int m, const int64_t over[][HS_MAX_DIM], const int64_t *shift, int64_t *reduced)
{
    for (int r = 0; r < m; r++) {
        uint64_t sum = 0;
        for (int l = 0; l < m; l++) {
            sum += (uint64_t)shift[l] * (uint64_t)over[l][r];
        }
        reduced[r] = (int64_t)sum;
    }
}

static bool
allocate(hs_recheck *recheck)
{
    hs_account   *account = &recheck->call->account;
    const int64_t n = recheck->now->points.n, m = recheck->m;
    const int64_t n_images = recheck->list->listing.images.n;
    recheck->image = hs_alloc(account, HS_FOR_WRAPS, n_images * m, sizeof *recheck->image);
    recheck->lag = hs_alloc(account, HS_FOR_WRAPS, n * m, sizeof *recheck->lag);
    recheck->lagging = hs_alloc(account, HS_FOR_WRAPS, n, sizeof *recheck->lagging);
    return recheck->image != NULL && recheck->lag != NULL && recheck->lagging != NULL;
}

/*
 * Lags. The scene's X = r - w B; images are for z = r - count A. So S = image + count_i - count_j
 * over A is, for X, image + lag_j - lag_i over B with lag = w - count. For points as given, w is 0.
 */
static void
set_lags(hs_recheck *recheck, bool over_given, const int64_t over[][HS_MAX_DIM])
{
    const hs_scene *scene = &recheck->scene;
    const int       m = recheck->m;
    for (int64_t a = 0; m > 0 && a < recheck->now->points.n; a++) {
        const int64_t i = recheck->list->listing.order[a];
        int64_t       count[HS_MAX_DIM] = {0}, reduced[HS_MAX_DIM], any = 0;
        if (recheck->counts != NULL) {
            memcpy(count, recheck->counts + a * m, (size_t)m * sizeof *count);
        }
        if (!over_given) {
            reduce_shift(m, over, count, reduced);
        }
        for (int r = 0; r < m; r++) {
            recheck->lag[a * m + r] =
                over_given
                    ? -count[r]
                    : (int64_t)((uint64_t)hs_turns_get(&scene->turns, r, i) - (uint64_t)reduced[r]);
            any |= recheck->lag[a * m + r];
        }
        recheck->lagging[a] = any != 0;
    }
}

static void
set_images(hs_recheck *recheck, bool over_given, const int64_t over[][HS_MAX_DIM])
{
    const hs_images *images = &recheck->list->listing.images;
    const int        m = recheck->m;
    for (int64_t number = 0; number < images->n; number++) {
        int64_t shift[HS_MAX_DIM], *to = recheck->image + number * m;
        for (int r = 0; r < m; r++) {
            shift[r] = images->of[number * m + r];
        }
        if (over_given) {
            memcpy(to, shift, (size_t)m * sizeof *to);
        } else {
            reduce_shift(m, over, shift, to);
        }
    }
}

static bool
set_coordinates(hs_recheck *recheck)
{
    const hs_scene *scene = &recheck->scene;
    double *const  *x = scene->keeps_originals ? scene->originals : scene->cloud.x;
    const int       d = recheck->d, width = recheck->writes ? HS_RECORD : d;
    const int32_t  *order = recheck->list->listing.order;
    const int64_t   n = recheck->now->points.n;
    recheck->width = width;
    recheck->x = hs_alloc(&recheck->call->account, HS_FOR_POINTS, n * width, sizeof *recheck->x);
    for (int64_t a = 0; recheck->x != NULL && a < n; a++) {
        const int64_t number = order[a];
        double       *to = recheck->x + a * width;
        for (int k = 0; k < d; k++) {
            if (a + MEASURE_AHEAD < n) {
                HS_PREFETCH(x[k] + order[a + MEASURE_AHEAD]);
            }
            to[k] = x[k][number];
        }
        for (int k = d; k < width; k++) { /* the last one's bits are the number */
            memcpy(to + k, &number, sizeof number);
        }
    }
    return recheck->x != NULL;
}

hs_status
hs_recheck_open_scene(hs_recheck *recheck, hs_failure *failure)
{
    hs_call   *call = recheck->call;
    hs_scene  *scene = &recheck->scene;
    hs_options options = call->options;
    int64_t    over[HS_MAX_DIM][HS_MAX_DIM] = {{0}};
    options.want |= HS_WANT_SHIFT; /* the turns by which points were wrapped are needed */
    const hs_status status = hs_scene_init(&call->account, call->team, &recheck->now->points,
                                           hs_frame_box(recheck->now), &options, scene, failure);
    if (status != HS_OK) {
        return status;
    }
    if (!allocate(recheck)) {
        return HS_ERR_MEMORY;
    }
    const bool over_given = scene->keeps_originals;
    if (!over_given && recheck->m > 0) {
        divide_rows(&scene->lattice, over);
    }
    set_lags(recheck, over_given, (const int64_t(*)[HS_MAX_DIM])over);
    set_images(recheck, over_given, (const int64_t(*)[HS_MAX_DIM])over);
    if (hs_recheck_plan_write(recheck) != HS_OK || !set_coordinates(recheck)) {
        return HS_ERR_MEMORY;
    }
    return HS_OK;
}

/* A batch of hits, and which points they are of. */
typedef struct hit_batch {
    int32_t     bundle;                    /* of the slab: that of the next hit */
    int32_t     next;                      /* hit */
    int32_t     of[HS_BATCH], b[HS_BATCH]; /* bundle; place */
    double      sign[HS_BATCH];            /* -1: the pair is from b to a */
    unsigned    lagging;                   /* whether any point is */
    hs_measured measured;
} hit_batch;

/* Takes hits [begin, end) of the batch, which are of the present bundle. */
HS_ALWAYS_INLINE void
take_of_bundle(const hs_recheck *recheck, const hs_slab_hits *slab, int32_t begin, int32_t end,
               const int d, hit_batch *HS_RESTRICT batch)
{
    const int32_t *hits = slab->hits + batch->next;
    const int32_t *order = recheck->list->listing.order;
    const double  *x = recheck->x;
    const int64_t  width = recheck->writes ? HS_RECORD : d;
    const uint8_t *lagging = recheck->lagging;
    const int32_t  bundle = batch->bundle;
    const int64_t  a = slab->bundles[bundle].point;
    const int32_t  number = order[a];
    unsigned       any = lagging[a];
    for (int32_t e = begin; e < end; e++) {
        const int64_t b = hits[e];
        for (int k = 0; k < d; k++) {
            batch->measured.p[k][e] = x[a * width + k];
            batch->measured.q[k][e] = x[b * width + k];
        }
        any |= lagging[b];
        batch->of[e] = bundle;
        batch->b[e] = (int32_t)b;
        /* -1 where order[b] < number, else 1: a branch would be mispredicted. */
        batch->sign[e] = 1 - 2 * (int)((uint32_t)(order[b] - number) >> 31);
    }
    batch->lagging |= any;
}

/* Takes the next hits of the slab into the batch. */
HS_ALWAYS_INLINE void
take_hits(const hs_recheck *recheck, const hs_slab_hits *slab, const int d, hit_batch *batch)
{
    const int32_t left = slab->n_hits - batch->next;
    const int32_t n = left < HS_BATCH ? left : HS_BATCH;
    batch->lagging = 0;
    for (int32_t e = 0; e < n;) {
        while (slab->hits_end[batch->bundle] <= batch->next + e) {
            batch->bundle++;
        }
        const int32_t of_bundle = slab->hits_end[batch->bundle] - batch->next;
        const int32_t end = of_bundle < n ? of_bundle : n;
        take_of_bundle(recheck, slab, e, end, d, batch);
        e = end;
    }
    batch->next += n;
    batch->measured.n = n;
}

/* The shifts of the batch, for the scene's metric. */
static void
fill_shifts(const hs_recheck *recheck, const hs_slab_hits *slab, hit_batch *batch)
{
    const bool has_images = slab_has_images(recheck, slab);
    const int  m = recheck->m;
    for (int32_t e = 0; e < batch->measured.n; e++) {
        const hs_bundle *bundle = &slab->bundles[batch->of[e]];
        const int64_t   *lag_a = recheck->lag + (int64_t)bundle->point * m;
        const int64_t   *lag_b = recheck->lag + (int64_t)batch->b[e] * m;
        for (int r = 0; r < m; r++) {
            const int64_t image = has_images ? recheck->image[(int64_t)bundle->image * m + r] : 0;
            const int64_t shift =
                (int64_t)((uint64_t)image + (uint64_t)lag_b[r] - (uint64_t)lag_a[r]);
            hs_measured_shift(&batch->measured, e, r, shift);
        }
    }
}

static void
fill(const hs_recheck *recheck, const hs_slab_hits *slab, hit_batch *batch)
{
    switch (recheck->d) {
    case 2: take_hits(recheck, slab, 2, batch); break;
    case 3: take_hits(recheck, slab, 3, batch); break;
    default: take_hits(recheck, slab, recheck->d, batch);
    }
    batch->measured.is_shifted = batch->measured.is_wide = false;
    if (recheck->m > 0 && (batch->lagging != 0 || slab_has_images(recheck, slab))) {
        fill_shifts(recheck, slab, batch);
    }
}

static void
recheck_measure(const hs_recheck *recheck, const hs_slab_hits *slab)
{
    const hs_scene   *scene = &recheck->scene;
    const hs_options *options = &recheck->call->options;
    const hs_scale    unscale = hs_measures_unscale(scene);
    const int         d = recheck->d;
    double           *distance = recheck_column(recheck, HS_WANT_DISTANCE, slab->at);
    double           *vectors = recheck_column(recheck, HS_WANT_VECTOR, slab->at);
    double           *vector[HS_MAX_DIM];
    hit_batch         batch;
    hs_measured      *measured = &batch.measured;
    memset(&batch, 0, sizeof batch); /* kernels read a little beyond the last pair */
    for (int k = 0; k < d; k++) {
        vector[k] = measured->vector[k];
    }
    while (batch.next < slab->n_hits) {
        const int32_t first = batch.next;
        fill(recheck, slab, &batch);
        hs_measured_find(recheck->call->kernel, &scene->metric, vectors != NULL, measured);
        if (distance != NULL) {
            hs_restore_distances(measured->distance, measured->n, unscale);
            hs_keep_all_within(measured->distance, measured->n, options->cutoff,
                               options->inclusive);
            memcpy(distance + first, measured->distance, (size_t)measured->n * sizeof *distance);
        }
        if (vectors != NULL) {
            hs_restore_vectors(vectors + (int64_t)first * d, vector, batch.sign, measured->n, d,
                               unscale);
        }
    }
}

/*
 * The hits of a slab as pairs: i and j by the kernel that writes those of a search,
 * S, and the measures. The kernel writes a little beyond the last pair. Where
 * that is none of ours, in arrays of the caller, it writes to the slab, and the pairs are copied.
 */

/* The hits as point numbers. */
static hs_hits
hits_by_number(const hs_recheck *recheck, hs_slab_hits *slab)
{
    const hs_listing *listing = &recheck->list->listing;
    const hs_hits     hits = {.n = slab->n_bundles,
                              .point = slab->point,
                              .end = slab->hits_end,
                              .label = recheck->numbers ? slab->hits : slab->number};
    for (int32_t b = 0; !recheck->numbers && b < slab->n_bundles; b++) {
        slab->point[b] = listing->order[slab->bundles[b].point];
    }
    for (int32_t h = 0; !recheck->numbers && h < slab->n_hits; h++) {
        slab->number[h] = listing->order[slab->hits[h]];
    }
    return hits;
}

/* n numbers to every `step`-th index from `to` on. */
HS_ALWAYS_INLINE void
copy_numbers(const int32_t *numbers, int32_t n, int index_bytes, const int step, void *to)
{
    if (to == NULL) {
        return;
    }
    if (index_bytes == 4 && step == 1) {
        memcpy(to, numbers, (size_t)n * sizeof *numbers);
    } else if (index_bytes == 4) {
        for (int32_t h = 0; h < n; h++) {
            ((int32_t *)to)[(int64_t)h * step] = numbers[h];
        }
    } else {
        for (int32_t h = 0; h < n; h++) {
            ((int64_t *)to)[(int64_t)h * step] = numbers[h];
        }
    }
}

static void
put_indices(const hs_recheck *recheck, hs_slab_hits *slab)
{
    const hs_kernel *kernel = recheck->call->kernel;
    const hs_output *output = recheck->output;
    const hs_hits    hits = hits_by_number(recheck, slab);
    const int        bytes = output->index_bytes;
    char            *both = recheck_column(recheck, HS_WANT_BOTH, slab->at);
    void            *i = recheck_column(recheck, HS_WANT_I, slab->at);
    void            *j = recheck_column(recheck, HS_WANT_J, slab->at);
    if (both == NULL && i == NULL && j == NULL) {
        return;
    }
    if (both == NULL && !output->fixed) {
        (bytes == 8 ? kernel->emit_int64 : kernel->emit_int32)(&hits, i, j);
        return;
    }
    kernel->emit_int32(&hits, slab->i, slab->j);
    copy_numbers(slab->i, slab->n_hits, bytes, 1, i);
    copy_numbers(slab->j, slab->n_hits, bytes, 1, j);
    copy_numbers(slab->i, slab->n_hits, bytes, 2, both);
    copy_numbers(slab->j, slab->n_hits, bytes, 2, both == NULL ? NULL : both + bytes);
}

/* Where the hits of a bundle begin. */
HS_ALWAYS_INLINE int32_t
begin_of(const hs_slab_hits *slab, int32_t t)
{
    return t > 0 ? slab->hits_end[t - 1] : 0;
}

/* S of the hits of one bundle; returns whether a number does not fit. counts: NULL: as if no point
 * had any. */
HS_ALWAYS_INLINE bool
put_of_bundle(const hs_recheck *recheck, const hs_slab_hits *slab, int32_t t, const int64_t *counts,
              const int d, const int m, int32_t *to)
{
    const hs_listing *listing = &recheck->list->listing;
    const int32_t    *order = listing->order;
    const int32_t    *image = recheck_image(recheck, slab, t);
    const int64_t     a = slab->bundles[t].point;
    const int32_t     number = order[a];
    uint64_t          of_a[HS_MAX_DIM] = {0};
    int64_t           beyond = 0;
    for (int r = 0; r < m; r++) { /* modulo 2^64: exact, for the sum fits */
        of_a[r] = image == NULL ? 0 : (uint64_t)(int64_t)image[r];
        of_a[r] += counts == NULL ? 0 : (uint64_t)counts[a * m + r];
    }
    for (int32_t h = begin_of(slab, t); h < slab->hits_end[t]; h++) {
        const int64_t  b = slab->hits[h];
        const uint64_t turn = number > order[b] ? UINT64_MAX : 0; /* -x is (x ^ ~0) + 1 */
        for (int r = 0; r < m; r++) {
            const uint64_t shift = of_a[r] - (counts == NULL ? 0 : (uint64_t)counts[b * m + r]);
            const int64_t  value = (int64_t)((shift ^ turn) - turn);
            beyond |= value ^ (int32_t)value;
            to[(int64_t)h * d + recheck->vector_of_row[r]] = (int32_t)value;
        }
    }
    return beyond != 0;
}

/* The first point of the first pair of the bundle whose S does not fit; there is one. */
static int64_t
first_beyond(const hs_recheck *recheck, const hs_slab_hits *slab, int32_t t)
{
    const hs_listing *listing = &recheck->list->listing;
    const int64_t     a = slab->bundles[t].point;
    for (int32_t h = begin_of(slab, t);; h++) {
        HS_ASSERT(h < slab->hits_end[t]);
        const int64_t b = slab->hits[h];
        const bool    turned = listing->order[a] > listing->order[b];
        int64_t       shift[HS_MAX_DIM];
        recheck_shift(recheck, a, b, recheck_image(recheck, slab, t), shift);
        for (int r = 0; r < recheck->m; r++) {
            const int64_t value = turned ? (int64_t)(0 - (uint64_t)shift[r]) : shift[r];
            if (value != (int32_t)value) {
                return listing->order[turned ? b : a];
            }
        }
    }
}

/* S, zero over open box vectors; where only sorting needs it, the images alone, which sort as S
 * does and always fit. */
static void
put_shifts(const hs_recheck *recheck, hs_slab_hits *slab)
{
    const bool     images_only = !(recheck->call->options.want & HS_WANT_SHIFT);
    const int64_t *counts = images_only ? NULL : recheck->counts;
    const bool     any = slab_has_images(recheck, slab) || counts != NULL;
    const int      d = recheck->d, m = recheck->m;
    int32_t       *to = recheck_column(recheck, HS_WANT_SHIFT, slab->at);
    if (m < d || !any) {
        memset(to, 0, (size_t)slab->n_hits * (size_t)d * sizeof *to);
    }
    for (int32_t t = 0; any && t < slab->n_bundles; t++) {
        const bool beyond = d == 3 && m == 3 ? put_of_bundle(recheck, slab, t, counts, 3, 3, to)
                                             : put_of_bundle(recheck, slab, t, counts, d, m, to);
        if (beyond) {
            slab->status = HS_ERR_SHIFT_RANGE;
            slab->failed_point = first_beyond(recheck, slab, t);
            return;
        }
    }
}

/* Writes the hits. */
static void
recheck_put(const hs_recheck *recheck, hs_slab_hits *slab)
{
    if (slab->n_hits == 0) {
        return;
    }
    if (!(recheck->writes && recheck_write(recheck, slab))) {
        put_indices(recheck, slab);
        if (recheck->measures) {
            recheck_measure(recheck, slab);
        }
    }
    if (recheck->output->columns & HS_WANT_SHIFT) {
        put_shifts(recheck, slab);
    }
}

/* Work between two polls, in pairs: a few milliseconds. */
#define POLL_WORK (INT64_C(1) << 20)
/* A decision by integers takes as long as so many pairs, and d or D of a pair as so many. */
#define INTEGER_WORK 1000
#define MEASURE_WORK 8

/* What the threads share. */
typedef struct recheck_job {
    hs_recheck *recheck;
    int64_t     n_plain, n_slabs; /* slabs: each ends where images begin, or is full */
    int64_t     in_range;         /* of them */
} recheck_job;

/* What one thread works with. */
typedef struct worker {
    hs_committer  committer;
    recheck_job  *job;
    hs_options    options; /* with this thread's poll */
    hs_recheck    recheck; /* the job's, with this thread's output */
    hs_slab_hits *slab;    /* owned */
    hs_output     found;   /* owned; pairs that wait for their turn */
    int64_t       work;    /* since the last poll */
    hs_counters   done;
} worker;

/* Finds the hits of a slab. */
static void
recheck_slab(const hs_recheck *recheck, hs_slab_hits *slab)
{
    const bool shifted = slab_has_images(recheck, slab);
    hs_slab    listed = {
           .ndim = recheck->d,
           .y = recheck->y,
           .offset = shifted ? recheck->offset : NULL,
           .j = recheck->list->listing.j,
           .bundles = slab->bundles,
           .first = slab->first,
           .end = slab->first + slab->n,
           .numbers = recheck->numbers,
           .limit = shifted ? recheck->shifted : recheck->plain,
           .hits = slab->hits,
           .point = slab->point,
           .hits_end = slab->hits_end,
           .open = slab->open,
    };
    recheck->call->kernel->recheck(&listed);
    slab->n_bundles = listed.n_bundles;
    slab->n_hits = listed.n_hits;
    slab->n_open = listed.n_open;
    if (slab->n_open > 0) {
        recheck_decide_unsure(recheck, slab);
    }
}

/* The first bundle that ends behind a pair of the list. */
static int64_t
bundle_of(const hs_listing *listing, int64_t pair)
{
    int64_t first = 0, end = listing->n_bundles;
    while (first < end) {
        const int64_t middle = first + (end - first) / 2;
        if (listing->bundles[middle].end <= pair) {
            first = middle + 1;
        } else {
            end = middle;
        }
    }
    return first;
}

static int64_t
slabs_of(int64_t n_pairs)
{
    return (n_pairs + HS_SLAB - 1) / HS_SLAB;
}

/* Pairs of slab s. */
static void
cut_slab(const recheck_job *job, int64_t s, hs_slab_hits *slab)
{
    const hs_listing *listing = &job->recheck->list->listing;
    const bool        plain = s < job->n_plain;
    const int64_t     end = plain ? listing->n_plain : listing->n_pairs;
    slab->first = plain ? s * HS_SLAB : listing->n_plain + (s - job->n_plain) * HS_SLAB;
    slab->n = (int32_t)(end - slab->first < HS_SLAB ? end - slab->first : HS_SLAB);
    slab->bundles = listing->bundles + bundle_of(listing, slab->first);
    slab->status = HS_OK;
    slab->stages = (hs_stages){0};
}

static void
note_slab(worker *me)
{
    const hs_slab_hits *slab = me->slab;
    me->done.candidates += slab->n;
    me->done.ambiguous += slab->n_open;
    me->done.by_float64 += slab->stages.by_float64;
    me->done.by_double_word += slab->stages.by_double_word;
    me->done.by_integers += slab->stages.by_integers;
    me->work += slab->n + INTEGER_WORK * slab->stages.by_integers +
                (me->recheck.measures ? MEASURE_WORK * (int64_t)slab->n_hits : 0);
}

/* Adds the hits of slab s to the thread's output. */
static hs_status
do_slab(worker *me, int64_t s)
{
    const hs_listing *listing = &me->job->recheck->list->listing;
    hs_output        *output = me->recheck.output;
    hs_slab_hits     *slab = me->slab;
    cut_slab(me->job, s, slab);
    recheck_slab(&me->recheck, slab);
    note_slab(me);
    const double done = (double)(slab->first + slab->n) / (double)listing->n_pairs;
    hs_status    status = HS_OK;
    slab->at = output->n_pairs;
    if (!output->fixed) {
        status = hs_output_reserve(output, slab->n_hits, output == &me->found ? 0.0 : done);
    }
    if (status == HS_OK && (!output->fixed || slab->at + slab->n_hits <= output->capacity)) {
        recheck_put(&me->recheck, slab);
        status = slab->status;
    }
    if (status == HS_OK) {
        output->n_pairs += slab->n_hits;
    } else if (status == HS_ERR_SHIFT_RANGE) {
        me->committer.failure.row = slab->failed_point;
    }
    if (status == HS_OK && me->work > POLL_WORK) {
        me->work = 0;
        status = hs_poll(&me->options, done);
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
do_range(void *context, int64_t range)
{
    worker            *me = context;
    const recheck_job *job = me->job;
    const int64_t      first = range * job->in_range, left = job->n_slabs - first;
    const int64_t      end = first + (left < job->in_range ? left : job->in_range);
    hs_status          status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = do_slab(me, s);
    }
    return status == HS_OK ? hs_commit(&me->committer, (double)end / (double)job->n_slabs, true)
                           : status;
}

/* A worker that writes to the output itself. */
static hs_status
open_alone(recheck_job *job, worker *me)
{
    hs_call *call = job->recheck->call;
    me->job = job;
    me->options = call->options;
    me->recheck = *job->recheck;
    me->slab = hs_alloc(&call->account, HS_FOR_CANDIDATES, 1, sizeof *me->slab);
    if (me->recheck.writes) {
        me->recheck.of_a = hs_alloc(&call->account, HS_FOR_CANDIDATES, 1, sizeof *me->recheck.of_a);
    }
    return me->slab == NULL || (me->recheck.writes && me->recheck.of_a == NULL) ? HS_ERR_MEMORY
                                                                                : HS_OK;
}

static void
free_scratch(worker *me)
{
    hs_account *account = &me->job->recheck->call->account;
    hs_free(account, me->recheck.of_a);
    hs_free(account, me->slab);
}

static hs_status
open_worker(void *context, void *place)
{
    recheck_job     *job = context;
    worker          *me = place;
    hs_recheck      *own = &me->recheck;
    const hs_status  status = open_alone(job, me);
    const hs_output *target = job->recheck->output;
    hs_output_init(NULL, target->ndim, target->columns, target->index_bytes, &me->found);
    me->committer.options = &me->options;
    me->committer.pairs = &me->found;
    own->output = &me->found;
    return status;
}

static void
close_worker(void *context, void *place)
{
    worker  *me = place;
    hs_call *call = ((recheck_job *)context)->recheck->call;
    hs_call_add_counters(call, &me->done);
    hs_output_free(&me->found);
    free_scratch(me);
}

static hs_status
run_together(recheck_job *job, hs_failure *failure)
{
    hs_crew crew = {.call = job->recheck->call,
                    .job = job,
                    .worker_size = sizeof(worker),
                    .open = open_worker,
                    .close = close_worker,
                    .n_ranges = (job->n_slabs + job->in_range - 1) / job->in_range,
                    .search = do_range,
                    .output = job->recheck->output};
    return hs_crew_run(&crew, failure);
}

static hs_status
run_alone(recheck_job *job, hs_failure *failure)
{
    hs_call  *call = job->recheck->call;
    worker    me = {.committer.failure = HS_NO_FAILURE};
    hs_status status = open_alone(job, &me);
    for (int64_t s = 0; s < job->n_slabs && status == HS_OK; s++) {
        status = do_slab(&me, s);
    }
    if (status == HS_ERR_SHIFT_RANGE) {
        failure->row = me.committer.failure.row;
    }
    hs_call_add_counters(call, &me.done);
    free_scratch(&me);
    return status;
}

static void
free_recheck(hs_recheck *recheck)
{
    hs_account *account = &recheck->call->account;
    hs_free(account, recheck->few);
    hs_free(account, recheck->lagging);
    hs_free(account, recheck->lag);
    hs_free(account, recheck->image);
    hs_free(account, recheck->x);
    hs_free(account, recheck->counts);
    hs_free(account, recheck->offset);
    hs_free(account, recheck->y);
}

/* Writes all pairs within the cutoff to the output. */
static hs_status
recheck_run(hs_recheck *recheck, hs_failure *failure)
{
    const hs_listing *listing = &recheck->list->listing;
    const bool        more = recheck->measures || (recheck->output->columns & HS_WANT_SHIFT);
    recheck_job       job = {.recheck = recheck, .n_plain = slabs_of(listing->n_plain)};
    job.n_slabs = job.n_plain + slabs_of(listing->n_pairs - listing->n_plain);
    job.in_range = 1 + HS_RANGE_BYTES / (1 + HS_SLAB * hs_output_bytes_per_pair(recheck->output));
    recheck->shared = recheck->call->team != NULL && job.n_slabs > job.in_range;
    recheck->numbers = !more && hs_slab_has_numbers(recheck->d);
    hs_status status = recheck_prepare(recheck);
    if (status == HS_OK && recheck->measures) {
        status = hs_recheck_open_scene(recheck, failure);
    }
    if (status == HS_OK && !(recheck->given.cutoff == 0.0 && !recheck->given.inclusive)) {
        status = recheck->shared ? run_together(&job, failure) : run_alone(&job, failure);
    }
    free_recheck(recheck);
    return status;
}

/* From a list and its last step to a result: unsorted as found, or sorted at the
 * end. */

/* The columns that are found: those wanted, and what putting them in order needs beside them. */
static unsigned
columns_to_sort(const hs_recheck *recheck)
{
    const bool images = recheck->list->listing.images.n > 0;
    return (recheck->call->options.want & ~(unsigned)HS_WANT_BOTH) | HS_WANT_I | HS_WANT_J |
           (images ? HS_WANT_SHIFT : 0);
}

static hs_status
find_sorted(hs_recheck *recheck, hs_output *output, hs_failure *failure)
{
    hs_call  *call = recheck->call;
    hs_output found;
    hs_output_init(&call->account, recheck->d, columns_to_sort(recheck), 4, &found);
    recheck->output = &found;
    hs_status status = recheck_run(recheck, failure);
    if (status == HS_OK) {
        status = hs_sort_pairs(call, 0, recheck->now->points.n, &found, output);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)found.n_pairs;
    }
    hs_output_free(&found);
    return status;
}

static hs_status
find_pairs(hs_recheck *recheck, hs_output *output, hs_failure *failure)
{
    const hs_call *call = recheck->call;
    hs_status      status;
    if (call->options.sorted) {
        status = find_sorted(recheck, output, failure);
    } else {
        recheck->output = output;
        status = recheck_run(recheck, failure);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)output->n_pairs);
    }
    hs_call_tell_limit(call, status, failure);
    return hs_pairs_conclude(output, status, failure);
}

static void
set_recheck(const hs_verlet *list, hs_call *call, hs_recheck *recheck)
{
    const hs_frame *now = &list->frames[list->now];
    double          rows[HS_MAX_DIM][HS_MAX_DIM];
    memset(recheck, 0, sizeof *recheck);
    recheck->list = list;
    recheck->now = now;
    recheck->call = call;
    recheck->d = now->points.ndim;
    recheck->m = hs_frame_periodic(now, recheck->vector_of_row);
    recheck->measures = call->options.want & (HS_WANT_DISTANCE | HS_WANT_VECTOR);
    for (int r = 0; r < recheck->m; r++) {
        memcpy(rows[r], now->box.rows[recheck->vector_of_row[r]], sizeof rows[r]);
    }
    hs_metric_init(&recheck->given, recheck->d, recheck->m, (const double(*)[HS_MAX_DIM])rows,
                   list->cutoff, call->options.inclusive);
}

hs_status
hs_recheck_find(const hs_verlet *list, hs_pairs *pairs, hs_failure *failure)
{
    hs_recheck       recheck;
    hs_call         *call = &pairs->call;
    const hs_points *points = &list->frames[list->now].points;
    if (call->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_call_gather(call, points->n);
    hs_pairs_open(pairs, points->ndim);
    set_recheck(list, call, &recheck);
    const hs_status status = find_pairs(&recheck, &pairs->output, failure);
    hs_scene_free(&call->account, &recheck.scene);
    return status;
}
