/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_plan.c: a plan tells what a search of a scene would do. */
#include "../../../csrc/core/levels/level_join.h"
#include "../support/harness.h"
#include "../support/among.h"
#include "../support/pair_checks.h"

#include <math.h>

void test_api_plan(void);

static void
plans_describe_the_search(void)
{
    static double   x[3 * 4000];
    harness_random  random = {20};
    hs_box          box = {.ndim = 3, .periodic = {true, true, false}};
    hs_plan         plan;
    const char     *best = "";
    int64_t         count = 0;
    brute_scene     scene = {.ndim = 3, .n = 4000, .x = x, .box = &box, .cutoff = 1.0};
    const hs_points points = points_of(&scene);
    for (int k = 0; k < 3; k++)
        box.rows[k][k] = 10.0;
    for (int e = 0; e < 3 * 4000; e++)
        x[e] = 10.0 * random_unit(&random);
    hs_options options = options_of(&scene);
    CHECK(hs_plan_make(AMONG(&points, &box), &options, &plan, NULL) == HS_OK);
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, NULL) == HS_OK);
    CHECK(plan.ndim == 3 && plan.n_periodic == 2 && plan.aligned && !plan.reduced);
    CHECK(!plan.keeps_originals && !plan.all_pairs && plan.stencil_rows > 1);
    CHECK(fabs(plan.expected_pairs / (double)count - 1.0) < 0.15);
    CHECK(hs_kernel_names(&best, 1) >= 1 && strcmp(plan.kernel, best) == 0);
    for (int k = 0; k < 3; k++) {
        CHECK(plan.images[k] == (k < 2));
        CHECK(fabs(plan.cell_size[k] * (double)plan.shape[k] - 10.0) < 0.1);
        CHECK(plan.cell_size[k] * (double)plan.reach[k] >= 1.0);
    }
    box.rows[1][0] = 30.0; /* three whole widths: the same lattice */
    CHECK(hs_plan_make(AMONG(&points, &box), &options, &plan, NULL) == HS_OK);
    CHECK(plan.reduced && plan.aligned);
    box.rows[1][0] = 3.0;
    CHECK(hs_plan_make(AMONG(&points, &box), &options, &plan, NULL) == HS_OK);
    CHECK(!plan.aligned && plan.keeps_originals);
    options.cutoff = 100.0;
    CHECK(hs_plan_make(AMONG(&points, &box), &options, &plan, NULL) == HS_OK);
    CHECK(plan.images[0] >= 10 && plan.images[1] >= 10 && plan.images[2] == 0);
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK);
    CHECK(plan.all_pairs && plan.n_periodic == 0 && plan.images[0] == 0);
}

/* Lengths are the caller's, whatever the search scales by; occupied cells and threads are told. */
static void
plans_are_in_the_callers_unit(void)
{
    enum { N = 8000 };
    static double   x[2 * N];
    harness_random  random = {21};
    hs_options      options = hs_options_default();
    hs_plan         plan;
    const hs_points points = {x, N, 2, HS_FLOAT64, 16, 8};
    for (int e = 0; e < 2 * N; e++)
        x[e] = 0x1p40 * random_unit(&random);
    options.cutoff = 0x1p36;
    options.threads = 1;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK);
    CHECK(!plan.sparse && plan.threads == 1 && plan.ndim == 2 && plan.expected_pairs > 1000.0);
    CHECK(plan.cell_size[1] * (double)plan.shape[1] > 0.95 * 0x1p40);
    CHECK(plan.cell_size[1] * (double)plan.shape[1] < 1.05 * 0x1p40);
    for (int i = 0; i < N; i++) {
        x[2 * i] = random_unit(&random) + (i % 2 ? 1e6 : 0.0);
        x[2 * i + 1] = random_unit(&random);
    }
    options.cutoff = 0.01;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK && plan.sparse);
}

/* The algorithm is that of the options, or the choice, with the cells that are stored. */
static void
plans_name_the_algorithm(void)
{
    static double   x[1000];
    harness_random  random = {22};
    hs_options      options = hs_options_default();
    hs_plan         plan;
    const hs_points points = {x, 1000, 1, HS_FLOAT64, 8, 8};
    for (int i = 0; i < 1000; i++)
        x[i] = 1000.0 * random_unit(&random);
    options.cutoff = 2.0;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK);
    CHECK(plan.algorithm == HS_GRID && plan.n_cells == plan.shape[0] && plan.n_searches == 1);
    for (hs_algorithm a = HS_ALL_PAIRS; a < HS_ALGORITHM_END; a++) {
        options.algorithm = a;
        CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK);
        CHECK(plan.algorithm == a && plan.n_searches == 1 && plan.sparse == (a == HS_HASH));
        CHECK((plan.n_cells == 1) == (a == HS_ALL_PAIRS));
        CHECK(fabs(plan.expected_pairs / 2000.0 - 1.0) < 0.1);
    }
    options.algorithm = HS_AUTO;
    options.cutoff = 1e4;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK);
    CHECK(plan.algorithm == HS_ALL_PAIRS && plan.expected_pairs == 1000.0 * 999.0 / 2.0);
}

/* Several searches, or none: of points without a pair there is nothing to say but what they are. */
static void
plans_know_a_reach(void)
{
    static double   x[1000], radii[1000];
    const double    none[1] = {-1.0}, x_none[1] = {0.0};
    const int32_t   type[1000] = {0};
    harness_random  random = {23};
    hs_options      options = hs_options_default();
    hs_plan         plan;
    int64_t         count = 0;
    const hs_points points = {x, 1000, 1, HS_FLOAT64, 8, 8}, empty = {x_none, 0, 1, 1, 8, 8};
    hs_reach        reach = {.rule = HS_RULE_MAX, .radii = radii};
    for (int i = 0; i < 1000; i++) {
        x[i] = 1000.0 * random_unit(&random);
        radii[i] = i % 20 == 0 ? 1.5 : ldexp(1.5, -4 * (1 + i % 2));
    }
    hs_among among = {.points = &points, .reach = &reach};
    options.cutoff = INFINITY;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    CHECK(hs_pairs_count(&among, &options, &count, NULL) == HS_OK);
    CHECK(plan.algorithm == HS_HIERARCHY && plan.n_searches == 5);
    CHECK(fabs(plan.expected_pairs / (double)count - 1.0) < 1e-9); /* all are counted */
    CHECK(plan.all_pairs || plan.cell_size[0] * (double)plan.reach[0] >= 1.5);
    options.algorithm = HS_GRID;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    CHECK(plan.algorithm == HS_GRID && plan.n_searches == 1);
    CHECK(plan.expected_pairs == (double)count);
    reach = (hs_reach){.n_types = 1, .types = type, .cutoffs = none};
    options.cutoff = 1.0;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    CHECK(plan.n_searches == 0 && plan.expected_pairs == 0.0 && plan.ndim == 1);
    among.points = &empty;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches == 0);
}

/* What a plan has of the cells where nothing is searched is that of a cutoff of 0, whatever the bound
 * is, even none. */
static void
plans_of_nothing_have_the_cells_of_no_cutoff(void)
{
    static double   x[1000];
    const double    none[1] = {-1.0};
    const int32_t   type[1000] = {0};
    hs_options      options = hs_options_default();
    hs_plan         plan, of_none, of_bound;
    const hs_points points = {x, 1000, 1, HS_FLOAT64, 8, 8}, empty = {x, 0, 1, HS_FLOAT64, 8, 8};
    const hs_reach  by_type = {.n_types = 1, .types = type, .cutoffs = none};
    const hs_reach  by_radii = {.rule = HS_RULE_SUM};
    for (int i = 0; i < 1000; i++)
        x[i] = 0.125 * i;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &of_none, NULL) == HS_OK);
    options.cutoff = 30.0;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &of_bound, NULL) == HS_OK);
    hs_among among = {.points = &points, .reach = &by_type};
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches == 0);
    CHECK(plan.n_cells == of_none.n_cells && plan.cell_size[0] == of_none.cell_size[0]);
    CHECK(plan.n_cells != of_bound.n_cells);
    options.cutoff = INFINITY;
    among = (hs_among){.points = &empty, .reach = &by_radii};
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    CHECK(plan.n_searches == 0 && plan.expected_pairs == 0.0);
}

/* Where levels of radii are so alike that one search with limits takes less time than several. */
static void
plans_join_levels_unless_told_otherwise(void)
{
    static double   x[300], radii[300];
    harness_random  random = {24};
    hs_options      options = hs_options_default();
    hs_plan         plan;
    const hs_points points = {x, 100, 3, HS_FLOAT64, 24, 8};
    const hs_reach  reach = {.rule = HS_RULE_SUM, .radii = radii};
    const hs_among  among = {.points = &points, .reach = &reach};
    for (int e = 0; e < 300; e++) {
        x[e] = 4.0 * random_unit(&random);
        radii[e] = e % 2 ? 0.5 : 0.2;
    }
    options.cutoff = INFINITY;
    const bool joins = hs_test_join_levels(true);
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches == 1);
    const double expected = plan.expected_pairs;
    options.algorithm = HS_HIERARCHY;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK && plan.n_searches > 1);
    CHECK(plan.expected_pairs == expected);
    (void)hs_test_join_levels(joins);
}

/* Nothing is written then. Queries are none of its business. */
static void
plans_need_options_and_room(void)
{
    const double    x[2] = {0.0, 1.0};
    const hs_points points = {x, 2, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    hs_failure      failure;
    hs_plan         plan = {.ndim = 77};
    options.cutoff = 1.0;
    CHECK(hs_plan_make(AMONG(&points, NULL), NULL, &plan, &failure) == HS_ERR_ARGUMENT);
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, NULL, &failure) == HS_ERR_ARGUMENT);
    CHECK(hs_plan_make(NULL, &options, &plan, &failure) == HS_ERR_ARGUMENT);
    CHECK(hs_plan_make(QUERIED(&points, &points, NULL), &options, &plan, NULL) == HS_ERR_ARGUMENT);
    options.cutoff = -1.0;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, &failure) == HS_ERR_CUTOFF);
    CHECK(plan.ndim == 77);
}

void
test_api_plan(void)
{
    RUN(plans_describe_the_search);
    RUN(plans_are_in_the_callers_unit);
    RUN(plans_name_the_algorithm);
    RUN(plans_know_a_reach);
    RUN(plans_of_nothing_have_the_cells_of_no_cutoff);
    RUN(plans_join_levels_unless_told_otherwise);
    RUN(plans_need_options_and_room);
}
