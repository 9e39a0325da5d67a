/* SPDX-License-Identifier: BSD-3-Clause */
/* store.c: see store.h. */
#include "store.h"

#include "decide.h"

#include <math.h>
#include <string.h>

/* Pairs in the first block, and in the largest; each block is twice the one before. */
#define FIRST_CAPACITY 1024
#define LAST_CAPACITY (1 << 19)

void
hs_store_init(hs_account *account, int ndim, unsigned stored, hs_store *store)
{
    *store = (hs_store){.account = account, .ndim = ndim, .stored = stored};
}

static void
free_block(hs_account *account, hs_pair_block *block)
{
    hs_free(account, block->i);
    hs_free(account, block->j);
    hs_free(account, block->distance);
    hs_free(account, block->vector);
    hs_free(account, block->shift);
    hs_free(account, block);
}

static hs_pair_block *
new_block(const hs_store *store, int64_t capacity)
{
    hs_account    *account = store->account;
    const unsigned stored = store->stored;
    hs_pair_block *block = hs_alloc(account, HS_FOR_INDICES, 1, sizeof *block);
    bool           complete = true;
    if (block == NULL) {
        return NULL;
    }
    *block = (hs_pair_block){.capacity = capacity};
    if (stored & HS_WANT_I) {
        block->i = hs_alloc(account, HS_FOR_INDICES, capacity, sizeof(int32_t));
        complete = complete && block->i != NULL;
    }
    if (stored & HS_WANT_J) {
        block->j = hs_alloc(account, HS_FOR_INDICES, capacity, sizeof(int32_t));
        complete = complete && block->j != NULL;
    }
    if (stored & HS_WANT_DISTANCE) {
        block->distance = hs_alloc(account, HS_FOR_DISTANCES, capacity, sizeof(double));
        complete = complete && block->distance != NULL;
    }
    if (stored & HS_WANT_VECTOR) {
        block->vector =
            hs_alloc(account, HS_FOR_VECTORS, capacity * store->ndim, sizeof(double));
        complete = complete && block->vector != NULL;
    }
    if (stored & HS_WANT_SHIFT) {
        block->shift = hs_alloc(account, HS_FOR_SHIFTS, capacity * store->ndim, sizeof(int32_t));
        complete = complete && block->shift != NULL;
    }
    if (!complete) {
        free_block(account, block);
        return NULL;
    }
    return block;
}

/* Makes room for n pairs in store->last. */
static hs_status
reserve(hs_store *store, int64_t n)
{
    hs_pair_block *last = store->last;
    if (last != NULL && last->capacity - last->n >= n) {
        return HS_OK;
    }
    int64_t capacity = last == NULL ? FIRST_CAPACITY : 2 * last->capacity;
    capacity = capacity > LAST_CAPACITY ? LAST_CAPACITY : capacity;
    hs_pair_block *block = new_block(store, capacity > n ? capacity : n);
    if (block == NULL) {
        return HS_ERR_MEMORY;
    }
    if (last == NULL) {
        store->first = block;
    } else {
        last->next = block;
    }
    store->last = block;
    return HS_OK;
}

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
        shift[lattice->axis_of_row[l]] = (int32_t)value;
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
    const hs_scale back = hs_scale_of(-search->scene.scale.exponent);
    const double   cutoff = search->options.cutoff;
    double         restored = search->scene.extreme ? distance : hs_scale_apply(back, distance);
    if (search->options.precision == HS_EXACT) {
        if (search->options.inclusive) {
            restored = fmin(restored, cutoff);
        } else if (restored >= cutoff) {
            restored = nextafter(cutoff, 0.0); /* it was rounded up to the cutoff */
        }
    }
    return restored;
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
        const hs_scale back = hs_scale_of(-search->scene.scale.exponent);
        for (int k = 0; k < store->ndim; k++) {
            const double along =
                search->scene.extreme ? vector[k] : hs_scale_apply(back, vector[k]);
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
        if (block->shift != NULL && !put_shift(&search->scene.lattice, pair.given, negate,
                                               block->shift + at * store->ndim)) {
            return HS_ERR_SHIFT_RANGE;
        }
        if (measures) {
            put_measures(store, search, &pair, negate, block, at);
        }
    }
    return HS_OK;
}

hs_status
hs_store_visit(void *context, hs_search *search, int32_t si, int32_t n_hits)
{
    hs_store *store = context;
    hs_status status = reserve(store, n_hits);
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

static void
copy_part(void *to, const void *from, int64_t at, int64_t n, size_t size)
{
    if (to != NULL) {
        memcpy((char *)to + (size_t)at * size, from, (size_t)n * size);
    }
}

hs_status
hs_store_merge(hs_store *store)
{
    const size_t d = (size_t)store->ndim;
    if (store->first == NULL || store->first == store->last) {
        return HS_OK;
    }
    hs_pair_block *whole = new_block(store, store->n_pairs);
    if (whole == NULL) {
        return HS_ERR_MEMORY;
    }
    while (store->first != NULL) {
        const hs_pair_block *part = store->first;
        copy_part(whole->i, part->i, whole->n, part->n, sizeof(int32_t));
        copy_part(whole->j, part->j, whole->n, part->n, sizeof(int32_t));
        copy_part(whole->distance, part->distance, whole->n, part->n, sizeof(double));
        copy_part(whole->vector, part->vector, whole->n, part->n, d * sizeof(double));
        copy_part(whole->shift, part->shift, whole->n, part->n, d * sizeof(int32_t));
        whole->n += part->n;
        hs_store_drop_first(store);
    }
    store->first = store->last = whole;
    return HS_OK;
}

void
hs_store_drop_first(hs_store *store)
{
    hs_pair_block *first = store->first;
    store->first = first->next;
    if (store->first == NULL) {
        store->last = NULL;
    }
    free_block(store->account, first);
}

void
hs_store_free(hs_store *store)
{
    while (store->first != NULL) {
        hs_store_drop_first(store);
    }
}
