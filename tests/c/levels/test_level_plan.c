/* SPDX-License-Identifier: BSD-3-Clause */
/* test_level_plan.c: whatever the rule and the radii, each pair of points is in exactly one step,
 * whose cutoff is no less than its limit. */
#include "../support/plan_checks.h"
#include "../support/poll_checks.h"

void test_level_plan(void);

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
        const bool     takes_one = rule != HS_RULE_SUM && rule != HS_RULE_MEAN;
        const hs_reach reach = {.rule = rule,
                                .radii = points.radii,
                                .query_radii = queries.radii,
                                .extent = takes_one && trial % 4 < 2 ? 0.8 : 0.0};
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
        reach_fill(&random, trial % 9 ? 50 : trial % 7, 1, 1.0, 0, 1.0, &points);
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
    make_plan_as(&reach, true, HUGE_VAL, HS_HIERARCHY, &made);
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

/* So do sums of which the largest alone is no float64. */
static void
sums_above_an_exact_one_are_not_it(void)
{
    const hs_reach reach = {
        .rule = HS_RULE_SUM, .radii = points.radii, .query_radii = queries.radii};
    planned        made;
    int            joined = 0;
    harness_random random = {77};
    reach_fill(&random, 2, 1, 1.0, 0, 1.0, &points);
    reach_fill(&random, 5, 1, 1.0, 0, 0.0, &queries);
    queries.radii[1] = 0x1p-60;
    queries.radii[3] = 0.375;
    queries.radii[4] = 0.1875;
    make_plan_as(&reach, true, HUGE_VAL, HS_HIERARCHY, &made);
    CHECK(covers_each_once(&made));
    for (int64_t s = 0; s < made.plan.n; s++) {
        const hs_level_step *step = &made.plan.steps[s];
        if (step->asking.end - step->asking.first == 2) {
            CHECK(step->has_limits && step->cutoff == nextafter(1.0, 2.0));
            joined++;
        }
    }
    CHECK(joined == 1);
    free_plan(&made);
}

/* All types are searched at once where two by two they would test nearly as many candidates: as the
 * products of their numbers and the lengths of their cutoffs, in any unit, say. */
static void
types_are_searched_at_once_where_that_costs_as_little(void)
{
    static const struct {
        int    n_first; /* points of type 0, of 90 */
        double table[4];
        bool   at_once;
    } cases[] = {
        {45, {1.0, 0.5, 0.5, -1.0}, true},    {45, {1.0, -1.0, -1.0, -1.0}, false},
        {45, {-1.0, -1.0, -1.0, 1.0}, false}, {45, {0.5, 0.1, 0.1, 1.0}, true},
        {81, {1.0, -1.0, -1.0, 0.5}, true},   {81, {0.25, 0.125, 0.125, 1.0}, false},
        {9, {1.0, 0.125, 0.125, 0.5}, true},  {9, {1.0, 0.125, 0.125, -1.0}, false},
        {45, {0.0, 0.0, 0.0, 0.0}, false},
    };
    harness_random random = {79};
    reach_fill(&random, 90, 1, 1.0, 0, 1.0, &points);
    for (size_t c = 0; c < 2 * (sizeof cases / sizeof *cases); c++) {
        double         sized[4];
        const hs_reach reach = {.n_types = 2, .types = points.types, .cutoffs = sized};
        planned        made;
        for (int e = 0; e < 4; e++)
            sized[e] = cases[c / 2].table[e] * (c % 2 ? 0x1p-20 : 1.0);
        for (int i = 0; i < 90; i++)
            points.types[i] = i >= cases[c / 2].n_first;
        make_plan(&reach, false, HUGE_VAL, &made);
        CHECK((made.plan.n == 1 && made.plan.steps[0].by_table) == cases[c / 2].at_once);
        free_plan(&made);
    }
}

/* More types than a table of limits is laid out for are searched two by two. A plan is single where
 * one step has all points. */
static void
many_types_are_searched_in_pairs(void)
{
    enum { N_TYPES = 9 };
    double         all[N_TYPES * N_TYPES];
    harness_random random = {78};
    planned        made;
    reach_fill(&random, 90, 1, 1.0, 0, 1.0, &points);
    for (int n_types = 1; n_types <= N_TYPES; n_types++) {
        const hs_reach reach = {.n_types = n_types, .types = points.types, .cutoffs = all};
        for (int e = 0; e < N_TYPES * N_TYPES; e++)
            all[e] = 1.0;
        for (int i = 0; i < 90; i++)
            points.types[i] = i % n_types;
        make_plan(&reach, false, HUGE_VAL, &made);
        CHECK(made.plan.n == (n_types <= 8 ? 1 : N_TYPES * (N_TYPES + 1) / 2));
        CHECK(hs_level_plan_is_single(&made.levels, &made.plan) == (n_types <= 8));
        free_plan(&made);
    }
    static const double alone[3][4] = {/* type 0 with itself, with type 1, or that with itself */
                                       {0.1, -1.0, -1.0, -1.0},
                                       {-1.0, 0.1, 0.1, -1.0},
                                       {-1.0, -1.0, -1.0, 0.1}};
    for (int lone = 0; lone < 3; lone++) {
        const hs_reach reach = {.n_types = 2, .types = points.types, .cutoffs = alone[lone]};
        for (int i = 0; i < 90; i++)
            points.types[i] = lone == 0 ? i % 9 != 0 : lone == 1 ? i % 2 : i % 9 == 0;
        make_plan(&reach, false, HUGE_VAL, &made);
        const bool by_table = made.plan.steps[0].by_table;
        CHECK(made.plan.n == 1);
        CHECK(hs_level_plan_is_single(&made.levels, &made.plan) == by_table);
        free_plan(&made);
    }
}

/* Queries of one level that look among all points ask for less than all levels. */
static void
a_level_of_two_is_not_all(void)
{
    const hs_reach reach = {
        .rule = HS_RULE_GATHER, .radii = points.radii, .query_radii = queries.radii};
    harness_random random = {79};
    planned        made;
    reach_fill(&random, 10, 1, 1.0, 0, 0.1, &points);
    reach_fill(&random, 10, 1, 1.0, 0, 0.1, &queries);
    points.radii[4] = 0.9;
    for (int upper = 0; upper < 2; upper++) {
        for (int i = 0; i < 10; i++)
            queries.radii[i] = upper ? 0.9 : 0.1;
        make_plan_as(&reach, true, HUGE_VAL, HS_HIERARCHY, &made);
        CHECK(made.levels.n == 2 && made.plan.n == 1 && made.plan.steps[0].asking.first == upper);
        CHECK(!hs_level_plan_is_single(&made.levels, &made.plan));
        free_plan(&made);
    }
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

/* Without a hierarchy all is one search with the largest reach, but for many types; with one, types
 * are never searched together. */
static void
algorithms_divide_or_do_not(void)
{
    const hs_reach by_sum = {.rule = HS_RULE_SUM, .radii = points.radii};
    hs_reach       by_type = {.types = points.types, .cutoffs = table};
    harness_random random = {77};
    planned        made;
    reach_fill(&random, 200, 1, 1.0, 0, 1.0, &points);
    for (int i = 0; i < 200; i++)
        points.radii[i] = ldexp(0.75, -(i % 12));
    for (hs_algorithm a = HS_ALL_PAIRS; a < HS_HIERARCHY; a++) {
        make_plan_as(&by_sum, false, HUGE_VAL, a, &made);
        CHECK(made.plan.n == 1 && made.plan.steps[0].is_own && made.plan.steps[0].has_limits);
        CHECK(made.plan.steps[0].cutoff == 1.5 && made.plan.steps[0].least == ldexp(0.75, -11));
        CHECK(hs_level_plan_is_single(&made.levels, &made.plan) && covers_each_once(&made));
        free_plan(&made);
    }
    make_plan_as(&by_sum, false, HUGE_VAL, HS_HIERARCHY, &made);
    CHECK(made.plan.n > 12 && covers_each_once(&made));
    free_plan(&made);
    for (int n = 3; n <= 12; n += 9) {
        for (int i = 0; i < 200; i++)
            points.types[i] = i % n;
        for (int e = 0; e < n * n; e++)
            table[e] = 1.0;
        by_type.n_types = n;
        make_plan_as(&by_type, false, HUGE_VAL, HS_HASH, &made);
        CHECK(made.plan.n == (n == 3 ? 1 : 78) && made.plan.steps[0].by_table == (n == 3));
        CHECK(covers_each_once(&made));
        free_plan(&made);
        make_plan_as(&by_type, false, HUGE_VAL, HS_HIERARCHY, &made);
        CHECK(made.plan.n == n * (n + 1) / 2 && covers_each_once(&made));
        free_plan(&made);
    }
}

static hs_status
plan_once(void *context)
{
    planned        *made = context;
    const hs_status status =
        hs_level_plan_make(&made->account, &made->levels, HUGE_VAL, HS_AUTO, &made->plan);
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
    RUN(sums_above_an_exact_one_are_not_it);
    RUN(types_are_searched_at_once_where_that_costs_as_little);
    RUN(many_types_are_searched_in_pairs);
    RUN(a_level_of_two_is_not_all);
    RUN(far_smaller_levels_join);
    RUN(algorithms_divide_or_do_not);
    RUN(nothing_leaks_when_memory_is_short);
}
