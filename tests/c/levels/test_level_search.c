/* SPDX-License-Identifier: BSD-3-Clause */
/* test_level_search.c: one step of a plan as an open search: its points have the caller's numbers,
 * and radii lie in the order of the cells; closed, nothing of it is left. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/levels/level_search.h"
#include "../support/poll_checks.h"
#include "../support/reach_sets.h"

void test_level_search(void);

static reach_set points, queries;

/* A plan and the call that its steps are opened for. */
typedef struct planned {
    hs_call       call;
    hs_levels     levels;
    hs_level_plan plan;
    const hs_box *box;
} planned;

static void
make_plan(const hs_reach *reach, bool has_queries, double bound, const hs_box *box, planned *made)
{
    hs_options      options = hs_options_default();
    const hs_points p = reach_points(&points), q = reach_points(&queries);
    hs_failure      failure = HS_NO_FAILURE;
    options.cutoff = bound;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    made->box = box;
    hs_call_begin(&options, &made->call);
    hs_account *account = &made->call.account;
    CHECK(hs_levels_divide(account, &options, &p, has_queries ? &q : NULL, reach, &made->levels,
                           &failure) == HS_OK);
    CHECK(hs_level_plan_make(account, &made->levels, bound, HS_AUTO, &made->plan) == HS_OK);
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

static hs_status
open_step(planned *made, int64_t step, hs_level_search *open, hs_failure *failure)
{
    *failure = HS_NO_FAILURE;
    return hs_level_open(&made->levels, &made->plan, step, made->box, false, &made->call, open,
                         failure);
}

/* The points of a slice, with the radii in the unit of the search: a power of two apart from the
 * caller's, and halved for the mean. */
static bool
has_points(const hs_bins *bins, const hs_level_set *set, hs_slice slice, const hs_radii *radii,
           hs_scale scale)
{
    const int64_t first = set->first[slice.first], end = set->first[slice.end];
    bool          seen[REACH_POINTS] = {false};
    bool          right = bins->n == end - first;
    for (int64_t at = first; right && at < end; at++)
        seen[set->number[at]] = true;
    for (int64_t si = 0; right && si < bins->n; si++) {
        const int32_t number = bins->order[si];
        int64_t       at = first;
        right = number >= 0 && number < set->n && seen[number];
        seen[right ? number : 0] = false;
        while (right && set->number[at] != number)
            at++;
        if (right && radii != NULL && radii->exact != NULL) {
            right = radii->exact[si] == hs_scale_apply(scale, set->radii[at]) &&
                    radii->near[si] == (float)radii->exact[si];
        }
    }
    for (int p = 0; right && radii != NULL && radii->exact != NULL && p < HS_PADDING; p++)
        right = radii->near[bins->n + p] == 0.0f;
    return right;
}

static bool
step_is_right(planned *made, int64_t s)
{
    const hs_level_step *step = &made->plan.steps[s];
    const hs_level_set  *among = &made->levels.points;
    hs_level_search      open;
    hs_failure           failure;
    bool                 right = open_step(made, s, &open, &failure) == HS_OK;
    if (!right) {
        return false;
    }
    const hs_search *search = &open.search;
    const hs_limits *limits = search->limits;
    const hs_scale   scale = search->scene.scale;
    const hs_rule    rule = made->levels.rule;
    right = (limits != NULL) == step->has_limits && made->call.options.cutoff == step->cutoff;
    right = right && search->has_queries == !step->is_own && search->is_full == !step->is_own;
    right = right && search->is_half == made->plan.is_half;
    right = right && has_points(&search->bins, among, step->points,
                                limits != NULL ? &limits->of_points : NULL, scale);
    if (!step->is_own) {
        right = right &&
                has_points(&search->query_bins, hs_levels_asking(&made->levels), step->asking,
                           limits != NULL ? &limits->of_asking : NULL, scale);
    }
    if (limits != NULL) {
        right = right && limits->rule == rule;
        right = right && (limits->of_points.exact == NULL) == (rule == HS_RULE_GATHER);
        right = right && (limits->of_asking.exact == NULL) == (rule == HS_RULE_SCATTER);
        right = right && limits->bound == hs_scale_apply(scale, made->plan.bound);
        right = right && limits->near_bound == (float)limits->bound;
    }
    right = right && hs_search_fraction(search, 0) == (double)s / (double)made->plan.n;
    right = right && hs_search_fraction(search, hs_search_asking(search)->n) ==
                         (double)(s + 1) / (double)made->plan.n;
    hs_level_close(&open);
    hs_level_close(&open);
    return right;
}

static void
steps_have_the_callers_numbers(void)
{
    const hs_box   box = {.ndim = 3,
                          .periodic = {true, false, true},
                          .rows = {{4.0, 0.0, 0.0}, {0.5, 4.0, 0.0}, {0.0, 0.25, 4.0}}};
    harness_random random = {91};
    int            wrong = 0, opened = 0;
    for (int trial = 0; trial < 96; trial++) {
        const hs_reach reach = {.rule = (hs_rule)(trial / 2 % HS_RULE_END),
                                .radii = points.radii,
                                .query_radii = queries.radii};
        planned        made;
        reach_fill(&random, 100, 3, 4.0, trial / 12 % 5, 0.5, &points);
        reach_fill(&random, trial % 5 ? 200 : 7, 3, 4.0, 2, 0.5, &queries);
        make_plan(&reach, trial & 1, trial % 3 ? HUGE_VAL : 0.375, trial % 4 < 2 ? &box : NULL,
                  &made);
        for (int64_t s = 0; s < made.plan.n; s++, opened++)
            wrong += !step_is_right(&made, s);
        free_plan(&made);
    }
    CHECK(wrong == 0 && opened > 500);
}

typedef struct one_step {
    planned *made;
    int64_t  step;
} one_step;

static hs_status
open_once(void *context)
{
    const one_step *one = context;
    hs_level_search open;
    hs_failure      failure;
    const int64_t   held = one->made->call.account.held;
    const hs_status status = open_step(one->made, one->step, &open, &failure);
    if (status == HS_OK) {
        hs_level_close(&open);
    }
    CHECK(one->made->call.account.held == held);
    return status;
}

/* Whether the search has the limits of the types of each two of its points, or -1. */
static bool
has_table(const hs_search *search, const double *table)
{
    const hs_limits *limits = search->limits;
    const hs_bins   *asking = hs_search_asking(search);
    const int32_t   *of_asking = search->has_queries ? queries.types : points.types;
    const double     bound = limits->bound;
    bool             right = true;
    for (int64_t si = 0; si < asking->n; si++) {
        for (int64_t sj = 0; sj < search->bins.n; sj++) {
            const int32_t a = of_asking[asking->order[si]];
            const int32_t b = points.types[search->bins.order[sj]];
            const double  cutoff = table[a * REACH_TYPES + b];
            const double scaled = cutoff < 0.0 ? -1.0 : hs_scale_apply(search->scene.scale, cutoff);
            const hs_dw  limit = hs_limit_of(limits, (int32_t)si, (int32_t)sj);
            const int32_t place =
                limits->table.of_asking[si] * limits->table.n_types + limits->table.of_points[sj];
            right = right && limit.hi == fmin(scaled, bound) && limit.lo == 0.0 &&
                    limits->table.near[place] == (float)scaled;
        }
    }
    return right;
}

static void
tables_are_those_of_the_types(void)
{
    double         table[REACH_TYPES * REACH_TYPES];
    harness_random random = {95};
    for (int trial = 0; trial < 12; trial++) {
        const hs_reach reach = {.n_types = REACH_TYPES,
                                .types = points.types,
                                .query_types = queries.types,
                                .cutoffs = table};
        planned        made;
        one_step       one = {&made, 0};
        reach_fill(&random, 80, 3, 4.0, 0, 0.5, &points);
        reach_fill(&random, 30, 3, 4.0, 0, 0.5, &queries);
        for (int i = 0; i < 80; i++)
            points.types[i] = points.types[i] == 1 ? 4 : points.types[i]; /* one is of no point */
        for (int a = 0; a < REACH_TYPES; a++) {
            for (int b = 0; b <= a; b++)
                table[a * REACH_TYPES + b] = table[b * REACH_TYPES + a] =
                    a == b && a % 2 ? -3.0 : 0.9 + 0.1 * random_unit(&random);
        }
        make_plan(&reach, trial & 1, trial % 3 ? 5.0 : 0.95, NULL, &made);
        CHECK(made.plan.n == 1 && made.plan.steps[0].by_table);
        hs_level_search open;
        hs_failure      failure;
        CHECK(open_step(&made, 0, &open, &failure) == HS_OK);
        CHECK(has_table(&open.search, table));
        CHECK(has_points(&open.search.bins, &made.levels.points, made.plan.steps[0].points, NULL,
                         open.search.scene.scale));
        hs_level_close(&open);
        CHECK(fail_each_allocation(open_once, &one, 100) > 5);
        free_plan(&made);
    }
}

/* Where scaling would lose digits, pairs are decided in the caller's unit, and so are limits. */
static void
extreme_radii_stay_as_they_are(void)
{
    const hs_reach reach = {.rule = HS_RULE_SUM, .radii = points.radii};
    harness_random random = {92};
    planned        made;
    int            kept = 0;
    reach_fill(&random, 40, 2, 1.0, 1, 0.5, &points);
    for (int e = 0; e < 80; e++)
        points.x[e] = e == 0 ? 0x1p-1070 : ldexp(points.x[e], 1010);
    for (int i = 0; i < 40; i++)
        points.radii[i] = i == 1 ? 0x1p-1060 : ldexp(points.radii[i], 1010);
    make_plan(&reach, false, HUGE_VAL, NULL, &made);
    for (int64_t s = 0; s < made.plan.n; s++) {
        hs_level_search open;
        hs_failure      failure;
        CHECK(open_step(&made, s, &open, &failure) == HS_OK);
        const hs_radii *radii = &open.own.limits.of_points;
        for (int64_t si = 0;
             open.search.scene.extreme && open.search.limits != NULL && si < open.search.bins.n;
             si++, kept++) {
            CHECK(radii->exact[si] == points.radii[open.search.bins.order[si]]);
            CHECK(open.own.limits.bound == HUGE_VAL && radii->near[si] <= 0x1p100f);
        }
        hs_level_close(&open);
    }
    CHECK(kept > 10);
    free_plan(&made);
    static const double ends[] = {0x1p1010, 0x1p-1060, 0x1p-1060, -1.0}; /* of two types */
    const hs_reach      by_type = {.n_types = 2, .types = points.types, .cutoffs = ends};
    hs_level_search     open;
    hs_failure          failure;
    for (int i = 0; i < 40; i++)
        points.types[i] = i == 1;
    make_plan(&by_type, false, HUGE_VAL, NULL, &made);
    CHECK(made.plan.n == 1 && made.plan.steps[0].by_table);
    CHECK(open_step(&made, 0, &open, &failure) == HS_OK && open.search.scene.extreme);
    CHECK(memcmp(open.own.limits.table.exact, ends, sizeof ends) == 0);
    CHECK(open.own.limits.table.near[3] == -1.0f && open.own.limits.table.near[0] <= 0x1p100f);
    hs_level_close(&open);
    free_plan(&made);
}

/* Few asking points meet all others without cells, unless the caller has said how. A level with
 * itself is searched both ways where the plan is none of half lists. */
static void
steps_are_searched_as_the_plan_says(void)
{
    static const struct {
        hs_algorithm asked, few;
    } cases[] = {{HS_AUTO, HS_ALL_PAIRS},
                 {HS_HIERARCHY, HS_ALL_PAIRS},
                 {HS_ALL_PAIRS, HS_ALL_PAIRS},
                 {HS_HASH, HS_HASH}};
    const hs_reach reach = {.rule = HS_RULE_GATHER, .query_radii = queries.radii};
    const hs_reach own = {.rule = HS_RULE_MAX, .radii = points.radii};
    harness_random random = {96};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        for (int n_queries = 4; n_queries <= 5; n_queries++) {
            planned         made;
            hs_level_search open;
            hs_failure      failure;
            reach_fill(&random, 60, 2, 4.0, 0, 0.5, &points);
            reach_fill(&random, n_queries, 2, 4.0, 0, 0.5, &queries);
            make_plan(&reach, true, HUGE_VAL, NULL, &made);
            made.plan.algorithm = cases[c].asked;
            CHECK(made.plan.n == 1 && open_step(&made, 0, &open, &failure) == HS_OK);
            CHECK(made.call.options.algorithm == (n_queries == 4 ? cases[c].few : cases[c].asked));
            hs_level_close(&open);
            free_plan(&made);
            make_plan(&own, false, HUGE_VAL, NULL, &made);
            made.plan.algorithm = cases[c].asked;
            made.plan.is_half = n_queries == 4;
            CHECK(made.plan.n == 1 && made.plan.steps[0].is_own);
            CHECK(open_step(&made, 0, &open, &failure) == HS_OK);
            CHECK(made.call.options.algorithm == cases[c].asked);
            CHECK(open.search.is_half == made.plan.is_half && !open.search.has_queries);
            CHECK(open.search.is_full == !made.plan.is_half);
            hs_level_close(&open);
            free_plan(&made);
        }
    }
}

/* A point too far for its box: the row is the caller's, of the set that it belongs to. */
static void
failures_name_the_callers_row(void)
{
    const hs_box   box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    harness_random random = {93};
    for (int in_queries = 0; in_queries < 2; in_queries++) {
        for (int has_queries = in_queries; has_queries < 2; has_queries++) {
            const hs_reach reach = {
                .rule = HS_RULE_GATHER, .radii = points.radii, .query_radii = queries.radii};
            planned made;
            int     n_failed = 0;
            reach_fill(&random, 60, 1, 1.0, 2, 0.25, &points);
            reach_fill(&random, 50, 1, 1.0, 2, 0.25, &queries);
            *(in_queries ? &queries.x[31] : &points.x[31]) = 1e300;
            make_plan(&reach, has_queries, HUGE_VAL, &box, &made);
            made.call.options.precision = HS_DOUBLE;
            for (int64_t s = 0; s < made.plan.n; s++) {
                hs_level_search open;
                hs_failure      failure;
                const hs_status status = open_step(&made, s, &open, &failure);
                if (status == HS_OK) {
                    hs_level_close(&open);
                    continue;
                }
                CHECK(status == HS_ERR_ROUNDING && failure.row == 31);
                CHECK(failure.in_queries == in_queries);
                n_failed++;
            }
            CHECK(n_failed > 0);
            free_plan(&made);
        }
    }
}

static void
nothing_leaks_when_memory_is_short(void)
{
    harness_random random = {94};
    reach_fill(&random, 60, 2, 4.0, 2, 0.5, &points);
    reach_fill(&random, 50, 2, 4.0, 2, 0.5, &queries);
    for (int rule = 0; rule < HS_RULE_END; rule++) {
        const hs_reach reach = {
            .rule = (hs_rule)rule, .radii = points.radii, .query_radii = queries.radii};
        planned made;
        make_plan(&reach, rule % 2, HUGE_VAL, NULL, &made);
        for (int64_t s = 0; s < made.plan.n && s < 6; s++) {
            one_step one = {&made, s};
            CHECK(fail_each_allocation(open_once, &one, 100) > 3);
        }
        free_plan(&made);
    }
}

/* Supports are looked at for the width of cells, and laid out for kernels: both poll. */
static void
opening_a_step_of_many_supports_can_be_stopped(void)
{
    enum { MANY = 2 * HS_POLL_SUPPORTS + 9 };
    static double   x[MANY], numbers[MANY];
    const hs_points p = {x, MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x};
    for (int64_t i = 0; i < MANY; i++) {
        x[i] = (double)i;
        numbers[i] = i == MANY - 1 ? 1.0 : 1.5; /* the last is as wide as the ball */
    }
    for (int rule = HS_RULE_MAX; rule < HS_RULE_END; rule++) {
        for (int has_queries = 0; has_queries < 2; has_queries++) {
            const bool      asks = rule != HS_RULE_SCATTER, meets = rule != HS_RULE_GATHER;
            const hs_reach  reach = {.rule = (hs_rule)rule,
                                     .has_supports = true,
                                     .extent = 1.0,
                                     .supports = meets || !has_queries ? numbers : NULL,
                                     .query_supports = asks && has_queries ? numbers : NULL};
            refusal         once = {.nth = 0};
            hs_options      options = hs_options_default();
            hs_failure      failure = HS_NO_FAILURE;
            hs_levels       levels;
            hs_level_plan   plan;
            hs_level_search open;
            hs_call         call;
            options.cutoff = HUGE_VAL;
            options.poll = refuse_once;
            options.poll_context = &once;
            hs_call_begin(&options, &call);
            CHECK(hs_levels_divide(&call.account, &options, &p, has_queries ? &p : NULL, &reach,
                                   &levels, &failure) == HS_OK);
            CHECK(hs_level_plan_make(&call.account, &levels, HUGE_VAL, HS_AUTO, &plan) == HS_OK);
            const int64_t held = call.account.held;
            once = (refusal){.nth = 0};
            CHECK(hs_level_open(&levels, &plan, 0, NULL, false, &call, &open, &failure) == HS_OK);
            hs_level_close(&open);
            const int64_t n = once.n;
            CHECK(n >= 4); /* the width of one side at least, and what is laid out */
            for (int64_t nth = 1; nth <= n; nth++) {
                once = (refusal){.nth = nth};
                CHECK(hs_level_open(&levels, &plan, 0, NULL, false, &call, &open, &failure) ==
                      HS_ERR_INTERRUPTED);
                CHECK(once.n == nth && call.account.held == held);
            }
            hs_level_plan_free(&call.account, &plan);
            hs_levels_free(&call.account, &levels);
            hs_call_dismiss(&call);
            hs_account_close(&call.account);
        }
    }
}

void
test_level_search(void)
{
    RUN(opening_a_step_of_many_supports_can_be_stopped);
    RUN(steps_have_the_callers_numbers);
    RUN(tables_are_those_of_the_types);
    RUN(extreme_radii_stay_as_they_are);
    RUN(steps_are_searched_as_the_plan_says);
    RUN(failures_name_the_callers_row);
    RUN(nothing_leaks_when_memory_is_short);
}
