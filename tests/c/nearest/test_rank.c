/* SPDX-License-Identifier: BSD-3-Clause */
/* test_rank.c: the order of nearest points is exact, and so is what is written of it. */
#include "../../../csrc/core/nearest/rank.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/nearest_unit.h"

#include <math.h>

void test_rank(void);

/*
 * ---- nearest rank ----
 *
 * Hits are put in exact order however much their squares err, as long as the block tells how much,
 * and nothing is called the nearest that a radius may have left out.
 */

enum { N = 300 };

static nearest_unit      unit;
static hs_nearest_leaves leaves;
static hs_nearest_block  block;
static hs_nearest_ranker ranker;
static hs_nearest_group  group;
static hs_options        rank_options;
static int32_t           hits[2 * N];

static void
open_scene(const double *x, int64_t n, int d, const hs_box *box, int64_t k, double radius)
{
    const hs_points points = {x, n, d, HS_FLOAT64, d * 8, 8};
    nearest_unit_open(&points, NULL, box, k, HS_WANT_J, INFINITY, &unit);
    group = nearest_unit_group(&unit, radius);
    CHECK(nearest_unit_fill(&unit, &group, 1e9, &leaves, &block) == HS_OK);
    rank_options = hs_options_default();
    ranker = (hs_nearest_ranker){.near = &unit.near, .options = &rank_options};
    for (int32_t h = 0; h < block.n && h < 2 * N; h++)
        hits[h] = h;
}

static void
close_scene(void)
{
    hs_nearest_ranker_free(&ranker);
    nearest_unit_clear(&unit, &leaves, &block);
    nearest_unit_close(&unit);
}

/* Point number i in tree order. */
static int32_t
place_of(int32_t i)
{
    int32_t si = 0;
    while (unit.search.bins.order[si] != i)
        si++;
    return si;
}

/* Four points on a line: from the first one 0.5, 1.0 and 1.2. */
static const double line[4] = {0.0, 0.5, 1.0, 1.2};

/* Ranks by squares in float32 if that can tell: then no square in float64 is computed. */
static bool
ranks_fast(int32_t si, const float *squares, int64_t n, int64_t *count)
{
    hs_nearest_ranker_set(&ranker, si);
    CHECK(hs_nearest_rank(&ranker, &block, hits, squares, n, false, count) == HS_OK);
    return ranker.n == 0;
}

/* Squares in float32 do where they differ by more than they err, from the point itself on. */
static void
float32_tells_only_what_it_can(void)
{
    float   squares[4 + HS_PADDING] = {0.0f};
    int64_t count;
    open_scene(line, 4, 1, NULL, 2, 1.5);
    const int32_t           si = place_of(0);
    hs_nearest_image *const home = &leaves.images[0];
    for (int32_t h = 0; h < 4; h++) {
        const double along = line[unit.search.bins.order[block.number[h]]];
        squares[h] = (float)(along * along);
    }
    /* 0, 0.25, 1, 1.44 below 2.25: at least 0.25 apart. Keys take 2^-15 of that. */
    const double errors[] = {1e-7, 0.1, 0.124, 0.126, 0.4};
    for (int e = 0; e < 5; e++) {
        block.square_error = errors[e];
        CHECK(ranks_fast(si, squares, 4, &count) == (e < 3));
        CHECK(count == 2);
        CHECK(unit.search.bins.order[ranker.keys[0].number] == 1 &&
              unit.search.bins.order[ranker.keys[1].number] == 2);
    }
    block.square_error = 1e-7;
    CHECK(!ranks_fast(place_of(1), squares, 4, &count)); /* not the first */
    CHECK(ranks_fast(si, squares, 2, &count) && count == -1);
    home->is_home = false; /* an image of itself is a neighbour */
    CHECK(!ranks_fast(si, squares, 4, &count));
    home->is_home = true;
    /* The last one wanted must be that far from the radius, too. */
    for (int32_t h = 0; h < 4; h++)
        squares[h] = squares[h] == 1.0f ? 2.2f : squares[h] > 1.0f ? 2.249f : squares[h];
    block.square_error = 0.02;
    CHECK(ranks_fast(si, squares, 4, &count));
    block.square_error = 0.0249;
    CHECK(!ranks_fast(si, squares, 4, &count));
    /* In float64, too: others may be as far as the radius. */
    const double radii[] = {0.75, 1.0, 1.0 + 0x1p-20};
    for (int e = 0; e < 3; e++) {
        block.frame.reach = radii[e] * block.frame.unit;
        CHECK(!ranks_fast(si, NULL, 4, &count) && count == (e < 2 ? -1 : 2));
    }
    close_scene();
}

/* Images of a point that lie as near as errors reach, itself among them. */
static void
only_the_point_itself_is_left_out(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, false}, .rows = {{0.25, 0.0625}, {0.0, 1.0}}};
    const double x[2] = {0.03125, 0.5};
    int64_t      count;
    open_scene(x, 1, 2, &box, 4, 0.75);
    CHECK(leaves.n_images >= 5 && block.n == leaves.n_images);
    block.frame.flat_error = 0.3; /* the next images are at 0.27 */
    hs_nearest_ranker_set(&ranker, 0);
    CHECK(hs_nearest_rank(&ranker, &block, hits, NULL, block.n, false, &count) == HS_OK);
    CHECK(count == 4);
    for (int e = 0; e < 4; e++) { /* -1 and 1, -2 and 2 */
        const hs_nearest_image *image = &ranker.images[ranker.keys[e].image];
        CHECK(!image->is_home && abs(image->shift[0]) == 1 + e / 2);
    }
    CHECK(ranker.images[ranker.keys[0].image].shift[0] * unit.search.scene.lattice.U[0][0] <
          0); /* the smaller S first */
    close_scene();
}

static bool
stop(void *context, double fraction)
{
    (void)fraction;
    ++*(int *)context;
    return false;
}

/* Whichever step the poll comes at, in sorting and among many that float64 cannot tell apart. */
static void
ranking_can_be_stopped_anywhere(void)
{
    static double x[2 * N];
    int64_t       count;
    int           n_stopped = 0, asked = 0;
    for (int e = 0; e < N; e++) {
        x[2 * e] = e == 0 ? 0.0 : 1.0;
        x[2 * e + 1] = ldexp(e, -44);
    }
    open_scene(x, N, 2, NULL, 1, 1.5);
    const int32_t si = place_of(0);
    hs_nearest_ranker_set(&ranker, si);
    CHECK(hs_nearest_rank(&ranker, &block, hits, NULL, N, false, &count) == HS_OK && count == 1);
    CHECK(unit.search.bins.order[ranker.keys[0].number] == 1);
    const int64_t n_steps = ranker.steps;
    CHECK(n_steps > 3 * N && ranker.n_compared >= N - 2);
    rank_options.poll = stop;
    rank_options.poll_context = &asked;
    for (int64_t ahead = 1; ahead <= n_steps + 20; ahead += 20) {
        ranker.steps = HS_NEAREST_POLL_STEPS - ahead;
        hs_nearest_ranker_set(&ranker, si);
        const hs_status status = hs_nearest_rank(&ranker, &block, hits, NULL, N, false, &count);
        CHECK(status == (ahead <= n_steps ? HS_ERR_INTERRUPTED : HS_OK));
        n_stopped += status != HS_OK;
    }
    CHECK(n_stopped > 40 && asked == n_stopped);
    rank_options.poll = NULL;
    hs_status status = HS_ERR_MEMORY;
    for (int refused = 1; status != HS_OK; refused++) { /* memory, by a ranker without any */
        hs_nearest_ranker_free(&ranker);
        ranker = (hs_nearest_ranker){.near = &unit.near, .options = &rank_options};
        hs_nearest_ranker_set(&ranker, si);
        hs_test_fail_allocation(refused);
        status = hs_nearest_rank(&ranker, &block, hits, NULL, N, false, &count);
        CHECK(status == (hs_test_failure_is_due() ? HS_OK : HS_ERR_MEMORY));
        CHECK(status != HS_OK || (refused > 2 && count == 1));
        hs_test_fail_allocation(0);
    }
    close_scene();
}

/*
 * ---- nearest write ----
 *
 * The columns of nearest points: each alone has the bits that it has beside all others, in either
 * width of index, whether shifts are those of images or of points as given.
 */

/* Whether an int32 column holds the numbers of an int64 one. */
static bool
same_numbers(const int32_t *narrow, const int64_t *wide, int64_t n)
{
    for (int64_t e = 0; e < n; e++) {
        if (narrow[e] != wide[e])
            return false;
    }
    return true;
}

static bool
same_column(const hs_pairs *one, const hs_pairs *all, unsigned which, size_t width)
{
    return hs_pairs_array(one, which) == NULL || same_array(one, all, which, width);
}

/* Each choice of columns gives what the search for all of them gives. */
static void
check_columns(const brute_scene *scene, const hs_points *queries, int64_t k, double limit)
{
    const unsigned  choices[] = {HS_WANT_J,
                                 HS_WANT_DISTANCE,
                                 HS_WANT_VECTOR,
                                 HS_WANT_SHIFT,
                                 HS_WANT_J | HS_WANT_DISTANCE,
                                 HS_WANT_DISTANCE | HS_WANT_VECTOR,
                                 HS_WANT_J | HS_WANT_VECTOR};
    const hs_points points = points_of(scene);
    const size_t    d = (size_t)scene->ndim;
    hs_options      options = options_of(scene);
    hs_pairs       *all = NULL;
    options.cutoff = limit;
    options.want = WANT_ALL & ~HS_WANT_I;
    CHECK(hs_nearest_find(QUERIED(&points, queries, scene->box), k, &options, &all, NULL) == HS_OK);
    for (int c = 0; c < 14; c++) {
        hs_pairs *one = NULL;
        options.want = choices[c % 7];
        options.index_bytes = c < 7 ? 8 : 4;
        CHECK(hs_nearest_find(QUERIED(&points, queries, scene->box), k, &options, &one, NULL) ==
              HS_OK);
        CHECK(hs_pairs_length(one) == hs_pairs_length(all));
        CHECK(same_column(one, all, HS_WANT_DISTANCE, 8));
        CHECK(same_column(one, all, HS_WANT_VECTOR, 8 * d));
        CHECK(same_column(one, all, HS_WANT_SHIFT, 4 * d));
        if (options.want & HS_WANT_J) {
            const void *j = hs_pairs_array(one, HS_WANT_J);
            CHECK(c < 7 ? same_array(one, all, HS_WANT_J, 8)
                        : same_numbers(j, hs_pairs_array(all, HS_WANT_J), hs_pairs_length(all)));
        }
        hs_pairs_free(one);
    }
    hs_pairs_free(all);
}

/* Those that ask lie at one face of the box and all points at the other: no candidate is where it
 * lies in the box. */
static void
all_candidates_may_lie_in_one_image(void)
{
    enum { POINTS = 60, QUERIES = 12 };
    double         x[2 * POINTS], q[2 * QUERIES];
    harness_random random = {95};
    hs_box         box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    for (int trial = 0; trial < 4; trial++) {
        for (int p = 0; p < POINTS; p++) {
            x[2 * p] = 0.4375 + 0.05 * random_unit(&random);
            x[2 * p + 1] = 0.1 * random_unit(&random);
        }
        for (int p = 0; p < QUERIES; p++) {
            q[2 * p] = (trial % 2 ? 0.51 : -0.49) + 0.03 * random_unit(&random);
            q[2 * p + 1] = 0.1 * random_unit(&random);
        }
        const brute_scene scene = {.ndim = 2, .n = POINTS, .x = x, .box = &box, .cutoff = 1.0};
        const hs_points   queries = {q, QUERIES, 2, HS_FLOAT64, 16, 8};
        check_columns(&scene, &queries, 3, trial < 2 ? INFINITY : 0.125);
    }
}

/* More groups on one spot than a thread takes at a time. */
static void
eight_thousand_points_may_be_one(void)
{
    enum { POINTS = 8000 };
    static double   x[3 * POINTS];
    hs_counters     counters;
    const hs_points points = {x, POINTS, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    int64_t         wrong = 0;
    for (int e = 0; e < 3 * POINTS; e++)
        x[e] = 0.25 * (e % 3);
    options.cutoff = INFINITY;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    options.counters = &counters;
    CHECK(hs_nearest_find(AMONG(&points, NULL), 2, &options, &rows, NULL) == HS_OK);
    CHECK(counters.groups == (POINTS + 47) / 48); /* each candidate is met by all of a group */
    CHECK(counters.candidates == 3 * POINTS && counters.pairs == 2 * POINTS);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    const double  *d = hs_pairs_array(rows, HS_WANT_DISTANCE);
    for (int i = 0; i < POINTS; i++) {
        wrong += j[2 * i] != (i == 0) || j[2 * i + 1] != (i < 2 ? 2 : 1);
        wrong += d[2 * i] != 0.0 || d[2 * i + 1] != 0.0;
    }
    CHECK(wrong == 0);
    hs_pairs_free(rows);
}

void
test_rank(void)
{
    RUN(float32_tells_only_what_it_can);
    RUN(only_the_point_itself_is_left_out);
    RUN(ranking_can_be_stopped_anywhere);
    RUN(all_candidates_may_lie_in_one_image);
    RUN(eight_thousand_points_may_be_one);
}
