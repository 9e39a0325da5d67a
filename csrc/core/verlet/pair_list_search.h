/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * pair_list_search.h: the pairs of a search in pieces, one for each range of its points, by several
 * threads. Which pieces there are depends on the number of threads, what follows from one to the
 * next does not. Points are told by their places in cell order, and few pairs have a shift: those
 * that are in different images once the points are wrapped.
 */
#ifndef HS_PAIR_LIST_SEARCH_H
#define HS_PAIR_LIST_SEARCH_H

#include "../collect/columns.h"
#include "../search/search.h"

typedef struct hs_piece {
    hs_output pairs;     /* int32 i and j, places in bins->order; counted by no account */
    int64_t   n_shifted; /* pairs with a shift that is not zero: */
    int64_t   capacity;
    int64_t  *at;    /* owned; which they are, ascending */
    int32_t  *shift; /* owned; m for each, over the box vectors that repeat, as given */
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
