/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * nearest_rank.h: the k nearest of a point's hits, in order. Squared distances in float64 put them
 * in order as far as their error allows; what is too close to tell is compared exactly.
 */
#ifndef HS_NEAREST_RANK_H
#define HS_NEAREST_RANK_H

#include "nearest_block.h"
#include "nearest_keys.h"

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

/* What the metric measures to, and its shift; also S over the periodic box vectors as given when
 * `given` is not NULL. False when a shift passes its range. */
bool hs_nearest_pair(const hs_nearest *near, const hs_nearest_block *block, int32_t si,
                     int32_t place, double *q, int64_t *shift, int64_t *given);

#endif
