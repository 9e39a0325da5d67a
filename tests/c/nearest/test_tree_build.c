/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_tree_build.c: the tree of nearest points, for points that samples do not show as they lie, so that
 * nodes are many; and for points a last place apart.
 */
#include "../support/harness.h"
#include "../support/nearest_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"
#include "../support/poll_checks.h"

#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/nearest/tree_build.h"
#include "../../../csrc/core/search/search.h"

void test_tree_build(void);

/*
 * Points that samples see least of: many are 0, the others each twice as far as the last, in an
 * order in which samples meet few of these, so that nearly each cut leaves one point alone.
 */
enum { N = 28 };
static const double lopsided[N] = {
    4096.0, 0.0,     0.0,    2.0,   0.0, 8192.0, 0.0,   8.0, 16384.0, 512.0,  0.0,  0.0, 16.0, 64.0,
    0.0,    32768.0, 1024.0, 256.0, 0.0, 0.0,    128.0, 0.0, 0.0,     2048.0, 32.0, 1.0, 0.0,  4.0,
};

static void
lopsided_points_need_many_nodes(void)
{
    double      x[2 * N] = {0.0};
    brute_scene scene = {.ndim = 1, .n = N, .x = lopsided, .cutoff = 40000.0};
    for (int64_t k = 1; k <= N; k += 3)
        CHECK(compare_rows(&scene, -1, k, 1) > 0);
    for (int i = 0; i < N; i++)
        x[2 * i + 1] = lopsided[i];
    scene.ndim = 2;
    scene.x = x;
    CHECK(compare_rows(&scene, -1, 3, 1) > 0);
}

/* One search, which frees its rows. */
typedef struct tree_search {
    hs_points points;
    int       threads;
} tree_search;

static hs_status
search_once(void *context)
{
    const tree_search *search = context;
    hs_options         options = hs_options_default();
    hs_pairs          *rows = NULL;
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    options.threads = search->threads;
    const hs_status status =
        hs_nearest_find(AMONG(&search->points, NULL), 2, &options, &rows, NULL);
    hs_pairs_free(rows);
    return status;
}

static void
allocations_fail_in_a_subtree_that_grows(void)
{
    tree_search search = {{lopsided, N, 1, HS_FLOAT64, 8, 8}, 1};
    CHECK(fail_each_allocation(search_once, &search, 200) > 10);
}

static void
allocations_fail_in_one_of_many_subtrees(void)
{
    enum { MANY = 40000 };
    harness_random random = {505};
    double        *x = array_of(MANY, sizeof *x);
    for (int i = 0; i < MANY; i++)
        x[i] = random_unit(&random);
    for (int threads = 1; threads <= 2; threads++) {
        tree_search search = {{x, MANY, 1, HS_FLOAT64, 8, 8}, threads};
        CHECK(fail_each_allocation(search_once, &search, 200) > 20);
    }
    free(x);
}

/* Two numbers that nothing lies between, a hundred times each: no middle is below one of them. */
static void
neighbouring_numbers_are_told_apart(void)
{
    double x[200];
    for (int trial = 0; trial < 4; trial++) {
        const double low = trial % 2 ? 1.0 : -1.0, high = nextafter(low, 2.0);
        brute_scene  scene = {.ndim = 1, .n = 200, .x = x, .cutoff = 0x1p-40};
        for (int i = 0; i < 200; i++) /* samples see both, or one of them alone */
            x[i] = (trial < 2 ? i == 3 : i % 2) ? high : low;
        CHECK(compare_rows(&scene, -1, 150, 1) > 0);
    }
}

/* The steps of a search that come before the tree, then the tree alone. */
static hs_status
build_alone(const hs_points *points, refusal *polls)
{
    const hs_sets sets = {.points = points, .is_full = true, .is_plain = true, .is_wide = true};
    hs_options    options = hs_options_default();
    hs_failure    failure;
    hs_call       call;
    hs_search     search;
    hs_tree       tree;
    options.cutoff = 1.0;
    options.threads = 1;
    hs_call_begin(&options, &call);
    hs_search_begin(&call, &search);
    CHECK(hs_scene_init_sets(&call.account, NULL, &sets, NULL, &options, &search.scene, NULL,
                             &failure) == HS_OK);
    options.poll = refuse_once;
    options.poll_context = polls;
    const hs_status status =
        hs_tree_build(&call.account, NULL, &options, &search.scene, 8, &search.bins, &tree);
    hs_tree_free(&call.account, &tree);
    hs_search_close(&search);
    hs_call_dismiss(&call);
    hs_account_close(&call.account);
    return status;
}

/* Of 100000 points four levels are split one by one, 400000 points with a poll after each 131072 or
 * a node more, and then 16 subtrees or so, four at a time. Sorting them takes one poll, or none. */
static void
building_is_polled_now_and_then_and_stops(void)
{
    enum { MANY = 100000 };
    harness_random  random = {404};
    double         *x = array_of(MANY, sizeof *x);
    const hs_points points = {x, MANY, 1, HS_FLOAT64, 8, 8};
    const int64_t   before = hs_test_live_blocks();
    for (int i = 0; i < MANY; i++)
        x[i] = random_unit(&random);
    refusal polls = {0};
    CHECK(build_alone(&points, &polls) == HS_OK);
    const int64_t n = polls.n;
    CHECK(n >= 5 && n <= 9);
    for (int64_t nth = 1; nth <= n; nth++) {
        polls = (refusal){.nth = nth};
        CHECK(build_alone(&points, &polls) == HS_ERR_INTERRUPTED && polls.n == nth);
        CHECK(hs_test_live_blocks() == before);
    }
    free(x);
}

void
test_tree_build(void)
{
    RUN(building_is_polled_now_and_then_and_stops);
    RUN(lopsided_points_need_many_nodes);
    RUN(allocations_fail_in_a_subtree_that_grows);
    RUN(allocations_fail_in_one_of_many_subtrees);
    RUN(neighbouring_numbers_are_told_apart);
}
