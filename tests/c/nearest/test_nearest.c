/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest.c: searches of nearest points: what they prepare and keep, their radii, and where
 * they stop. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "../../../csrc/core/base/os_thread.h"
#include "../../../csrc/core/collect/columns.h"
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/core/nearest/nearest.h"
#include "../../../csrc/core/nearest/rank.h"
#include "../support/among.h"
#include "../support/answers.h"
#include "../support/harness.h"
#include "../support/nearest_unit.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

#include <math.h>

void test_nearest(void);

/*
 * ---- nearest kept ----
 *
 * One of those that come at once builds the tree that is kept, the others do with one of their own.
 */

static nearest_unit unit;

/* The four numbers 0, 0.5, 1 and 1.2, or so many others. */
static const double line[4] = {0.0, 0.5, 1.0, 1.2};

static hs_points
points_on_line(const double *x, int64_t n)
{
    return (hs_points){x, n, 1, HS_FLOAT64, 8, 8};
}

/* Prepares a search that may use what is kept; whether it does. */
static bool
borrows(hs_nearest_kept *kept, double limit)
{
    const hs_points points = points_on_line(line, 4);
    const hs_sets   sets = {
          .points = &points, .is_full = true, .is_plain = true, .is_wide = true, .trees = kept};
    hs_options options = hs_options_default();
    hs_failure failure;
    options.cutoff = limit;
    options.want = HS_WANT_J;
    hs_call_begin(&options, &unit.call);
    hs_search_begin(&unit.call, &unit.search);
    unit.call.team = hs_team_create(2);
    unit.near = (hs_nearest){.search = &unit.search, .k = 1, .omits_self = true};
    CHECK(hs_nearest_prepare(&unit.near, &sets, NULL, limit, &failure) == HS_OK);
    CHECK(unit.near.tree.n_nodes == 1 && unit.near.limit > 0.0);
    const bool borrowed = unit.search.is_borrowed;
    hs_nearest_release(&unit.near);
    hs_search_close(&unit.search);
    hs_call_dismiss(&unit.call);
    hs_account_close(&unit.call.account);
    return borrowed;
}

static void
whoever_comes_while_it_is_built_does_without(void)
{
    const int64_t    blocks = hs_test_live_blocks();
    hs_nearest_kept *kept = hs_nearest_kept_new();
    CHECK(kept->state == HS_NEAREST_NOTHING);
    kept->state = HS_NEAREST_BUILDS + hs_atomic_load(&hs_n_forks);
    CHECK(!borrows(kept, INFINITY));
    hs_test_fork(); /* a thread of the parent built it */
    CHECK(borrows(kept, INFINITY));
    CHECK(borrows(kept, 1.0));
    CHECK(!borrows(kept, 0x1p-900)); /* has a scale of its own */
    CHECK(kept->state == HS_NEAREST_BUILT && kept->near.tree.n_nodes == 1);
    CHECK(kept->call.team == NULL); /* it was the call's that built it */
    hs_nearest_kept_free(kept);
    hs_nearest_kept_free(NULL);
    CHECK(hs_test_live_blocks() == blocks);
}

/* A ranker for point number i of the unit. */
static void
open_ranker(int32_t i, hs_nearest_ranker *ranker)
{
    int32_t si = 0;
    while (hs_search_asking(&unit.search)->order[si] != i)
        si++;
    *ranker = (hs_nearest_ranker){.near = &unit.near, .options = &unit.call.options};
    hs_nearest_ranker_set(ranker, si);
}

/* Points that a radius beyond the largest distance has let in. */
static void
rows_end_at_the_largest_distance(void)
{
    const hs_points          points = points_on_line(line, 4);
    static hs_nearest_leaves leaves;
    static hs_nearest_block  block;
    static hs_nearest_writer writer;
    static const double      limits[] = {0.25, 0.5, 0.75, 1.0, 1.125, 1.25};
    static const int         within[] = {0, 1, 1, 2, 2, 3};
    for (int trial = 0; trial < 12; trial++) {
        const int         l = trial / 2, walks = trial % 2;
        hs_nearest_ranker ranker;
        nearest_unit_open(&points, NULL, NULL, 3, HS_WANT_J | HS_WANT_DISTANCE, limits[l], &unit);
        hs_nearest_group group = nearest_unit_group(&unit, 1.5);
        int32_t          hits[4] = {0, 1, 2, 3};
        int64_t          count;
        CHECK(hs_output_reserve(&unit.rows, 12, 0.0) == HS_OK);
        unit.rows.n_pairs = 12;
        CHECK(nearest_unit_fill(&unit, &group, 1e9, &leaves, &block) == HS_OK);
        open_ranker(0, &ranker);
        if (walks) {
            CHECK(hs_nearest_walk(&ranker, &count) == HS_OK && count == within[l]);
        } else {
            CHECK(hs_nearest_rank(&ranker, &block, hits, NULL, 4, false, &count) == HS_OK);
            CHECK(count == 3);
        }
        memset(&writer, 0, sizeof writer);
        hs_nearest_writer_init(&unit.near, &writer);
        CHECK(hs_nearest_write(&writer, &ranker, count) == HS_OK);
        hs_nearest_flush(&writer);
        const int64_t *j = hs_output_column(&unit.rows, HS_WANT_J);
        const double  *d = hs_output_column(&unit.rows, HS_WANT_DISTANCE);
        for (int e = 0; e < 3; e++) {
            CHECK(j[e] == (e < within[l] ? e + 1 : -1));
            CHECK(d[e] == (e < within[l] ? line[e + 1] : INFINITY));
        }
        hs_nearest_ranker_free(&ranker);
        nearest_unit_clear(&unit, &leaves, &block);
        nearest_unit_close(&unit);
    }
}

/* Squares of what is far from as large as all points would overflow or vanish: the unit changes, up
 * and down to the last that there is. */
static void
check_two_points(const double *x, int n)
{
    const hs_points points = points_on_line(x, n);
    for (int32_t i = 0; i < 2; i++) {
        hs_nearest_ranker ranker;
        int64_t           count;
        nearest_unit_open(&points, NULL, NULL, 1, HS_WANT_J, INFINITY, &unit);
        open_ranker(i, &ranker);
        CHECK(hs_nearest_walk(&ranker, &count) == HS_OK && count == 1);
        CHECK(unit.search.bins.order[ranker.keys[0].number] == 1 - i);
        CHECK(ranker.keys[0].square >= 0x1p-620 && ranker.keys[0].square <= 0x1p620);
        hs_nearest_ranker_free(&ranker);
        nearest_unit_close(&unit);
    }
}

static void
distances_may_be_of_any_size(void)
{
    check_two_points((const double[2]){-0x1.fp900, 0x1.fp900}, 2);
    check_two_points((const double[2]){0.0, 0x1.fp-900}, 2);
    check_two_points((const double[3]){0.0, 0x1p-200, 0x1p200}, 3);
    check_two_points((const double[3]){0.0, 0x1p-500, 0x1p480}, 3);
    check_two_points((const double[3]){-0x1p-500, 0x1.fp-470, 1.0}, 3);
    check_two_points((const double[3]){0x1p500, 0x1.fp470, 0x1p900}, 3);
}

/*
 * ---- nearest search ----
 *
 * Rows of nearest points are right where groups, ranges of them, images and ties are at their
 * limits, and refused beyond these.
 */

/* Points that one box vector apart are the same in X, and are not as given. */
static void
points_that_wrapping_makes_equal(void)
{
    static double x[2 * 60];
    hs_box        box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.5, 1.0}}};
    brute_scene   scene = {.ndim = 2, .n = 60, .x = x, .box = &box, .cutoff = 1.0};
    for (int i = 0; i < 60; i++) {
        x[2 * i] = i % 20 + 0.25;
        x[2 * i + 1] = 0.25 * (i / 20);
    }
    for (int salt = 0; salt < (IS_SLOW ? 4 : 14); salt++)
        CHECK(nearest_are_right(&scene, (uint64_t)salt));
}

/* Scales in one search that are far apart: clusters that are nothing beside their distances. */
static void
clusters_of_all_sizes(void)
{
    enum { N = 120 };
    static double  x[2 * N];
    harness_random random = {12};
    for (int trial = 0; trial < 30; trial += IS_SLOW ? 5 : 1) {
        hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0, 0.0}, {3.0, 7.0}}};
        brute_scene scene = {.ndim = 2, .n = N, .x = x, .cutoff = 0.5};
        scene.box = trial % 3 ? &box : NULL;
        for (int i = 0; i < N; i++) {
            const int spread = -random_below(&random, trial % 2 ? 60 : 20);
            for (int k = 0; k < 2; k++)
                x[2 * i + k] = ldexp(random_unit(&random) - 0.5, spread) + i % 3;
        }
        CHECK(nearest_are_right(&scene, (uint64_t)trial));
    }
}

/* Where all that are wanted are within the cutoff, rows are the same without one. */
static void
check_unlimited(const brute_scene *scene, int64_t k)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *limited = NULL, *unlimited = NULL;
    options.want = HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT;
    CHECK(hs_nearest_find(AMONG(&points, scene->box), k, &options, &limited, NULL) == HS_OK);
    options.cutoff = INFINITY;
    CHECK(hs_nearest_find(AMONG(&points, scene->box), k, &options, &unlimited, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(limited, HS_WANT_J);
    const int64_t *of = hs_pairs_array(unlimited, HS_WANT_J);
    const double  *d = hs_pairs_array(limited, HS_WANT_DISTANCE);
    const double  *without = hs_pairs_array(unlimited, HS_WANT_DISTANCE);
    int64_t        wrong = 0;
    for (int64_t e = 0; e < hs_pairs_length(limited); e++)
        wrong += j[e] >= 0 ? j[e] != of[e] || d[e] != without[e]
                           : of[e] >= 0 && without[e] <= scene->cutoff;
    CHECK(wrong == 0);
    hs_pairs_free(limited);
    hs_pairs_free(unlimited);
}

/* A hundred thousand points of the lattice of whole numbers, whose nearest are known. */
static void
many_points_on_a_lattice(void)
{
    enum { SIDE = 45, N = SIDE * SIDE * SIDE, K = 6 };
    double    *x = array_of(3 * N, sizeof *x);
    int64_t    wrong = 0;
    hs_options options = hs_options_default();
    hs_pairs  *rows = NULL;
    for (int i = 0; i < N; i++) {
        x[3 * i] = i % SIDE;
        x[3 * i + 1] = i / SIDE % SIDE;
        x[3 * i + 2] = i / SIDE / SIDE;
    }
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    options.cutoff = INFINITY;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    options.threads = 2;
    CHECK(hs_nearest_find(AMONG(&points, NULL), K, &options, &rows, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    const double  *d = hs_pairs_array(rows, HS_WANT_DISTANCE);
    for (int64_t i = 0; i < N; i++) {
        const int steps[] = {-SIDE * SIDE, -SIDE, -1, 1, SIDE, SIDE * SIDE};
        int       n = 0;
        for (int s = 0; s < 6; s++) {
            const int    k = s < 3 ? 2 - s : s - 3;
            const double to = x[3 * i + k] + (s < 3 ? -1.0 : 1.0);
            if (to >= 0.0 && to < SIDE) {
                wrong += j[K * i + n] != i + steps[s] || d[K * i + n] != 1.0;
                n++;
            }
        }
        for (; n < K; n++)
            wrong += d[K * i + n] != sqrt(2.0) ||
                     (d[K * i + n - 1] > 1.0 && j[K * i + n] <= j[K * i + n - 1]);
    }
    CHECK(wrong == 0);
    hs_pairs_free(rows);
    free(x);
}

/* Many dimensions, where each group needs nearly all leaves; and one leaf alone. */
static void
many_leaves_and_few(void)
{
    enum { N = 24000, D = 6 };
    double        *x = array_of(D * N, sizeof *x);
    harness_random random = {14};
    int64_t        wrong = 0;
    hs_options     options = hs_options_default();
    hs_pairs      *rows = NULL;
    for (int e = 0; e < D * N; e++)
        x[e] = random_unit(&random);
    for (int few = 0; few < 2; few++) {
        const hs_points points = {x, few ? 5 : N, D, HS_FLOAT64, 8 * D, 8};
        const hs_points queries = {x, few ? 3000 : 700, D, HS_FLOAT64, 8 * D, 8};
        options.cutoff = INFINITY;
        options.want = HS_WANT_J | HS_WANT_DISTANCE;
        CHECK(hs_nearest_find(QUERIED(&points, &queries, NULL), 2, &options, &rows, NULL) == HS_OK);
        const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
        for (int64_t i = 0; i < queries.n; i += few ? 37 : 23) {
            double  least = INFINITY; /* of all but the point itself */
            int64_t nearest = -1;
            for (int64_t q = 0; q < points.n; q++) {
                double square = 0.0;
                for (int k = 0; k < D; k++)
                    square += (x[D * q + k] - x[D * i + k]) * (x[D * q + k] - x[D * i + k]);
                if (q != i && square < least) {
                    least = square;
                    nearest = q;
                }
            }
            wrong += i < points.n ? j[2 * i] != i || j[2 * i + 1] != nearest : j[2 * i] != nearest;
        }
        hs_pairs_free(rows);
    }
    CHECK(wrong == 0);
    free(x);
}

/* From far away nearly all points are within the radius: too many to be put in order. */
static void
crowds_are_far_away(void)
{
    enum { N = 700, Q = 200 };
    static const double far[4] = {1e4, 1e3, 100.0, 10.0}, size[4] = {1.0, 0.25, 0.01, 0.01};
    double             *x = array_of(N, sizeof *x), *q = array_of(Q, sizeof *q);
    harness_random      random = {16};
    hs_options          options = hs_options_default();
    const hs_points     points = points_on_line(x, N), queries = points_on_line(q, Q);
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    for (int kind = 0; kind < 4; kind++) {
        int32_t   first = 0;
        hs_pairs *rows = NULL;
        for (int i = 0; i < N; i++) {
            x[i] = size[kind] * random_unit(&random);
            first = x[i] > x[first] ? i : first;
        }
        for (int i = 0; i < Q; i++)
            q[i] = far[kind] + size[kind] * random_unit(&random);
        CHECK(hs_nearest_find(QUERIED(&points, &queries, NULL), 1, &options, &rows, NULL) == HS_OK);
        const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
        for (int i = 0; i < Q; i++)
            CHECK(j[i] == first);
        hs_pairs_free(rows);
    }
    free(x);
    free(q);
}

/* Boxes so long that a ball as large as the density says holds thousands of images of few
 * points. */
static void
long_boxes_have_many_images(void)
{
    static double  x[3 * 120];
    harness_random random = {15};
    for (int e = 0; e < 3 * 120; e++)
        x[e] = random_unit(&random);
    for (int trial = 0; trial < 12; trial += IS_SLOW ? 5 : 1) { /* 5: all kinds */
        hs_box      box = {.ndim = 3, .periodic = {true, true, true}};
        brute_scene scene = {.ndim = 3, .n = trial % 2 ? 2 : 120, .x = x, .box = &box};
        scene.cutoff = trial % 2 ? 3.0 : 0.75;
        box.rows[0][0] = box.rows[1][1] = 1.0;
        box.rows[2][2] = trial % 4 < 2 ? 1e6 : 1e15;
        box.rows[1][0] = trial % 3 ? 0.25 : 0.0;
        CHECK(nearest_are_right(&scene, (uint64_t)trial));
        check_unlimited(&scene, 10);
    }
}

/*
 * ---- nearest stops ----
 *
 * Long searches for nearest points can be stopped wherever they ask whether to go on, and fail
 * wherever memory ends, with nothing left.
 */

static const hs_selection *selected_until; /* or NULL */

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
    const hs_among among = {.points = SET(&points),
                            .queries = SET(queries),
                            .box = scene->box,
                            .selection = selected_until};
    return hs_nearest_find(&among, k, &options, rows, NULL);
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
    selected_until = &(hs_selection){.min_distance = 1e-9};
    CHECK(stop_everywhere(&scene, &query, K, 6) > 6);
    selected_until = NULL;
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

/*
 * ---- nearest radius ----
 *
 * A first radius holds about as many points as are wanted; where the density does not say so, what
 * was found before does: few points are searched one by one.
 */

enum { POINTS = 9000 };

/* Calls that take no more candidates for each point than `most`, however their points lie. */
static const struct even_call {
    enum { CUBE, PLANE, SLANTED, SPOT, CLUMPS, LONG_BOX, FAR_ASKING, FAR_POINT, TINY, HUGE } kind;
    int64_t k, most;
    int     exclude; /* a pair */
    double  apart;   /* the least distance */
} even_calls[] = {
    {CUBE, 8, 500, 0, 0.0},       {PLANE, 8, 500, 0, 0.0},     {SLANTED, 8, 500, 0, 0.0},
    {SPOT, 2, 20, 1, 0.0},        {SPOT, 64, 80, 1, 0.0},      {SPOT, 2, 0, 0, 0.5},
    {CLUMPS, 2, 50, 0, 0.5},      {CUBE, 2, 1500, 0, 0.5},     {LONG_BOX, 64, 2000, 0, 0.0},
    {FAR_ASKING, 8, 300, 0, 0.0}, {FAR_POINT, 8, 200, 0, 0.0}, {TINY, 8, 500, 0, 0.0},
    {HUGE, 8, 500, 0, 0.0},
};

/* A coordinate in such a scene, from a number between 0 and 1 and the coordinate before. */
static double
even_coordinate(int kind, int axis, double number, double before)
{
    switch (kind) {
    case PLANE: return axis == 0 ? 2.0 : number;
    case SLANTED: return axis > 0 ? before : number;
    case SPOT: return 0.25;
    case CLUMPS: return 1e-3 * number;
    case LONG_BOX: return axis == 0 ? 1e6 * number : number;
    case TINY: return ldexp(number, -1000);
    case HUGE: return ldexp(number, 1000);
    default: return number;
    }
}

static void
no_scene_takes_much_more_than_others(void)
{
    static double  x[3 * POINTS], q[3 * POINTS];
    harness_random random = {342};
    const int64_t  pair[2] = {0, 1};
    const hs_box   box = {
          .ndim = 3, .periodic = {true, true, true}, .rows = {{1e6}, {0, 1.0}, {0, 0, 1.0}}};
    for (size_t c = 0; c < sizeof even_calls / sizeof *even_calls; c++) {
        const struct even_call *call = &even_calls[c];
        const hs_set            points = {.at = {x, POINTS, 3, HS_FLOAT64, 24, 8}};
        const hs_set            asking = {.at = {q, POINTS, 3, HS_FLOAT64, 24, 8}};
        const bool              asks = call->kind == FAR_ASKING || call->kind == FAR_POINT;
        const hs_selection      selection = {
                 .n_excluded = call->exclude, .excluded = pair, .min_distance = call->apart};
        const hs_among among = {.points = &points,
                                .queries = asks ? &asking : NULL,
                                .box = call->kind == LONG_BOX ? &box : NULL,
                                .selection = call->exclude || call->apart > 0.0 ? &selection
                                                                                : NULL};
        hs_options     options = hs_options_default();
        hs_counters    counters;
        hs_pairs      *rows = NULL;
        for (int e = 0; e < 3 * POINTS; e++) {
            x[e] = even_coordinate(call->kind, e % 3, random_unit(&random), e > 0 ? x[e - 1] : 0.0);
            x[e] += call->kind == CLUMPS && e / 3 % 2 != 0 ? 1.0 : 0.0;
            q[e] = (call->kind == FAR_POINT ? 1e6 : 1e4) * (1.0 + random_unit(&random));
        }
        x[0] = call->kind == FAR_POINT ? 3e6 : x[0];
        options.cutoff = INFINITY;
        options.want = HS_WANT_J | HS_WANT_DISTANCE;
        options.counters = &counters;
        CHECK(hs_nearest_find(&among, call->k, &options, &rows, NULL) == HS_OK);
        CHECK(counters.candidates <= call->most * POINTS);
        CHECK(call->kind > SLANTED || call->apart > 0.0 || counters.groups < POINTS / 6);
        CHECK(counters.by_integers == 0);
        hs_pairs_free(rows);
    }
}

/* Queries that are points find themselves, even in the midst of what is too near. */
static void
no_point_is_too_near_to_itself(void)
{
    enum { SPOT_POINTS = 40 };
    static double  x[SPOT_POINTS + 1];
    static int64_t numbers[SPOT_POINTS + 1];
    const hs_set   points = {.at = points_on_line(x, SPOT_POINTS + 1)};
    hs_selection   selection = {.query_numbers = numbers, .min_distance = 0.5};
    const hs_among among = {.points = &points, .queries = &points, .selection = &selection};
    hs_options     options = hs_options_default();
    hs_pairs      *rows = NULL;
    for (int64_t i = 0; i <= SPOT_POINTS; i++)
        numbers[i] = i;
    x[SPOT_POINTS] = 1.0;
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    CHECK(hs_nearest_find(&among, 2, &options, &rows, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    for (int64_t i = 0; i < SPOT_POINTS; i++)
        CHECK(j[2 * i] == i && j[2 * i + 1] == SPOT_POINTS);
    hs_pairs_free(rows);
    selection.query_numbers = NULL; /* queries that are no points are, even in their place */
    CHECK(hs_nearest_find(&among, 2, &options, &rows, NULL) == HS_OK);
    j = hs_pairs_array(rows, HS_WANT_J);
    for (int64_t i = 0; i < SPOT_POINTS; i++)
        CHECK(j[2 * i] == SPOT_POINTS && j[2 * i + 1] == -1);
    CHECK(j[2 * SPOT_POINTS] == 0 && j[2 * SPOT_POINTS + 1] == 1);
    hs_pairs_free(rows);
}

/* All but so many images of a point that these cannot be counted are too near. */
static void
a_least_distance_may_be_too_large(void)
{
    const double       x[2] = {0.25, 0.5};
    const hs_box       box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    const hs_set       points = {.at = points_in_rows(x, 1, 2)};
    const hs_selection selection = {.min_distance = 1e12};
    const hs_among     among = {.points = &points, .box = &box, .selection = &selection};
    hs_options         options = hs_options_default();
    hs_pairs          *rows = NULL;
    hs_failure         failure;
    options.cutoff = INFINITY;
    CHECK(hs_nearest_find(&among, 1, &options, &rows, &failure) == HS_ERR_MEMORY);
    CHECK(rows == NULL && failure.row == 0 && !failure.in_queries);
    CHECK(failure.expected_bytes == INFINITY);
}

/* ---- the search for a radius that surely suffices ends when it is told to ---- */

enum { N_BOUND = 6000, QUERIES = 400, K_BOUND = 10 };

/* Points on a sphere, and queries about its centre: no density says how far the nearest are, and to
 * find out takes a walk over nearly all of them for each. */
static hs_status
find_hollow(refusal *once, hs_pairs **rows)
{
    static double   x[3 * N_BOUND], q[3 * QUERIES];
    harness_random  random = {61};
    const hs_points points = {x, N_BOUND, 3, HS_FLOAT64, 24, 8};
    const hs_points queries = {q, QUERIES, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    for (int i = 0; i < N_BOUND; i++) {
        double square = 0.0;
        for (int k = 0; k < 3; k++) {
            x[3 * i + k] = random_unit(&random) - 0.5;
            square += x[3 * i + k] * x[3 * i + k];
        }
        for (int k = 0; k < 3; k++)
            x[3 * i + k] /= sqrt(square);
    }
    for (int e = 0; e < 3 * QUERIES; e++)
        q[e] = 0.01 * random_unit(&random);
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    options.poll = refuse_once;
    options.poll_context = once;
    return hs_nearest_find(QUERIED(&points, &queries, NULL), K_BOUND, &options, rows, NULL);
}

static void
one_refusal_ends_the_search(void)
{
    refusal   once = {.nth = 0};
    hs_pairs *rows = NULL;
    CHECK(find_hollow(&once, &rows) == HS_OK);
    CHECK(hs_pairs_length(rows) == QUERIES * K_BOUND);
    hs_pairs_free(rows);
    const int64_t polls = once.n;
    CHECK(polls > 2);
    for (int64_t nth = 1; nth <= polls; nth += IS_SLOW ? 1 + polls / 8 : 1) {
        once = (refusal){.nth = nth};
        CHECK(find_hollow(&once, &rows) == HS_ERR_INTERRUPTED);
        CHECK(rows == NULL && once.n == nth); /* there is no further question */
    }
}

/* One point and one query so many boxes apart: S, or the status that says that it is too large. */
static hs_status
find_far(double away, unsigned want, double *distance, int32_t *shift, hs_failure *failure)
{
    const double    x[2] = {0.25, 0.5}, far[2] = {away, 0.5};
    const hs_box    box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.5, 1.0}}};
    const hs_points point = {x, 1, 2, HS_FLOAT64, 16, 8}, query = {far, 1, 2, HS_FLOAT64, 16, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    options.cutoff = INFINITY;
    options.want = want | HS_WANT_DISTANCE;
    const hs_status status =
        hs_nearest_find(QUERIED(&point, &query, &box), 1, &options, &rows, failure);
    if (status == HS_OK) {
        *distance = ((const double *)hs_pairs_array(rows, HS_WANT_DISTANCE))[0];
        *shift = want != 0 ? ((const int32_t *)hs_pairs_array(rows, HS_WANT_SHIFT))[0] : 0;
    }
    hs_pairs_free(rows);
    return status;
}

static void
shifts_may_be_too_large(void)
{
    double     distance = -1.0;
    int32_t    shift = -1;
    hs_failure failure;
    CHECK(find_far(0x1p30, HS_WANT_SHIFT, &distance, &shift, &failure) == HS_OK);
    CHECK(distance == 0.25 && shift == 1 << 30);
    CHECK(find_far(-0x1p31, HS_WANT_SHIFT, &distance, &shift, &failure) == HS_OK);
    CHECK(distance == 0.25 && shift == INT32_MIN);
    for (int sign = -1; sign <= 1; sign += 2) {
        CHECK(find_far(sign * 0x1p32, HS_WANT_SHIFT, &distance, &shift, &failure) ==
              HS_ERR_SHIFT_RANGE);
        CHECK(failure.row == 0);
        for (int exponent = 33; exponent <= 50; exponent += 17) {
            CHECK(find_far(sign * ldexp(1.0, exponent), 0, &distance, &shift, &failure) == HS_OK);
            CHECK(distance == 0.25);
        }
    }
}

void
test_nearest(void)
{
    RUN(whoever_comes_while_it_is_built_does_without);
    RUN(rows_end_at_the_largest_distance);
    RUN(distances_may_be_of_any_size);
    RUN(points_that_wrapping_makes_equal);
    RUN(clusters_of_all_sizes);
    RUN(many_points_on_a_lattice);
    RUN(many_leaves_and_few);
    RUN(crowds_are_far_away);
    RUN(long_boxes_have_many_images);
    RUN(many_points_can_be_stopped);
    RUN(many_images_can_be_stopped);
    RUN(no_scene_takes_much_more_than_others);
    RUN(no_point_is_too_near_to_itself);
    RUN(a_least_distance_may_be_too_large);
    RUN(one_refusal_ends_the_search);
    RUN(shifts_may_be_too_large);
}
