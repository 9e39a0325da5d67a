/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level_plan.c: the steps by rule. With a sum, the larger of two points decides nearly alone once
 * the other one is an eighth of it: only the two levels below a level are searched by themselves.
 */
#include "level_plan.h"

#include "../search/limits.h"

#include <math.h>

/* Levels below another that are searched one by one for a sum of radii. */
#define APART 2

/* Steps that a level begins, at most: with itself, with those below it, and these with it. */
#define MOST_STEPS (1 + 2 * (APART + 1))

/* Radii of points in some levels; nothing where there are none. */
typedef struct radii_range {
    double smallest, largest, least; /* least: that is not 0 */
} radii_range;

static radii_range
range_of(const hs_level_set *set, hs_slice levels)
{
    if (set->radii == NULL) {
        return (radii_range){0.0, 0.0, 0.0};
    }
    radii_range range = {HUGE_VAL, 0.0, 0.0};
    for (int64_t i = set->first[levels.first]; i < set->first[levels.end]; i++) {
        const double radius = set->radii[i];
        range.smallest = hs_smaller(range.smallest, radius);
        range.largest = hs_larger(range.largest, radius);
        if (radius > 0.0 && !(range.least > 0.0 && range.least <= radius)) {
            range.least = radius;
        }
    }
    return range;
}

/* What steps are added to, and from. */
typedef struct planning {
    const hs_levels *levels;
    hs_level_plan   *plan;
} planning;

static bool
is_empty(const hs_level_set *set, hs_slice levels)
{
    return levels.first >= levels.end || set->first[levels.first] == set->first[levels.end];
}

static void
add_step(planning *now, hs_slice asking, hs_slice points, bool is_own)
{
    const hs_levels    *levels = now->levels;
    hs_level_plan      *plan = now->plan;
    const hs_level_set *askers = hs_levels_asking(levels);
    if (is_empty(askers, asking) || is_empty(&levels->points, points)) {
        return;
    }
    hs_level_step step = {.asking = asking, .points = points, .is_own = is_own};
    if (levels->cutoffs != NULL) {
        step.cutoff = levels->cutoffs[asking.first * levels->n + points.first];
        if (step.cutoff < 0.0) {
            return;
        }
        step.cutoff = hs_smaller(step.cutoff, plan->bound);
        plan->steps[plan->n++] = step;
        return;
    }
    const radii_range a = range_of(askers, asking), b = range_of(&levels->points, points);
    const hs_dw       low = hs_limit_by(levels->rule, a.smallest, b.smallest, plan->bound);
    const hs_dw       high = hs_limit_by(levels->rule, a.largest, b.largest, plan->bound);
    step.cutoff = high.lo > 0.0 ? hs_next_up(high.hi) : high.hi;
    step.least = a.least > 0.0 && !(b.least > 0.0 && b.least < a.least) ? a.least : b.least;
    step.has_limits = low.hi != high.hi || low.lo != 0.0 || high.lo != 0.0;
    plan->steps[plan->n++] = step;
}

/* Level l with itself and with all below it, those far below together; with queries, both ways. */
static void
add_below(planning *now, int32_t l, int32_t apart)
{
    const hs_slice own = {l, l + 1};
    const bool     is_half = now->plan->is_half;
    add_step(now, own, own, is_half);
    for (int32_t below = l - 1; below >= 0 && below >= l - apart; below--) {
        const hs_slice other = {below, below + 1};
        add_step(now, own, other, false);
        if (!is_half) {
            add_step(now, other, own, false);
        }
    }
    const hs_slice rest = {0, l - apart};
    add_step(now, own, rest, false);
    if (!is_half) {
        add_step(now, rest, own, false);
    }
}

/* Level l with itself and with all above it, which look among its points. */
static void
add_above(planning *now, int32_t l)
{
    const hs_slice own = {l, l + 1}, rest = {l + 1, now->levels->n};
    add_step(now, own, own, now->plan->is_half);
    add_step(now, rest, own, false);
    if (!now->plan->is_half) {
        add_step(now, own, rest, false);
    }
}

/*
 * Whether all types are searched at once, with the largest cutoff, and not in pairs. These test
 * fewer candidates, in proportion to the volumes of their cutoffs, but sort every type into cells
 * for every other: with three types that costs two or three times as much.
 */
#define SHARE_OF_PAIRED 0.3

static double
count_of(const hs_level_set *set, int32_t level)
{
    return (double)(set->first[level + 1] - set->first[level]);
}

static bool
takes_all_types(const hs_levels *levels)
{
    const hs_level_set *asking = hs_levels_asking(levels), *points = &levels->points;
    const int32_t       n = levels->n;
    double              largest = 0.0, share = 0.0;
    if (n > HS_TABLE_TYPES || n < 2) {
        return false;
    }
    for (int32_t e = 0; e < n * n; e++) {
        largest = hs_larger(largest, levels->cutoffs[e]);
    }
    const double all = (double)asking->n * (double)points->n;
    for (int32_t a = 0; a < n && largest > 0.0; a++) {
        for (int32_t b = 0; b < n; b++) {
            const double part = hs_larger(levels->cutoffs[a * n + b], 0.0) / largest;
            const double volume = pow(part, points->ndim);
            share += count_of(asking, a) * count_of(points, b) / all * volume;
        }
    }
    return share > SHARE_OF_PAIRED;
}

static void
add_all_types(planning *now)
{
    const hs_levels *levels = now->levels;
    const hs_slice   all = {0, levels->n};
    hs_level_step    step = {.asking = all,
                             .points = all,
                             .is_own = now->plan->is_half,
                             .by_table = true,
                             .has_limits = true};
    for (int32_t e = 0; e < levels->n * levels->n; e++) {
        const double cutoff = levels->cutoffs[e];
        step.cutoff = hs_larger(step.cutoff, cutoff);
        if (cutoff > 0.0 && !(step.least > 0.0 && step.least <= cutoff)) {
            step.least = cutoff;
        }
    }
    step.cutoff = hs_smaller(step.cutoff, now->plan->bound);
    now->plan->steps[now->plan->n++] = step;
}

static void
add_level(planning *now, int32_t l)
{
    const hs_slice own = {l, l + 1}, all = {0, now->levels->n};
    if (now->levels->cutoffs != NULL) {
        add_below(now, l, l);
        return;
    }
    switch (now->levels->rule) {
    case HS_RULE_MAX: add_below(now, l, 0); break;
    case HS_RULE_MIN: add_above(now, l); break;
    case HS_RULE_GATHER: add_step(now, own, all, false); break;
    case HS_RULE_SCATTER: add_step(now, all, own, false); break;
    default: add_below(now, l, APART);
    }
}

hs_status
hs_level_plan_make(hs_account *account, const hs_levels *levels, double bound, hs_level_plan *plan)
{
    const int64_t n = levels->n, most = levels->cutoffs != NULL ? 2 * n : MOST_STEPS;
    const bool    is_directed = levels->cutoffs == NULL &&
                             (levels->rule == HS_RULE_GATHER || levels->rule == HS_RULE_SCATTER);
    *plan = (hs_level_plan){.is_half = !levels->has_queries && !is_directed, .bound = bound};
    plan->steps = hs_alloc(account, HS_FOR_CELLS, n * most, sizeof *plan->steps);
    if (plan->steps == NULL) {
        return HS_ERR_MEMORY;
    }
    planning now = {.levels = levels, .plan = plan};
    if (levels->cutoffs != NULL && takes_all_types(levels)) {
        add_all_types(&now);
        return HS_OK;
    }
    for (int32_t l = 0; l < n; l++) {
        add_level(&now, l);
    }
    HS_ASSERT(plan->n <= n * most);
    return HS_OK;
}

bool
hs_level_plan_is_single(const hs_levels *levels, const hs_level_plan *plan)
{
    const hs_level_step *step = plan->steps;
    return plan->n == 1 && step->points.first == 0 && step->points.end == levels->n &&
           step->asking.first == 0 && step->asking.end == levels->n;
}

void
hs_level_plan_free(hs_account *account, hs_level_plan *plan)
{
    hs_free(account, plan->steps);
    *plan = (hs_level_plan){.n = 0};
}
