/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_ROWS_TABLE_H
#define HS_ROWS_TABLE_H

#include "../search/search.h"
#include "../collect/columns.h"

/*
 * table.h: all neighbours of each asking point, one row a point, in the order of the caller's
 * numbers; of a search that lists each pair once, only those that follow the point, which is a
 * sorted half list. One walk counts them, a second one writes each row to its place: no row moves,
 * and nothing is held but the result. A small table is found by one walk, and its rows are moved.
 */

/* Neighbours of each asking point, not counting itself, to counts[0 ... n - 1]. HS_ERR_SHIFT_RANGE
 * sets failure->row. */
hs_status hs_table_count(hs_search *search, int64_t *counts, hs_failure *failure);

/* The rows of a full search, as the entries of an empty output with columns for what is wanted, and
 * where each row begins, rows + 1, as i of `offsets`, which it opens; where each pair is listed
 * once these numbers may be left unset. The search may be made one for each pair once on the way.
 * HS_ERR_MEMORY where the result, or one neighbourhood, is too large; HS_ERR_CAPACITY. */
hs_status hs_table_find(hs_search *search, hs_output *entries, hs_output *offsets,
                        hs_failure *failure);

#endif
