/* SPDX-License-Identifier: BSD-3-Clause */
/* sort_pairs.h: the ascending order of pairs. */
#ifndef HS_SORT_PAIRS_H
#define HS_SORT_PAIRS_H

#include "columns.h"
#include "../search/search.h"

/* The columns that must be found, so that pairs can be put in order and have all that is wanted. */
unsigned hs_sort_columns(const hs_search *search);

/*
 * Writes `found`, which has these columns with int32 indices, to `sorted`, ascending by (i, j, S).
 * Numbers i are those of n_points points from first_point on. The call is charged for the work.
 */
hs_status hs_sort_pairs(hs_call *call, int32_t first_point, int64_t n_points,
                        const hs_output *found, hs_output *sorted);

/*
 * The same for the rows of a table, of points or queries 0 to n_rows - 1; both_ways: each pair
 * found is in two rows, as (j, i, -S) too. offsets: receives n_rows + 1 numbers, where each row
 * begins.
 */
hs_status hs_sort_rows(hs_call *call, int64_t n_rows, const hs_output *found, bool both_ways,
                       int64_t *offsets, hs_output *sorted);

#endif
