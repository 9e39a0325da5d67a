/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_LEVELS_LEVELS_H
#define HS_LEVELS_LEVELS_H

#include "../search/limits.h"

/*
 * levels.h: points divided by the size of their reach, so that small ones are searched in small
 * cells however large others are: a level is all points whose radii are of one binary order,
 * counted from the largest one, or all points of one type. Each level lies in one piece, which is a
 * set of points by itself.
 */

/* Points of levels that are read, or looked at, between two polls: with supports, milliseconds. */
#define HS_POLL_LEVELS (HS_POLL_POINTS / 16)

/* The supports of a set of points, read once and checked: hs_support_numbers for each point. */
typedef struct hs_support_set {
    double *numbers; /* owned; one support after the other, in the caller's order; NULL: none */
    int64_t first;   /* the number of the first */
} hs_support_set;

/* Consecutive levels, or a part of what lies in them. */
typedef struct hs_slice {
    int64_t first, end;
} hs_slice;

/* Radii of points in some levels. */
typedef struct hs_radii_range {
    double smallest, largest, least; /* least: that is not 0; infinity where there is none */
} hs_radii_range;

/* The points of one set by level, in the caller's order in each. Arrays are owned. */
typedef struct hs_level_set {
    int64_t  n;
    int      ndim;
    double  *rows;   /* n * ndim coordinates */
    int32_t *number; /* n: the caller's number of each */
    double  *radii; /* n, halved for HS_RULE_MEAN; of supports, how far they reach; NULL where there
                      * are none */
    hs_radii_range *range; /* of each level; NULL where there are no radii */
    double          lower[HS_MAX_DIM], upper[HS_MAX_DIM]; /* range of the coordinates */
    int64_t        *first;                                /* of each level, and n */
    hs_support_set  supports;                             /* in the caller's order */
} hs_level_set;

typedef struct hs_levels {
    hs_rule      rule;
    double       factor; /* radii count so many times; 1 for rules of sums */
    int32_t      n; /* levels, ascending by their radii or types; each has a point of some set */
    hs_level_set points, queries; /* queries: nothing without them */
    bool         has_queries;
    double      *cutoffs; /* owned; of two types, -1 for no pairs; NULL: radii */
    bool         has_supports;
    double       extent; /* of supports; their radii have it already */
} hs_levels;

/*
 * Reads the points, radii, types and supports, each number once, and checks their values:
 * HS_ERR_RADII, HS_ERR_TYPES, HS_ERR_SUPPORTS, HS_ERR_SUPPORT_REACH and HS_ERR_NOT_FINITE name the
 * first row that is wrong, HS_ERR_CUTOFF a table that is not symmetric or not finite. queries may
 * be NULL. HS_ERR_INTERRUPTED where the poll of the options says so. On failure holds nothing.
 */
hs_status hs_levels_divide(hs_account *account, const hs_options *options, const hs_set *points,
                           const hs_set *queries, const hs_reach *reach, hs_levels *levels,
                           hs_failure *failure);

/* Counts the points from `first` on: they are part of more. */
void hs_levels_renumber(int32_t first, hs_levels *levels);

/* Idempotent. */
void hs_levels_free(hs_account *account, hs_levels *levels);

/* Those that search: queries, or the points. */
HS_ALWAYS_INLINE const hs_level_set *
hs_levels_asking(const hs_levels *levels)
{
    return levels->has_queries ? &levels->queries : &levels->points;
}

/*
 * Which levels are searched together. A search between two levels costs what its largest reach
 * costs. Where one level is much larger than others, its own size decides the reach, and these
 * others may be searched against it all at once: so there are a few searches for each level, and
 * not one for every two levels.
 */

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
    const hs_levels *levels; /* borrowed */
    hs_level_step   *steps;  /* owned */
    int64_t          n;
    bool             is_half;   /* each pair of points once, the lower number first. If not, a level
                             * with itself gives each point all its neighbours */
    double           bound;     /* no pair is further apart than this; may be infinite */
    hs_algorithm     algorithm; /* the caller's choice, which is narrowed for each step */
} hs_level_plan;

/* Whether one step is all of the search. */
bool hs_level_plan_is_single(const hs_level_plan *plan);

/* Idempotent. */
void hs_level_plan_free(hs_account *account, hs_level_plan *plan);

/*
 * One search of all levels takes the place of several where that is quicker. Searches of a few
 * levels each sort their points and walk over them again; one search tests more candidates, each
 * with a limit of its own. Points of few sizes, all of them common, are better searched at once.
 *
 * Without queries, rules that are the same both ways give the half list; else every asking point
 * meets all that it can. algorithm: HS_HIERARCHY is levels in any case, HS_AUTO what is expected to
 * be quickest, and any other one search of all, with the largest reach; but types are searched in
 * pairs where there are more of them than a table of limits holds. box: of the points, borrowed, or
 * NULL. HS_OK, or HS_ERR_MEMORY, without a plan.
 */
hs_status hs_level_plan_make(hs_account *account, const hs_levels *levels, const hs_box *box,
                             double bound, hs_algorithm algorithm, hs_level_plan *plan);

#ifdef HS_TESTING
/* Whether plans are replaced; off at first, so that few points have several searches. */
extern bool hs_test_joins_levels;
#endif

/*
 * An open step of a plan: a search like any other, of two sets of points, or of one, with the
 * caller's numbers; and where pairs have lengths of their own, limits by radii, by the types of
 * both points or by supports, in the order of its cells. It must not move: the search has a pointer
 * to its limits.
 */
typedef struct hs_level_search {
    hs_search   search;
    hs_limits   limits;                /* where the step has any */
    hs_supports supports;              /* those of limits, if it has any */
    void       *of_asking, *of_points; /* owned: the radii of limits, the types, or the supports */
    void       *table;                 /* owned: that of limits */
} hs_level_search;

/*
 * Opens step number `step`, for the options of the call but for the cutoff, which is set to that of
 * the step. keeps_none: pairs are not kept. On failure it is closed, and the failure names rows as
 * the caller does.
 */
hs_status hs_level_open(const hs_level_plan *plan, int64_t step, const hs_box *box, bool keeps_none,
                        hs_call *call, hs_level_search *open, hs_failure *failure);

/* Idempotent. */
void hs_level_close(hs_level_search *open);

#endif
