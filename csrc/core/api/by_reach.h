/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_BY_REACH_H
#define HS_API_BY_REACH_H

#include "../levels/levels.h"
#include "request.h"

/*
 * by_reach.h: searches in which pairs have a reach of their own: several searches of levels, one
 * after the other, in place of one.
 */

/* What the searches of a request are. */
typedef struct hs_by_reach {
    hs_levels     levels;
    hs_level_plan plan;
    const hs_box *box; /* borrowed */
} hs_by_reach;

/* Whether a request has all that its reach needs; points and options have been checked. */
hs_status hs_by_reach_check(const hs_request *request, hs_failure *failure);

/* Checks the arguments of a request that has a reach, and divides the points, for a call that has
 * begun. On failure it holds nothing. */
hs_status hs_by_reach_open(const hs_request *request, hs_call *call, hs_by_reach *by,
                           hs_failure *failure);

/* Idempotent. */
void hs_by_reach_close(hs_call *call, hs_by_reach *by);

/* hs_request_use for requests with a reach and without. */
hs_status hs_by_reach_each_step(const hs_request *request, hs_use_fn use, void *context,
                                hs_failure *failure);

/*
 * What hs_pairs_find, hs_neighbors_find and hs_neighbors_count do for a request that
 * has a reach. fill, count: what does it for one search, which is taken where there is but one.
 */

hs_status hs_by_reach_pairs(const hs_request *request, hs_pairs **result, hs_failure *failure);
hs_status hs_by_reach_rows(const hs_request *request, hs_fill_fn fill, hs_pairs **result,
                           hs_failure *failure);
hs_status hs_by_reach_count_rows(const hs_request *request, hs_use_fn count, int64_t *counts,
                                 hs_failure *failure);

#endif
