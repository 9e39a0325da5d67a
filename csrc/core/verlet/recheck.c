/* SPDX-License-Identifier: BSD-3-Clause */
#include "pair_list.h"
#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"

#include <math.h>
#include <string.h>

/* recheck.c: slabs of the list, one after the other by one thread, or several at once by threads
 * that write what they find in turn. */

/* Points ahead whose numbers are fetched: they lie anywhere in memory. */
#define POINTS_AHEAD 16

/*
 * Everything that slabs share, read only while they work. Points are those of the list: in the cell
 * order of the step it was built for.
 */
typedef struct checking {
    const hs_verlet *list;   /* borrowed */
    const hs_frame  *now;    /* the list's */
    hs_call         *call;   /* borrowed */
    hs_output       *output; /* borrowed */
    bool             shared; /* each thread has an output of its own first */
    int              d, m;
    int              vector_of_row[HS_MAX_DIM];
    hs_metric        given;  /* on points and box vectors as given */
    void            *memory; /* owned; of all arrays below: in whole pages where there is much */
    int64_t         *counts; /* m a point, as those of the list, jumps included */
    double           most_counts;    /* the largest of them, of either sign */
    float           *y;              /* kernels/slab.h */
    float           *offset;         /* of each image */
    hs_thresholds    plain, shifted; /* for pairs without and with an image */
    bool             numbers;        /* point numbers are all that is wanted of a hit */
    bool             measures;       /* d or D are wanted */
    /* What pairs are decided and measured by: the scene of a search, or if none is needed `given`.
     * The metric's shift from a to b is image + lead_a - lead_b. */
    hs_scene         scene;
    const hs_metric *metric;
    double *const   *columns;    /* of the points; NULL: they are read where they are */
    int64_t         *image;      /* m for each image */
    int64_t         *lead;       /* or `counts`; m a point; NULL: all are zero */
    bool             writes;     /* d and D are written by the kernel's writer. Then: */
    hs_candidate    *candidates; /* the points, moved by -lead */
    bool             are_fine;   /* hs_write.is_fine */
    int64_t          in_range;   /* slabs */
} checking;

/* Consecutive pairs, all with or all without an image, and their hits. */
typedef struct slab_hits {
    hs_slab   of;
    bool      has_images;
    hs_stages stages;
    /* Places b, or where recheck->numbers says so the caller's numbers of them, and those of a for
     * each bundle; and where the hits of each bundle end. */
    int32_t      hits[HS_SLAB + HS_PADDING], point[HS_SLAB], hits_end[HS_SLAB];
    hs_open_pair open[HS_SLAB + 1];
    int32_t      number[HS_SLAB + HS_PADDING]; /* of b */
    int32_t      ends[2][HS_SLAB + HS_PADDING];
    hs_measured  batch; /* of hits */
    /* Of the points a of the bundles, as kernels/write.h wants them: */
    double  p[HS_WRITE_MOST_DIM][HS_SLAB];
    int32_t turns[HS_WRITE_MOST_DIM][HS_SLAB];
} slab_hits;

/* The points of a step in the order of the list, as floats, and the thresholds that hold for
 * them. */

#define UNIT 0x1p-53
/* Points that the middle of all is guessed from. */
#define SAMPLE 128
/* Cutoffs between 2^-20 and 2^20 are not scaled: float32 has room for their squares. */
#define ORDINARY_EXPONENT 20

/* Point number `a` of the list in the frame of its images, in float64: r - count h. */
HS_ALWAYS_INLINE void
place_of(const checking *recheck, const hs_real real, int64_t a, const int d, const int m,
         double *z)
{
    const int64_t i = recheck->list->listing.order[a];
    for (int k = 0; k < d; k++) {
        z[k] = hs_frame_entry(recheck->now->points.data, real, i * d + k);
    }
    for (int r = 0; r < m; r++) {
        const double count = (double)recheck->counts[a * m + r];
        for (int k = 0; k < d; k++) {
            z[k] -= count * recheck->given.rows[r][k];
        }
    }
}

/* Rows of floats; returns the largest, infinity or NaN included. */
HS_ALWAYS_INLINE double
put_floats(const checking *recheck, hs_scale scale, const double *centre, const hs_real real,
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
            HS_PREFETCH((const char *)recheck->now->points.data +
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
put_points(const checking *recheck, hs_scale scale)
{
    const hs_real real = recheck->now->points.real;
    const int     d = recheck->d, m = recheck->m;
    const bool    narrow = real == HS_FLOAT32;
    const int64_t n = recheck->now->points.n, step = (n + SAMPLE - 1) / SAMPLE;
    double        lower[HS_MAX_DIM] = {0.0}, upper[HS_MAX_DIM] = {0.0}, centre[HS_MAX_DIM];
    for (int64_t a = 0; a < n; a += step) { /* floats lose least around the middle */
        place_of(recheck, real, a, d, m, centre);
        for (int k = 0; k < d; k++) {
            lower[k] = a == 0 ? centre[k] : hs_smaller(centre[k], lower[k]);
            upper[k] = a == 0 ? centre[k] : hs_larger(centre[k], upper[k]);
        }
    }
    for (int k = 0; k < d; k++) {
        centre[k] = 0.5 * lower[k] + 0.5 * upper[k];
    }
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

/*
 * Thresholds of filter.h, where a candidate is y_j and a point is q = y_i - offset, which
 * it knows to be rounded to a float. Before that, y_i and the offset were rounded, too (u of each),
 * and the offset was summed in float64. Images become floats here.
 */
static void
set_thresholds(checking *recheck, hs_scale scale, double largest)
{
    const hs_listing *listing = &recheck->list->listing;
    const int         stride = hs_slab_stride(recheck->d);
    const double      cutoff = hs_scale_apply(scale, recheck->given.cutoff);
    const double      u = 0x1p-24, tiny = 0x1p-100; /* more than scaling and flushing lose */
    const int         m = recheck->m;
    double            error = tiny, rows = 0.0;
    double            offset = 0.0, size = 0.0; /* largest component; sum of absolute terms */
    for (int r = 0; r < m; r++) {
        double longest = 0.0;
        for (int k = 0; k < recheck->d; k++) {
            longest = hs_larger(fabs(recheck->given.rows[r][k]), longest);
        }
        rows += longest;
    }
    if (m > 0) { /* coordinates are counted off by m products and sums */
        error += (2 * m + 4) * UNIT *
                 (hs_scale_apply(scale, recheck->now->largest) +
                  recheck->most_counts * hs_scale_apply(scale, rows));
    }
    recheck->plain = hs_thresholds_of(recheck->d, cutoff, 2.0 * largest, error);
    for (int64_t image = 0; image < listing->n_images; image++) {
        for (int k = 0; k < stride; k++) {
            double sum = 0.0, terms = 0.0;
            for (int r = 0; k < recheck->d && r < m; r++) {
                const double term = listing->images[image * m + r] *
                                    hs_scale_apply(scale, recheck->given.rows[r][k]);
                sum += term;
                terms += fabs(term);
            }
            recheck->offset[image * stride + k] = (float)sum;
            offset = hs_larger(fabs((double)(float)sum), offset);
            size = hs_larger(terms, size);
        }
    }
    const double more = u * (largest + offset) * (1.0 + 0x1p-20) + (2 * m + 2) * UNIT * size;
    const double extent = (2.0 * largest + offset) * (1.0 + 0x1p-20);
    recheck->shifted = hs_thresholds_of(recheck->d, cutoff, extent, error + more);
}

/*
 * Pairs of a slab: they are decided as a search decides them, where float32 cannot tell, and
 * measured as a search does it, a batch at a time, so that d and D have its bits.
 */

/* Coordinate k of a point, for the metric. */
HS_ALWAYS_INLINE double
coordinate_of(const checking *recheck, int64_t a, int k, const int d)
{
    const hs_frame *now = recheck->now;
    const int64_t   i = recheck->list->listing.order[a];
    return recheck->columns != NULL ? recheck->columns[k][i]
                                    : hs_frame_entry(now->points.data, now->points.real, i * d + k);
}

/* The metric's shift along row r, from the point of a bundle to that at place b. */
HS_ALWAYS_INLINE int64_t
shift_between(const checking *recheck, const slab_hits *slab, const hs_bundle *of, int64_t b, int r)
{
    const int m = recheck->m;
    uint64_t  shift = 0; /* modulo 2^64: exact, for the sum fits */
    if (slab->has_images) {
        shift += (uint64_t)recheck->image[(int64_t)of->image * m + r];
    }
    if (recheck->lead != NULL) {
        shift += (uint64_t)recheck->lead[(int64_t)of->point * m + r] -
                 (uint64_t)recheck->lead[b * m + r];
    }
    return (int64_t)shift;
}

/* n pairs to the batch: of these bundles, and with the points at these places. */
HS_ALWAYS_INLINE void
fill_in(const checking *recheck, slab_hits *slab, const int32_t *bundle, const int32_t *place,
        int32_t n, const int d)
{
    hs_measured *batch = &slab->batch;
    batch->n = n;
    batch->is_shifted = batch->is_wide = false;
    for (int32_t e = 0; e < n;) {
        const int32_t    t = bundle[e];
        const hs_bundle *of = &slab->of.bundles[t];
        double           p[HS_MAX_DIM];
        for (int k = 0; k < d; k++) {
            p[k] = coordinate_of(recheck, of->point, k, d);
        }
        for (; e < n && bundle[e] == t; e++) {
            for (int k = 0; k < d; k++) {
                batch->p[k][e] = p[k];
                batch->q[k][e] = coordinate_of(recheck, place[e], k, d);
            }
            for (int r = 0; r < recheck->m; r++) {
                hs_measured_shift(batch, e, r, shift_between(recheck, slab, of, place[e], r));
            }
        }
    }
    const size_t padding = HS_BATCH_PADDING * sizeof(double); /* which kernels read */
    for (int k = 0; k < d; k++) {
        memset(batch->p[k] + n, 0, padding);
        memset(batch->q[k] + n, 0, padding);
        memset(batch->times[k] + n, 0, padding);
    }
}

static void
fill(const checking *recheck, slab_hits *slab, const int32_t *bundle, const int32_t *place,
     int32_t n)
{
    switch (recheck->d) {
    case 2: fill_in(recheck, slab, bundle, place, n, 2); break;
    case 3: fill_in(recheck, slab, bundle, place, n, 3); break;
    default: fill_in(recheck, slab, bundle, place, n, recheck->d);
    }
}

/* Decides the hits of a slab that float32 cannot tell, of which there are some, and takes those
 * that are beyond the cutoff from the hits. */
static void
decide_unsure(const checking *recheck, slab_hits *slab)
{
    const int32_t n_open = slab->of.n_open;
    int32_t       gone[HS_SLAB], bundle[HS_BATCH], place[HS_BATCH], n_gone = 0;
    uint8_t       within[HS_IN_BATCH];
    for (int32_t first = 0; first < n_open; first += HS_BATCH) {
        const hs_open_pair *open = slab->open + first;
        const int32_t       n = n_open - first < HS_BATCH ? n_open - first : HS_BATCH;
        for (int32_t e = 0; e < n; e++) {
            bundle[e] = open[e].bundle;
            place[e] = slab->of.j[slab->of.first + open[e].pair];
        }
        fill(recheck, slab, bundle, place, n);
        hs_measured_decide(recheck->call->kernel, recheck->metric, &slab->batch, within,
                           &slab->stages);
        for (int32_t e = 0; e < n; e++) {
            gone[n_gone] = open[e].at;
            n_gone += !within[e];
        }
    }
    for (int32_t t = 0, h = 0, g = 0; n_gone > 0 && t < slab->of.n_bundles; t++) {
        for (; h < slab->hits_end[t]; h++) {
            slab->hits[h - g] = slab->hits[h];
            g += g < n_gone && gone[g] == h;
        }
        slab->hits_end[t] -= g;
    }
    slab->of.n_hits -= n_gone;
}

/* d and D of all hits, which are the next pairs of the output. */
static void
measure(const checking *recheck, slab_hits *slab, const hs_output *output)
{
    const hs_options *options = &recheck->call->options;
    const hs_scale    unscale = hs_measures_unscale(&recheck->scene);
    const int32_t    *order = recheck->list->listing.order;
    const int         d = recheck->d;
    hs_measured      *batch = &slab->batch;
    double           *distance = hs_output_next(output, HS_WANT_DISTANCE);
    double           *vectors = hs_output_next(output, HS_WANT_VECTOR);
    double           *vector[HS_MAX_DIM], sign[HS_BATCH];
    int32_t           bundle[HS_BATCH], of = 0; /* of the next hit */
    for (int k = 0; k < d; k++) {
        vector[k] = batch->vector[k];
    }
    for (int32_t first = 0; first < slab->of.n_hits; first += batch->n) {
        const int32_t  left = slab->of.n_hits - first, n = left < HS_BATCH ? left : HS_BATCH;
        const int32_t *hits = slab->hits + first;
        for (int32_t e = 0; e < n; e++) {
            while (slab->hits_end[of] <= first + e) {
                of++;
            }
            bundle[e] = of;
        }
        for (int32_t e = 0; vectors != NULL && e < n; e++) {
            /* -1 where b has the lower number: a branch would be mispredicted. */
            const int32_t below = order[hits[e]] - order[slab->of.bundles[bundle[e]].point];
            sign[e] = 1 - 2 * (int)((uint32_t)below >> 31);
        }
        fill(recheck, slab, bundle, hits, n);
        hs_measured_find(recheck->call->kernel, recheck->metric, vectors != NULL, batch);
        if (distance != NULL) {
            hs_restore_distances(batch->distance, n, unscale);
            hs_keep_all_within(batch->distance, n, options->cutoff, options->inclusive);
            memcpy(distance + first, batch->distance, (size_t)n * sizeof *distance);
        }
        if (vectors != NULL) {
            hs_restore_vectors(vectors + (int64_t)first * d, vector, sign, n, d, unscale);
        }
    }
}

/*
 * The scene of a search of these points. Its X = r - w B; images are for z = r - count A. So S =
 * image + count_i - count_j over A is, for X, image + lead_i - lead_j over B with lead = count - w.
 * For points as given, w is 0.
 */

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

/* Leads of the points, unless all are zero, and images, in the metric of the scene. */
static void
set_shifts(checking *recheck)
{
    const hs_scene   *scene = &recheck->scene;
    const hs_listing *listing = &recheck->list->listing;
    const bool        as_given = recheck->lead == NULL;
    const int         m = recheck->m;
    const int64_t     n = recheck->now->points.n;
    int64_t           over[HS_MAX_DIM][HS_MAX_DIM] = {{0}}, shift[HS_MAX_DIM];
    int64_t           any = 0;
    /* over[l][r]: how many times row r of B is in given box vector l. B is diagonal here, so that
     * this is an entry over a period: a quotient of doubles that is an integer, hence a double;
     * here modulo 2^64. */
    for (int r = 0; r < m; r++) {
        over[r][r] = 1;
    }
    for (int k = 0; !as_given && k < recheck->d; k++) {
        const int r = scene->lattice.row_of_axis[k];
        for (int l = 0; r >= 0 && l < m; l++) {
            const double times =
                fmod(scene->lattice.scaled[l][k] / scene->lattice.rows[r][k], 0x1p64);
            const uint64_t size = (uint64_t)fabs(times);
            over[l][r] = (int64_t)(times < 0.0 ? 0 - size : size);
        }
    }
    for (int64_t number = 0; number < listing->n_images; number++) {
        for (int r = 0; r < m; r++) {
            shift[r] = listing->images[number * m + r];
        }
        reduce_shift(m, (const int64_t(*)[HS_MAX_DIM])over, shift, recheck->image + number * m);
    }
    if (as_given) {
        recheck->lead = m > 0 ? recheck->counts : NULL;
        return;
    }
    for (int64_t a = 0; a < n; a++) {
        int64_t *lead = recheck->lead + a * m;
        reduce_shift(m, (const int64_t(*)[HS_MAX_DIM])over, recheck->counts + a * m, lead);
        for (int r = 0; r < m; r++) {
            const int64_t turns = hs_turns_get(&scene->turns, r, recheck->list->listing.order[a]);
            lead[r] = (int64_t)((uint64_t)lead[r] - (uint64_t)turns);
            any |= lead[r];
        }
    }
    if (any == 0) {
        recheck->lead = NULL;
    }
}

/* Leads and images up to here: their sums fit. */
#define MOST_SHIFT (INT64_C(1) << 29)

static bool
are_small(const int64_t *shifts, int64_t n)
{
    uint64_t any = 0;
    for (int64_t e = 0; shifts != NULL && e < n; e++) {
        any |= (uint64_t)shifts[e] + (uint64_t)MOST_SHIFT;
    }
    return any < 2 * (uint64_t)MOST_SHIFT;
}

/*
 * Whether hits are measured while they are written, by the writer of a search (kernels/write.h), if
 * all leads and images are small. Its shift is the one that the metric multiplies. It would go by
 * the sign of that, which is not the sign of S, for a point that may be its own neighbour. B is
 * diagonal here.
 */
static bool
can_write(const checking *recheck)
{
    const hs_scene  *scene = &recheck->scene;
    const hs_metric *metric = &scene->metric;
    const int        d = recheck->d, m = recheck->m;
    if (recheck->call->kernel->write == NULL || d < 2 || d > HS_WRITE_MOST_DIM ||
        scene->keeps_originals || !metric->floats_usable) {
        return false;
    }
    for (int r = 0; r < m; r++) {
        double longest = 0.0;
        for (int k = 0; k < d; k++) {
            longest = hs_larger(fabs(metric->rows[r][k]), longest);
        }
        if (!(longest > metric->cutoff)) {
            return false;
        }
    }
    return true;
}

/* The points of the scene, and as candidates in the order of the list. */
static void
set_points(checking *recheck)
{
    const hs_scene  *scene = &recheck->scene;
    const int32_t   *order = recheck->list->listing.order;
    const int64_t    n = recheck->now->points.n;
    const int        m = recheck->m;
    const hs_halving by = hs_write_halving(scene->metric.cutoff);
    recheck->columns = scene->keeps_originals ? scene->originals : scene->cloud.x;
    recheck->writes = recheck->candidates != NULL && are_small(recheck->lead, n * m) &&
                      are_small(recheck->image, recheck->list->listing.n_images * m);
    recheck->are_fine = true;
    for (int64_t a = 0; recheck->writes && a < n; a++) {
        double   q[HS_WRITE_MOST_DIM] = {0.0};
        int32_t  shift[HS_WRITE_MOST_DIM] = {0}, any = 0;
        hs_moved moved = {.is_fine = true};
        for (int k = 0; a + POINTS_AHEAD < n && k < recheck->d; k++) {
            HS_PREFETCH(recheck->columns[k] + order[a + POINTS_AHEAD]);
        }
        for (int k = 0; k < recheck->d; k++) {
            q[k] = scene->cloud.x[k][order[a]];
        }
        for (int r = 0; recheck->lead != NULL && r < m; r++) {
            shift[r] = (int32_t)-recheck->lead[a * m + r];
            any |= shift[r];
        }
        if (any != 0) {
            (void)hs_write_move(&scene->metric, by, shift, &moved);
        }
        recheck->are_fine &=
            hs_candidate_set(&recheck->candidates[a], q, by, &moved, order[a], shift);
        recheck->are_fine &= moved.is_fine;
    }
}

/*
 * The hits of a slab as the next pairs of an output that grows: i, j, d and D by the kernels of a
 * search, S from what was counted.
 */

/* Writes i, j, d and D; false: the writer cannot, and what it has written does not count. */
static bool
write_hits(const checking *recheck, slab_hits *slab, const hs_output *output)
{
    const bool shifted = slab->has_images || recheck->lead != NULL;
    const int  m = recheck->m;
    hs_write   write = {
          .ndim = recheck->d,
          .is_half = true,
          .is_measured = true,
          .is_shifted = shifted,
          .by_S = shifted,
          .is_fine = recheck->are_fine,
          .metric = recheck->metric,
          .candidates = recheck->candidates,
          .place = recheck->list->listing.order,
          .x_width = 1,
          .index_bytes = output->index_bytes,
          .i = hs_output_next(output, HS_WANT_I),
          .j = hs_output_next(output, HS_WANT_J),
          .distance = hs_output_next(output, HS_WANT_DISTANCE),
          .vector = hs_output_next(output, HS_WANT_VECTOR),
    };
    const hs_hits hits = {
        .n = slab->of.n_bundles, .point = slab->point, .end = slab->hits_end, .label = slab->hits};
    hs_measures_tell(&recheck->scene, &recheck->call->options, &write);
    for (int32_t t = 0; t < slab->of.n_bundles; t++) {
        const hs_bundle    *bundle = &slab->of.bundles[t];
        const int64_t       a = bundle->point;
        const hs_candidate *own = &recheck->candidates[a];
        slab->point[t] = own->number;
        for (int k = 0; k < recheck->d; k++) { /* halves that have not been moved are at hand */
            slab->p[k][t] = recheck->lead == NULL ? own->large[k] + own->small[k]
                                                  : recheck->scene.cloud.x[k][own->number];
        }
        for (int r = 0; shifted && r < m; r++) {
            const int64_t image = slab->has_images ? recheck->image[(int64_t)bundle->image * m + r]
                                                   : 0;
            const int64_t lead = recheck->lead != NULL ? recheck->lead[a * m + r] : 0;
            slab->turns[r][t] = (int32_t)(image + lead);
        }
    }
    for (int k = 0; k < recheck->d; k++) {
        write.p[k] = slab->p[k];
        write.x[k] = recheck->scene.cloud.x[k];
    }
    for (int r = 0; shifted && r < m; r++) {
        write.turns[r] = slab->turns[r];
        write.column[r] = r; /* S itself is not written */
    }
    memset(slab->hits + slab->of.n_hits, 0, HS_PADDING * sizeof *slab->hits);
    return recheck->call->kernel->write(&write, &hits);
}

static void
put_indices(const checking *recheck, slab_hits *slab, const hs_output *output)
{
    const hs_kernel *kernel = recheck->call->kernel;
    const int32_t   *order = recheck->list->listing.order;
    const int        bytes = output->index_bytes;
    char            *both = hs_output_next(output, HS_WANT_BOTH);
    const hs_hits    hits = {.n = slab->of.n_bundles,
                             .point = slab->point,
                             .end = slab->hits_end,
                             .label = recheck->numbers ? slab->hits : slab->number};
    if (!(output->columns & (HS_WANT_I | HS_WANT_J | HS_WANT_BOTH))) {
        return;
    }
    for (int32_t t = 0; !recheck->numbers && t < slab->of.n_bundles; t++) {
        slab->point[t] = order[slab->of.bundles[t].point];
    }
    for (int32_t h = 0; !recheck->numbers && h < slab->of.n_hits; h++) {
        slab->number[h] = order[slab->hits[h]];
    }
    if (output->columns & (HS_WANT_I | HS_WANT_J)) {
        kernel->emit(&hits, bytes, hs_output_next(output, HS_WANT_I),
                     hs_output_next(output, HS_WANT_J));
    }
    if (both != NULL) {
        kernel->emit(&hits, 4, slab->ends[0], slab->ends[1]);
        hs_put_indices(both, bytes, 2, slab->ends[0], 1, slab->of.n_hits);
        hs_put_indices(both + bytes, bytes, 2, slab->ends[1], 1, slab->of.n_hits);
    }
}

/* S of hits [begin, end), which are of bundle t; returns whether a number does not fit. counts:
 * NULL: as if no point had any. */
HS_ALWAYS_INLINE bool
put_of_bundle(const checking *recheck, const slab_hits *slab, int32_t t, int32_t begin, int32_t end,
              const int64_t *counts, const int d, const int m, int32_t *to)
{
    const hs_listing *listing = &recheck->list->listing;
    const int32_t    *order = listing->order;
    const int64_t     a = slab->of.bundles[t].point;
    const int32_t     number = order[a];
    const int64_t     image = (int64_t)slab->of.bundles[t].image * m;
    uint64_t          of_a[HS_MAX_DIM] = {0};
    int64_t           beyond = 0;
    for (int r = 0; r < m; r++) { /* modulo 2^64: exact, for the sum fits */
        of_a[r] = slab->has_images ? (uint64_t)(int64_t)listing->images[image + r] : 0;
        of_a[r] += counts == NULL ? 0 : (uint64_t)counts[a * m + r];
    }
    for (int32_t h = begin; h < end; h++) {
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

/* S, zero over open box vectors; where only sorting needs it, the images alone, which sort as S
 * does and always fit. HS_ERR_SHIFT_RANGE names the first point of the first pair whose S does
 * not. */
static hs_status
put_shifts(const checking *recheck, const slab_hits *slab, const hs_output *output,
           hs_failure *failure)
{
    const bool     images_only = !(recheck->call->options.want & HS_WANT_SHIFT);
    const int64_t *counts = images_only ? NULL : recheck->counts;
    const bool     any = slab->has_images || counts != NULL;
    const int      d = recheck->d, m = recheck->m;
    int32_t       *to = hs_output_next(output, HS_WANT_SHIFT);
    if (m < d || !any) {
        memset(to, 0, (size_t)slab->of.n_hits * (size_t)d * sizeof *to);
    }
    for (int32_t t = 0, h = 0; any && t < slab->of.n_bundles; h = slab->hits_end[t++]) {
        const int32_t end = slab->hits_end[t];
        const bool    beyond = d == 3 && m == 3
                                   ? put_of_bundle(recheck, slab, t, h, end, counts, 3, 3, to)
                                   : put_of_bundle(recheck, slab, t, h, end, counts, d, m, to);
        if (beyond) {
            while (!put_of_bundle(recheck, slab, t, h, h + 1, counts, d, m, to)) {
                h++;
            }
            const int32_t *order = recheck->list->listing.order;
            const int32_t  one = order[slab->of.bundles[t].point], other = order[slab->hits[h]];
            failure->row = one < other ? one : other;
            return HS_ERR_SHIFT_RANGE;
        }
    }
    return HS_OK;
}

/* Work between two polls, in pairs: a few milliseconds. */
#define POLL_WORK (INT64_C(1) << 20)
/* A decision by integers takes as long as so many pairs, and d or D of a pair as so many. */
#define INTEGER_WORK 1000
#define MEASURE_WORK 8

/* What one thread works with. */
typedef struct worker {
    hs_committer committer;
    slab_hits   *slab;   /* owned */
    hs_output   *output; /* pairs that wait for their turn, or where nothing is shared all */
    hs_counters  done;
} worker;

static void
find_hits(const checking *recheck, int64_t s, slab_hits *slab)
{
    const hs_listing   *listing = &recheck->list->listing;
    const hs_list_part *part = listing->parts + 2 * listing->n_pieces - 1;
    while (part->first_slab > s) {
        part--;
    }
    const bool    plain = part - listing->parts < listing->n_pieces;
    const int64_t first = (s - part->first_slab) * HS_SLAB, left = part->pairs.n_pairs - first;
    int64_t       bundle = 0, end = part->n_bundles;
    while (bundle < end) { /* the first that ends behind the slab's first pair */
        const int64_t middle = bundle + (end - bundle) / 2;
        if (part->bundles[middle].end <= first) {
            bundle = middle + 1;
        } else {
            end = middle;
        }
    }
    slab->has_images = !plain;
    slab->stages = (hs_stages){0};
    slab->of = (hs_slab){
        .ndim = recheck->d,
        .y = recheck->y,
        .offset = plain ? NULL : recheck->offset,
        .j = hs_output_column(&part->pairs, HS_WANT_J),
        .bundles = part->bundles + bundle,
        .first = first,
        .end = first + (left < HS_SLAB ? left : HS_SLAB),
        .numbers = recheck->numbers,
        .limit = plain ? recheck->plain : recheck->shifted,
        .hits = slab->hits,
        .point = slab->point,
        .hits_end = slab->hits_end,
        .open = slab->open,
    };
    recheck->call->kernel->recheck(&slab->of);
    if (slab->of.n_open > 0) {
        decide_unsure(recheck, slab);
    }
}

static hs_status
do_slab(worker *me, int64_t s)
{
    const checking *recheck = me->committer.job;
    hs_output      *output = me->output;
    slab_hits      *slab = me->slab;
    find_hits(recheck, s, slab);
    me->done.candidates += slab->of.end - slab->of.first;
    me->done.ambiguous += slab->of.n_open;
    me->done.by_float64 += slab->stages.by_float64;
    me->done.by_double_word += slab->stages.by_double_word;
    me->done.by_integers += slab->stages.by_integers;
    const int64_t work = slab->of.end - slab->of.first + INTEGER_WORK * slab->stages.by_integers +
                         (recheck->measures ? MEASURE_WORK * (int64_t)slab->of.n_hits : 0);
    const double done = (double)(s + 1) / (double)recheck->list->listing.n_slabs;
    hs_status    status = hs_output_reserve(output, slab->of.n_hits, recheck->shared ? 0.0 : done);
    if (status == HS_OK && slab->of.n_hits > 0) {
        const bool written = recheck->writes && write_hits(recheck, slab, output);
        if (!written || (output->columns & HS_WANT_BOTH)) {
            put_indices(recheck, slab, output);
        }
        if (!written && recheck->measures) {
            measure(recheck, slab, output);
        }
        if (output->columns & HS_WANT_SHIFT) {
            status = put_shifts(recheck, slab, output, &me->committer.failure);
        }
        output->n_pairs += status == HS_OK ? slab->of.n_hits : 0;
    }
    return status == HS_OK ? hs_note_work(&me->committer, work, POLL_WORK, done) : status;
}

/* A hs_range_fn. */
static hs_status
do_range(void *context, int64_t range)
{
    worker         *me = context;
    const checking *recheck = me->committer.job;
    const int64_t first = range * recheck->in_range, left = recheck->list->listing.n_slabs - first;
    const int64_t end = first + (left < recheck->in_range ? left : recheck->in_range);
    hs_status     status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = do_slab(me, s);
    }
    return status == HS_OK && recheck->shared
               ? hs_commit(&me->committer, (double)end / (double)recheck->list->listing.n_slabs,
                           true)
               : status;
}

static hs_status
open_worker(void *context, void *place)
{
    checking *recheck = context;
    worker   *me = place;
    me->output = recheck->shared ? me->committer.pairs : recheck->output;
    me->slab = hs_alloc(&recheck->call->account, HS_FOR_CANDIDATES, 1, sizeof *me->slab);
    return me->slab != NULL ? HS_OK : HS_ERR_MEMORY;
}

static void
close_worker(void *context, void *place)
{
    worker  *me = place;
    hs_call *call = ((checking *)context)->call;
    hs_call_add_counters(call, &me->done);
    hs_free(&call->account, me->slab);
}

/* Writes all pairs within the cutoff to the output. */
static hs_status
run(checking *recheck, hs_failure *failure)
{
    const hs_verlet  *list = recheck->list;
    const hs_listing *listing = &list->listing;
    const int64_t     n = recheck->now->points.n, n_slabs = listing->n_slabs;
    const int         m = recheck->m, stride = hs_slab_stride(recheck->d);
    const unsigned    columns = recheck->output->columns;
    hs_account       *account = &recheck->call->account;
    recheck->in_range =
        1 + HS_RANGE_BYTES / (1 + HS_SLAB * hs_output_bytes_per_pair(recheck->output));
    /* The kernels write a little beyond the last pair, where the caller's arrays may end. */
    recheck->shared = recheck->output->fixed ||
                      (recheck->call->team != NULL && n_slabs > recheck->in_range);
    recheck->numbers = !recheck->measures && !(columns & HS_WANT_SHIFT) &&
                       hs_slab_has_numbers(recheck->d);
    hs_status status = HS_OK;
    if (recheck->measures) {
        hs_options    options = recheck->call->options;
        const hs_sets sets = {.points = &recheck->now->points};
        options.want |= HS_WANT_SHIFT; /* the turns by which points were wrapped are needed */
        recheck->metric = &recheck->scene.metric;
        status = hs_scene_make(account, recheck->call->team, &sets, hs_frame_box(recheck->now),
                               &options, &recheck->scene, NULL, failure);
    }
    if (status == HS_OK) {
        hs_parts parts;
        hs_parts_begin(&parts);
        hs_parts_add(&parts, (void **)&recheck->y, n * stride, sizeof(float));
        hs_parts_add(&parts, (void **)&recheck->offset, listing->n_images * stride, sizeof(float));
        hs_parts_add(&parts, (void **)&recheck->image, listing->n_images * m, sizeof(int64_t));
        hs_parts_add(&parts, (void **)&recheck->counts, n * m, sizeof(int64_t));
        if (recheck->measures && can_write(recheck)) {
            hs_parts_add(&parts, (void **)&recheck->candidates, n, sizeof(hs_candidate));
        }
        if (recheck->measures && !recheck->scene.keeps_originals && m > 0) {
            hs_parts_add(&parts, (void **)&recheck->lead, n * m, sizeof(int64_t));
        }
        recheck->memory = hs_parts_alloc(account, HS_FOR_POINTS, &parts);
        status = recheck->memory != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        const double   cutoff = recheck->given.cutoff;
        const int      exponent = cutoff > 0.0 ? ilogb(cutoff) : 0;
        const bool     ordinary = exponent >= -ORDINARY_EXPONENT && exponent <= ORDINARY_EXPONENT;
        const hs_scale scale = hs_scale_of(ordinary ? 0 : exponent);
        const int32_t *order = listing->order;
        const int64_t *jumps = list->jumps_now >= 0 ? list->jumps[list->jumps_now] : NULL;
        for (int64_t a = 0; a < n; a++) { /* those of the list, and the jumps since then */
            const int64_t *jump = jumps != NULL ? jumps + (int64_t)order[a] * m : NULL;
            if (jumps != NULL && a + POINTS_AHEAD < n) {
                HS_PREFETCH(jumps + (int64_t)order[a + POINTS_AHEAD] * m);
            }
            for (int r = 0; r < m; r++) {
                const int64_t count = listing->counts[a * m + r] + (jump != NULL ? jump[r] : 0);
                recheck->counts[a * m + r] = count;
                recheck->most_counts = hs_larger(fabs((double)count), recheck->most_counts);
            }
        }
        set_thresholds(recheck, scale, put_points(recheck, scale));
        set_shifts(recheck);
    }
    if (status == HS_OK && recheck->measures) {
        set_points(recheck);
    }
    if (status == HS_OK && !(recheck->given.cutoff == 0.0 && !recheck->given.inclusive)) {
        hs_crew crew = {.call = recheck->call,
                        .job = recheck,
                        .worker_size = sizeof(worker),
                        .open = open_worker,
                        .close = close_worker,
                        .n_ranges = (n_slabs + recheck->in_range - 1) / recheck->in_range,
                        .search = do_range,
                        .output = recheck->shared ? recheck->output : NULL};
        status = hs_crew_run(&crew, failure);
    }
    hs_free(account, recheck->memory);
    hs_scene_free(account, &recheck->scene);
    return status;
}

hs_status
hs_recheck_find(const hs_verlet *list, hs_pairs *pairs, hs_failure *failure)
{
    hs_call        *call = &pairs->call;
    const hs_frame *now = &list->frames[list->now];
    double          rows[HS_MAX_DIM][HS_MAX_DIM];
    checking        recheck = {.list = list, .now = now, .call = call, .output = &pairs->output};
    recheck.d = now->points.ndim;
    if (call->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_call_gather(call, now->points.n);
    hs_pairs_open(pairs, recheck.d);
    recheck.m = hs_frame_periodic(now, recheck.vector_of_row);
    recheck.measures = call->options.want & (HS_WANT_DISTANCE | HS_WANT_VECTOR);
    for (int r = 0; r < recheck.m; r++) {
        memcpy(rows[r], now->box.rows[recheck.vector_of_row[r]], sizeof rows[r]);
    }
    hs_metric_init(&recheck.given, recheck.d, recheck.m, (const double(*)[HS_MAX_DIM])rows,
                   list->cutoff, call->options.inclusive);
    recheck.metric = &recheck.given;
    hs_output found = {.n_pairs = 0};
    if (call->options.sorted) { /* found first, with the columns that sorting needs as well */
        const unsigned columns = (call->options.want & ~(unsigned)HS_WANT_BOTH) | HS_WANT_I |
                                 HS_WANT_J | (list->listing.n_images > 0 ? HS_WANT_SHIFT : 0);
        hs_output_init(&call->account, recheck.d, columns, 4, &found);
        recheck.output = &found;
    }
    hs_status status = run(&recheck, failure);
    if (status == HS_OK && call->options.sorted) {
        status = hs_sort_pairs(call, 0, now->points.n, &found, false, NULL, &pairs->output);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)recheck.output->n_pairs);
    }
    hs_output_free(&found);
    return hs_pairs_conclude(&pairs->output, status, failure);
}
