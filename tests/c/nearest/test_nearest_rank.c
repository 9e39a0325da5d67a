/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_rank.c: hits are put in exact order however much their squares err, as long as the
 * block tells how much, and nothing is called the nearest that a radius may have left out. */
#include "../../../csrc/core/nearest/nearest_rank.h"
#include "../support/nearest_unit.h"

#include <math.h>

void test_nearest_rank(void);

enum { N = 300 };

static nearest_unit      unit;
static hs_nearest_block  block;
static hs_nearest_ranker ranker;
static hs_nearest_group  group;
static hs_options        options;
static int32_t           hits[2 * N];

static void
open_scene(const double *x, int64_t n, int d, const hs_box *box, int64_t k, double radius)
{
    const hs_points points = {x, n, d, HS_FLOAT64, d * 8, 8};
    nearest_unit_open(&points, NULL, box, k, HS_WANT_J, INFINITY, &unit);
    CHECK(hs_nearest_block_init(&unit.near, &block) == HS_OK);
    group = nearest_unit_group(&unit, radius);
    CHECK(hs_nearest_block_fill(&unit.near, &unit.call.options, &group, 1e9, NULL, &block) ==
          HS_OK);
    options = hs_options_default();
    ranker =
        (hs_nearest_ranker){.near = &unit.near, .block = &block, .pace = {.options = &options}};
    for (int32_t h = 0; h < block.n && h < 2 * N; h++)
        hits[h] = h;
}

static void
close_scene(void)
{
    hs_nearest_ranker_free(&ranker);
    hs_nearest_block_free(&unit.near, &block);
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

/* Exact squares in integers: coordinates are multiples of 2^-20 below 2^4. */
static int64_t
square_between(const double *p, const double *q)
{
    int64_t square = 0;
    for (int k = 0; k < 2; k++) {
        const int64_t along = (int64_t)((p[k] - q[k]) * 0x1p20);
        square += along * along;
    }
    return square;
}

/* Number of the hit that is the e-th nearest of point i, by (distance, j). */
static int32_t
nearest_of(const double *x, int32_t i, int e)
{
    for (int32_t j = 0; j < N; j++) {
        const int64_t square = square_between(x + 2 * i, x + 2 * j);
        int           before = 0;
        for (int32_t other = 0; other < N; other++) {
            const int64_t of_other = square_between(x + 2 * i, x + 2 * other);
            before += other != i && other != j &&
                      (of_other < square || (of_other == square && other < j));
        }
        if (j != i && before == e)
            return j;
    }
    return -1;
}

/* The search's copies of the points are moved by as much as the block says that they may be off;
 * what decides are the points as given. */
static void
order_is_exact_whatever_the_squares_err(void)
{
    static double  x[2 * N];
    const hs_box   box = {.ndim = 2, .periodic = {true, true}, .rows = {{64.0}, {1.5, 64.0}}};
    harness_random random = {1618};
    for (int trial = 0; trial < 24; trial++) {
        const double  off = ldexp(1.0, -4 - 3 * (trial % 6));
        const int64_t k = trial % 3 == 0 ? 1 : trial % 3 == 1 ? 5 : 20;
        for (int e = 0; e < 2 * N; e++) {
            const double cells = trial % 4 == 3 ? 8.0 : 0x1p20; /* a lattice: with many ties */
            x[e] = 8.0 + floor(4.0 * random_unit(&random) * cells) / cells;
        }
        open_scene(x, N, 2, &box, k, 7.0);
        CHECK(unit.search.bins.keeps_originals && block.n == N && block.unit == 0.25);
        for (int32_t si = 0; si < N; si++)
            for (int axis = 0; axis < 2; axis++)
                unit.search.bins.x[axis][si] += off * (2.0 * random_unit(&random) - 1.0);
        /* Each component of a difference errs by 2 off, times the unit; 2 e |D| + e^2. */
        const double along = sqrt(2.0) * 2.0 * off * block.unit;
        block.flat_error = along * (2.0 * block.reach + along);
        for (int32_t i = trial; i < N; i += 97) {
            int64_t count;
            CHECK(hs_nearest_rank(&ranker, &group, place_of(i), hits, N, &count) == HS_OK);
            CHECK(count == (off < 0x1p-3 ? k : count));
            for (int e = 0; e < count; e++) {
                const int32_t sj = block.number[ranker.keys[e].place];
                CHECK(unit.search.bins.order[sj] == nearest_of(x, i, e));
            }
        }
        close_scene();
    }
}

/* Four points on a line: from the first one 0.5, 1.0 and 1.2. */
static const double line[4] = {0.0, 0.5, 1.0, 1.2};

/* So many hits are the nearest only if nothing beyond the radius can be nearer. */
static void
what_the_radius_may_have_left_out_is_told(void)
{
    int64_t count;
    open_scene(line, 4, 1, NULL, 3, 1.5);
    const int32_t si = place_of(0), n = block.n;
    const double  reach = block.reach * block.reach;
    CHECK(n == 4 && block.unit == 1.0);
    CHECK(hs_nearest_rank(&ranker, &group, si, hits, n, &count) == HS_OK && count == 3);
    block.flat_error = 0.4999 * (reach - 1.44);
    CHECK(hs_nearest_rank(&ranker, &group, si, hits, n, &count) == HS_OK && count == 3);
    block.flat_error = 0.5001 * (reach - 1.44);
    CHECK(hs_nearest_rank(&ranker, &group, si, hits, n, &count) == HS_OK && count == -1);
    group.is_complete = true;
    CHECK(hs_nearest_rank(&ranker, &group, si, hits, n, &count) == HS_OK && count == 3);
    block.flat_error = 0.0;
    unit.near.k = 4; /* there are no more */
    CHECK(hs_nearest_rank(&ranker, &group, si, hits, n, &count) == HS_OK && count == 3);
    group.is_complete = false;
    CHECK(hs_nearest_rank(&ranker, &group, si, hits, n, &count) == HS_OK && count == -1);
    CHECK(hs_nearest_rank(&ranker, &group, si, hits, 0, &count) == HS_OK && count == -1);
    close_scene();
}

/* Squares in float32 do where they differ by more than they err, from the point itself on. */
static void
float32_tells_only_what_it_can(void)
{
    float   squares[4 + HS_PADDING] = {0.0f};
    int64_t count;
    open_scene(line, 4, 1, NULL, 2, 1.5);
    const int32_t si = place_of(0);
    for (int32_t h = 0; h < 4; h++) {
        const double along = line[unit.search.bins.order[block.number[h]]];
        squares[h] = (float)(along * along);
    }
    /* 0, 0.25, 1, 1.44 below 2.25: at least 0.25 apart. Keys take 2^-15 of that. */
    const double errors[] = {1e-7, 0.1, 0.124, 0.126, 0.4};
    for (int e = 0; e < 5; e++) {
        block.square_error = errors[e];
        CHECK(hs_nearest_rank_fast(&ranker, si, hits, squares, 4, &count) == (e < 3));
        CHECK(count == (e < 3 ? 2 : -1));
        CHECK(e >= 3 || (unit.search.bins.order[block.number[ranker.keys[0].place]] == 1 &&
                         unit.search.bins.order[block.number[ranker.keys[1].place]] == 2));
    }
    block.square_error = 1e-7;
    CHECK(
        !hs_nearest_rank_fast(&ranker, place_of(1), hits, squares, 4, &count)); /* not the first */
    CHECK(hs_nearest_rank_fast(&ranker, si, hits, squares, 2, &count) && count == -1);
    block.images[0].is_home = false; /* an image of itself is a neighbour */
    CHECK(!hs_nearest_rank_fast(&ranker, si, hits, squares, 4, &count));
    block.images[0].is_home = true;
    /* The last one wanted must be that far from the radius, too. */
    for (int32_t h = 0; h < 4; h++)
        squares[h] = squares[h] == 1.0f ? 2.2f : squares[h] > 1.0f ? 2.249f : squares[h];
    block.square_error = 0.02;
    CHECK(hs_nearest_rank_fast(&ranker, si, hits, squares, 4, &count));
    block.square_error = 0.0249;
    CHECK(!hs_nearest_rank_fast(&ranker, si, hits, squares, 4, &count));
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
    CHECK(block.n_images >= 5 && block.n == block.n_images);
    block.flat_error = 0.3; /* the next images are at 0.27 */
    CHECK(hs_nearest_rank(&ranker, &group, 0, hits, block.n, &count) == HS_OK && count == 4);
    for (int e = 0; e < 4; e++) { /* -1 and 1, -2 and 2 */
        const hs_nearest_image *image = hs_nearest_image_of(&block, ranker.keys[e].place);
        CHECK(!image->is_home && abs(image->shift[0]) == 1 + e / 2);
    }
    CHECK(hs_nearest_image_of(&block, ranker.keys[0].place)->shift[0] *
              unit.search.scene.lattice.U[0][0] <
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
    CHECK(hs_nearest_rank(&ranker, &group, place_of(0), hits, N, &count) == HS_OK && count == 1);
    CHECK(unit.search.bins.order[block.number[ranker.keys[0].place]] == 1);
    const int64_t n_steps = ranker.pace.steps;
    CHECK(n_steps > 3 * N && ranker.n_compared >= N - 2);
    options.poll = stop;
    options.poll_context = &asked;
    for (int64_t ahead = 1; ahead <= n_steps + 20; ahead += 20) {
        ranker.pace =
            (hs_nearest_pace){.options = &options, .steps = HS_NEAREST_POLL_STEPS - ahead};
        const hs_status status = hs_nearest_rank(&ranker, &group, place_of(0), hits, N, &count);
        CHECK(status == (ahead <= n_steps ? HS_ERR_INTERRUPTED : HS_OK));
        n_stopped += status != HS_OK;
    }
    CHECK(n_stopped > 40 && asked == n_stopped);
    close_scene();
}

/* Points at one spot are told apart by their numbers alone, however many they are and whichever of
 * them are wanted. */
static void
points_at_one_spot_are_in_order_of_number(void)
{
    for (int n = 3; n <= 8; n++) {
        for (int at_spot = 2; at_spot <= n; at_spot++) {
            double x[8];
            for (int i = 0; i < n; i++) /* the others come first, and lie farther away */
                x[i] = i < n - at_spot ? 0.25 + 0.0625 * i : 0.0;
            for (int64_t k = 1; k < at_spot; k++) {
                int64_t count;
                open_scene(x, n, 1, NULL, k, 1.0);
                for (int32_t i = n - at_spot; i < n; i++) {
                    CHECK(hs_nearest_rank(&ranker, &group, place_of(i), hits, block.n, &count) ==
                          HS_OK);
                    CHECK(count == k);
                    for (int32_t e = 0; e < count; e++) {
                        const int32_t j = n - at_spot + e, sj = block.number[ranker.keys[e].place];
                        CHECK(unit.search.bins.order[sj] == j + (j >= i));
                    }
                }
                close_scene();
            }
        }
    }
}

void
test_nearest_rank(void)
{
    RUN(points_at_one_spot_are_in_order_of_number);
    RUN(order_is_exact_whatever_the_squares_err);
    RUN(what_the_radius_may_have_left_out_is_told);
    RUN(float32_tells_only_what_it_can);
    RUN(only_the_point_itself_is_left_out);
    RUN(ranking_can_be_stopped_anywhere);
}
