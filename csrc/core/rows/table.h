/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_ROWS_TABLE_H
#define HS_ROWS_TABLE_H

#include "../collect/record.h"
#include "../memory/memory.h"

/*
 * table.h: all neighbours of each asking point, one row a point, in the order of the caller's
 * numbers; of a search that lists each pair once, only those that follow the point, which is a
 * sorted half list. One walk counts them, a second one writes each row to its place: no row moves,
 * and nothing is held but the result. A small table is found by one walk, and its rows are moved.
 */

/* A table that is being made, of a full search. */
typedef struct hs_table {
    hs_search       *search;  /* borrowed */
    int64_t         *offsets; /* borrowed; where each row begins, rows + 1 */
    hs_output       *entries; /* borrowed; columns for what is wanted */
    hs_neighbourhood most;    /* set by hs_table_prepare */
    hs_output        kept;    /* owned; rows in cell order, until they have places */
} hs_table;

/* Neighbours of each asking point, not counting itself, to counts[0 ... n - 1]. HS_ERR_SHIFT_RANGE
 * sets failure->row. */
hs_status hs_table_count(hs_search *search, int64_t *counts, hs_failure *failure);

/* Call first: finds the largest neighbourhood. */
hs_status hs_table_prepare(hs_table *table, hs_failure *failure);

/* Fills offsets. Where few entries are expected, one walk finds them, and keeps them. */
hs_status hs_table_measure(hs_table *table, hs_failure *failure);

/* Call last: fills the entries, which have room for offsets[rows]. */
hs_status hs_table_fill(hs_table *table, hs_failure *failure);

/* Idempotent. */
void hs_table_free(hs_table *table);

#endif
