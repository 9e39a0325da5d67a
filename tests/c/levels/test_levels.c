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
            const int64_t n = once.n;
            CHECK(n >= (kind == 1 ? 4 : 6) * (has_queries + 1));
            for (int64_t nth = 1; nth <= n; nth += n > 40 && nth > 2 && nth < n - 12 ? 9 : 1) {
                once = (refusal){.nth = nth};
                CHECK(hs_levels_divide(&account, &options, &p, has_queries ? &p : NULL,
                                       &reaches[kind], &levels, &failure) == HS_ERR_INTERRUPTED);
                CHECK(once.n == nth && account.held == 0 && levels.n == 0);
            }
            close_account(&account);
        }
    }
}

/* ---- plans of levels, and whether every pair of points is in one step of theirs ---- */

static reach_set points, queries;
static double    table[12 * 12]; /* of up to 12 types */

/* A division and a plan of it. */
typedef struct planned {
    hs_account    account;
    hs_levels     levels;
    hs_level_plan plan;
} planned;

static void
make_plan_as(const hs_reach *reach, bool has_queries, double bound, hs_algorithm algorithm,
             planned *made)
{
    const hs_options options = hs_options_default();
    const hs_set     p = reach_set_of(&points), q = reach_set_of(&queries);
    hs_failure       failure = HS_NO_FAILURE;
    hs_account_init(&made->account, &options);
    CHECK(hs_levels_divide(&made->account, &options, &p, has_queries ? &q : NULL, reach,
                           &made->levels, &failure) == HS_OK);
    CHECK(hs_level_plan_make(&made->account, &options, &made->levels, NULL, bound, algorithm,
                             &made->plan) == HS_OK);
}

static void
make_plan(const hs_reach *reach, bool has_queries, double bound, planned *made)
{
    make_plan_as(reach, has_queries, bound, HS_AUTO, made);
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
    return hs_limit_by(levels->rule, levels->factor, radius_at(hs_levels_asking(levels), a),
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
        const double factor = made->levels.factor, part = factor != 1.0 ? factor * 0x1p-110 : 1.0;
        right = step->least == (least < HUGE_VAL ? least * part : 0.0) && !step->by_table;
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

/*
 * ---- level plan ----
 *
 * Whatever the rule and the radii, each pair of points is in exactly one step, whose cutoff is no
 * less than its limit.
 */

/* So do sums of which the largest alone is no float64. */
static void
sums_above_an_exact_one_are_not_it(void)
{
    const hs_reach reach = {.rule = HS_RULE_SUM};
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
        const hs_reach reach = {.n_types = n_types, .cutoffs = all};
        for (int e = 0; e < N_TYPES * N_TYPES; e++)
            all[e] = 1.0;
        for (int i = 0; i < 90; i++)
            points.types[i] = i % n_types;
        make_plan(&reach, false, HUGE_VAL, &made);
        CHECK(made.plan.n == (n_types <= 8 ? 1 : N_TYPES * (N_TYPES + 1) / 2));
        CHECK(hs_level_plan_is_single(&made.plan) == (n_types <= 8));
        free_plan(&made);
    }
    static const double alone[3][4] = {/* type 0 with itself, with type 1, or that with itself */
                                       {0.1, -1.0, -1.0, -1.0},
                                       {-1.0, 0.1, 0.1, -1.0},
                                       {-1.0, -1.0, -1.0, 0.1}};
    for (int lone = 0; lone < 3; lone++) {
        const hs_reach reach = {.n_types = 2, .cutoffs = alone[lone]};
        for (int i = 0; i < 90; i++)
            points.types[i] = lone == 0 ? i % 9 != 0 : lone == 1 ? i % 2 : i % 9 == 0;
        make_plan(&reach, false, HUGE_VAL, &made);
        const bool by_table = made.plan.steps[0].by_table;
        CHECK(made.plan.n == 1);
        CHECK(hs_level_plan_is_single(&made.plan) == by_table);
        free_plan(&made);
    }
}

/* Queries of one level that look among all points ask for less than all levels. */
static void
a_level_of_two_is_not_all(void)
{
    const hs_reach reach = {.rule = HS_RULE_GATHER};
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
        CHECK(!hs_level_plan_is_single(&made.plan));
        free_plan(&made);
    }
}

/*
 * ---- level join ----
 *
 * Few common sizes are searched at once, rare large points and dense neighbourhoods of small ones
 * are not.
 */

static void
choose_plan(const hs_box *box, planned *made)
{
    const hs_options   options = hs_options_default();
    const hs_algorithm algorithm = made->plan.algorithm;
    hs_level_plan_free(&made->account, &made->plan);
    CHECK(hs_level_plan_make(&made->account, &options, &made->levels, box, HUGE_VAL, algorithm,
                             &made->plan) == HS_OK);
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

/* A plan that the caller chose, of one step, of types, of too many levels or of no points stays. */
static void
some_plans_are_never_joined(void)
{
    hs_reach       reach = {.rule = HS_RULE_SUM};
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
    reach = (hs_reach){.n_types = REACH_TYPES, .cutoffs = table};
    make_plan(&reach, false, HUGE_VAL, &made);
    CHECK(made.plan.n == REACH_TYPES);
    stays(&made);
}

static void
choose_plan_by(const hs_options *options, planned *made, hs_status expected)
{
    const hs_status status = hs_level_plan_make(&made->account, options, &made->levels, NULL,
                                                HUGE_VAL, HS_AUTO, &made->plan);
    CHECK(status == expected && (made->plan.n > 0) == (expected == HS_OK));
    hs_level_plan_free(&made->account, &made->plan);
}

/* A pass over the points polls, and ends where the caller says so. */
static void
it_can_be_stopped(void)
{
    enum { MANY = 2 * HS_POLL_POINTS + 9 };
    static double x[2 * MANY], radii[2 * MANY];
    const hs_set  p = {.at = {x, 2 * MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x}, .radii = radii},
                 q = {.at = {x, MANY, 1, HS_FLOAT64, sizeof *x, sizeof *x}, .radii = radii};
    const hs_reach   reach = {.rule = HS_RULE_SUM};
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
    CHECK(hs_level_plan_make(account, &options, &made->levels, NULL, bound, HS_AUTO, &made->plan) ==
          HS_OK);
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

/* A point too far for its box: the row is the caller's, of the set that it belongs to. */
static void
failures_name_the_callers_row(void)
{
    const hs_box   box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    harness_random random = {93};
    for (int in_queries = 0; in_queries < 2; in_queries++) {
        for (int has_queries = in_queries; has_queries < 2; has_queries++) {
            const hs_reach reach = {.rule = HS_RULE_GATHER};
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
    enum { MANY = 2 * HS_POLL_SUPPORTS + 9 };
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
            CHECK(hs_level_plan_make(&call.account, &call.options, &levels, NULL, HUGE_VAL, HS_AUTO,
                                     &plan) == HS_OK);
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
    RUN(sums_above_an_exact_one_are_not_it);
    RUN(many_types_are_searched_in_pairs);
    RUN(a_level_of_two_is_not_all);
    RUN(it_can_be_stopped);
    RUN(some_plans_are_never_joined);
    RUN(opening_a_step_of_many_supports_can_be_stopped);
    RUN(failures_name_the_callers_row);
}
