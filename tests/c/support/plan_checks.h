/* SPDX-License-Identifier: BSD-3-Clause */
/* plan_checks.h: plans of levels, and whether every pair of points is in one step of theirs. */
#ifndef HS_PLAN_CHECKS_H
#define HS_PLAN_CHECKS_H

#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/levels/level_plan.h"
#include "../../../csrc/core/search/limits.h"
#include "reach_sets.h"

static reach_set points, queries;
static double    table[12 * 12]; /* of up to 12 types */

/* A division and a plan of it. */
typedef struct planned {
    hs_account    account;
    hs_levels     levels;
    hs_level_plan plan;
} planned;

static inline void
make_plan_as(const hs_reach *reach, bool has_queries, double bound, hs_algorithm algorithm,
             planned *made)
{
    const hs_options options = hs_options_default();
    const hs_points  p = reach_points(&points), q = reach_points(&queries);
    hs_failure       failure = HS_NO_FAILURE;
    hs_account_init(&made->account, &options);
    CHECK(hs_levels_divide(&made->account, &options, &p, has_queries ? &q : NULL, reach,
                           &made->levels, &failure) == HS_OK);
    CHECK(hs_level_plan_make(&made->account, &made->levels, bound, algorithm, &made->plan) ==
          HS_OK);
}

static inline void
make_plan(const hs_reach *reach, bool has_queries, double bound, planned *made)
{
    make_plan_as(reach, has_queries, bound, HS_AUTO, made);
}

static inline void
free_plan(planned *made)
{
    hs_level_plan_free(&made->account, &made->plan);
    hs_level_plan_free(&made->account, &made->plan);
    CHECK(made->plan.steps == NULL && made->plan.n == 0);
    hs_levels_free(&made->account, &made->levels);
    CHECK(made->account.held == 0);
    hs_account_close(&made->account);
}

/* Sign of what a pair is compared with, less the cutoff. */
static inline int
compare_limit(hs_dw limit, double cutoff)
{
    return limit.hi != cutoff ? (limit.hi > cutoff) - (limit.hi < cutoff)
                              : (limit.lo > 0.0) - (limit.lo < 0.0);
}

static inline double
radius_at(const hs_level_set *set, int64_t at)
{
    return set->radii != NULL ? set->radii[at] : 0.0;
}

/* The limit of the asking point and the point at these places. */
static inline hs_dw
limit_at(const planned *made, int64_t a, int64_t b)
{
    const hs_levels *levels = &made->levels;
    return hs_limit_by(levels->rule, levels->factor, radius_at(hs_levels_asking(levels), a),
                       radius_at(&levels->points, b), made->plan.bound);
}

/* The smallest positive radius in a slice; infinity where there is none. */
static inline double
least_of(const hs_level_set *set, hs_slice slice)
{
    double least = HUGE_VAL;
    for (int64_t at = set->first[slice.first]; at < set->first[slice.end]; at++) {
        if (radius_at(set, at) > 0.0)
            least = fmin(least, radius_at(set, at));
    }
    return least;
}

/* The cutoff of two types by the table of the levels; negative: none. */
static inline double
cutoff_at(const planned *made, int64_t a, int64_t b)
{
    const hs_levels    *levels = &made->levels;
    const hs_level_set *asking = hs_levels_asking(levels);
    int32_t             row = 0, column = 0;
    while (asking->first[row + 1] <= a)
        row++;
    while (levels->points.first[column + 1] <= b)
        column++;
    return levels->cutoffs[row * levels->n + column];
}

/* Of one pair: sign of its limit less the cutoff of the step. With a table, pairs of types that have
 * none are not counted. */
static inline int
count_pair(const planned *made, const hs_level_step *step, int64_t a, int64_t b, int *covered)
{
    const bool has_types = made->levels.cutoffs != NULL;
    double     cutoff = has_types ? cutoff_at(made, a, b) : 0.0;
    if (cutoff < 0.0 && step->by_table) {
        return -1;
    }
    ++*covered;
    cutoff = fmin(cutoff, made->plan.bound);
    return compare_limit(has_types ? (hs_dw){cutoff, 0.0} : limit_at(made, a, b), step->cutoff);
}

/* Counts the pairs of a step, and checks what it says of them: no limit passes the cutoff, one or
 * more are it, and all of them are where there are no limits. */
static inline bool
cover(const planned *made, const hs_level_step *step, int *covered, int64_t n_points)
{
    const hs_level_set *asking = hs_levels_asking(&made->levels), *among = &made->levels.points;
    const hs_slice      askers = step->is_own ? step->points : step->asking;
    const double        least = fmin(least_of(asking, askers), least_of(among, step->points));
    bool                right = true, reaches = false, all_equal = true;
    if (made->levels.cutoffs == NULL) {
        const double factor = made->levels.factor, part = factor != 1.0 ? factor * 0x1p-110 : 1.0;
        right = step->least == (least < HUGE_VAL ? least * part : 0.0) && !step->by_table;
    }
    right = right && asking->first[askers.first] < asking->first[askers.end];
    right = right && among->first[step->points.first] < among->first[step->points.end];
    right = right && (!step->is_own || made->plan.is_half);
    for (int64_t a = asking->first[askers.first]; a < asking->first[askers.end]; a++) {
        const int64_t from = step->is_own ? a : among->first[step->points.first];
        for (int64_t b = from; b < among->first[step->points.end]; b++) {
            const int64_t pair = asking->number[a] * n_points + among->number[b];
            const int     sign = count_pair(made, step, a, b, &covered[pair]);
            right = right && sign <= 0;
            all_equal = all_equal && sign == 0;
            reaches = reaches || sign == 0 || made->levels.cutoffs != NULL ||
                      compare_limit(limit_at(made, a, b), hs_next_down(step->cutoff)) > 0;
        }
    }
    return right && reaches && (step->has_limits || all_equal);
}

/* Every pair as often as it must be. */
static inline bool
covers_each_once(const planned *made)
{
    static int          covered[REACH_POINTS * REACH_POINTS];
    const hs_levels    *levels = &made->levels;
    const hs_level_set *asking = hs_levels_asking(levels);
    const int64_t       n = levels->points.n, n_asking = asking->n;
    const int32_t      *of_asking = levels->has_queries ? queries.types : points.types;
    bool                right = true;
    memset(covered, 0, sizeof covered);
    for (int64_t s = 0; s < made->plan.n; s++) {
        right = cover(made, &made->plan.steps[s], covered, n) && right;
    }
    for (int64_t i = 0; i < n_asking; i++) {
        for (int64_t j = made->plan.is_half ? i : 0; j < n; j++) {
            const bool none = levels->cutoffs != NULL &&
                              table[of_asking[i] * REACH_TYPES + points.types[j]] < 0.0;
            int times = covered[i * n + j];
            times += made->plan.is_half && i != j ? covered[j * n + i] : 0;
            right = right && times == !none;
        }
    }
    return right;
}

#endif
