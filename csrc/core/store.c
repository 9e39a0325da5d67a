/* SPDX-License-Identifier: BSD-3-Clause */
/* store.c: see store.h. */
#include "store.h"

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

hs_status
hs_store_reserve(hs_store *store, int64_t n)
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
