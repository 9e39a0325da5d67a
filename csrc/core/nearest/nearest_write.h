/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_write.h: rows of the nearest, to their places in the output: k entries for each asking
 * point, in the caller's order; what a row lacks is j = -1, d = infinity, D = NaN and S = 0. */
#ifndef HS_NEAREST_WRITE_H
#define HS_NEAREST_WRITE_H

#include "../collect/measures.h"
#include "nearest_rank.h"

/* Owned by a thread. A batch of entries that are still to be measured. */
typedef struct hs_nearest_writer {
    const hs_nearest *near; /* borrowed */
    void             *j;    /* columns of the output; NULL where they are not wanted */
    double           *d, *D;
    int32_t          *S;
    int64_t           at[HS_BATCH];       /* entry of the output */
    bool              is_first[HS_BATCH]; /* of its row */
    hs_measured       pairs;              /* shifts are zero from the first entry that is free on */
    int32_t           failed; /* the asking point, in the caller's numbers, of HS_ERR_SHIFT_RANGE */
} hs_nearest_writer;

void hs_nearest_writer_init(const hs_nearest *near, hs_nearest_writer *writer);

/* The row of the ranker's point: the first `count` of its keys, as far as they are within the
 * largest distance, and then entries that stand for no neighbour. HS_ERR_SHIFT_RANGE. */
hs_status hs_nearest_write(hs_nearest_writer *writer, hs_nearest_ranker *ranker, int64_t count);

/* Prefetches the row of point si, which will be written soon: rows lie far apart in memory. */
void hs_nearest_expect(const hs_nearest_writer *writer, int32_t si);

/* Writes what is left of the batch: needed once, at the end. Entries do not refer to the block. */
void hs_nearest_flush(hs_nearest_writer *writer);

/* Entries that stand for no neighbour, from entry `from` of the row of the caller's point
 * `row` on. */
void hs_nearest_write_nothing(const hs_nearest *near, int64_t row, int64_t from);

#endif
