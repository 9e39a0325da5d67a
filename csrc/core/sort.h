/* SPDX-License-Identifier: BSD-3-Clause */
/* sort.h: the ascending order of pairs. */
#ifndef HS_SORT_H
#define HS_SORT_H

#include "search.h"
#include "store.h"

/*
 * *order: receives n_pairs places in the store's only block, ascending by (i, j, S); to be freed by
 * the caller. The store must be merged and hold i and j; S counts if it is stored. n_points: i and
 * j are below it. `search` is polled; HS_ERR_INTERRUPTED when it says so.
 */
hs_status hs_sort_pairs(hs_search *search, const hs_store *store, int64_t n_points,
                        int64_t **order);

#endif
