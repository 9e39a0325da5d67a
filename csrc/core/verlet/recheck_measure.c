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
    recheck->x = hs_alloc(account, HS_FOR_POINTS, n * recheck->d, sizeof *recheck->x);
    recheck->image = hs_alloc(account, HS_FOR_WRAPS, n_images * m, sizeof *recheck->image);
    recheck->lag = hs_alloc(account, HS_FOR_WRAPS, n * m, sizeof *recheck->lag);
    recheck->lagging = hs_alloc(account, HS_FOR_WRAPS, n, sizeof *recheck->lagging);
    return recheck->x != NULL && recheck->image != NULL && recheck->lag != NULL &&
           recheck->lagging != NULL;
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

static void
set_coordinates(hs_recheck *recheck)
{
    const hs_scene *scene = &recheck->scene;
    double *const  *x = scene->keeps_originals ? scene->originals : scene->cloud.x;
    const int       d = recheck->d;
    const int32_t  *order = recheck->list->listing.order;
    const int64_t   n = recheck->now->points.n;
    for (int64_t a = 0; a < n; a++) {
        for (int k = 0; k < d; k++) {
            if (a + AHEAD < n) {
                HS_PREFETCH(x[k] + order[a + AHEAD]);
            }
            recheck->x[a * d + k] = x[k][order[a]];
        }
    }
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
    set_coordinates(recheck);
    return HS_OK;
}

/* The shifts of the batch, for the scene's metric. */
static void
fill_shifts(const hs_recheck *recheck, const hs_sifted *slab, const uint16_t *hits,
            hs_measured *batch)
{
    const hs_listing *listing = &recheck->list->listing;
    const int         m = recheck->m;
    const int32_t    *i = listing->i + slab->first, *j = listing->j + slab->first;
    const int32_t    *code =
        slab->first < listing->n_plain ? NULL : listing->code + (slab->first - listing->n_plain);
    for (int32_t b = 0; b < batch->n; b++) {
        const int32_t  e = hits[b];
        const int64_t *lag_i = recheck->lag + (int64_t)i[e] * m;
        const int64_t *lag_j = recheck->lag + (int64_t)j[e] * m;
        for (int r = 0; r < m; r++) {
            const int64_t image = code != NULL ? recheck->image[(int64_t)code[e] * m + r] : 0;
            const int64_t shift =
                (int64_t)((uint64_t)image + (uint64_t)lag_j[r] - (uint64_t)lag_i[r]);
            hs_measured_shift(batch, b, r, shift);
        }
    }
}

HS_ALWAYS_INLINE void
fill_points(const hs_recheck *recheck, const hs_sifted *slab, const uint16_t *hits, const int d,
            hs_measured *batch)
{
    const int32_t *i = recheck->list->listing.i + slab->first;
    const int32_t *j = recheck->list->listing.j + slab->first;
    unsigned       lagging = 0;
    for (int32_t b = 0; b < batch->n; b++) {
        const int64_t p = i[hits[b]], q = j[hits[b]];
        for (int k = 0; k < d; k++) {
            batch->p[k][b] = recheck->x[p * d + k];
            batch->q[k][b] = recheck->x[q * d + k];
        }
        lagging |= recheck->m > 0 ? recheck->lagging[p] | recheck->lagging[q] : 0;
    }
    batch->is_shifted = batch->is_wide = false;
    if (recheck->m > 0 && (lagging != 0 || slab->first >= recheck->list->listing.n_plain)) {
        fill_shifts(recheck, slab, hits, batch);
    }
}

static void
fill(const hs_recheck *recheck, const hs_sifted *slab, int32_t first, hs_measured *batch)
{
    const uint16_t *hits = slab->hits + first;
    switch (recheck->d) {
    case 2: fill_points(recheck, slab, hits, 2, batch); break;
    case 3: fill_points(recheck, slab, hits, 3, batch); break;
    default: fill_points(recheck, slab, hits, recheck->d, batch);
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
    double           *vector[HS_MAX_DIM], sign[HS_BATCH];
    hs_measured       batch;
    memset(&batch, 0, sizeof batch); /* kernels read a little beyond the last pair */
    for (int k = 0; k < d; k++) {
        vector[k] = batch.vector[k];
    }
    for (int b = 0; b < HS_BATCH; b++) {
        sign[b] = 1.0; /* listed pairs are the right way round */
    }
    for (int32_t first = 0; first < slab->n_hits; first += HS_BATCH) {
        const int32_t left = slab->n_hits - first;
        batch.n = left < HS_BATCH ? left : HS_BATCH;
        fill(recheck, slab, first, &batch);
        hs_measured_find(recheck->call->kernel, &scene->metric, vectors != NULL, &batch);
        if (distance != NULL) {
            hs_restore_distances(batch.distance, batch.n, unscale);
            hs_keep_all_within(batch.distance, batch.n, options->cutoff, options->inclusive);
            memcpy(distance + first, batch.distance, (size_t)batch.n * sizeof *distance);
        }
        if (vectors != NULL) {
            hs_restore_vectors(vectors + (int64_t)first * d, vector, sign, batch.n, d, unscale);
        }
    }
}
