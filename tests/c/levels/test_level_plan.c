/* SPDX-License-Identifier: BSD-3-Clause */
/* test_level_plan.c: whatever the rule and the radii, each pair of points is in exactly one step,
 * whose cutoff is no less than its limit. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/levels/level_plan.h"
#include "../../../csrc/core/search/limits.h"
#include "../support/poll_checks.h"
#include "../support/reach_sets.h"

void test_level_plan(void);

static reach_set points, queries;
static double    table[REACH_TYPES * REACH_TYPES];

/* A division and a plan of it. */
typedef struct planned {
    hs_account    account;
    hs_levels     levels;
    hs_level_plan plan;
} planned;

static void
make_plan(const hs_reach *reach, bool has_queries, double bound, planned *made)
{
    const hs_options options = hs_options_default();
    const hs_points  p = reach_points(&points), q = reach_points(&queries);
    hs_failure       failure = HS_NO_FAILURE;
    hs_account_init(&made->account, &options);
    CHECK(hs_levels_divide(&made->account, &p, has_queries ? &q : NULL, reach, &made->levels,
                           &failure) == HS_OK);
    CHECK(hs_level_plan_make(&made->account, &made->levels, bound, &made->plan) == HS_OK);
}

static void
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
static int
compare_limit(hs_dw limit, double cutoff)
{
    return limit.hi != cutoff ? (limit.hi > cutoff) - (limit.hi < cutoff)
                              : (limit.lo > 0.0) - (limit.lo < 0.0);
}

static double
radius_at(const hs_level_set *set, int64_t at)
{
    return set->radii != NULL ? set->radii[at] : 0.0;
}

/* The limit of the asking point and the point at these places. */
static hs_dw
limit_at(const planned *made, int64_t a, int64_t b)
{
    const hs_levels *levels = &made->levels;
    return hs_limit_by(levels->rule, radius_at(hs_levels_asking(levels), a),
                       radius_at(&levels->points, b), made->plan.bound);
}

/* The smallest positive radius in a slice; infinity where there is none. */
static double
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
static double
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
static int
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
static bool
cover(const planned *made, const hs_level_step *step, int *covered, int64_t n_points)
{
    const hs_level_set *asking = hs_levels_asking(&made->levels), *among = &made->levels.points;
    const hs_slice      askers = step->is_own ? step->points : step->asking;
    const double        least = fmin(least_of(asking, askers), least_of(among, step->points));
    bool                right = true, reaches = false, all_equal = true;
    if (made->levels.cutoffs == NULL) {
        right = step->least == (least < HUGE_VAL ? least : 0.0) && !step->by_table;
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
static bool
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

static void
each_pair_is_in_one_step(void)
{
    harness_random random = {71};
    int            wrong = 0, plain = 0, with_limits = 0;
    for (int trial = 0; trial < 600; trial++) {
        const bool     has_queries = trial & 1;
        const hs_rule  rule = (hs_rule)(trial / 2 % HS_RULE_END);
        const int      spread = trial / 12 % 5; /* no subnormal ones, which cannot be halved */
        const double   bound = trial % 5 ? HUGE_VAL : 0.3 * random_unit(&random);
        const hs_reach reach = {.rule = rule, .radii = points.radii, .query_radii = queries.radii};
        planned        made;
        reach_fill(&random, trial % 10 ? 60 : trial % 20, 1, 1.0, spread, 0.7, &points);
        reach_fill(&random, trial % 7 ? 40 : 0, 1, 1.0, trial % 4 ? spread : 0, 0.7, &queries);
        make_plan(&reach, has_queries, bound, &made);
        CHECK(made.plan.is_half ==
              (!has_queries && rule != HS_RULE_GATHER && rule != HS_RULE_SCATTER));
        wrong += !covers_each_once(&made);
        CHECK(made.plan.n <= 7 * (int64_t)made.levels.n);
        for (int64_t s = 0; s < made.plan.n; s++) {
            plain += !made.plan.steps[s].has_limits;
            with_limits += made.plan.steps[s].has_limits;
        }
        free_plan(&made);
    }
    CHECK(wrong == 0);
    CHECK(plain > 50 && with_limits > 1000);
}

static bool
is_least_of_table(const planned *made, double least)
{
    bool found = least == 0.0, right = true;
    for (int32_t e = 0; e < made->levels.n * made->levels.n; e++) {
        const double cutoff = made->levels.cutoffs[e];
        found = found || cutoff == least;
        right = right && (cutoff <= 0.0 || cutoff >= least);
    }
    return found && right;
}

/* Searched two by two, or all at once by a table. */
static void
each_pair_of_types_is_in_one_step(void)
{
    harness_random random = {72};
    int            wrong = 0, by_table = 0, by_pairs = 0;
    for (int trial = 0; trial < 200; trial++) {
        const hs_reach reach = {.rule = (hs_rule)(trial % HS_RULE_END),
                                .n_types = REACH_TYPES,
                                .types = points.types,
                                .query_types = queries.types,
                                .cutoffs = table};
        const double   bound = trial % 3 ? HUGE_VAL : 0.5;
        planned        made;
        reach_fill(&random, trial % 10 ? 50 : trial % 7, 1, 1.0, 0, 1.0, &points);
        reach_fill(&random, 30, 1, 1.0, 0, 1.0, &queries);
        for (int a = 0; a < REACH_TYPES; a++) {
            for (int b = 0; b <= a; b++)
                table[a * REACH_TYPES + b] = table[b * REACH_TYPES + a] =
                    random_bits(&random) % 4 ? random_unit(&random) * (trial % 2 ? 1.0 : a == 5)
                                             : -1.0;
        }
        make_plan(&reach, trial & 1, bound, &made);
        CHECK(made.plan.is_half == !(trial & 1));
        wrong += !covers_each_once(&made);
        for (int64_t s = 0; s < made.plan.n; s++) {
            const hs_level_step *step = &made.plan.steps[s];
            CHECK(step->by_table == step->has_limits && (!step->by_table || made.plan.n == 1));
            CHECK(step->by_table || step->least == 0.0);
            CHECK(!step->by_table || is_least_of_table(&made, step->least));
            by_table += step->by_table;
            by_pairs += !step->by_table;
        }
        free_plan(&made);
    }
    CHECK(wrong == 0);
    CHECK(by_table > 20 && by_pairs > 200);
}

/* One radius for all needs one step and no limits; with a sum that is no float64 it does. */
static void
equal_limits_are_one_cutoff(void)
{
    static const double radii[] = {0.0, 0.5, 0.1, 0x1p-1074, 0x1p1022};
    harness_random      random = {73};
    for (int e = 0; e < 5; e++) {
        const hs_reach reach = {.rule = HS_RULE_SUM, .radii = points.radii};
        planned        made;
        reach_fill(&random, 20, 1, 1.0, 0, radii[e], &points);
        make_plan(&reach, false, HUGE_VAL, &made);
        CHECK(made.plan.n == 1 && made.plan.steps[0].is_own && !made.plan.steps[0].has_limits);
        CHECK(made.plan.steps[0].cutoff == 2.0 * radii[e]);
        CHECK(made.plan.steps[0].least == radii[e]);
        free_plan(&made);
    }
    const hs_reach reach = {
        .rule = HS_RULE_SUM, .radii = points.radii, .query_radii = queries.radii};
    planned made;
    reach_fill(&random, 20, 1, 1.0, 0, 0.1, &points);
    reach_fill(&random, 20, 1, 1.0, 0, 0.7, &queries);
    make_plan(&reach, true, HUGE_VAL, &made); /* 0.1 + 0.7 lies above the float64 below it */
    CHECK(made.plan.n == 1 && made.plan.steps[0].has_limits);
    CHECK(made.plan.steps[0].cutoff == nextafter(0.1 + 0.7, 1.0));
    free_plan(&made);
}

/* Sums that round to the same float64, one of them exactly: they are not equal. Both small radii
 * are of levels that join, for there are two between them and the large one. */
static void
sums_that_round_to_one_are_not_one(void)
{
    const double   least = 0x1p-52, less = nextafter(least, 0.0);
    const hs_reach reach = {
        .rule = HS_RULE_SUM, .radii = points.radii, .query_radii = queries.radii};
    planned        made;
    int            joined = 0;
    harness_random random = {74};
    reach_fill(&random, 2, 1, 1.0, 0, 1.0, &points);
    reach_fill(&random, 6, 1, 1.0, 0, least, &queries);
    queries.radii[4] = 0.375;
    queries.radii[5] = 0.1875;
    queries.radii[1] = queries.radii[3] = less;
    CHECK(1.0 + less == 1.0 + least);
    make_plan(&reach, true, HUGE_VAL, &made);
    CHECK(covers_each_once(&made));
    CHECK(made.levels.n == 5);
    for (int64_t s = 0; s < made.plan.n; s++) {
        const hs_level_step *step = &made.plan.steps[s];
        if (step->asking.end - step->asking.first == 2) {
            CHECK(step->has_limits && step->cutoff == 1.0 + least);
            joined++;
        }
    }
    CHECK(joined == 1);
    free_plan(&made);
}

/* Small levels join for the search with a far larger one: a few steps a level. */
static void
far_smaller_levels_join(void)
{
    const hs_reach reach = {.rule = HS_RULE_SUM, .radii = points.radii};
    planned        made;
    reach_set     *set = &points;
    harness_random random = {75};
    reach_fill(&random, 300, 1, 1.0, 0, 1.0, set);
    for (int i = 0; i < 300; i++)
        set->radii[i] = ldexp(0.75, -(i % 30));
    make_plan(&reach, false, HUGE_VAL, &made);
    CHECK(made.levels.n == 29 && made.plan.n <= 4 * 29 && made.plan.n > 29);
    CHECK(covers_each_once(&made));
    free_plan(&made);
}

static hs_status
plan_once(void *context)
{
    planned        *made = context;
    const hs_status status =
        hs_level_plan_make(&made->account, &made->levels, HUGE_VAL, &made->plan);
    CHECK((status == HS_OK) == (made->plan.steps != NULL));
    hs_level_plan_free(&made->account, &made->plan);
    return status;
}

static void
nothing_leaks_when_memory_is_short(void)
{
    const hs_reach reach = {.rule = HS_RULE_SUM, .radii = points.radii};
    planned        made;
    harness_random random = {76};
    reach_fill(&random, 30, 1, 1.0, 2, 1.0, &points);
    make_plan(&reach, false, HUGE_VAL, &made);
    hs_level_plan_free(&made.account, &made.plan);
    CHECK(fail_each_allocation(plan_once, &made, 10) == 2);
    free_plan(&made);
}

void
test_level_plan(void)
{
    RUN(each_pair_is_in_one_step);
    RUN(each_pair_of_types_is_in_one_step);
    RUN(equal_limits_are_one_cutoff);
    RUN(sums_that_round_to_one_are_not_one);
    RUN(far_smaller_levels_join);
    RUN(nothing_leaks_when_memory_is_short);
}
