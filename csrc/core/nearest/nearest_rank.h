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
typedef struct hs_near_ranker {
    const hs_near       *near;  /* borrowed */
    const hs_near_block *block; /* borrowed */
    hs_near_key         *keys;  /* those that count come first */
    hs_near_key         *spare;
    int64_t              capacity;
    int32_t              si; /* the asking point */
    hs_near_pace         pace;
    hs_stages            stages;
    int64_t              n_compared;
} hs_near_ranker;

void hs_near_ranker_free(hs_near_ranker *ranker);

/* Ranks as hs_near_rank does, but from squares in float32, for a block that has them: false when
 * these cannot tell. */
bool hs_near_rank_fast(hs_near_ranker *ranker, int32_t si, const int32_t *hits,
                       const float *squares, int64_t n, int64_t *count);

/*
 * Ranks the nearest of n hits of point si: ranker->keys[0 ... *count - 1], at most k, in order of
 * distance, then (j, S). *count is -1 when there may be nearer ones beyond the group's radius.
 * HS_ERR_MEMORY, HS_ERR_INTERRUPTED.
 */
hs_status hs_near_rank(hs_near_ranker *ranker, const hs_near_group *group, int32_t si,
                       const int32_t *hits, int64_t n, int64_t *count);

/* What the metric measures to, and its shift; also S over the periodic box vectors as given when
 * `given` is not NULL. False when a shift passes its range. */
bool hs_near_pair(const hs_near *near, const hs_near_block *block, int32_t si, int32_t place,
                  double *q, int64_t *shift, int64_t *given);

#endif
