/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * neighbourhood_sort.h: gathered candidates in the order of the caller's numbers, so that hits come
 * out sorted: a neighbourhood is sorted once for all points of its group, which is some twenty
 * times less work than sorting each point's hits.
 */
#ifndef HS_NEIGHBOURHOOD_SORT_H
#define HS_NEIGHBOURHOOD_SORT_H

#include "neighbourhood.h"

/* Candidates that can be sorted, and places told apart: more fit no memory that results fit. */
#define HS_ORDER_CANDIDATES (INT64_C(1) << 28)

/* Room to sort a block in; owned, one entry for each candidate. */
typedef struct hs_order {
    uint64_t *entries; /* key << 32 | place */
    uint64_t *spare;
    float    *column;
    int64_t  *shifts; /* of images, by runs: one for each run and given box vector */
} hs_order;

/* Room for this block, and its `origin`. On failure hs_order_free. */
hs_status hs_order_init(hs_account *account, hs_block *block, hs_order *order);
void      hs_order_free(hs_account *account, hs_block *block, hs_order *order);

/*
 * Sorts a block that has been gathered: ascending by the caller's number, then, where hits are
 * listed as places, by S over the box vectors as given. block->origin says where each candidate
 * was; ids follow the new order only where these are listed. HS_ERR_SHIFT_RANGE when an image
 * passes 2^62; HS_ERR_INTERRUPTED, as options say, while a large block is sorted.
 */
hs_status hs_order_block(const hs_lattice *lattice, const hs_options *options, hs_block_use use,
                         hs_block *block, hs_order *order);

#endif
