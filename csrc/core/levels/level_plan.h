/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level_plan.h: which levels are searched together. A search between two levels costs what its
 * largest reach costs. Where one level is much larger than others, its own size decides the reach,
 * and these others may be searched against it all at once: so there are a few searches for each
 * level, and not one for every two levels.
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
    bool           is_half;   /* each pair of points once, the lower number first. If not, a level
                             * with itself gives each point all its neighbours */
    double         bound;     /* no pair is further apart than this; may be infinite */
    hs_algorithm   algorithm; /* the caller's choice, which level_search.c narrows for each step */
} hs_level_plan;

/* Without queries, rules that are the same both ways give the half list; else every asking point
 * meets all that it can. HS_OK or HS_ERR_MEMORY. algorithm: HS_HIERARCHY is levels in any case,
 * HS_AUTO what is expected to be quickest, and any other one search of all, with the largest reach;
 * but types are searched in pairs where there are more of them than a table of limits holds. */
hs_status hs_level_plan_make(hs_account *account, const hs_levels *levels, double bound,
                             hs_algorithm algorithm, hs_level_plan *plan);

/* One step that is all of a search by radii, in place of those of the plan, which has some. */
hs_level_step hs_level_plan_all(const hs_levels *levels, const hs_level_plan *plan);

/* Whether one step is all of the search. */
bool hs_level_plan_is_single(const hs_levels *levels, const hs_level_plan *plan);

/* Harmless twice. */
void hs_level_plan_free(hs_account *account, hs_level_plan *plan);

#endif
