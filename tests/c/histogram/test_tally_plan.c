/* SPDX-License-Identifier: BSD-3-Clause */
/* test_tally_plan.c: which pairs of types are told apart, and that a plan gives back what it
 * took. */
#include "../../../csrc/core/histogram/tally.h"
#include "../support/search_unit.h"

void test_tally_plan(void);

enum { N = 30, MOST_TYPES = 7 };

static search_unit unit;

/* Points among themselves, or asked by as many queries. */
static void
open_search(bool has_queries)
{
    const hs_sets sets = {.points = &unit.points,
                          .queries = has_queries ? &unit.points : NULL,
                          .is_full = has_queries};
    hs_options    options = hs_options_default();
    hs_failure    failure = HS_NO_FAILURE;
    options.cutoff = 0.5;
    options.threads = 1;
    search_unit_points(5, N, 2, 2.0, &unit);
    hs_call_begin(&options, &unit.call);
    CHECK(hs_search_open(&sets, NULL, &unit.call, &unit.search, &failure) == HS_OK);
}

/* Groups are numbered from 0 on without a gap; (a, b) and (b, a) have one number in the half list
 * only. */
static void
check_groups(const hs_tally_plan *plan, bool has_queries)
{
    const int n = plan->n_types;
    int       members[MOST_TYPES * MOST_TYPES] = {0};
    CHECK(plan->n_groups == (has_queries ? n * n : n * (n + 1) / 2));
    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++) {
            const int32_t group = plan->group[a * n + b];
            CHECK(group >= 0 && group < plan->n_groups);
            CHECK(has_queries || plan->group[b * n + a] == group);
            members[group]++;
        }
    }
    for (int g = 0; g < plan->n_groups; g++)
        CHECK(members[g] == 1 || (members[g] == 2 && !has_queries));
}

static void
pairs_of_types_are_told_apart(void)
{
    int32_t types[N];
    double  edge = 0.5, weights[N], sum = 0.0;
    int64_t count;
    for (int trial = 0; trial < 2 * MOST_TYPES; trial++) {
        const bool   has_queries = trial % 2;
        const int    n_types = 1 + trial / 2;
        hs_histogram histogram = {
            .n_edges = 1, .edges = &edge, .n_types = n_types, .counts = &count};
        hs_tally_plan plan = {0};
        hs_failure    failure = HS_NO_FAILURE;
        for (int i = 0; i < N; i++) {
            types[i] = i % n_types;
            weights[i] = i;
        }
        histogram.of_points = histogram.of_queries = (hs_marks){types, weights};
        histogram.sums = trial % 3 ? &sum : NULL;
        open_search(has_queries);
        const int64_t held = unit.call.account.held;
        CHECK(hs_tally_plan_open(&unit.search, &histogram, &plan, &failure) == HS_OK);
        CHECK(plan.has_types == (n_types > 1) && plan.sums == (trial % 3 > 0));
        CHECK(plan.asking == (has_queries ? &plan.queries : &plan.points));
        CHECK(plan.points.weights.value != NULL && plan.asking->weights.value != NULL);
        CHECK(unit.call.account.held > held);
        if (n_types > 1)
            check_groups(&plan, has_queries);
        CHECK(n_types > 1 || (plan.n_groups == 1 && plan.group == NULL));
        hs_tally_plan_close(&plan);
        CHECK(unit.call.account.held == held);
        search_unit_close(&unit);
    }
}

/* Whichever allocation fails. */
static void
refused_plans_hold_nothing(void)
{
    int32_t            types[N] = {0};
    double             edge = 0.5, weights[N] = {0.5};
    int64_t            count;
    const hs_histogram histogram = {.n_edges = 1,
                                    .edges = &edge,
                                    .n_types = 2,
                                    .of_points = {types, weights},
                                    .of_queries = {types, weights},
                                    .counts = &count};
    open_search(true);
    const int64_t held = unit.call.account.held;
    int           n_refused = 0;
    for (hs_status status = HS_ERR_MEMORY; status == HS_ERR_MEMORY && n_refused < 50;) {
        hs_tally_plan plan = {0};
        hs_failure    failure = HS_NO_FAILURE;
        hs_test_fail_allocation(n_refused + 1);
        status = hs_tally_plan_open(&unit.search, &histogram, &plan, &failure);
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        hs_tally_plan_close(&plan);
        CHECK(unit.call.account.held == held);
        n_refused += status != HS_OK;
    }
    CHECK(n_refused >= 5 && n_refused < 50); /* edges, two types, two weights, groups */
    search_unit_close(&unit);
}

void
test_tally_plan(void)
{
    RUN(pairs_of_types_are_told_apart);
    RUN(refused_plans_hold_nothing);
}
