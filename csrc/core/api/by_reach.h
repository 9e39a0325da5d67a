/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * by_reach.h: searches in which pairs have a reach of their own: several searches of levels, one
 * after the other, in place of one.
 */
#ifndef HS_BY_REACH_H
#define HS_BY_REACH_H

#include "../levels/level_join.h"
#include "../levels/level_search.h"

#include "request.h"

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

/* Harmless twice. */
void hs_by_reach_close(hs_call *call, hs_by_reach *by);

/* Uses each search in turn, as long as that gives HS_OK; *n_pairs, zero before, is how many all of
 * them found. keeps_none: pairs are not kept. */
hs_status hs_by_reach_each(const hs_by_reach *by, bool keeps_none, hs_call *call, hs_use_fn use,
                           void *context, int64_t *n_pairs, hs_failure *failure);

/* Uses the one search that there is, of all neighbours of each asking point. */
hs_status hs_by_reach_single(hs_by_reach *by, hs_call *call, hs_use_fn use, void *context,
                             int64_t *n_pairs, hs_failure *failure);

/* hs_request_use for requests with a reach and without. */
hs_status hs_by_reach_use(const hs_request *request, hs_use_fn use, void *context,
                          hs_failure *failure);

#endif
