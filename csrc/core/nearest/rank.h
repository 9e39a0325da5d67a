/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_NEAREST_RANK_H
#define HS_NEAREST_RANK_H

#include "../base/os.h"
#include "candidates.h"
#include "../collect/record.h"
#include "../search/choice.h"

/*
 * rank.h: the k nearest of an asking point. Keys come from the hits of a block, or from a walk down
 * the tree for this point alone; squared distances in float64 put them in order as far as their
 * error allows; what is too close to tell is compared exactly; and the row is written.
 */

/* A candidate: its number in tree order, which image of it, and about |D|^2 in the frame's unit. */
typedef struct hs_nearest_key {
    double  square;
    int32_t number, image;
} hs_nearest_key;

/* A node of the tree, and the squared distance to it. */
typedef struct hs_nearest_waiting {
    double  gap;
    int32_t number;
} hs_nearest_waiting;

/* Steps between two polls: some milliseconds, even of exact comparisons. */
#define HS_NEAREST_POLL_STEPS (INT64_C(1) << 15)

/* Owned by a thread; zeros at first, but for what is borrowed. */
typedef struct hs_nearest_ranker {
    const hs_nearest       *near;    /* borrowed */
    const hs_options       *options; /* borrowed; polled */
    hs_nearest_frame        frame;
    const hs_nearest_image *images;       /* borrowed */
    hs_nearest_key         *keys, *spare; /* owned */
    int64_t                 n, capacity;  /* keys; those that count come first */
    int32_t                 si;           /* the asking point */
    hs_chooser              chooser;      /* its own, if the call has a choice */
    int64_t                 steps;        /* since the last poll */
    hs_status               status;       /* of it */
    hs_stages               stages;
    int64_t                 n_compared;
    /* Of a walk. */
    double             *least; /* owned: a heap of the least squares so far, the largest first */
    int64_t             n_least, least_capacity;
    hs_nearest_image   *walked; /* owned: images in which keys are */
    int32_t             n_walked, walked_capacity;
    hs_nearest_waiting *waiting; /* owned: nodes that are left to look at; NULL before a walk */
    int64_t             n_met;   /* points so far */
} hs_nearest_ranker;

void hs_nearest_ranker_free(hs_nearest_ranker *ranker);

/* Whose keys come next. */
void hs_nearest_ranker_set(hs_nearest_ranker *ranker, int32_t si);

/* Ranks the nearest of all, and finds what is too close to tell from them. Sets keys and count as
 * hs_nearest_rank, but that *count is not -1; some may be beyond the largest distance.
 * HS_TRY_OTHER: too many images may be as near. */
hs_status hs_nearest_walk(hs_nearest_ranker *ranker, int64_t *count);

/*
 * Ranks the nearest of n hits of the point in a group's block: ranker->keys[0 ... *count - 1], at
 * most k, in order of distance, then (j, S). *count is -1 when there may be nearer ones beyond the
 * group's radius, unless that is_complete. squares: of the hits, or NULL. HS_ERR_MEMORY,
 * HS_ERR_INTERRUPTED, and any status of hs_choice_is_nearest.
 */
hs_status hs_nearest_rank(hs_nearest_ranker *ranker, const hs_nearest_block *block,
                          const int32_t *hits, const float *squares, int64_t n, bool is_complete,
                          int64_t *count);

/* Rows of the nearest, to their places in the output: k entries for each asking point, in the
 * caller's order; what a row lacks is j = -1, d = infinity, D = NaN and S = 0. A batch of entries
 * that are still to be measured. Owned by a thread. */
typedef struct hs_nearest_writer {
    const hs_nearest *near; /* borrowed */
    void             *j;    /* columns of the output; NULL where they are not wanted */
    double           *d, *D;
    int32_t          *S;
    int64_t           at[HS_BATCH];       /* entry of the output */
    bool              is_first[HS_BATCH]; /* of its row */
    hs_measured       pairs;              /* shifts are zero from the first entry that is free on */
} hs_nearest_writer;

/* Of a writer of zeros. */
void hs_nearest_writer_init(const hs_nearest *near, hs_nearest_writer *writer);

/* The row of the ranker's point: the first `count` of its keys, as far as they are within the
 * largest distance, and then entries that stand for no neighbour. HS_ERR_SHIFT_RANGE. */
hs_status hs_nearest_write(hs_nearest_writer *writer, hs_nearest_ranker *ranker, int64_t count);

/* Prefetches the row of point si, which will be written soon: rows lie far apart in memory. */
void hs_nearest_prefetch(const hs_nearest_writer *writer, int32_t si);

/* Writes what is left of the batch: needed once, at the end. Entries do not refer to the block. */
void hs_nearest_flush(hs_nearest_writer *writer);

/* Entries that stand for no neighbour, from entry `from` of the row of the caller's point
 * `row` on. */
void hs_nearest_write_nothing(const hs_nearest_writer *writer, int64_t row, int64_t from);

#endif
