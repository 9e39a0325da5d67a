/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * pair_list_search.h: the pairs of a search in pieces, one for each range of its points, by several
 * threads. Which pieces there are depends on the number of threads, what follows from one to the
 * next does not. Points are told by their places in cell order. Few pairs have a shift, those that
 * are in different images once the points are wrapped, and each piece keeps them apart.
 */
#ifndef HS_PAIR_LIST_SEARCH_H
#define HS_PAIR_LIST_SEARCH_H

#include "../collect/columns.h"
#include "../search/search.h"

/* Some pairs of a piece, as in a hs_listing. */
typedef struct hs_part {
    hs_output  pairs;   /* b of each, in its column j; counted by no account */
    hs_bundle *bundles; /* owned; ends are places in this part */
    int32_t   *shift;   /* owned; m for each bundle, over the box vectors that repeat, as given */
    int64_t    n_bundles, capacity;
} hs_part;

typedef struct hs_piece {
    hs_part plain, shifted;
} hs_piece;

typedef struct hs_pieces {
    int64_t   n;
    hs_piece *of; /* owned */
} hs_pieces;

/* All pairs. search->bins.order must be 0, 1, 2, ... On failure nothing is held; HS_ERR_SHIFT_RANGE
 * sets failure->row, a place. */
hs_status hs_pieces_find(hs_search *search, hs_pieces *pieces, hs_failure *failure);

void hs_pieces_free(hs_account *account, hs_pieces *pieces);

#endif
