/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * levels.h: points divided by the size of their reach, so that small ones are searched in small
 * cells however large others are: a level is all points whose radii are of one binary order,
 * counted from the largest one, or all points of one type. Each level lies in one piece, which is a
 * set of points by itself.
 */
#ifndef HS_LEVELS_H
#define HS_LEVELS_H

#include "support_set.h"

/* Consecutive levels, or a part of what lies in them. */
typedef struct hs_slice {
    int64_t first, end;
} hs_slice;

/* The points of one set by level, in the caller's order in each. Arrays are owned. */
typedef struct hs_level_set {
    int64_t  n;
    int      ndim;
    double  *rows;   /* n * ndim coordinates */
    int32_t *number; /* n: the caller's number of each */
    double  *radii; /* n, halved for HS_RULE_MEAN; of supports, how far they reach; NULL where there
                      * are none */
    int64_t *first; /* of each level, and n */
    hs_support_set supports; /* in the caller's order */
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
hs_status hs_levels_divide(hs_account *account, const hs_options *options, const hs_points *points,
                           const hs_points *queries, const hs_reach *reach, hs_levels *levels,
                           hs_failure *failure);

/* Counts the points from `first` on: they are part of more. */
void hs_levels_renumber(int32_t first, hs_levels *levels);

/* Harmless twice. */
void hs_levels_free(hs_account *account, hs_levels *levels);

/* The points of these levels, borrowed. */
hs_points hs_level_points(const hs_level_set *set, hs_slice levels);

/* How many these are. */
HS_ALWAYS_INLINE double
hs_level_count(const hs_level_set *set, hs_slice levels)
{
    return (double)(set->first[levels.end] - set->first[levels.first]);
}

/* Those that search: queries, or the points. */
HS_ALWAYS_INLINE const hs_level_set *
hs_levels_asking(const hs_levels *levels)
{
    return levels->has_queries ? &levels->queries : &levels->points;
}

#endif
