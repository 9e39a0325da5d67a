/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level_plan.h: which levels are searched together. A search of two levels costs what its largest
 * reach costs, so levels much smaller than another may join for it, where the reach is about that
 * of the larger one anyway: there are a few searches a level, not one for every two levels.
 */
#ifndef HS_LEVEL_PLAN_H
#define HS_LEVEL_PLAN_H

#include "levels.h"

/* One search: these levels of the asking set among these of the points. */
typedef struct hs_level_step {
    hs_slice asking, points; /* levels */
    double   cutoff;         /* the largest length that one of the pairs is compared with */
    double   least;          /* the smallest positive radius that is involved, or 0 */
    bool     is_own;         /* one level with itself, each pair once; asking is not looked at */
    bool     by_table;       /* of all types: limits are those of the table */
    bool     has_limits;     /* pairs have lengths of their own, up to the cutoff */
} hs_level_step;

typedef struct hs_level_plan {
    hs_level_step *steps; /* owned */
    int64_t        n;
    bool           is_half; /* each pair of points once, the lower number first. If not, a level
                             * with itself gives each point all its neighbours */
    double         bound;   /* no pair is further apart than this; may be infinite */
} hs_level_plan;

/* Without queries, rules that are the same both ways give the half list; else every asking point
 * meets all that it can. HS_OK or HS_ERR_MEMORY. */
hs_status hs_level_plan_make(hs_account *account, const hs_levels *levels, double bound,
                             hs_level_plan *plan);

/* Whether one step is all of the search. */
bool hs_level_plan_is_single(const hs_levels *levels, const hs_level_plan *plan);

/* Harmless twice. */
void hs_level_plan_free(hs_account *account, hs_level_plan *plan);

#endif
