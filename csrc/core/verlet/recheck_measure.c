/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * recheck_measure.c: d and D of hits. They are measured in the scene of a search of these points,
 * so that they have its bits: between the wrapped points with shifts over the reduced box, or
 * between the points as given.
 */
#include "recheck.h"

#include "../collect/measures.h"

#include <math.h>
#include <string.h>

/* Points ahead whose numbers are fetched: they lie anywhere in memory. */
#define AHEAD 16

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
            if (a + AHEAD < n) {
                HS_PREFETCH(x[k] + order[a + AHEAD]);
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
take_of_bundle(const hs_recheck *recheck, const hs_sifted *slab, int32_t begin, int32_t end,
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
take_hits(const hs_recheck *recheck, const hs_sifted *slab, const int d, hit_batch *batch)
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
fill_shifts(const hs_recheck *recheck, const hs_sifted *slab, hit_batch *batch)
{
    const bool has_images = hs_sifted_has_images(recheck, slab);
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
fill(const hs_recheck *recheck, const hs_sifted *slab, hit_batch *batch)
{
    switch (recheck->d) {
    case 2: take_hits(recheck, slab, 2, batch); break;
    case 3: take_hits(recheck, slab, 3, batch); break;
    default: take_hits(recheck, slab, recheck->d, batch);
    }
    batch->measured.is_shifted = batch->measured.is_wide = false;
    if (recheck->m > 0 && (batch->lagging != 0 || hs_sifted_has_images(recheck, slab))) {
        fill_shifts(recheck, slab, batch);
    }
}

void
hs_recheck_measure(const hs_recheck *recheck, const hs_sifted *slab)
{
    const hs_scene   *scene = &recheck->scene;
    const hs_options *options = &recheck->call->options;
    const hs_scale    unscale = hs_measures_unscale(scene);
    const int         d = recheck->d;
    double           *distance = hs_recheck_column(recheck, HS_WANT_DISTANCE, slab->at);
    double           *vectors = hs_recheck_column(recheck, HS_WANT_VECTOR, slab->at);
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
