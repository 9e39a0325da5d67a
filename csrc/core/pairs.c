/* SPDX-License-Identifier: BSD-3-Clause */
/* pairs.c: the public searches: find, count, write. */
#include "../halfshell.h"

#include "estimate.h"
#include "fpenv.h"
#include "record.h"
#include "sort.h"

#include <math.h>
#include <string.h>

/* Pairs written between two calls of poll(). */
#define POLL_PAIRS (INT64_C(1) << 18)

struct hs_pairs {
    hs_search search; /* closed: kept for its account, options and scene */
    hs_store  store;
    int64_t  *order;  /* owned; NULL unless sorted */
};

static void
clear_failure(hs_failure *failure)
{
    *failure = (hs_failure){.row = -1, .column = -1};
}

hs_options
hs_options_default(void)
{
    return (hs_options){.inclusive = true,
                        .want = HS_WANT_I | HS_WANT_J,
                        .index_bytes = 8,
                        .memory_limit = INFINITY};
}

/* A pair of points can occur in several images, so that sorting needs to tell these apart. */
static bool
images_repeat(const hs_search *search)
{
    const hs_lattice *lattice = &search->scene.lattice;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0 &&
            2.0 * search->grid.range[k] >= lattice->period[k]) {
            return true;
        }
    }
    return false;
}

/* What must be kept to return what is wanted, in order. */
static unsigned
choose_stored(const hs_search *search)
{
    unsigned stored = search->options.want & ~(unsigned)HS_WANT_BOTH;
    if (search->options.sorted || (search->options.want & HS_WANT_BOTH)) {
        stored |= HS_WANT_I | HS_WANT_J;
    }
    if (search->options.sorted) {
        stored |= images_repeat(search) ? HS_WANT_SHIFT : 0;
    }
    return stored;
}

/* Now that their number is known: the caller's arrays beside what is held, some of which is given
 * back while they are written. */
static bool
result_fits(hs_pairs *pairs)
{
    hs_search   *search = &pairs->search;
    const double bytes =
        (double)pairs->store.n_pairs * hs_bytes_per_pair(&search->options, search->scene.ndim);
    return hs_account_allows(&search->account, fmax(0.0, bytes - (double)search->account.held));
}

static hs_status
find_pairs(hs_pairs *pairs, hs_failure *failure)
{
    hs_search *search = &pairs->search;
    hs_store  *store = &pairs->store;
    hs_status  status = hs_estimate_by_sample(search, failure);
    if (status == HS_OK) {
        status = hs_search_walk(search, hs_record_hits, store);
    }
    if (status == HS_OK && !result_fits(pairs)) {
        failure->expected_bytes =
            (double)store->n_pairs * hs_bytes_per_pair(&search->options, store->ndim);
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK && search->options.sorted && store->n_pairs > 0) {
        status = hs_store_merge(store);
        if (status == HS_OK) {
            status = hs_sort_pairs(search, store, search->scene.n, &pairs->order);
        }
    }
    if (status == HS_ERR_SHIFT_RANGE) {
        failure->row = search->failed_point;
    }
    if (status == HS_ERR_MEMORY && failure->expected_pairs == 0.0) {
        failure->expected_pairs = (double)store->n_pairs;
        failure->limit_bytes = search->account.limit;
    }
    return status;
}

hs_status
hs_pairs_find(const hs_points *points, const hs_box *box, const hs_options *options,
              hs_pairs **result, hs_failure *failure)
{
    hs_failure ignored;
    *result = NULL;
    failure = failure != NULL ? failure : &ignored;
    clear_failure(failure);
    hs_pairs *pairs = hs_alloc(NULL, HS_FOR_INDICES, 1, sizeof *pairs);
    if (pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(pairs, 0, sizeof *pairs);
    const hs_fpenv saved = hs_fpenv_enter();
    hs_status      status = hs_search_open(points, box, options, &pairs->search, failure);
    if (status == HS_OK) {
        const unsigned stored = choose_stored(&pairs->search);
        hs_store_init(&pairs->search.account, points->ndim, stored, &pairs->store);
        pairs->search.lists_places = (stored & ~(unsigned)(HS_WANT_I | HS_WANT_J)) != 0;
        status = find_pairs(pairs, failure);
        hs_search_report(&pairs->search, pairs->store.n_pairs);
        hs_search_close(&pairs->search);
    }
    hs_fpenv_leave(saved);
    if (status != HS_OK) {
        hs_pairs_free(pairs);
        return status;
    }
    *result = pairs;
    return HS_OK;
}

static hs_status
count_hits(void *context, hs_search *search, int32_t si, int32_t n_hits)
{
    (void)search;
    (void)si;
    *(int64_t *)context += n_hits;
    return HS_OK;
}

hs_status
hs_pairs_count(const hs_points *points, const hs_box *box, const hs_options *options,
               int64_t *count, hs_failure *failure)
{
    hs_failure ignored;
    hs_options counting = *options;
    hs_search  search;
    int64_t    found = 0;
    failure = failure != NULL ? failure : &ignored;
    clear_failure(failure);
    counting.want = 0;
    counting.sorted = false;
    const hs_fpenv saved = hs_fpenv_enter();
    hs_status      status = hs_search_open(points, box, &counting, &search, failure);
    if (status == HS_OK) {
        status = hs_search_walk(&search, count_hits, &found);
        if (status == HS_ERR_SHIFT_RANGE) {
            failure->row = search.failed_point;
        }
        hs_search_report(&search, found);
        hs_search_close(&search);
    }
    hs_fpenv_leave(saved);
    if (status == HS_OK) {
        *count = found;
    }
    return status;
}

int64_t
hs_pairs_length(const hs_pairs *pairs)
{
    return pairs->store.n_pairs;
}

/* n indices, from `first` on or as `order` says, to every `stride`-th element of the array. */
static void
write_index(void *array, int index_bytes, int64_t at, int64_t stride, const int32_t *indices,
            int64_t first, const int64_t *order, int64_t n)
{
    if (array == NULL) {
        return;
    }
    const int32_t *from = indices + first;
    if (index_bytes == 8) {
        int64_t *to = (int64_t *)array + at;
        for (int64_t p = 0; p < n; p++) {
            to[p * stride] = from[order != NULL ? order[p] : p];
        }
    } else {
        int32_t *to = (int32_t *)array + at;
        for (int64_t p = 0; p < n; p++) {
            to[p * stride] = from[order != NULL ? order[p] : p];
        }
    }
}

/* n rows of `size` bytes, from `first` on or as `order` says. */
static void
write_rows(void *array, int64_t at, const void *rows, int64_t first, const int64_t *order,
           int64_t n, size_t size)
{
    if (array == NULL) {
        return;
    }
    const char *from = (const char *)rows + (size_t)first * size;
    char       *to = (char *)array + (size_t)at * size;
    if (order == NULL) {
        memcpy(to, from, (size_t)n * size);
        return;
    }
    for (int64_t p = 0; p < n; p++) {
        memcpy(to + (size_t)p * size, from + (size_t)order[p] * size, size);
    }
}

/* Pairs [first, first + n) of the first block, or of the order over it, to place `at` on. */
static void
write_part(const hs_pairs *pairs, const hs_pair_arrays *arrays, int64_t first, int64_t n,
           int64_t at)
{
    const hs_pair_block *block = pairs->store.first;
    const int64_t       *order = pairs->order != NULL ? pairs->order + first : NULL;
    const int64_t        from = order != NULL ? 0 : first;
    const size_t         d = (size_t)pairs->store.ndim;
    const int            bytes = arrays->index_bytes;
    write_index(arrays->i, bytes, at, 1, block->i, from, order, n);
    write_index(arrays->j, bytes, at, 1, block->j, from, order, n);
    write_index(arrays->both, bytes, 2 * at, 2, block->i, from, order, n);
    write_index(arrays->both, bytes, 2 * at + 1, 2, block->j, from, order, n);
    write_rows(arrays->distance, at, block->distance, from, order, n, sizeof(double));
    write_rows(arrays->vector, at, block->vector, from, order, n, d * sizeof(double));
    write_rows(arrays->shift, at, block->shift, from, order, n, d * sizeof(int32_t));
}

hs_status
hs_pairs_write(hs_pairs *pairs, const hs_pair_arrays *arrays)
{
    hs_store *store = &pairs->store;
    int64_t   at = 0;
    for (; store->first != NULL; hs_store_drop_first(store)) {
        for (int64_t first = 0; first < store->first->n; first += POLL_PAIRS) {
            const int64_t left = store->first->n - first;
            const int64_t n = left < POLL_PAIRS ? left : POLL_PAIRS;
            write_part(pairs, arrays, first, n, at);
            at += n;
            const hs_status status = at > POLL_PAIRS ? hs_search_poll(&pairs->search) : HS_OK;
            if (status != HS_OK) {
                return status;
            }
        }
    }
    return HS_OK;
}

void
hs_pairs_free(hs_pairs *pairs)
{
    if (pairs == NULL) {
        return;
    }
    hs_store_free(&pairs->store);
    hs_free(&pairs->search.account, pairs->order);
    hs_free(NULL, pairs);
}
