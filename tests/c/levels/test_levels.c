/* SPDX-License-Identifier: BSD-3-Clause */
/* test_levels.c: points with radii of many sizes are divided into levels, whose searches find each
 * pair once. */
#include "../../../csrc/core/base/status.h"
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/levels/levels.h"
#include "../../../csrc/core/search/limits.h"
#include "../support/poll_checks.h"
#include "../support/reach_sets.h"

#include <math.h>

void test_levels(void);

/* ---- supports as they are read: the lower triangle, a size, how far each reaches ---- */

enum { N = 5 };

static double matrices[N * 9];

/* Diagonal 1, 2, 4 and beside it 0.25, for each point a power of two of that. */
static void
fill(int ndim)
{
    for (int i = 0; i < N; i++)
        for (int k = 0; k < ndim; k++)
            for (int l = 0; l < ndim; l++)
                matrices[(i * ndim + k) * ndim + l] = ldexp(k == l ? ldexp(1.0, k) : 0.25, i);
}

static void
is_refused(hs_status status, int64_t row, double value)
{
    static const double rows[N * 3];
    const hs_options    options = hs_options_default();
    const hs_reach      reach = {.rule = HS_RULE_MAX, .has_supports = true, .extent = 1.0};
    const hs_set        points = {.at = {rows, N, 3, HS_FLOAT64, 24, 8}, .supports = matrices};
    hs_account          account = new_account();
    hs_failure          failure = {.row = -1};
    hs_levels           levels;
    CHECK(hs_levels_divide(&account, &options, &points, NULL, &reach, &levels, &failure) == status);
    CHECK(failure.row == row && levels.points.supports.numbers == NULL && account.held == 0);
    CHECK(failure.value == value || (isnan(failure.value) && isnan(value)));
    hs_account_close(&account);
}

static void
the_first_that_is_wrong_is_named(void)
{
    static const double wrong[] = {NAN, INFINITY, -INFINITY};
    for (int e = 0; e < 9; e++) {
        for (int w = 0; w < 3; w++) {
            fill(3);
            matrices[2 * 9 + e] = matrices[4 * 9] = wrong[w];
            is_refused(HS_ERR_SUPPORTS, 2, wrong[w]);
        }
        fill(3);
        matrices[3 * 9 + e] += 1.0; /* not symmetric, unless on the diagonal */
        if (e % 4 != 0) {           /* by its upper entry */
            is_refused(HS_ERR_SUPPORTS, 3, e % 3 > e / 3 ? 3.0 : 2.0);
        }
    }
    fill(3);
    matrices[9 + 4] = 0.0625;                    /* singular, or less */
    is_refused(HS_ERR_SUPPORTS, 1, matrices[9]); /* named by its first entry */
    fill(3);
    for (int e = 0; e < 9; e++)
        matrices[4 * 9 + e] *= 0x1p-1050;
    is_refused(HS_ERR_SUPPORT_REACH, 4, 1.0); /* the extent */
}

/* ---- each point is in one level, in the caller's order there, and levels ascend ---- */

static void
close_account(hs_account *account)
{
    CHECK(account->held == 0);
    hs_account_close(account);
}

/* Every poll of a division of many points: the one that says no ends it, and nothing is left. */
static void
a_division_can_be_stopped(void)
{
    enum { MANY = 2 * HS_POLL_POINTS + 9 };
    static double  x[MANY], numbers[MANY];
    static int32_t types[MANY];
    const double   cutoff = 1.0;
    const hs_set   p = {.at = {x, MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x},
                        .radii = numbers,
                        .supports = numbers,
                        .types = types};
    const hs_reach reaches[] = {
        {.rule = HS_RULE_SUM},
        {.n_types = 1, .cutoffs = &cutoff},
        {.rule = HS_RULE_MAX, .has_supports = true, .extent = 1.0},
    };
    for (int64_t i = 0; i < MANY; i++) {
        x[i] = (double)i;
        numbers[i] = 1.0;
    }
    for (int kind = 0; kind < 3; kind++) {
        refusal    once = {.nth = 0};
        hs_options options = hs_options_default();
        hs_levels  levels;
        options.poll = refuse_once;
        options.poll_context = &once;
        for (int has_queries = 0; has_queries < 2; has_queries++) {
            hs_account account = new_account();
            hs_failure failure = HS_NO_FAILURE;
            once = (refusal){.nth = 0};
            CHECK(hs_levels_divide(&account, &options, &p, has_queries ? &p : NULL, &reaches[kind],
                                   &levels, &failure) == HS_OK);
            hs_levels_free(&account, &levels);
            const int64_t n = once.n, step = (n > 40 ? 9 : 1) * (IS_SLOW ? 3 : 1);
            CHECK(n >= (kind == 1 ? 4 : 6) * (has_queries + 1));
            for (int64_t nth = 1; nth <= n; nth += nth > 2 && nth < n - 12 ? step : 1) {
                once = (refusal){.nth = nth};
                CHECK(hs_levels_divide(&account, &options, &p, has_queries ? &p : NULL,
                                       &reaches[kind], &levels, &failure) == HS_ERR_INTERRUPTED);
                CHECK(once.n == nth && account.held == 0 && levels.n == 0);
            }
            close_account(&account);
        }
    }
}

/* ---- plans of levels: which searches there are, where levels may be joined and where not ---- */

static reach_set points, queries;

static int64_t
count_searches(const hs_reach *reach, hs_algorithm algorithm, bool joins)
{
    const hs_set   set = reach_set_of(&points);
    const hs_among among = {.points = &set, .reach = reach};
    hs_options     options = hs_options_default();
    hs_plan        plan;
    options.cutoff = reach->n_types > 0 ? 1e6 : HUGE_VAL;
    options.algorithm = algorithm;
    const bool before = hs_test_joins_levels;
    hs_test_joins_levels = joins;
    CHECK(hs_plan_make(&among, &options, &plan, NULL) == HS_OK);
    hs_test_joins_levels = before;
    return plan.n_searches;
}

/* More types than a table of limits is laid out for are searched two by two, and so are types of
 * which few meet. */
static void
many_types_are_searched_in_pairs(void)
{
    enum { MOST_TYPES = 9 };
    double         all[MOST_TYPES * MOST_TYPES];
    harness_random random = {78};
    reach_fill(&random, 90, 1, 1.0, 0, 1.0, &points);
    for (int n_types = 1; n_types <= MOST_TYPES; n_types++) {
        const hs_reach reach = {.n_types = n_types, .cutoffs = all};
        for (int e = 0; e < MOST_TYPES * MOST_TYPES; e++)
            all[e] = 1.0;
        for (int i = 0; i < 90; i++)
            points.types[i] = i % n_types;
        const int64_t expected = n_types <= 8 ? 1 : MOST_TYPES * (MOST_TYPES + 1) / 2;
        CHECK(count_searches(&reach, HS_AUTO, false) == expected);
    }
    reach_fill(&random, 90, 1, 1.0, 0, 1.0, &points);
    for (int e = 0; e < REACH_TYPES * REACH_TYPES; e++)
        all[e] = e % (REACH_TYPES + 1) == 0 ? 0.001 : -1.0;
    const hs_reach own = {.n_types = REACH_TYPES, .cutoffs = all};
    CHECK(count_searches(&own, HS_AUTO, true) == REACH_TYPES);
}

/* A plan that the caller chose, of one step or of too many levels stays. */
static void
some_plans_are_never_joined(void)
{
    const hs_reach reach = {.rule = HS_RULE_SUM};
    harness_random random = {73};
    reach_fill(&random, REACH_POINTS, 3, 20.0, 0, 0.5, &points);
    CHECK(count_searches(&reach, HS_AUTO, true) == 1);
    for (int i = 0; i < REACH_POINTS; i += 2)
        points.radii[i] = 1.2;
    CHECK(count_searches(&reach, HS_HIERARCHY, true) == 3);
    CHECK(count_searches(&reach, HS_AUTO, true) == 1);
    for (int n_levels = 16; n_levels <= 17; n_levels++) { /* few points, far apart */
        reach_fill(&random, 2 * n_levels, 3, 1e6, 0, 1.0, &points);
        for (int i = 0; i < 2 * n_levels; i++)
            points.radii[i] = ldexp(0.75, -(i % n_levels));
        points.radii[0] = 1.0; /* the largest has a level of its own size, or of all above half */
        const int64_t apart = count_searches(&reach, HS_AUTO, false);
        CHECK(apart > n_levels);
        CHECK(count_searches(&reach, HS_AUTO, true) == (n_levels == 16 ? 1 : apart));
    }
}

/*
 * ---- level search ----
 *
 * One step of a plan as an open search: its points have the caller's numbers, and radii lie in the
 * order of the cells.
 */

/* A plan and the call that its steps are opened for. */
typedef struct opened_plan {
    hs_call       call;
    hs_levels     levels;
    hs_level_plan plan;
    const hs_box *box;
} opened_plan;

static void
open_plan(const hs_reach *reach, bool has_queries, double bound, const hs_box *box,
          opened_plan *made)
{
    hs_options   options = hs_options_default();
    const hs_set p = reach_set_of(&points), q = reach_set_of(&queries);
    hs_failure   failure = HS_NO_FAILURE;
    options.cutoff = bound;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    made->box = box;
    hs_call_begin(&options, &made->call);
    hs_account *account = &made->call.account;
    CHECK(hs_levels_divide(account, &options, &p, has_queries ? &q : NULL, reach, &made->levels,
                           &failure) == HS_OK);
    CHECK(hs_level_plan_make(account, &made->levels, NULL, bound, HS_AUTO, &made->plan) == HS_OK);
}

static void
close_plan(opened_plan *made)
{
    hs_level_plan_free(&made->call.account, &made->plan);
    hs_levels_free(&made->call.account, &made->levels);
    hs_call_dismiss(&made->call);
    CHECK(made->call.account.held == 0);
    hs_account_close(&made->call.account);
}

static hs_status
open_step(opened_plan *made, int64_t step, hs_level_search *open, hs_failure *failure)
{
    *failure = HS_NO_FAILURE;
    return hs_level_open(&made->plan, step, made->box, false, &made->call, open, failure);
}

/* No length passes the cutoff of its step, not even a sum that is just above a float64; and the least
 * radius is known, or a part of it that no product has digits below. */
static void
steps_have_all_lengths(void)
{
    const double factors[] = {0.0, 1.5};
    for (int k = 0; k < 2; k++) {
        const hs_reach reach = {.rule = k > 0 ? HS_RULE_MAX : HS_RULE_SUM, .extent = factors[k]};
        harness_random random = {77};
        opened_plan    made;
        int            joined = 0;
        reach_fill(&random, 2, 1, 1.0, 0, 1.0, &points);
        reach_fill(&random, 5, 1, 1.0, 0, 0.0, &queries);
        queries.radii[1] = 0x1p-60;
        queries.radii[3] = 0.375;
        queries.radii[4] = 0.1875;
        open_plan(&reach, true, HUGE_VAL, NULL, &made);
        for (int64_t s = 0; s < made.plan.n; s++) {
            const hs_level_step *step = &made.plan.steps[s];
            if (k == 0 && step->asking.end - step->asking.first == 2) {
                CHECK(step->has_limits && step->cutoff == nextafter(1.0, 2.0));
                CHECK(step->least == 0x1p-60);
                joined++;
            }
            CHECK(k == 0 || (step->cutoff == 1.5 && step->least <= 1.5 * 0x1p-110));
        }
        CHECK(joined == (k == 0));
        close_plan(&made);
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
            const hs_reach reach = {.rule = has_queries ? HS_RULE_GATHER : HS_RULE_SUM};
            opened_plan    made;
            int            n_failed = 0;
            reach_fill(&random, 60, 1, 1.0, 2, 0.25, &points);
            reach_fill(&random, 50, 1, 1.0, 2, 0.25, &queries);
            *(in_queries ? &queries.x[31] : &points.x[31]) = 1e300;
            open_plan(&reach, has_queries, HUGE_VAL, &box, &made);
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
            close_plan(&made);
        }
    }
}

/* Supports are looked at for the width of cells, and laid out for kernels: both poll. */
static void
opening_a_step_of_many_supports_can_be_stopped(void)
{
    enum { MANY = 2 * HS_POLL_LEVELS + 9 };
    static double   x[MANY], numbers[MANY];
    const hs_points at = {x, MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x};
    for (int64_t i = 0; i < MANY; i++) {
        x[i] = (double)i;
        numbers[i] = i == MANY - 1 ? 1.0 : 1.5; /* the last is as wide as the ball */
    }
    for (int rule = HS_RULE_MAX; rule < HS_RULE_END; rule++) {
        for (int has_queries = 0; has_queries < 2; has_queries++) {
            const bool      asks = rule != HS_RULE_SCATTER, meets = rule != HS_RULE_GATHER;
            const hs_reach  reach = {.rule = (hs_rule)rule, .has_supports = true, .extent = 1.0};
            const hs_set    p = {.at = at, .supports = meets || !has_queries ? numbers : NULL};
            const hs_set    q = {.at = at, .supports = asks ? numbers : NULL};
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
            CHECK(hs_levels_divide(&call.account, &options, &p, has_queries ? &q : NULL, &reach,
                                   &levels, &failure) == HS_OK);
            CHECK(hs_level_plan_make(&call.account, &levels, NULL, HUGE_VAL, HS_AUTO, &plan) ==
                  HS_OK);
            const int64_t held = call.account.held;
            once = (refusal){.nth = 0};
            CHECK(hs_level_open(&plan, 0, NULL, false, &call, &open, &failure) == HS_OK);
            hs_level_close(&open);
            const int64_t n = once.n;
            CHECK(n >= 4); /* the width of one side at least, and what is laid out */
            for (int64_t nth = 1; nth <= n; nth++) {
                once = (refusal){.nth = nth};
                CHECK(hs_level_open(&plan, 0, NULL, false, &call, &open, &failure) ==
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
test_levels(void)
{
    RUN(the_first_that_is_wrong_is_named);
    RUN(a_division_can_be_stopped);
    RUN(many_types_are_searched_in_pairs);
    RUN(some_plans_are_never_joined);
    RUN(opening_a_step_of_many_supports_can_be_stopped);
    RUN(steps_have_all_lengths);
    RUN(failures_name_the_callers_row);
}
