/* SPDX-License-Identifier: BSD-3-Clause */
/* record.c: from the hits of a point to pairs of the half list. See record.h. */
#include "record.h"

#include "decide.h"

#include <string.h>

static void
put_indices(hs_pair_block *block, int64_t at, int32_t i, int32_t j)
{
    if (block->i != NULL) {
        block->i[at] = i < j ? i : j;
    }
    if (block->j != NULL) {
        block->j[at] = i < j ? j : i;
    }
}

/* S over all box vectors, zero on open ones; false when it does not fit int32. */
static bool
put_shift(const hs_lattice *lattice, const int64_t *given, bool negate, int32_t *shift)
{
    memset(shift, 0, (size_t)lattice->ndim * sizeof(int32_t));
    for (int l = 0; l < lattice->n_periodic; l++) {
        const int64_t value = negate ? -given[l] : given[l];
        if (value < INT32_MIN || value > INT32_MAX) {
            return false;
        }
        shift[lattice->vector_of_row[l]] = (int32_t)value;
    }
    return true;
}

/* The first nonzero component is negative. */
static bool
is_backward(const int64_t *shift, int n)
{
    for (int l = 0; l < n; l++) {
        if (shift[l] != 0) {
            return shift[l] < 0;
        }
    }
    return false;
}

/* |D| back in the caller's unit, still on the right side of the cutoff. */
static double
restore_distance(const hs_search *search, double distance)
{
    const hs_options *options = &search->options;
    const double      restored = hs_scene_restore(&search->scene, distance);
    return options->precision == HS_EXACT
               ? hs_keep_within(restored, options->cutoff, options->inclusive)
               : restored;
}

static void
put_measures(const hs_store *store, const hs_search *search, const hs_traced *pair, bool negate,
             hs_pair_block *block, int64_t at)
{
    double       vector[HS_MAX_DIM];
    const double distance = hs_metric_measure(&search->scene.metric, pair->p, pair->q,
                                              pair->metric_shift, vector);
    if (block->distance != NULL) {
        block->distance[at] = restore_distance(search, distance);
    }
    if (block->vector != NULL) {
        for (int k = 0; k < store->ndim; k++) {
            const double along = hs_scene_restore(&search->scene, vector[k]);
            block->vector[at * store->ndim + k] = negate ? -along : along;
        }
    }
}

/* Hits as places in the block: indices and whatever else was asked for. */
static hs_status
visit_places(hs_store *store, const hs_search *search, int32_t si, int32_t n_hits)
{
    const hs_bins *bins = &search->bins;
    hs_pair_block *block = store->last;
    hs_cursor      cursor = {search->block.runs};
    const int32_t  i = bins->order[si];
    const bool     measures = (store->stored & (HS_WANT_DISTANCE | HS_WANT_VECTOR)) != 0;
    const bool     shifts = (store->stored & (HS_WANT_SHIFT | HS_WANT_VECTOR)) != 0;
    /* Shifts that only sort the images of one pair may leave out what all of these share: the turns
     * by which i and j were wrapped, which can be too many for int32. */
    const bool keys_only = (search->options.want & HS_WANT_SHIFT) == 0;
    for (int32_t h = 0; h < n_hits; h++) {
        const int64_t at = block->n + h;
        hs_traced     pair;
        hs_status     status = hs_trace(search, si, search->block.hits[h],
                                        shifts && bins->n_periodic > 0, &cursor, &pair);
        if (status != HS_OK) {
            return status;
        }
        const int32_t j = bins->order[pair.sj];
        const bool    negate =
            j < i || (j == i && shifts && is_backward(pair.given, bins->n_periodic));
        put_indices(block, at, i, j);
        if (block->shift != NULL) {
            int64_t key[HS_MAX_DIM];
            if ((keys_only && !hs_lattice_shift(&search->scene.lattice, pair.image, key)) ||
                !put_shift(&search->scene.lattice, keys_only ? key : pair.given, negate,
                           block->shift + at * store->ndim)) {
                return HS_ERR_SHIFT_RANGE;
            }
        }
        if (measures) {
            put_measures(store, search, &pair, negate, block, at);
        }
    }
    return HS_OK;
}

hs_status
hs_record_hits(void *context, hs_search *search, int32_t si, int32_t n_hits)
{
    hs_store *store = context;
    hs_status status = hs_store_reserve(store, n_hits);
    if (status != HS_OK) {
        return status;
    }
    hs_pair_block *block = store->last;
    if (search->lists_places) {
        status = visit_places(store, search, si, n_hits);
        if (status != HS_OK) {
            return status;
        }
    } else {
        const int32_t  i = search->bins.order[si];
        const int32_t *hits = search->block.hits;
        for (int32_t h = 0; h < n_hits; h++) {
            put_indices(block, block->n + h, i, hits[h]);
        }
    }
    block->n += n_hits;
    store->n_pairs += n_hits;
    return HS_OK;
}
