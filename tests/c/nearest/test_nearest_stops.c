/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_nearest_stops.c: long searches for nearest points can be stopped wherever they ask whether
 * to go on, and fail wherever memory ends, with nothing left.
 */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/among.h"

#include "../../../csrc/core/collect/columns.h"
#include "../../../csrc/core/memory/account.h"

void test_nearest_stops(void);

/* Rows of a search that may be asked so often whether it goes on. */
static hs_status
find_until(const brute_scene *scene, const hs_points *queries, int64_t k, int64_t polls,
           hs_counters *counters, hs_pairs **rows)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    options.cutoff = scene->cutoff;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    options.poll = stop_after;
    options.poll_context = &polls;
    options.counters = counters;
    return hs_nearest_find(QUERIED(&points, queries, scene->box), k, &options, rows, NULL);
}

/* Stops at `tries` of its polls, evenly picked, and at the last one. Returns how many there are. */
static int64_t
stop_everywhere(const brute_scene *scene, const hs_points *queries, int64_t k, int tries)
{
    hs_counters   counters;
    hs_pairs     *rows = NULL;
    const int64_t blocks = hs_test_live_blocks();
    CHECK(find_until(scene, queries, k, INT64_MAX, &counters, &rows) == HS_OK);
    hs_pairs_free(rows);
    const int64_t polls = counters.polls;
    for (int t = 0; t <= tries; t++) {
        rows = NULL;
        CHECK(find_until(scene, queries, k, (polls - 1) * t / tries, NULL, &rows) ==
              HS_ERR_INTERRUPTED);
        CHECK(rows == NULL && hs_test_live_blocks() == blocks);
    }
    return polls;
}

/* More points than are sorted into a tree, gathered or ranked between two polls. */
static void
many_points_can_be_stopped(void)
{
    enum { N = 150000, K = 140000 };
    double         *x = array_of(N, sizeof *x);
    harness_random  random = {21};
    hs_pairs       *rows = NULL;
    const double    at = 0.5;
    const hs_points query = {&at, 1, 1, HS_FLOAT64, 8, 8};
    brute_scene     scene = {.ndim = 1, .n = N, .x = x, .cutoff = INFINITY};
    for (int i = 0; i < N; i++)
        x[i] = random_unit(&random);
    CHECK(find_until(&scene, &query, K, INT64_MAX, NULL, &rows) == HS_OK);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    const double  *d = hs_pairs_array(rows, HS_WANT_DISTANCE);
    int64_t        wrong = 0, nearer = 0;
    for (int64_t e = 0; e < K; e++) {
        wrong += d[e] != fabs(x[j[e]] - at) || (e > 0 && d[e] < d[e - 1]);
    }
    for (int i = 0; i < N; i++)
        nearer += fabs(x[i] - at) <= d[K - 1];
    CHECK(wrong == 0 && nearer == K);
    hs_pairs_free(rows);
    CHECK(stop_everywhere(&scene, &query, K, 12) > 12);
    free(x);
}

/* A hundred thousand images of one point are asked for, or lie nearer than what is. */
static void
many_images_can_be_stopped(void)
{
    double x[6] = {0.125, 0.25, 0.375, 0.0, 0.0, 0.0};
    hs_box box = {
        .ndim = 3, .periodic = {true, true, true}, .rows = {{1.0}, {0.0, 1.0}, {0.0, 0.0, 1.0}}};
    brute_scene     scene = {.ndim = 3, .n = 1, .x = x, .box = &box, .cutoff = INFINITY};
    const hs_points query = {x + 3, 1, 3, HS_FLOAT64, 24, 8};
    hs_pairs       *rows = NULL;
    int64_t         wrong = 0;
    CHECK(find_until(&scene, &query, 30000, INT64_MAX, NULL, &rows) == HS_OK);
    const double *d = hs_pairs_array(rows, HS_WANT_DISTANCE);
    int64_t       nearer = 0;
    for (int64_t e = 1; e < 30000; e++)
        wrong += d[e] < d[e - 1];
    for (int a = -24; a <= 24; a++) {
        for (int b = -24; b <= 24; b++) {
            for (int c = -24; c <= 24; c++) {
                const double u = a + x[0], v = b + x[1], w = c + x[2];
                nearer += sqrt(u * u + v * v + w * w) < d[29999];
            }
        }
    }
    CHECK(wrong == 0 && nearer <= 29999 && nearer > 29900);
    hs_pairs_free(rows);
    CHECK(stop_everywhere(&scene, &query, 30000, 8) > 8);
    x[3] = 400.0;
    box.periodic[0] = false;
    CHECK(stop_everywhere(&scene, &query, 3, 3) >= 1);
    x[3] = 6000.0; /* far along the open axis of the box: many images are about as near */
    CHECK(stop_everywhere(&scene, &query, 3, 3) >= 1);
    box.rows[1][0] = 0.5; /* which is not upright any more */
    CHECK(stop_everywhere(&scene, &query, 3, 3) >= 1);
}

/* Rows are written in the order of the tree, to pages all over the result: these are cleared
 * before, by parts, between which there is a poll. */
static void
clearing_the_result_polls(void)
{
    enum { N = 5000, K = 20, PART = 4096 };
    static double  x[3 * N];
    harness_random random = {23};
    brute_scene    scene = {.ndim = 3, .n = N, .x = x, .cutoff = INFINITY};
    hs_counters    large_parts, small_parts;
    hs_pairs      *rows = NULL;
    for (int e = 0; e < 3 * N; e++)
        x[e] = random_unit(&random);
    CHECK(find_until(&scene, NULL, K, INT64_MAX, &large_parts, &rows) == HS_OK);
    hs_pairs_free(rows);
    const size_t before = hs_test_touch_parts(PART);
    CHECK(find_until(&scene, NULL, K, INT64_MAX, &small_parts, &rows) == HS_OK);
    hs_pairs_free(rows);
    /* j and d: eight bytes each. */
    CHECK(small_parts.polls - large_parts.polls >= 2 * (N * K * 8 / PART));
    CHECK(stop_everywhere(&scene, NULL, K, 12) == small_parts.polls);
    CHECK(hs_test_touch_parts(before) == PART);
}

static hs_status
find_forty(void *scene)
{
    hs_pairs       *rows = NULL;
    const hs_status status = find_until(scene, NULL, 40, INT64_MAX, NULL, &rows);
    hs_pairs_free(rows);
    return status;
}

/* Of a search that needs more leaves, runs and images than there is room for at first. */
static void
whichever_allocation_fails_nothing_is_left(void)
{
    static double  x[3 * 400];
    harness_random random = {16};
    hs_box         box = {.ndim = 3,
                          .periodic = {true, true, true},
                          .rows = {{1.0, 0.0, 0.0}, {0.25, 1.0, 0.0}, {0.0, 0.0, 1e4}}};
    brute_scene    scene = {.ndim = 3, .n = 400, .x = x, .box = &box, .cutoff = INFINITY};
    for (int e = 0; e < 3 * 400; e++)
        x[e] = random_unit(&random);
    CHECK(fail_each_allocation(find_forty, &scene, 300) > 30);
}

void
test_nearest_stops(void)
{
    RUN(many_points_can_be_stopped);
    RUN(many_images_can_be_stopped);
    RUN(clearing_the_result_polls);
    RUN(whichever_allocation_fails_nothing_is_left);
}
