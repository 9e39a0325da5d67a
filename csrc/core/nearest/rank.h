/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_NEAREST_RANK_H
#define HS_NEAREST_RANK_H

#include "../base/os.h"
#include "candidates.h"
#include "../collect/record.h"
#include "../search/choice.h"

/*
 * rank.h: the nearest of the hits in order: keys, comparisons that floats cannot tell, and rows of
 * results.
 */

/* Hits put in order, by their squares or by any comparison. */

/* A hit: its place in the block, and about |D|^2 in the block's units. */
typedef struct hs_nearest_key {
    double  square;
    int32_t place;
} hs_nearest_key;

/* Whether b must come before a. */
typedef bool (*hs_nearest_before_fn)(void *context, const hs_nearest_key *b,
                                     const hs_nearest_key *a);

#define HS_NEAREST_FEW     24 /* up to here keys are sorted by insertion */
#define HS_NEAREST_COUNTED 64 /* up to here each key's place is counted, without a branch */

/* Steps between two polls: some milliseconds, even of exact comparisons. */
#define HS_NEAREST_POLL_STEPS (INT64_C(1) << 15)

/* Whether what may take long goes on: once it does not, keys are in any order, some of them twice,
 * and of no use. */
typedef struct hs_nearest_pace {
    const hs_options *options; /* borrowed; polled */
    int64_t           steps;   /* since the last poll */
    hs_status         status;
} hs_nearest_pace;

/* Counts so many more steps, and polls now and then; false: stop. */
HS_ALWAYS_INLINE bool
hs_nearest_goes_on(hs_nearest_pace *pace, int64_t steps)
{
    pace->steps += steps;
    if (pace->steps >= HS_NEAREST_POLL_STEPS && pace->status == HS_OK) {
        pace->steps = 0;
        pace->status = hs_poll(pace->options, 0.0);
    }
    return pace->status == HS_OK;
}

/* Sorts by squares, none of which is above `largest`. *spare: room for n keys; the two may change
 * places. */
void hs_nearest_sort(hs_nearest_pace *pace, hs_nearest_key **keys, hs_nearest_key **spare,
                     int64_t n, double largest);

/* Stable, by insertion. */
HS_ALWAYS_INLINE void
hs_nearest_insert(void *context, hs_nearest_key *keys, int64_t n, hs_nearest_before_fn before)
{
    for (int64_t e = 1; e < n; e++) {
        const hs_nearest_key key = keys[e];
        int64_t              at = e;
        for (; at > 0 && before(context, &key, &keys[at - 1]); at--) {
            keys[at] = keys[at - 1];
        }
        keys[at] = key;
    }
}

/* Stable, by merging, with room for n keys in `left`; few calls of `before` where all is in order
 * already. */
HS_ALWAYS_INLINE void
hs_nearest_merge(hs_nearest_pace *pace, void *context, hs_nearest_key *keys, hs_nearest_key *left,
                 int64_t n, hs_nearest_before_fn before)
{
    for (int64_t begin = 0; begin < n && hs_nearest_goes_on(pace, HS_NEAREST_FEW);
         begin += HS_NEAREST_FEW) {
        hs_nearest_insert(context, keys + begin,
                          n - begin < HS_NEAREST_FEW ? n - begin : HS_NEAREST_FEW, before);
    }
    for (int64_t width = HS_NEAREST_FEW; width < n; width *= 2) {
        for (int64_t begin = 0; begin + width < n && hs_nearest_goes_on(pace, 1);
             begin += 2 * width) {
            hs_nearest_key *to = keys + begin, *right = to + width;
            const int64_t   n_right = n - begin - width < width ? n - begin - width : width;
            if (!before(context, right, right - 1)) {
                continue;
            }
            memcpy(left, to, (size_t)width * sizeof *left);
            for (int64_t l = 0, r = 0; l < width && hs_nearest_goes_on(pace, 1);) {
                const bool takes_right = r < n_right && before(context, &right[r], &left[l]);
                *to++ = takes_right ? right[r++] : left[l++];
            }
        }
    }
}

/*
 * The k nearest of a point's hits, in order. Squared distances in float64 put them
 * in order as far as their error allows; what is too close to tell is compared exactly.
 */

/* Owned by a thread. */
typedef struct hs_nearest_ranker {
    const hs_nearest       *near;  /* borrowed */
    const hs_nearest_block *block; /* borrowed */
    hs_nearest_key         *keys;  /* those that count come first */
    hs_nearest_key         *spare;
    int64_t                 capacity;
    int32_t                 si; /* the asking point */
    hs_nearest_pace         pace;
    hs_stages               stages;
    int64_t                 n_compared;
} hs_nearest_ranker;

void hs_nearest_ranker_free(hs_nearest_ranker *ranker);

/* Point sj in one image, as asking point si sees it. */
typedef struct hs_nearest_candidate {
    int32_t        si, sj;
    const int32_t *image;  /* shifts over the rows of B */
    double         square; /* about |D|^2, of lengths times the unit */
    double         unit;
    double         error; /* of each component of D, times the unit */
} hs_nearest_candidate;

/* Whether the call's choice lets it count, decided exactly. The point itself does, unless it is of
 * another group. Any status of hs_choice_is_nearest. */
hs_status hs_nearest_counts(const hs_nearest *near, const hs_chooser *chooser,
                            const hs_nearest_candidate *candidate, hs_stages *stages, bool *counts);

/* Takes out of the *n hits of point si, and of their squares unless these are NULL, what does not
 * count. Any status of hs_nearest_counts, or HS_ERR_INTERRUPTED. */
hs_status hs_nearest_choose(hs_nearest_ranker *ranker, int32_t si, int32_t *hits, float *squares,
                            int32_t *n);

/* Ranks as hs_nearest_rank does, but from squares in float32, for a block that has them: false when
 * these cannot tell. */
bool hs_nearest_rank_fast(hs_nearest_ranker *ranker, int32_t si, const int32_t *hits,
                          const float *squares, int64_t n, int64_t *count);

/*
 * Ranks the nearest of n hits of point si: ranker->keys[0 ... *count - 1], at most k, in order of
 * distance, then (j, S). *count is -1 when there may be nearer ones beyond the group's radius.
 * HS_ERR_MEMORY, HS_ERR_INTERRUPTED.
 */
hs_status hs_nearest_rank(hs_nearest_ranker *ranker, const hs_nearest_group *group, int32_t si,
                          const int32_t *hits, int64_t n, int64_t *count);

/* Rows of the nearest, to their places in the output: k entries for each asking
 * point, in the caller's order; what a row lacks is j = -1, d = infinity, D = NaN and S = 0. */

/* Owned by a thread. A batch of entries that are still to be measured. */
typedef struct hs_nearest_writer {
    const hs_nearest *near; /* borrowed */
    void             *j;    /* columns of the output; NULL where they are not wanted */
    double           *d, *D;
    int32_t          *S;
    int64_t           at[HS_BATCH];       /* entry of the output */
    bool              is_first[HS_BATCH]; /* of its row */
    hs_measured       pairs;              /* shifts are zero from the first entry that is free on */
} hs_nearest_writer;

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
void hs_nearest_write_nothing(const hs_nearest *near, int64_t row, int64_t from);

#endif
