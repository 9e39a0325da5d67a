/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * refilter_put.c: the hits of a slab as pairs: i, j, S, d and D. The scene that d and D are measured
 * in is that of a search of these points, so that they have its bits.
 */
#include "refilter.h"

#include "poll.h"
#include "restore.h"

#include <math.h>
#include <string.h>

/* Integers up to here are float64 numbers, and what the batch kernels take. */
#define WIDEST_SHIFT (INT64_C(1) << 53)

enum { IN_BATCH = HS_BATCH + HS_BATCH_PADDING };

/* Some hits, as the batch kernels take them, and what they return. */
typedef struct measured {
    int32_t n;
    bool    is_shifted, is_wide;
    double  p[HS_MAX_DIM][IN_BATCH], q[HS_MAX_DIM][IN_BATCH], times[HS_MAX_DIM][IN_BATCH];
    int64_t shift[HS_BATCH][HS_MAX_DIM];
    double  distance[IN_BATCH], vector[HS_MAX_DIM][IN_BATCH];
} measured;

/* Room in the column of this HS_WANT_ bit for the first hit of the slab; NULL where not kept. */
static void *
column_at(const hs_refilter *refilter, unsigned bit, int64_t at)
{
    char *column = hs_output_column(refilter->output, bit);
    return column == NULL ? NULL
                          : column + (size_t)at * hs_output_width(refilter->output, bit);
}

/* A double that is an integer, modulo 2^64. */
static int64_t
integer_of(double x)
{
    int           exponent;
    const int64_t significand = (int64_t)ldexp(frexp(x, &exponent), 53);
    exponent -= 53;
    if (exponent < 0) {
        return exponent > -64 ? significand / (INT64_C(1) << -exponent) : 0;
    }
    return exponent < 64 ? (int64_t)((uint64_t)significand << exponent) : 0;
}

hs_status
hs_refilter_open_scene(hs_refilter *refilter, hs_failure *failure)
{
    hs_search *search = refilter->search;
    hs_scene  *scene = &search->scene;
    hs_options options = search->options;
    options.want |= HS_WANT_SHIFT; /* the turns by which points were wrapped are needed */
    const hs_status status =
        hs_scene_init(&search->account, search->team, &refilter->now->points,
                      hs_frame_box(refilter->now), &options, scene, failure);
    if (status != HS_OK) {
        return status;
    }
    const hs_lattice *lattice = &scene->lattice;
    refilter->over_given = scene->keeps_originals || refilter->m == 0;
    for (int k = 0; !refilter->over_given && k < refilter->d; k++) {
        /* B is diagonal here, so a given row has row r of B as often as its entry on that axis
         * holds the period: a quotient of doubles that is an integer, hence a double. */
        const int r = lattice->row_of_axis[k];
        for (int l = 0; r >= 0 && l < lattice->n_periodic; l++) {
            refilter->to_reduced[l][r] = integer_of(lattice->scaled[l][k] / lattice->rows[r][k]);
        }
    }
    return HS_OK;
}

/* S over the rows of B, for X: shift * to_reduced + turns_j - turns_i, modulo 2^64. */
HS_ALWAYS_INLINE void
reduce_shift(const hs_refilter *refilter, int32_t i, int32_t j, int64_t *shift)
{
    const hs_turns *turns = &refilter->search->scene.turns;
    const int       m = refilter->m;
    uint64_t        reduced[HS_MAX_DIM];
    for (int r = 0; r < m; r++) {
        reduced[r] = (uint64_t)hs_turns_get(turns, r, j) - (uint64_t)hs_turns_get(turns, r, i);
        for (int l = 0; l < m; l++) {
            reduced[r] += (uint64_t)shift[l] * (uint64_t)refilter->to_reduced[l][r];
        }
    }
    memcpy(shift, reduced, (size_t)m * sizeof *shift);
}

static void
fill(const hs_refilter *refilter, const hs_sifted *slab, int32_t first, measured *batch)
{
    const hs_listing *listing = &refilter->list->listing;
    const hs_scene   *scene = &refilter->search->scene;
    const uint16_t   *hits = slab->hits + first;
    const int32_t    *i = listing->i + slab->first, *j = listing->j + slab->first;
    int64_t           any = 0;
    batch->is_wide = false;
    for (int k = 0; k < refilter->d; k++) {
        const double *x = scene->keeps_originals ? scene->originals[k] : scene->cloud.x[k];
        for (int32_t b = 0; b < batch->n; b++) {
            batch->p[k][b] = x[i[hits[b]]];
            batch->q[k][b] = x[j[hits[b]]];
        }
    }
    for (int32_t b = 0; refilter->m > 0 && b < batch->n; b++) {
        int64_t *shift = batch->shift[b];
        hs_refilter_shift(refilter, slab->first + hits[b], shift);
        if (!refilter->over_given) {
            reduce_shift(refilter, i[hits[b]], j[hits[b]], shift);
        }
        for (int r = 0; r < refilter->m; r++) {
            batch->times[r][b] = (double)shift[r];
            any |= shift[r];
            batch->is_wide =
                batch->is_wide || shift[r] > WIDEST_SHIFT || shift[r] < -WIDEST_SHIFT;
        }
    }
    batch->is_shifted = any != 0;
}

/* d and D of the batch, in the unit of the metric. */
static void
measure(const hs_refilter *refilter, double *const *vector, measured *batch)
{
    const hs_metric *metric = &refilter->search->scene.metric;
    uint8_t          done[IN_BATCH] = {0};
    hs_batch         given = {.n = batch->n};
    for (int k = 0; k < refilter->d; k++) {
        given.p[k] = batch->p[k];
        given.q[k] = batch->q[k];
    }
    for (int r = 0; batch->is_shifted && r < refilter->m; r++) {
        given.shift[r] = batch->times[r];
    }
    if (!batch->is_wide) {
        refilter->search->kernel->measure(metric, &given, batch->distance, vector, done);
    }
    for (int32_t b = 0; b < batch->n; b++) {
        double p[HS_MAX_DIM], q[HS_MAX_DIM], along[HS_MAX_DIM];
        for (int k = 0; !done[b] && k < refilter->d; k++) {
            p[k] = batch->p[k][b];
            q[k] = batch->q[k][b];
        }
        if (HS_UNLIKELY(!done[b])) {
            batch->distance[b] = hs_metric_measure(
                metric, p, q, batch->is_shifted ? batch->shift[b] : NULL, along);
            for (int k = 0; vector != NULL && k < refilter->d; k++) {
                vector[k][b] = along[k];
            }
        }
    }
}

static void
put_measures(const hs_refilter *refilter, const hs_sifted *slab)
{
    const hs_scene   *scene = &refilter->search->scene;
    const hs_options *options = &refilter->search->options;
    const hs_scale    same = {.exponent = 0, .first = 1.0, .second = 1.0};
    const hs_scale    unscale = scene->extreme ? same : scene->unscale;
    const int         d = refilter->d;
    double           *distance = column_at(refilter, HS_WANT_DISTANCE, slab->at);
    double           *vectors = column_at(refilter, HS_WANT_VECTOR, slab->at);
    double           *vector[HS_MAX_DIM], sign[HS_BATCH];
    measured          batch;
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
        fill(refilter, slab, first, &batch);
        measure(refilter, vectors != NULL ? vector : NULL, &batch);
        if (distance != NULL) {
            if (unscale.exponent != 0) {
                hs_restore_distances(batch.distance, batch.n, unscale);
            }
            hs_keep_all_within(batch.distance, batch.n, options->cutoff, options->inclusive);
            memcpy(distance + first, batch.distance, (size_t)batch.n * sizeof *distance);
        }
        if (vectors != NULL) {
            hs_restore_vectors(vectors + (int64_t)first * d, vector, sign, batch.n, d, unscale);
        }
    }
}

/* S over all box vectors, zero on open ones; where only sorting needs it the images alone, which
 * are in the same order and always fit. */
static void
put_shifts(const hs_refilter *refilter, hs_sifted *slab)
{
    const hs_listing *listing = &refilter->list->listing;
    const bool        keys_only = !(refilter->search->options.want & HS_WANT_SHIFT);
    const int         d = refilter->d, m = refilter->m;
    int32_t          *to = column_at(refilter, HS_WANT_SHIFT, slab->at);
    const bool        plain = slab->first < listing->n_plain;
    memset(to, 0, (size_t)slab->n_hits * (size_t)d * sizeof *to);
    if (plain && (keys_only || refilter->counts == NULL)) {
        return;
    }
    for (int32_t h = 0; h < slab->n_hits; h++) {
        const int64_t  e = slab->first + slab->hits[h];
        const int32_t *image =
            plain ? NULL : listing->images.of + (int64_t)listing->code[e - listing->n_plain] * m;
        int64_t shift[HS_MAX_DIM];
        if (!keys_only) {
            hs_refilter_shift(refilter, e, shift);
        }
        for (int r = 0; r < m; r++) {
            const int64_t value = keys_only ? image[r] : shift[r];
            if (value < INT32_MIN || value > INT32_MAX) {
                slab->status = HS_ERR_SHIFT_RANGE;
                slab->failed_point = listing->i[e];
                return;
            }
            to[(int64_t)h * d + refilter->vector_of_row[r]] = (int32_t)value;
        }
    }
}

/* Numbers of the hits, to every `step`-th index. */
static void
put_numbers(const int32_t *from, const hs_sifted *slab, int index_bytes, int step, void *to)
{
    const uint16_t *hits = slab->hits;
    from += slab->first;
    if (to == NULL) {
        return;
    }
    if (index_bytes == 8) {
        int64_t *wide = to;
        for (int32_t h = 0; h < slab->n_hits; h++) {
            wide[(int64_t)h * step] = from[hits[h]];
        }
    } else {
        int32_t *narrow = to;
        for (int32_t h = 0; h < slab->n_hits; h++) {
            narrow[(int64_t)h * step] = from[hits[h]];
        }
    }
}

void
hs_refilter_put(const hs_refilter *refilter, hs_sifted *slab)
{
    const hs_listing *listing = &refilter->list->listing;
    const int         bytes = refilter->output->index_bytes;
    char             *both = column_at(refilter, HS_WANT_BOTH, slab->at);
    put_numbers(listing->i, slab, bytes, 1, column_at(refilter, HS_WANT_I, slab->at));
    put_numbers(listing->j, slab, bytes, 1, column_at(refilter, HS_WANT_J, slab->at));
    put_numbers(listing->i, slab, bytes, 2, both);
    put_numbers(listing->j, slab, bytes, 2, both == NULL ? NULL : both + bytes);
    if (refilter->output->columns & HS_WANT_SHIFT) {
        put_shifts(refilter, slab);
    }
    if (refilter->measures && slab->n_hits > 0) {
        put_measures(refilter, slab);
    }
}
