/* SPDX-License-Identifier: BSD-3-Clause */
/* test_level_limits.c: points with supports are divided by how far these reach, and a step of
 * theirs as an open search has the supports of both sides, as far as its rule looks at them. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/levels/level_search.h"
#include "../support/poll_checks.h"
#include "../support/reach_sets.h"

void test_level_limits(void);

enum { ENTRIES = REACH_POINTS * 9 };

static reach_set points, queries;
static double    matrices[ENTRIES], query_matrices[ENTRIES];

/* Round ones, of which some reach many times as far, with a little beside the diagonal. */
static void
fill_supports(harness_random *random, int spread, const reach_set *set, double *to)
{
    const int d = set->ndim;
    for (int64_t i = 0; i < set->n; i++) {
        const double size = ldexp(1.0, (int)(random_bits(random) % (unsigned)spread));
        for (int k = 0; k < d; k++) {
            for (int l = 0; l < k; l++)
                to[(i * d + k) * d + l] = to[(i * d + l) * d + k] = 0.25 * size;
            to[(i * d + k) * d + k] = size * (1.0 + random_unit(random));
        }
    }
}

static void
fill(harness_random *random, int64_t n, int64_t n_queries, int ndim)
{
    reach_fill(random, n, ndim, 4.0, 0, 1.0, &points);
    reach_fill(random, n_queries, ndim, 4.0, 0, 1.0, &queries);
    fill_supports(random, 6, &points, matrices);
    fill_supports(random, 6, &queries, query_matrices);
}

/* What the rule needs, and no more. */
static hs_reach
reach_of(hs_rule rule, bool has_queries)
{
    return (hs_reach){.rule = rule,
                      .has_supports = true,
                      .extent = 0.75,
                      .supports = has_queries && rule == HS_RULE_GATHER ? NULL : matrices,
                      .query_supports = !has_queries || rule == HS_RULE_SCATTER ? NULL
                                                                                : query_matrices};
}

static const hs_rule rules[] = {HS_RULE_MAX, HS_RULE_MIN, HS_RULE_GATHER, HS_RULE_SCATTER};

/* A plan and the call that its steps are opened for. */
typedef struct planned {
    hs_call       call;
    hs_levels     levels;
    hs_level_plan plan;
    hs_failure    failure;
} planned;

static hs_status
divide(const hs_reach *reach, bool has_queries, double bound, planned *made)
{
    hs_options      options = hs_options_default();
    const hs_points p = reach_points(&points), q = reach_points(&queries);
    options.cutoff = bound;
    made->failure = HS_NO_FAILURE;
    made->plan = (hs_level_plan){.n = 0};
    hs_call_begin(&options, &made->call);
    return hs_levels_divide(&made->call.account, &options, &p, has_queries ? &q : NULL, reach,
                            &made->levels, &made->failure);
}

static void
make_plan(const hs_reach *reach, bool has_queries, double bound, planned *made)
{
    CHECK(divide(reach, has_queries, bound, made) == HS_OK);
    CHECK(hs_level_plan_make(&made->call.account, &made->levels, bound, HS_AUTO, &made->plan) ==
          HS_OK);
}

static void
free_plan(planned *made)
{
    hs_level_plan_free(&made->call.account, &made->plan);
    hs_levels_free(&made->call.account, &made->levels);
    hs_call_dismiss(&made->call);
    CHECK(made->call.account.held == 0);
    hs_account_close(&made->call.account);
}

/* Radii are how far the supports reach, ascending by levels; supports stay in the caller's order. */
static bool
is_divided(const hs_level_set *set, const double *given, int32_t n_levels, double extent)
{
    const int d = set->ndim, n_entries = hs_support_entries(d);
    bool      right = (set->radii != NULL) == (given != NULL);
    double    before = 0.0;
    right = right && (set->supports.numbers != NULL) == (given != NULL);
    right = right && set->first[n_levels] == set->n;
    if (given == NULL) {
        return right && set->first[1] == set->n; /* as if their radii were 0 */
    }
    for (int32_t l = 0; right && l < n_levels; l++) {
        double largest = before;
        for (int64_t at = set->first[l]; right && at < set->first[l + 1]; at++) {
            const int32_t i = set->number[at];
            const double *own = set->supports.numbers + i * (n_entries + 1);
            double        reach;
            right = hs_support_reach(d, own, extent, &reach) == HS_SUPPORT_FITS &&
                    set->radii[at] == reach && reach > before;
            for (int e = 0; right && e < d * d; e++)
                right = own[hs_support_at(e / d, e % d)] == given[(int64_t)i * d * d + e];
            largest = fmax(largest, set->radii[at]);
        }
        before = largest;
    }
    return right;
}

static void
points_are_divided_by_how_far_supports_reach(void)
{
    harness_random random = {2201};
    for (int trial = 0; trial < 48; trial++) {
        const bool     has_queries = trial & 1;
        const hs_reach reach = reach_of(rules[trial / 2 % 4], has_queries);
        planned        made;
        fill(&random, trial < 40 ? 120 : 0, trial < 44 ? 80 : 0, 1 + trial / 8 % 3);
        CHECK(divide(&reach, has_queries, HUGE_VAL, &made) == HS_OK);
        CHECK(made.levels.has_supports && made.levels.extent == 0.75);
        CHECK(made.levels.factor == 1.0); /* reaches have the extent */
        if (made.levels.n > 0) {
            CHECK(is_divided(&made.levels.points, reach.supports, made.levels.n, 0.75));
            if (has_queries)
                CHECK(is_divided(&made.levels.queries, reach.query_supports, made.levels.n, 0.75));
        }
        CHECK(trial >= 40 || made.levels.n > 4);
        free_plan(&made);
    }
}

static void
is_refused(hs_status status, int64_t row, bool in_queries)
{
    const hs_reach reach = reach_of(HS_RULE_MAX, true);
    planned        made;
    CHECK(divide(&reach, true, HUGE_VAL, &made) == status);
    CHECK(made.failure.row == row && made.failure.in_queries == in_queries);
    CHECK(made.levels.points.rows == NULL && made.levels.points.supports.numbers == NULL);
    free_plan(&made);
}

static void
the_first_wrong_support_is_named(void)
{
    harness_random random = {2202};
    double        *wrong = query_matrices + 4 * 17;
    fill(&random, 50, 40, 2);
    memcpy(wrong, (double[]){1.0, 0.5, 0.25, 1.0}, sizeof(double[4])); /* not symmetric */
    is_refused(HS_ERR_SUPPORTS, 17, true);
    memcpy(wrong, (double[]){1.0, 0.5, 0.5, 0.25}, sizeof(double[4])); /* singular */
    is_refused(HS_ERR_SUPPORTS, 17, true);
    queries.x[2 * 3 + 1] = NAN; /* points are read after supports */
    is_refused(HS_ERR_SUPPORTS, 17, true);
    wrong[3] = 1.0;
    is_refused(HS_ERR_NOT_FINITE, 3, true);
    for (int e = 0; e < 4; e++)
        matrices[4 * 31 + e] = e % 3 == 0 ? 0x1p-1060 : 0.0;
    is_refused(HS_ERR_SUPPORT_REACH, 31, false);
}

/* The supports of a side, as they are decided with and as kernels read them. */
static bool
has_side(const hs_level_search *open, const hs_bins *bins, const hs_level_set *set, bool needed,
         const hs_support_side *side)
{
    const int d = set->ndim, n_numbers = hs_support_numbers(d);
    float     near[REACH_POINTS * (HS_SUPPORT_ENTRIES + 1)];
    if (!needed) {
        return side->numbers == NULL && side->near == NULL;
    }
    hs_supports_lay_out(side, 0, bins->n, d, 0.75, hs_scale_apply(open->search.scene.unscale, 1.0),
                        near);
    return side->numbers == set->supports.numbers && side->order == bins->order &&
           side->near != NULL &&
           memcmp(side->near, near, (size_t)(bins->n * n_numbers) * sizeof *near) == 0;
}

static bool
step_is_right(planned *made, int64_t s, bool is_bounded)
{
    const hs_levels *levels = &made->levels;
    const hs_rule    rule = levels->rule;
    hs_level_search  open;
    hs_failure       failure;
    if (hs_level_open(levels, &made->plan, s, NULL, false, &made->call, &open, &failure) != HS_OK) {
        return false;
    }
    const hs_search   *search = &open.search;
    const hs_scene    *scene = &search->scene;
    const hs_supports *supports = &open.own.supports;
    const bool         both = !search->has_queries;
    bool right = made->plan.steps[s].has_limits && search->limits == &open.own.limits &&
                 open.own.limits.supports == supports && open.own.limits.rule == rule;
    right = right && supports->rule == rule && supports->is_bounded == is_bounded;
    right = right && supports->metric.limit.cutoff == 0.75;
    right = right && supports->metric.exponent == (scene->extreme ? 0 : -scene->scale.exponent);
    right = right && has_side(&open, &search->bins, &levels->points, both || rule != HS_RULE_GATHER,
                              &supports->of_points);
    right = right && has_side(&open, hs_search_asking(search), hs_levels_asking(levels),
                              both || rule != HS_RULE_SCATTER, &supports->of_asking);
    hs_level_close(&open);
    hs_level_close(&open);
    return right;
}

static void
steps_have_the_supports_that_the_rule_needs(void)
{
    harness_random random = {2203};
    int            wrong = 0, opened = 0;
    for (int trial = 0; trial < 48; trial++) {
        const bool     has_queries = trial & 1, is_bounded = trial % 3 == 0;
        const hs_reach reach = reach_of(rules[trial / 2 % 4], has_queries);
        planned        made;
        fill(&random, 100, trial % 5 ? 60 : 3, 1 + trial / 8 % 3);
        make_plan(&reach, has_queries, is_bounded ? 0x1p-8 : HUGE_VAL, &made);
        for (int64_t s = 0; s < made.plan.n; s++, opened++)
            wrong += !step_is_right(&made, s, is_bounded);
        free_plan(&made);
    }
    CHECK(wrong == 0 && opened > 200);
}

/* Where scaling would lose digits, supports are for the caller's unit. */
static void
extreme_points_are_not_scaled(void)
{
    const hs_reach reach = reach_of(HS_RULE_MAX, false);
    harness_random random = {2204};
    planned        made;
    int            extreme = 0;
    fill(&random, 40, 0, 2);
    for (int e = 0; e < 80; e++)
        points.x[e] = e == 0 ? 0x1p-1070 : ldexp(points.x[e], 1010);
    for (int e = 0; e < 160; e++)
        matrices[e] = ldexp(matrices[e], -1010);
    make_plan(&reach, false, HUGE_VAL, &made);
    for (int64_t s = 0; s < made.plan.n; s++) {
        hs_level_search open;
        hs_failure      failure;
        CHECK(hs_level_open(&made.levels, &made.plan, s, NULL, false, &made.call, &open,
                            &failure) == HS_OK);
        CHECK(!open.search.scene.extreme || open.own.supports.metric.exponent == 0);
        extreme += open.search.scene.extreme;
        hs_level_close(&open);
    }
    CHECK(extreme > 0);
    free_plan(&made);
}

typedef struct one_step {
    planned *made;
    int64_t  step;
} one_step;

static hs_status
open_once(void *context)
{
    const one_step *one = context;
    planned        *made = one->made;
    hs_level_search open;
    hs_failure      failure = HS_NO_FAILURE;
    const int64_t   held = made->call.account.held;
    const hs_status status = hs_level_open(&made->levels, &made->plan, one->step, NULL, false,
                                           &made->call, &open, &failure);
    if (status == HS_OK)
        hs_level_close(&open);
    CHECK(made->call.account.held == held);
    CHECK(failure.row == -1);
    return status;
}

static hs_status
divide_once(void *context)
{
    planned         made;
    const hs_status status = divide(context, true, HUGE_VAL, &made);
    CHECK(status == HS_OK || made.levels.points.rows == NULL);
    free_plan(&made);
    return status;
}

static void
nothing_leaks_when_memory_is_short(void)
{
    harness_random random = {2205};
    fill(&random, 60, 50, 3);
    for (int rule = 0; rule < 4; rule++) {
        for (int has_queries = 0; has_queries < 2; has_queries++) {
            hs_reach reach = reach_of(rules[rule], has_queries);
            planned  made;
            make_plan(&reach, has_queries, HUGE_VAL, &made);
            for (int64_t s = 0; s < made.plan.n && s < 4; s++) {
                one_step one = {&made, s};
                CHECK(fail_each_allocation(open_once, &one, 100) > 3);
            }
            free_plan(&made);
            if (has_queries)
                CHECK(fail_each_allocation(divide_once, &reach, 100) > 10);
        }
    }
}

void
test_level_limits(void)
{
    RUN(points_are_divided_by_how_far_supports_reach);
    RUN(the_first_wrong_support_is_named);
    RUN(steps_have_the_supports_that_the_rule_needs);
    RUN(extreme_points_are_not_scaled);
    RUN(nothing_leaks_when_memory_is_short);
}
