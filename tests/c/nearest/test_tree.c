/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_tree.c: the tree of nearest points, for points that samples do not show as they lie, so that
 * nodes are many; and for points a last place apart.
 */
#include "../support/harness.h"
#include "../support/nearest_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

#include "../../../csrc/core/memory/account.h"

void test_tree(void);

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

static void
whichever_allocation_fails_nothing_is_left(const hs_points *points, int64_t k)
{
    bool          ended = false;
    int           nth = 0, n_spared = 0;
    hs_options    options = hs_options_default();
    const int64_t before = hs_test_live_blocks();
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    options.threads = 1;
    while (!ended && nth < 200) {
        hs_pairs *rows = NULL;
        hs_test_fail_allocation(++nth);
        const hs_status status = hs_nearest_find(AMONG(points, NULL), k, &options, &rows, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_ERR_MEMORY || status == HS_OK);
        n_spared += status == HS_OK && !ended; /* the arena, and regions: then without a pool */
        hs_pairs_free(rows);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && nth > 10 && n_spared <= 3);
}

static void
allocations_fail_in_a_part_that_grows(void)
{
    const hs_points points = {lopsided, N, 1, HS_FLOAT64, 8, 8};
    whichever_allocation_fails_nothing_is_left(&points, 2);
}

static void
allocations_fail_in_one_of_several_parts(void)
{
    enum { MANY = 10000 };
    harness_random  random = {505};
    double         *x = array_of(MANY, sizeof *x);
    const hs_points points = {x, MANY, 1, HS_FLOAT64, 8, 8};
    for (int i = 0; i < MANY; i++)
        x[i] = random_unit(&random);
    whichever_allocation_fails_nothing_is_left(&points, 2);
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

static bool
count_polls(void *context, double fraction)
{
    (void)context;
    return fraction >= 0.0;
}

/* Splitting is polled once in HS_POLL_POINTS points of all levels, not at every node. */
static void
splitting_is_polled_now_and_then(void)
{
    enum { MANY = 40000 };
    double         *x = array_of(MANY, sizeof *x);
    harness_random  random = {404};
    brute_scene     scene = {.ndim = 1, .n = MANY, .x = x, .cutoff = INFINITY};
    const double    q = 0.5;
    const hs_points query = {&q, 1, 1, HS_FLOAT64, 8, 8};
    hs_counters     counters;
    hs_pairs       *rows = NULL;
    for (int i = 0; i < MANY; i++)
        x[i] = random_unit(&random);
    const hs_points points = points_of(&scene);
    hs_options      options = options_of(&scene);
    options.want = HS_WANT_J;
    options.threads = 1;
    options.counters = &counters;
    options.poll = count_polls;
    CHECK(hs_nearest_find(QUERIED(&points, &query, NULL), 1, &options, &rows, NULL) == HS_OK);
    /* Of some twelve levels three are split one by one: 120000 points. */
    CHECK(counters.polls >= 1 && counters.polls <= 4);
    hs_pairs_free(rows);
    free(x);
}

void
test_tree(void)
{
    RUN(splitting_is_polled_now_and_then);
    RUN(lopsided_points_need_many_nodes);
    RUN(allocations_fail_in_a_part_that_grows);
    RUN(allocations_fail_in_one_of_several_parts);
    RUN(neighbouring_numbers_are_told_apart);
}
