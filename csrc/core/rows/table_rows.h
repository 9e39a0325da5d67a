/* SPDX-License-Identifier: BSD-3-Clause */
/* table_rows.h: table rows (the neighbours of one point each), written as walkers find them: to
 * their places when offsets are known, or one behind another in cell order, to be moved later. */
#ifndef HS_TABLE_ROWS_H
#define HS_TABLE_ROWS_H

#include "../collect/recorder.h"

/* Columns of a table that are measured, not numbers. */
#define HS_MEASURES (HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT)

/* Bytes of rows that wait for their places. */
#define HS_MOST_KEPT (6 << 20)

/* A table that is being made, of a full search. */
typedef struct hs_table {
    hs_search       *search;  /* borrowed */
    int64_t         *offsets; /* borrowed; where each row begins, rows + 1 */
    hs_output       *entries; /* borrowed; columns for what is wanted */
    hs_neighbourhood most;    /* set by hs_table_prepare */
    hs_output        kept;    /* owned; rows in cell order, int32, until they have places */
} hs_table;

/* What one thread fills rows with; the context of the visits below. */
typedef struct hs_filler {
    hs_table   *table;
    hs_output  *to;       /* borrowed; where the rows go */
    hs_output   part;     /* owned; measures of the hits of one visit */
    hs_recorder recorder; /* owned; of the part */
    int32_t    *numbers;  /* owned; of the hits of one point, where hits are places */
} hs_filler;

/* After hs_table_prepare. On failure hs_filler_close. */
hs_status hs_filler_open(hs_table *table, hs_output *to, hs_filler *fill);
void      hs_filler_close(hs_filler *fill);

/* A hs_visit_fn of ordered walkers: whole rows, to their places by table->offsets. */
hs_status hs_fill_rows(void *filler, hs_scanner *scanner, int32_t first, const hs_hits *hits);

/* A hs_visit_fn of ordered walkers: whole rows, one behind another, and their lengths as offsets.
 * HS_TOO_MUCH when they are more than HS_MOST_KEPT. */
hs_status hs_keep_rows(void *filler, hs_scanner *scanner, int32_t first, const hs_hits *hits);

/* The rows of a visit with HS_BLOCK_LISTS_IDS, one behind another, in fill->to, which has room for
 * them: to table->offsets the lengths, and to `where` the entry that each begins with. Of `fill`
 * only table and to are looked at. */
void hs_keep_numbers(hs_filler *fill, const hs_scanner *scanner, const hs_hits *hits,
                     int64_t *where);

/* The rows that were kept, to their places. */
void hs_move_rows(hs_table *table);

#endif
