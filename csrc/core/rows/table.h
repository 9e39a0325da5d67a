/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_ROWS_TABLE_H
#define HS_ROWS_TABLE_H

#include "../collect/record.h"
#include "../memory/memory.h"

/*
 * table.h: all neighbours of each asking point, one row a point, in the order of the caller's
 * numbers. One walk counts them, a second one writes each row to its place: no row moves, and
 * nothing is held but the result. A small table is found by one walk, and its rows are moved.
 */

/* Table rows (the neighbours of one point each), written as walkers find them: to
 * their places when offsets are known, or one behind another in cell order, to be moved later. */

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
void hs_filler_close(hs_filler *fill);

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

/*
 * A large table of i and j by one walk, not two. The rows are found in cell order, as
 * int32, and wait in memory that the result needs anyway: that of i, whose turn comes last. Then j
 * is written from them in the order of the table, and i over them.
 */

/* Whether to try: i and j, nothing else, in columns of the search's own, by one thread. */
bool hs_table_takes_one_walk(const hs_table *table);

/* After hs_table_prepare: finds offsets and entries. HS_TRY_OTHER when memory is short: nothing is
 * kept then, and two walks, the first of which only counts, can do with less or tell how much it
 * takes. */
hs_status hs_table_find_in_one_walk(hs_table *table, hs_failure *failure);

/*
 * A large column of point numbers that is written from its first entry to its last,
 * past the caches: it does not fit them, and what a store misses there would first be read.
 *
 * Usage: hs_put_open(column, index_bytes, &out); hs_put_numbers or hs_put_repeat any
 * number of times; hs_put_close(&out), before which part of it is not there.
 */

#define HS_PUT_BYTES 4096 /* collected before they are written: well inside the first-level cache */

/* Numbers of 4 or 8 bytes on their way to memory. */
typedef struct hs_put_column {
    char  *to; /* where the collected bytes will go */
    size_t n;  /* of them */
    int    index_bytes;
    union {
        char    bytes[HS_PUT_BYTES + HS_ALIGNMENT];
        int32_t narrow[(HS_PUT_BYTES + HS_ALIGNMENT) / sizeof(int32_t)];
        int64_t wide[(HS_PUT_BYTES + HS_ALIGNMENT) / sizeof(int64_t)];
    } part;
} hs_put_column;

/* column: aligned to HS_ALIGNMENT; borrowed. */
void hs_put_open(void *column, int index_bytes, hs_put_column *out);

/* These n numbers, none of which is negative. */
void hs_put_numbers(hs_put_column *out, const int32_t *numbers, int64_t n);

/* n times this number. */
void hs_put_repeat(hs_put_column *out, int32_t number, int64_t n);

void hs_put_close(hs_put_column *out);

#endif
