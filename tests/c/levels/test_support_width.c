/* SPDX-License-Identifier: BSD-3-Clause */
/* test_support_width.c: how wide the supports of a step are along a normal, by its rule, and cells
 * that go by it. */
#include "../../../csrc/core/levels/level_search.h"
#include "../../../csrc/core/levels/support_width.h"
#include "../support/harness.h"

#include <math.h>

void test_support_width(void);

enum { N = 40 };

static double points[N * 3], matrices[N * 9], query_points[N * 3], query_matrices[N * 9];

/* Needles along one axis, the last one with another width across it. */
static void
fill_needles(double across, double last, double *x, double *m)
{
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < 3; k++)
            x[3 * i + k] = (double)((i * (7 + 3 * k)) % N) / N;
        for (int e = 0; e < 9; e++)
            m[9 * i + e] = 0.0;
        m[9 * i] = m[9 * i + 4] = 1.0 / (i == N - 1 ? last : across);
        m[9 * i + 8] = 1.0;
    }
}

static double
step_width(hs_rule rule, double enough)
{
    const hs_options options = hs_options_default();
    const hs_points  p = {points, N, 3, HS_FLOAT64, 24, 8},
                    q = {query_points, N, 3, HS_FLOAT64, 24, 8};
    const hs_reach reach = {.rule = rule,
                            .has_supports = true,
                            .extent = 0.5,
                            .supports = rule == HS_RULE_GATHER ? NULL : matrices,
                            .query_supports = rule == HS_RULE_SCATTER ? NULL : query_matrices};
    const double   normal[3] = {1.0, 0.0, 0.0};
    hs_account     account;
    hs_levels      levels;
    hs_failure     failure;
    hs_account_init(&account, &options);
    CHECK(hs_levels_divide(&account, &options, &p, &q, &reach, &levels, &failure) == HS_OK);
    const hs_level_step   step = {.asking = {0, levels.n}, .points = {0, levels.n}};
    const hs_support_step of = {&levels, &step, &options};
    double                width;
    CHECK(hs_support_step_width(&of, normal, enough, &width) == HS_OK);
    hs_levels_free(&account, &levels);
    hs_account_close(&account);
    return width;
}

static bool
is_about(double x, double expected)
{
    return x >= expected && x <= expected * (1.0 + 1e-9);
}

static void
the_rule_says_whose_width_counts(void)
{
    fill_needles(0.125, 0.25, points, matrices);
    fill_needles(0.03125, 0.0625, query_points, query_matrices);
    CHECK(is_about(step_width(HS_RULE_MAX, 1.0), 0.125));
    CHECK(is_about(step_width(HS_RULE_MIN, 1.0), 0.03125));
    CHECK(is_about(step_width(HS_RULE_GATHER, 1.0), 0.03125));
    CHECK(is_about(step_width(HS_RULE_SCATTER, 1.0), 0.125));
    CHECK(is_about(step_width(HS_RULE_MAX, 0.01), 0.015625)); /* the first one is enough */
}

/* The range along each axis of an open search. */
static void
cells_go_by_the_width(void)
{
    const hs_points p = {points, N, 3, HS_FLOAT64, 24, 8};
    const double    radii[N] = {0.0};
    const hs_box    box = {.ndim = 3,
                           .periodic = {true, true, true},
                           .rows = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
    fill_needles(0.125, 0.125, points, matrices);
    for (int kind = 0; kind < 2; kind++) {
        const hs_reach  reach = kind == 0 ? (hs_reach){.rule = HS_RULE_MAX,
                                                       .has_supports = true,
                                                       .extent = 0.25,
                                                       .supports = matrices}
                                          : (hs_reach){.rule = HS_RULE_MAX, .radii = radii};
        hs_options      options = hs_options_default();
        hs_failure      failure;
        hs_call         call;
        hs_levels       levels;
        hs_level_plan   plan;
        hs_level_search open;
        options.cutoff = HUGE_VAL;
        hs_call_begin(&options, &call);
        CHECK(hs_levels_divide(&call.account, &options, &p, NULL, &reach, &levels, &failure) ==
              HS_OK);
        CHECK(hs_level_plan_make(&call.account, &levels, HUGE_VAL, HS_AUTO, &plan) == HS_OK);
        CHECK(hs_level_open(&levels, &plan, 0, &box, false, &call, &open, &failure) == HS_OK);
        const hs_scene *scene = &open.search.scene;
        for (int k = 0; k < 3; k++) {
            const double range = hs_scale_apply(scene->unscale, open.search.grid.range[k]);
            if (kind == 0)
                CHECK(range >= (k < 2 ? 0.03125 : 0.25) && range < (k < 2 ? 0.03126 : 0.2501));
            else
                CHECK(scene->less[k] == 0.0);
            CHECK((scene->less[k] > 0.0) == (kind == 0 && k < 2));
        }
        hs_level_close(&open);
        hs_level_plan_free(&call.account, &plan);
        hs_levels_free(&call.account, &levels);
        hs_call_dismiss(&call);
        hs_account_close(&call.account);
    }
}

void
test_support_width(void)
{
    RUN(the_rule_says_whose_width_counts);
    RUN(cells_go_by_the_width);
}
