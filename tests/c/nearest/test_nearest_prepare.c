/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_prepare.c: a search for the nearest begins with a scene that keeps every digit and
 * with trees of points and queries, made anew or borrowed. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/nearest/nearest_kept.h"
#include "../support/nearest_unit.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_nearest_prepare(void);

enum { N = 40 };

static nearest_unit unit;
static double       x[2 * N], q[2 * N];

static hs_points
points_in(const double *data, int64_t n)
{
    return (hs_points){data, n, 2, HS_FLOAT64, 16, 8};
}

static void
fill(uint64_t seed, double side, double *data)
{
    harness_random random = {seed};
    for (int e = 0; e < 2 * N; e++)
        data[e] = side * random_unit(&random);
}

/* What is ordinary is not scaled; small boxes and small largest distances scale by their size. */
static void
scenes_are_scaled_by_what_is_small(void)
{
    const struct {
        double side, period, limit;
        int    exponent;
    } cases[] = {{1.0, 0.0, INFINITY, 0},
                 {0x1p-600, 0.0, INFINITY, 0},
                 {1.0, 4.0, INFINITY, 0},
                 {0x1p-400, 0x1p-499, INFINITY, 0},
                 {0x1p-600, 0x1p-501, INFINITY, -501},
                 {0x1p-795, 0.0, 0x1p-799, 0},
                 {0x1p-800, 0.0, 0x1p-801, -801},
                 {0x1p-800, 0.0, 0.0, 0}};
    for (int trial = 0; trial < 16; trial++) {
        const int    c = trial / 2, is_first = trial % 2; /* the short row of the box */
        const double period = cases[c].period;
        const hs_box box = {
            .ndim = 2,
            .periodic = {true, true},
            .rows = {{is_first ? period : 4.0 * period}, {0.0, is_first ? 4.0 * period : period}}};
        const hs_points points = points_in(x, N);
        fill(5, cases[c].side, x);
        nearest_unit_open(&points, NULL, period > 0.0 ? &box : NULL, 1, HS_WANT_J, cases[c].limit,
                          &unit);
        CHECK(unit.search.scene.scale.exponent == cases[c].exponent);
        CHECK(!unit.search.scene.extreme);
        CHECK(unit.near.limit ==
              (cases[c].limit == INFINITY ? INFINITY : ldexp(cases[c].limit, -cases[c].exponent)));
        CHECK(unit.near.within.inclusive && unit.near.order.inclusive);
        CHECK(unit.near.within.cutoff == (cases[c].limit == INFINITY ? 1.0 : unit.near.limit));
        nearest_unit_close(&unit);
    }
}

/* Leaves of 8 points, or of 16 where as many are wanted as four of them hold. */
static void
leaves_are_larger_where_many_are_wanted(void)
{
    const hs_points points = points_in(x, N);
    fill(6, 1.0, x);
    for (int64_t k = 31; k <= 32; k++) {
        int32_t largest = 0;
        nearest_unit_open(&points, NULL, NULL, k, HS_WANT_J, INFINITY, &unit);
        for (int32_t number = 0; number < unit.near.tree.n_nodes; number++) {
            const hs_tree_node *node = &unit.near.tree.nodes[number];
            const int32_t       n = node->left == 0 ? node->end - node->first : 0;
            largest = n > largest ? n : largest;
        }
        CHECK(k == 31 ? largest <= 8 : largest > 8 && largest <= 16);
        nearest_unit_close(&unit);
    }
}

/* Queries have a tree of their own, and points are then no queries. */
static void
queries_have_a_tree_of_their_own(void)
{
    const hs_points points = points_in(x, N), queries = points_in(q, N / 2);
    fill(7, 1.0, x);
    fill(8, 1.0, q);
    nearest_unit_open(&points, &queries, NULL, 2, HS_WANT_J, INFINITY, &unit);
    CHECK(unit.search.has_queries && unit.near.asking == &unit.near.asking_tree);
    CHECK(unit.near.tree.nodes[0].end == N && unit.near.asking_tree.nodes[0].end == N / 2);
    CHECK(unit.search.query_bins.n == N / 2 && unit.search.bins.n == N);
    nearest_unit_close(&unit);
    nearest_unit_open(&points, NULL, NULL, 2, HS_WANT_J, INFINITY, &unit);
    CHECK(!unit.search.has_queries && unit.near.asking == &unit.near.tree);
    CHECK(unit.near.asking_tree.nodes == NULL && unit.search.is_full);
    nearest_unit_close(&unit);
}

/* A search that prepares by itself, and ends. */
static hs_status
prepare(const hs_sets *sets, const hs_box *box, double limit, const char *kernel,
        hs_failure *failure)
{
    hs_options options = hs_options_default();
    options.cutoff = limit;
    options.want = HS_WANT_J;
    options.threads = 1;
    options.kernel = kernel;
    *failure = HS_NO_FAILURE;
    memset(&unit, 0, sizeof unit);
    hs_call_begin(&options, &unit.call);
    hs_search_begin(&unit.call, &unit.search);
    unit.near = (hs_nearest){.search = &unit.search, .k = 1, .of_spot = 2};
    return hs_nearest_prepare(&unit.near, sets, box, limit, failure);
}

static void
release(void)
{
    hs_nearest_release(&unit.near);
    hs_search_close(&unit.search);
    hs_call_dismiss(&unit.call);
    CHECK(unit.call.account.held == 0);
    hs_account_close(&unit.call.account);
}

static void
failures_are_told(void)
{
    const hs_points points = points_in(x, N), queries = points_in(q, N);
    hs_sets         sets = {.points = &points, .queries = &queries, .is_full = true};
    const hs_box    flat = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {2.0}}};
    hs_failure      failure;
    sets.is_plain = sets.is_wide = true;
    fill(9, 1.0, x);
    fill(10, 1.0, q);
    CHECK(prepare(&sets, NULL, INFINITY, "none of that name", &failure) == HS_ERR_KERNEL);
    release();
    CHECK(prepare(&sets, &flat, INFINITY, NULL, &failure) == HS_ERR_BOX_DEPENDENT);
    release();
    q[7] = NAN;
    CHECK(prepare(&sets, NULL, INFINITY, NULL, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.in_queries && failure.row == 3 && failure.column == 1);
    release();
    x[4] = INFINITY;
    CHECK(prepare(&sets, NULL, INFINITY, NULL, &failure) == HS_ERR_NOT_FINITE);
    CHECK(!failure.in_queries && failure.row == 2 && failure.column == 0);
    release();
}

static hs_status
prepare_and_release(void *context)
{
    const hs_points points = points_in(x, N), queries = points_in(q, N);
    const hs_sets   sets = {.points = &points,
                            .queries = &queries,
                            .is_full = true,
                            .is_plain = true,
                            .is_wide = true,
                            .trees = context};
    const hs_box    box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.5, 1.0}}};
    hs_failure      failure;
    const hs_status status = prepare(&sets, &box, INFINITY, NULL, &failure);
    release();
    return status;
}

static hs_status
prepare_with_kept(void *context)
{
    hs_nearest_kept *kept = hs_nearest_kept_new();
    (void)context;
    const hs_status status = kept != NULL ? prepare_and_release(kept) : HS_ERR_MEMORY;
    hs_nearest_kept_free(kept);
    return status;
}

static void
any_allocation_may_be_refused(void)
{
    fill(11, 1.0, x);
    fill(12, 1.0, q);
    CHECK(fail_each_allocation(prepare_and_release, NULL, 200) > 6);
    CHECK(fail_each_allocation(prepare_with_kept, NULL, 200) > 8);
}

/* What is borrowed is what would be made: but for the points of a leaf, as for any k. */
static void
what_is_borrowed_is_what_would_be_made(void)
{
    const hs_box     box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_points  points = points_in(x, N), queries = points_in(q, N);
    hs_sets          sets = {.points = &points, .is_full = true, .is_plain = true, .is_wide = true};
    hs_nearest_kept *kept = hs_nearest_kept_new();
    hs_failure       failure;
    fill(13, 1.0, x);
    fill(14, 1.0, q);
    CHECK(prepare(&sets, &box, 0.5, NULL, &failure) == HS_OK);
    const hs_nearest anew = unit.near;
    release();
    CHECK(anew.has_layer);
    for (int asks = 0; asks < 2; asks++) {
        sets.trees = kept;
        sets.queries = asks ? &queries : NULL;
        CHECK(prepare(&sets, &box, 0.5, NULL, &failure) == HS_OK);
        CHECK(unit.search.is_borrowed && unit.near.limit == anew.limit);
        CHECK(memcmp(unit.near.drift[0], anew.drift[0], sizeof(double)) == 0);
        CHECK(memcmp(unit.near.drift[1], anew.drift[1], sizeof(double)) == 0);
        CHECK(unit.near.smallest_period == anew.smallest_period && unit.near.has_layer);
        CHECK(unit.near.layer_lower[1] == anew.layer_lower[1]);
        CHECK(unit.near.layer_upper[1] == anew.layer_upper[1]);
        CHECK(unit.near.within.cutoff == 0.5 && unit.near.order.n_rows == anew.order.n_rows);
        CHECK(unit.near.tree.nodes[0].end == N && unit.search.bins.n == N);
        CHECK(unit.near.asking == (asks ? &unit.near.asking_tree : &unit.near.tree));
        release();
    }
    /* Too small a largest distance, and queries too far away, have a scene of their own. */
    sets.queries = NULL;
    CHECK(prepare(&sets, &box, 0x1p-900, NULL, &failure) == HS_OK && !unit.search.is_borrowed);
    release();
    CHECK(prepare(&sets, &box, 0x1p-50, NULL, &failure) == HS_OK && !unit.search.is_borrowed);
    release();
    CHECK(prepare(&sets, &box, 0x1p-30, NULL, &failure) == HS_OK && unit.search.is_borrowed);
    release();
    sets.queries = &queries;
    q[1] = 0x1p60;
    CHECK(prepare(&sets, &box, 0.5, NULL, &failure) == HS_OK && !unit.search.is_borrowed);
    CHECK(!failure.in_queries);
    release();
    q[1] = NAN;
    CHECK(prepare(&sets, &box, 0.5, NULL, &failure) == HS_ERR_NOT_FINITE && failure.in_queries);
    release();
    hs_nearest_kept_free(kept);
}

void
test_nearest_prepare(void)
{
    RUN(scenes_are_scaled_by_what_is_small);
    RUN(leaves_are_larger_where_many_are_wanted);
    RUN(queries_have_a_tree_of_their_own);
    RUN(failures_are_told);
    RUN(any_allocation_may_be_refused);
    RUN(what_is_borrowed_is_what_would_be_made);
}
