/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * store.h: the pairs that have been found, in blocks that never move, with only the quantities that
 * were asked for. Emptied once into the caller's arrays.
 */
#ifndef HS_STORE_H
#define HS_STORE_H

#include "memory.h"

/* One block; arrays are NULL for what is not stored. Owned by the store. */
typedef struct hs_pair_block {
    struct hs_pair_block *next;
    int64_t  n, capacity;
    int32_t *i, *j;
    double  *distance;
    double  *vector; /* ndim each */
    int32_t *shift;  /* ndim each */
} hs_pair_block;

typedef struct hs_store {
    hs_account    *account; /* borrowed */
    int            ndim;
    unsigned       stored;  /* HS_WANT_ bits that are kept */
    int64_t        n_pairs;
    hs_pair_block *first, *last;
} hs_store;

void hs_store_init(hs_account *account, int ndim, unsigned stored, hs_store *store);

/* Makes room for n more pairs in store->last. */
hs_status hs_store_reserve(hs_store *store, int64_t n);

/* Turns the blocks into one of exactly n_pairs; keeps order. */
hs_status hs_store_merge(hs_store *store);

/* Frees the first block. */
void hs_store_drop_first(hs_store *store);

void hs_store_free(hs_store *store);

#endif
