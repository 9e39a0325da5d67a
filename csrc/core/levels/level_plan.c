/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * level_plan.c: the steps by rule. With a sum, the larger of two points decides nearly alone once
 * the other one is an eighth of it: only the two levels below a level are searched by themselves.
 */
#include "level_plan.h"

#include "../base/rule.h"
#include "../search/limits.h"

#include <math.h>

/* Levels below another that are searched one by one for a sum of radii. */
#define APART 2

/* Steps that a level begins, at most: with itself, with those below it, and these with it. */
#define MOST_STEPS (1 + 2 * (APART + 1))

/* Times a product of two float64s, less than what its low word is a multiple of. */
#define LOW_WORD 0x1p-110

/* Radii of points in some levels; nothing where there are none. */
typedef struct radii_range {
    double smallest, largest, least; /* least: that is not 0 */
} radii_range;

/* Extremes are found in so many parts, which do not wait for each other. */
#define PARTS 4

/* The smallest of radii, and of those that are not 0; infinity where there are none. */
static void
find_smallest(const double *radii, int64_t n, radii_range *range)
{
    double smallest[PARTS], least[PARTS];
    for (int p = 0; p < PARTS; p++) {
        smallest[p] = least[p] = HUGE_VAL;
    }
    for (int64_t first = 0; first < n; first += PARTS) {
        for (int p = 0; p < PARTS; p++) {
            const double radius = radii[first + p < n ? first + p : n - 1];
            const double positive = radius > 0.0 ? radius : HUGE_VAL;
            smallest[p] = hs_smaller(smallest[p], radius);
            least[p] = hs_smaller(least[p], positive);
        }
    }
    for (int p = 0; p < PARTS; p++) {
        range->smallest = hs_smaller(range->smallest, smallest[p]);
        range->least = hs_smaller(range->least, least[p]);
    }
}

static double
largest_of(const double *radii, int64_t n)
{
    double largest[PARTS] = {0.0};
    for (int64_t first = 0; first < n; first += PARTS) {
        for (int p = 0; p < PARTS; p++) {
            largest[p] = hs_larger(largest[p], radii[first + p < n ? first + p : n - 1]);
        }
    }
    return hs_larger(hs_larger(largest[0], largest[1]), hs_larger(largest[2], largest[3]));
}

/* Of a slice that has a point. Levels ascend, so that the first ones and the last tell all. */
static radii_range
range_of(const hs_level_set *set, hs_slice levels)
{
    const int64_t end = set->first[levels.end];
    int64_t       last = levels.end - 1;
    if (set->radii == NULL) {
        return (radii_range){0.0, 0.0, 0.0};
    }
    radii_range range = {.smallest = HUGE_VAL, .least = HUGE_VAL};
    for (int64_t l = levels.first; l < levels.end && range.least == HUGE_VAL; l++) {
        const int64_t first = set->first[l];
        find_smallest(set->radii + first, set->first[l + 1] - first, &range);
    }
    while (set->first[last] == end) {
        last--;
    }
    range.largest = largest_of(set->radii + set->first[last], end - set->first[last]);
    range.least = range.least == HUGE_VAL ? 0.0 : range.least;
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

static hs_dw
limit_by(const planning *now, double asking, double other)
{
    return hs_limit_by(now->levels->rule, now->levels->factor, asking, other, now->plan->bound);
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
    const hs_dw       low = limit_by(now, a.smallest, b.smallest);
    const hs_dw       high = limit_by(now, a.largest, b.largest);
    step.cutoff = high.lo > 0.0 ? hs_next_up(high.hi) : high.hi;
    step.least = a.least > 0.0 && !(b.least > 0.0 && b.least < a.least) ? a.least : b.least;
    if (levels->factor != 1.0) { /* where lengths are scaled, the low words of products count */
        step.least *= levels->factor * LOW_WORD;
    }
    step.has_limits = levels->has_supports || low.hi != high.hi || low.lo != 0.0 || high.lo != 0.0;
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

/* By how much the candidates of all pairs of types are fewer than those of all at once. */
static double
share_of_paired(const hs_levels *levels)
{
    const hs_level_set *asking = hs_levels_asking(levels), *points = &levels->points;
    const int32_t       n = levels->n;
    double              largest = 0.0, share = 0.0;
    for (int32_t e = 0; e < n * n; e++) {
        largest = hs_larger(largest, levels->cutoffs[e]);
    }
    const double all = (double)asking->n * (double)points->n;
    for (int32_t e = 0; e < n * n && largest > 0.0 && all > 0.0; e++) {
        const double   volume = pow(hs_larger(levels->cutoffs[e], 0.0) / largest, points->ndim);
        const hs_slice a = {e / n, e / n + 1}, b = {e % n, e % n + 1};
        share += hs_level_count(asking, a) * hs_level_count(points, b) / all * volume;
    }
    return share;
}

/* Whether there is one search, as far as that does not depend on where the points are. */
static bool
takes_all(const hs_levels *levels, hs_algorithm algorithm)
{
    const bool has_types = levels->cutoffs != NULL;
    if (levels->n < 2 || algorithm == HS_HIERARCHY || (has_types && levels->n > HS_TABLE_TYPES)) {
        return false;
    }
    return algorithm != HS_AUTO || (has_types && share_of_paired(levels) > SHARE_OF_PAIRED);
}

static void
add_all(planning *now)
{
    const hs_levels *levels = now->levels;
    const hs_slice   all = {0, levels->n};
    if (levels->cutoffs == NULL) {
        add_step(now, all, all, now->plan->is_half);
        return;
    }
    hs_level_step step = {.asking = all,
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
hs_level_plan_make(hs_account *account, const hs_levels *levels, double bound,
                   hs_algorithm algorithm, hs_level_plan *plan)
{
    const int64_t n = levels->n, most = levels->cutoffs != NULL ? 2 * n : MOST_STEPS;
    const bool    is_directed = levels->cutoffs == NULL && hs_rule_is_directed(levels->rule);
    *plan = (hs_level_plan){
        .is_half = !levels->has_queries && !is_directed, .bound = bound, .algorithm = algorithm};
    plan->steps = hs_alloc(account, HS_FOR_CELLS, n * most, sizeof *plan->steps);
    if (plan->steps == NULL) {
        return HS_ERR_MEMORY;
    }
    planning now = {.levels = levels, .plan = plan};
    if (takes_all(levels, algorithm)) {
        add_all(&now);
        return HS_OK;
    }
    for (int32_t l = 0; l < n; l++) {
        add_level(&now, l);
    }
    HS_ASSERT(plan->n <= n * most);
    return HS_OK;
}

hs_level_step
hs_level_plan_all(const hs_levels *levels, const hs_level_plan *plan)
{
    hs_level_step  all = {.is_own = plan->is_half};
    hs_level_plan  one = {.steps = &all, .is_half = plan->is_half, .bound = plan->bound};
    planning       now = {.levels = levels, .plan = &one};
    const hs_slice each = {0, levels->n};
    add_step(&now, each, each, plan->is_half);
    HS_ASSERT(one.n == 1);
    return all;
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
