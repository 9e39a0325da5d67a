/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_plan.c: a plan tells what a search of a scene would do. */
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
    static double   x[2 * 1000];
    harness_random  random = {21};
    hs_options      options = hs_options_default();
    hs_plan         plan;
    const hs_points points = {x, 1000, 2, HS_FLOAT64, 16, 8};
    for (int e = 0; e < 2 * 1000; e++)
        x[e] = 0x1p40 * random_unit(&random);
    options.cutoff = 0x1p36;
    options.threads = 1;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK);
    CHECK(!plan.sparse && plan.threads == 1 && plan.ndim == 2 && plan.expected_pairs > 1000.0);
    CHECK(plan.cell_size[1] * (double)plan.shape[1] > 0.95 * 0x1p40);
    CHECK(plan.cell_size[1] * (double)plan.shape[1] < 1.05 * 0x1p40);
    for (int i = 0; i < 1000; i++) {
        x[2 * i] = random_unit(&random) + (i % 2 ? 1e6 : 0.0);
        x[2 * i + 1] = random_unit(&random);
    }
    options.cutoff = 0.01;
    CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK && plan.sparse);
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
    RUN(plans_need_options_and_room);
}
