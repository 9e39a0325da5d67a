/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_unit.h: a search for the nearest that is ready, so that a test can take its steps one by
 * one. */
#ifndef HS_NEAREST_UNIT_H
#define HS_NEAREST_UNIT_H

#include "../../../csrc/core/base/status.h"
#include "../../../csrc/core/nearest/candidates.h"
#include "../../../csrc/core/nearest/nearest.h"
#include "harness.h"

typedef struct nearest_unit {
    hs_call    call;
    hs_search  search;
    hs_nearest near;
    hs_output  rows;
} nearest_unit;

/* want: quantities of the rows. limit: the largest distance. */
static inline void
nearest_unit_open_by(int threads, const hs_points *points, const hs_points *queries,
                     const hs_box *box, int64_t k, unsigned want, double limit, nearest_unit *unit)
{
    const hs_sets sets = {
        .points = points, .queries = queries, .is_full = true, .is_plain = true, .is_wide = true};
    hs_options options = hs_options_default();
    hs_failure failure;
    options.cutoff = limit;
    options.want = want;
    options.threads = threads;
    hs_call_begin(&options, &unit->call);
    hs_search_begin(&unit->call, &unit->search);
    unit->near = (hs_nearest){
        .search = &unit->search, .k = k, .omits_self = queries == NULL, .rows = &unit->rows};
    hs_output_init(&unit->call.account, points->ndim, want, 8, &unit->rows);
    CHECK(hs_nearest_prepare(&unit->near, &sets, box, limit, &failure) == HS_OK);
    unit->near.shared = hs_shared_new(&unit->call.account, HS_FOR_CANDIDATES);
    CHECK(unit->near.shared != NULL);
}

static inline void
nearest_unit_open(const hs_points *points, const hs_points *queries, const hs_box *box, int64_t k,
                  unsigned want, double limit, nearest_unit *unit)
{
    nearest_unit_open_by(1, points, queries, box, k, want, limit, unit);
}

static inline void
nearest_unit_close(nearest_unit *unit)
{
    hs_shared_free(unit->near.shared);
    hs_nearest_release(&unit->near);
    hs_output_free(&unit->rows);
    hs_search_close(&unit->search);
    hs_call_dismiss(&unit->call);
    hs_account_close(&unit->call.account);
}

/* All asking points as one group, with this radius. A block holds the coordinates of the first of
 * them only, as many as groups have. */
static inline hs_nearest_group
nearest_unit_group(const nearest_unit *unit, double radius)
{
    hs_nearest_group group;
    hs_nearest_group_set(&unit->near, 0, (int32_t)hs_search_asking(&unit->search)->n, &group);
    group.last = group.last < HS_GROUP_POINTS ? group.last : HS_GROUP_POINTS;
    group.radius = radius;
    return group;
}

/* Fills a block for one group from leaves of its own. */
static inline hs_status
nearest_unit_fill(nearest_unit *unit, const hs_nearest_group *group, double most,
                  hs_nearest_leaves *leaves, hs_nearest_block *block)
{
    CHECK(hs_nearest_leaves_find(&unit->near, group, most, leaves) == HS_OK);
    return hs_nearest_block_fill(&unit->near, &unit->call.options, group, most, leaves, block);
}

/* Frees the memory of leaves and a block, and makes them as they were at first. */
static inline void
nearest_unit_clear(nearest_unit *unit, hs_nearest_leaves *leaves, hs_nearest_block *block)
{
    hs_shared_release(unit->near.shared, &leaves->memory);
    hs_shared_release(unit->near.shared, &block->memory);
    memset(leaves, 0, sizeof *leaves);
    memset(block, 0, sizeof *block);
}

#endif
