/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_COLLECT_SORT_PAIRS_H
#define HS_COLLECT_SORT_PAIRS_H

#include "columns.h"
#include "../search/search.h"

/* sort_pairs.h: the ascending order of pairs. */

#ifdef HS_TESTING
/* How many bits a place may have at most. */
extern int hs_test_place_bits;
#endif

/* The columns that must be found, so that pairs can be put in order and have all that is wanted. */
unsigned hs_sort_columns(const hs_search *search);

/*
 * Writes `found`, which has these columns with int32 indices, to `sorted`, ascending by (i, j, S).
 * Numbers i are those of n_rows points from first_point on. both_ways: each pair found is in two
 * rows, as (j, i, -S) too. offsets: NULL, or receives n_rows + 1 numbers, where each row begins.
 * The call is charged for the work.
 */
hs_status hs_sort_pairs(hs_call *call, int32_t first_point, int64_t n_rows, const hs_output *found,
                        bool both_ways, int64_t *offsets, hs_output *sorted);

#endif
