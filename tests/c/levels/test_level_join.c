/* SPDX-License-Identifier: BSD-3-Clause */
/* test_level_join.c: few common sizes are searched at once, rare large points and dense neighbourhoods
 * of small ones are not; either way each pair is in one step. */
#include "../../../csrc/core/levels/level_join.h"
#include "../support/plan_checks.h"
#include "../support/poll_checks.h"

void test_level_join(void);

static void
choose_plan(const hs_box *box, planned *made)
{
    const hs_options   options = hs_options_default();
    const hs_algorithm algorithm = made->plan.algorithm;
    hs_level_plan_free(&made->account, &made->plan);
    CHECK(hs_level_plan_choose(&made->account, &options, &made->levels, box, HUGE_VAL, algorithm,
                               &made->plan) == HS_OK);
}

static void
make_joined(const hs_reach *reach, bool has_queries, const hs_box *box, planned *made)
{
    make_plan(reach, has_queries, HUGE_VAL, made);
    const int64_t before = made->plan.n;
    choose_plan(box, made);
    CHECK(made->plan.n == before); /* switched off */
    CHECK(!hs_test_join_levels(true));
    choose_plan(box, made);
    CHECK(hs_test_join_levels(false));
}

/* As it is, where levels may be joined; and frees it. */
static void
stays(planned *made)
{
    const int64_t n = made->plan.n;
    CHECK(!hs_test_join_levels(true));
    choose_plan(NULL, made);
    CHECK(hs_test_join_levels(false));
    CHECK(made->plan.n == n && covers_each_once(made));
    free_plan(made);
}

/* Half of the points have a radius of 0.5, the others one of `large`; n points in a cube. */
static void
two_sizes(int64_t n, double side, double large, int64_t every)
{
    harness_random random = {4711};
    reach_fill(&random, n, 3, side, 0, 1.0, &points);
    for (int64_t i = 0; i < n; i++)
        points.radii[i] = i % every == 0 ? large : 0.5;
}

static void
common_sizes_are_searched_at_once(void)
{
    for (int rule = 0; rule < HS_RULE_END; rule++) {
        const hs_reach reach = {.rule = (hs_rule)rule, .radii = points.radii};
        planned        made;
        two_sizes(REACH_POINTS, 20.0, 1.2, 2); /* a few neighbours each */
        make_joined(&reach, false, NULL, &made);
        CHECK(made.levels.n == 2);
        CHECK(hs_level_plan_is_single(&made.levels, &made.plan));
        CHECK(made.plan.steps[0].has_limits && covers_each_once(&made));
        free_plan(&made);
    }
}

/* All points lie within the reach of the large ones, and meet few others. */
static void
rare_large_points_are_searched_apart(void)
{
    const hs_reach reach = {.rule = HS_RULE_SUM, .radii = points.radii};
    hs_box         box = {
                .ndim = 3, .periodic = {true, true, true}, .rows = {{6.0}, {0.0, 6.0}, {0.0, 0.0, 6.0}}};
    planned made;
    two_sizes(REACH_POINTS, 6.0, 100.0, 50);
    make_joined(&reach, false, NULL, &made);
    CHECK(made.levels.n == 2 && made.plan.n > 1 && covers_each_once(&made));
    free_plan(&made);
    two_sizes(REACH_POINTS, 600.0, 1.9, 50); /* many boxes away: they are wrapped into it */
    make_joined(&reach, false, NULL, &made);
    CHECK(made.plan.n == 1 && covers_each_once(&made));
    free_plan(&made);
    for (int open = 0; open < 4; open++) { /* along an open axis they are not wrapped */
        for (int k = 0; k < 3; k++)
            box.periodic[k] = k >= open;
        make_joined(&reach, false, &box, &made);
        CHECK((made.plan.n > 1) == (open == 0) && covers_each_once(&made));
        free_plan(&made);
    }
}

/* A plan that the caller chose, of one step, of types, of too many levels or of no points stays. */
static void
some_plans_are_never_joined(void)
{
    hs_reach       reach = {.rule = HS_RULE_SUM, .radii = points.radii};
    harness_random random = {73};
    planned        made;
    two_sizes(REACH_POINTS, 20.0, 1.2, 2);
    make_plan_as(&reach, false, HUGE_VAL, HS_HIERARCHY, &made);
    stays(&made);
    two_sizes(REACH_POINTS, 20.0, 0.5, 2);
    make_plan(&reach, false, HUGE_VAL, &made);
    CHECK(made.plan.n == 1);
    stays(&made);
    for (int n_levels = 16; n_levels <= 17; n_levels++) { /* few points, far apart */
        reach_fill(&random, 2 * n_levels, 3, 1e6, 0, 1.0, &points);
        for (int i = 0; i < 2 * n_levels; i++)
            points.radii[i] = ldexp(0.75, -(i % n_levels));
        points.radii[0] =
            1.0; /* the largest one has a level of its own size, or of all above half */
        make_plan(&reach, false, HUGE_VAL, &made);
        CHECK(made.levels.n == n_levels);
        if (n_levels == 17) {
            stays(&made);
        } else {
            CHECK(made.plan.n > 1);
            CHECK(!hs_test_join_levels(true));
            choose_plan(NULL, &made);
            CHECK(hs_test_join_levels(false));
            CHECK(made.plan.n == 1 && covers_each_once(&made));
            free_plan(&made);
        }
    }
    reach_fill(&random, 90, 1, 1.0, 0, 1.0, &points);
    for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
        table[e] = e % (REACH_TYPES + 1) == 0 ? 0.001 : -1.0;
    reach = (hs_reach){.n_types = REACH_TYPES, .types = points.types, .cutoffs = table};
    make_plan(&reach, false, HUGE_VAL, &made);
    CHECK(made.plan.n == REACH_TYPES);
    stays(&made);
}

/* Whatever radii, rule and queries are, none of a set's points among them. */
static void
each_pair_is_in_one_step(void)
{
    harness_random random = {72};
    int            wrong = 0, joined = 0;
    for (int trial = 0; trial < 300; trial++) {
        const bool     has_queries = trial & 1;
        const hs_rule  rule = (hs_rule)(trial / 2 % HS_RULE_END);
        const hs_reach reach = {.rule = rule, .radii = points.radii, .query_radii = queries.radii};
        planned        made;
        reach_fill(&random, trial % 10 ? 60 : trial % 20, 1, 1.0, trial / 12 % 5, 0.7, &points);
        reach_fill(&random, trial % 7 ? 40 : 0, 1, 1.0, trial / 12 % 5, 0.7, &queries);
        make_joined(&reach, has_queries, NULL, &made);
        wrong += !covers_each_once(&made);
        joined += made.plan.n == 1;
        free_plan(&made);
    }
    CHECK(wrong == 0);
    CHECK(joined > 200); /* with so few points */
}

static hs_status
choose_once(void *context)
{
    planned         *made = context;
    const hs_options options = hs_options_default();
    const hs_status  status = hs_level_plan_choose(&made->account, &options, &made->levels, NULL,
                                                   HUGE_VAL, HS_AUTO, &made->plan);
    hs_level_plan_free(&made->account, &made->plan);
    return status;
}

static void
nothing_leaks_when_memory_is_short(void)
{
    const hs_reach reach = {.rule = HS_RULE_SUM, .radii = points.radii};
    planned        made;
    two_sizes(REACH_POINTS, 20.0, 1.2, 2);
    make_plan(&reach, false, HUGE_VAL, &made);
    hs_level_plan_free(&made.account, &made.plan);
    CHECK(fail_each_allocation(choose_once, &made, 10) == 2);
    free_plan(&made);
}

static void
choose_plan_by(const hs_options *options, planned *made, hs_status expected)
{
    const hs_status status = hs_level_plan_choose(&made->account, options, &made->levels, NULL,
                                                  HUGE_VAL, HS_AUTO, &made->plan);
    CHECK(status == expected && (made->plan.n > 0) == (expected == HS_OK));
    hs_level_plan_free(&made->account, &made->plan);
}

/* A pass over the points polls, and ends where the caller says so. */
static void
it_can_be_stopped(void)
{
    enum { MANY = 2 * HS_POLL_POINTS + 9 };
    static double   x[2 * MANY], radii[2 * MANY];
    const hs_points p = {x, 2 * MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x},
                    q = {x, MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x};
    const hs_reach   reach = {.rule = HS_RULE_SUM, .radii = radii, .query_radii = radii};
    const hs_options quiet = hs_options_default();
    for (int64_t i = 0; i < 2 * MANY; i++) {
        x[i] = (double)i;
        radii[i] = i % 2 ? 1.0 : 4.0;
    }
    for (int has_queries = 0; has_queries < 2; has_queries++) {
        refusal    once = {.nth = 0};
        hs_options options = quiet;
        planned    made;
        hs_failure failure;
        options.poll = refuse_once;
        options.poll_context = &once;
        hs_account_init(&made.account, &quiet);
        CHECK(hs_levels_divide(&made.account, &quiet, &p, has_queries ? &q : NULL, &reach,
                               &made.levels, &failure) == HS_OK);
        CHECK(!hs_test_join_levels(true));
        choose_plan_by(&options, &made, HS_OK);
        const int64_t n = once.n;
        CHECK(n == (has_queries ? 6 : 4));
        for (int64_t nth = 1; nth <= n; nth++) {
            once = (refusal){.nth = nth};
            choose_plan_by(&options, &made, HS_ERR_INTERRUPTED);
            CHECK(once.n == nth);
        }
        CHECK(hs_test_join_levels(false));
        free_plan(&made);
    }
}

void
test_level_join(void)
{
    RUN(it_can_be_stopped);
    RUN(nothing_leaks_when_memory_is_short);
    RUN(common_sizes_are_searched_at_once);
    RUN(rare_large_points_are_searched_apart);
    RUN(some_plans_are_never_joined);
    RUN(each_pair_is_in_one_step);
}
