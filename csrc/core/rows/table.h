/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * table.h: all neighbours of each asking point, one row a point, in the order of the caller's
 * numbers. One walk counts them, a second one writes each row to its place: no row moves, and
 * nothing is held but the result. A small table is found by one walk, and its rows are moved.
 */
#ifndef HS_TABLE_H
#define HS_TABLE_H

#include "table_rows.h"

/* Neighbours of each asking point, not counting itself, to counts[0 ... n - 1]. HS_ERR_SHIFT_RANGE
 * sets failure->row. */
hs_status hs_table_count(hs_search *search, int64_t *counts, hs_failure *failure);

/* Call first: finds the largest neighbourhood. */
hs_status hs_table_prepare(hs_table *table, hs_failure *failure);

/* Fills offsets. Where few entries are expected, one walk finds them, and keeps them. */
hs_status hs_table_measure(hs_table *table, hs_failure *failure);

/* Offsets that hold the number of each row's entries: where it begins. */
void hs_table_sum(hs_table *table);

/* Call last: fills the entries, which have room for offsets[rows]. */
hs_status hs_table_fill(hs_table *table, hs_failure *failure);

/* Harmless twice. */
void hs_table_free(hs_table *table);

#endif
