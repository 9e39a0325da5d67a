/* SPDX-License-Identifier: BSD-3-Clause */
/* test_write.c: the writers of this CPU against the functions for one pair, bit by bit; they decline
 * what they cannot take in halves, and only that. */
#include <math.h>

#include "../../../csrc/core/exact/metric.h"
#include "../../../csrc/kernels/kernel.h"
#include "../support/harness.h"

void test_write(void);

enum { POINTS = 5, PLACES = 64, MOST_HITS = 40, ROOM = MOST_HITS + HS_PADDING };

/* Candidates, points and hits of both, with room for the pairs. */
typedef struct scene {
    hs_metric metric;
    double    q[PLACES][HS_RECORD];
    int32_t   number[PLACES];
    int32_t   image[PLACES][HS_RECORD], few[PLACES][HS_RECORD];
    /* As the writer has them; all points lie in another order. */
    hs_candidate candidates[PLACES];
    int32_t      place[PLACES], base[3], turned[3][PLACES];
    double       x[PLACES][3];
    bool         is_fine;
    double       p[3][POINTS];
    int32_t      turns[3][POINTS];
    int32_t      point[POINTS], end[POINTS], label[ROOM];
    bool         has_images, has_turns, is_inclusive;
    int          first_column; /* of S, for the first row: those before are of open box vectors */
    int64_t      wide[2][ROOM];
    int32_t      narrow[2][ROOM];
    double       distance[ROOM], vector[3 * ROOM];
    int32_t      shift[3 * ROOM];
} scene;

static scene it;

/* Coordinates are multiples of `grain` if that is not 0, so that points coincide; a few are next to
 * nothing. */
static double
coordinate(harness_random *random, double grain)
{
    double x = 10.0 * random_unit(random) - 5.0;
    x = random_bits(random) % 256 == 0 ? 0x1p-60 * x : x; /* its halves are not fine */
    return grain > 0.0 ? grain * floor(x / grain) : x;
}

/* A few images and turns, or none; hits of some points, the last of which fill no vector. */
static void
make_scene(int ndim, bool is_coupled, bool has_images, bool has_turns, double grain,
           harness_random *random)
{
    static const double coupled[3][HS_MAX_DIM] = {{9.0}, {2.7, 10.1}, {-3.1, 0.7, 8.3}};
    static const double aligned[3][HS_MAX_DIM] = {{0.0, 9.3}, {10.7}, {0.0, 0.0, 8.0}};
    memset(&it, 0, sizeof it);
    it.has_images = has_images;
    it.has_turns = has_turns;
    it.is_inclusive = true;
    it.first_column = (int)(random_bits(random) % 2);
    hs_metric_init(&it.metric, ndim, ndim - it.first_column, is_coupled ? coupled : aligned, 8.0,
                   true);
    for (int32_t c = 0; c < PLACES; c++) {
        it.number[c] = (int32_t)(random_bits(random) % 70);
        it.place[c] = (c * 5 + 3) % PLACES;
        for (int k = 0; k < ndim; k++) {
            it.q[c][k] = coordinate(random, grain);
            it.image[c][k] = has_images ? (int32_t)(random_bits(random) % 3) - 1 : 0;
            it.few[c][k] = it.image[c][k];
            it.few[c][k] += has_turns ? (int32_t)(random_bits(random) % 5) - 2 : 0;
        }
    }
    int32_t h = 0;
    for (int32_t t = 0; t < POINTS; t++) {
        for (int k = 0; k < 3; k++) {
            it.p[k][t] = coordinate(random, grain);
            it.turns[k][t] = has_turns ? (int32_t)(random_bits(random) % 5) - 2 : 0;
        }
        it.point[t] = (int32_t)(random_bits(random) % 70);
        for (uint64_t n = random_bits(random) % (MOST_HITS / POINTS + 1); n > 0; n--) {
            it.label[h++] = (int32_t)(random_bits(random) % PLACES);
        }
        it.end[t] = h;
    }
}

/* Candidates as they are now. */
static void
set_candidates(bool by_S)
{
    const hs_halving by = hs_write_halving(it.metric.cutoff);
    it.is_fine = true;
    for (int32_t c = 0; c < PLACES; c++) {
        hs_moved move;
        int32_t  S[3] = {0}, moved[3] = {0};
        for (int r = 0; r < it.metric.n_rows; r++) {
            const int32_t shift = it.has_turns ? it.few[c][r] : it.image[c][r];
            S[r + it.first_column] = shift;
            it.base[r] = by_S ? r - 1 : 0;
            moved[r] = by_S ? shift + it.base[r] : it.image[c][r];
            it.turned[r][it.place[c]] = it.image[c][r] - shift;
        }
        memcpy(it.x[it.place[c]], it.q[c], sizeof it.x[0]);
        (void)hs_write_move(&it.metric, by, moved, &move);
        it.is_fine &= move.is_fine;
        it.is_fine &= hs_candidate_set(&it.candidates[c], it.q[c], by, &move, it.number[c], S);
    }
}

static hs_write
write_of(bool is_half, bool by_S, int index_bytes)
{
    const int ndim = it.metric.ndim;
    hs_write  write = {.ndim = ndim,
                       .is_half = is_half,
                       .is_measured = true,
                       .is_shifted = it.has_images || by_S,
                       .by_S = by_S,
                       .metric = &it.metric,
                       .candidates = it.candidates,
                       .place = it.place,
                       .x_width = 3,
                       .first = 0x1p3,
                       .second = 0x1p-1,
                       .cutoff = 20.0,
                       .largest = it.is_inclusive ? 20.0 : nextafter(20.0, 0.0),
                       .index_bytes = index_bytes,
                       .i = index_bytes == 8 ? (void *)it.wide[0] : (void *)it.narrow[0],
                       .j = index_bytes == 8 ? (void *)it.wide[1] : (void *)it.narrow[1],
                       .distance = it.distance,
                       .vector = it.vector,
                       .shift = it.shift};
    set_candidates(by_S);
    write.is_fine = it.is_fine;
    for (int k = 0; k < ndim; k++) {
        write.p[k] = it.p[k];
        write.x[k] = &it.x[0][k];
    }
    for (int r = 0; r < it.metric.n_rows; r++) {
        write.base[r] = it.base[r];
        write.turns[r] = it.has_turns ? it.turns[r] : NULL;
        write.turned[r] = it.has_turns ? it.turned[r] : NULL;
        write.column[r] = r + it.first_column;
    }
    return write;
}

/* What is right for hit h of point t. */
static bool
is_right(const hs_write *write, int32_t t, int32_t h)
{
    const int     ndim = it.metric.ndim;
    const int32_t place = it.label[h];
    const int64_t number = it.number[place], point = it.point[t];
    double        p[3], vector[3];
    int64_t       S[3], times[3], given[3] = {0};
    bool          flips = number < point;
    for (int k = 0; k < ndim; k++) {
        p[k] = it.p[k][t];
    }
    for (int r = it.metric.n_rows - 1; r >= 0; r--) {
        const int64_t of_candidate = it.has_turns ? it.few[place][r] : it.image[place][r];
        S[r] = of_candidate + (it.has_turns ? it.turns[r][t] : 0);
        times[r] = write->by_S ? S[r] : it.image[place][r];
        given[r + it.first_column] = S[r];
        flips = number == point && S[r] != 0 ? S[r] < 0 : flips;
    }
    flips = flips && write->is_half;
    const double  length = hs_metric_measure(&it.metric, p, it.q[place], times, vector);
    const double  distance = length * 4.0 < 20.0 ? length * 4.0 : write->largest;
    const int64_t i = write->index_bytes == 8 ? it.wide[0][h] : it.narrow[0][h];
    const int64_t j = write->index_bytes == 8 ? it.wide[1][h] : it.narrow[1][h];
    const bool    swaps = write->is_half && number < point;
    bool          right = i == (swaps ? number : point) && j == (swaps ? point : number) &&
                 it.distance[h] == distance;
    for (int k = 0; k < ndim; k++) {
        const double D = (flips ? -vector[k] : vector[k]) * 4.0 + 0.0;
        right = right && memcmp(&it.vector[h * ndim + k], &D, sizeof D) == 0 &&
                it.shift[h * ndim + k] == (int32_t)(flips ? -given[k] : given[k]);
    }
    return right;
}

/* Whether all pairs are right, if the writer took them. */
static bool
are_right(const hs_kernel *kernel, const hs_write *write, int *taken)
{
    const hs_hits hits = {.n = POINTS, .point = it.point, .end = it.end, .label = it.label};
    if (!kernel->write(write, &hits)) {
        return true;
    }
    *taken += 1;
    for (int32_t t = 0, h = 0; t < POINTS; t++) {
        for (; h < it.end[t]; h++) {
            if (!is_right(write, t, h)) {
                return false;
            }
        }
    }
    return true;
}

/* Calls test for each kernel of this CPU that has a writer. */
static void
with_each_writer(void (*test)(const hs_kernel *kernel))
{
    const char *names[8];
    const int   n = hs_kernel_names(names, 8);
    for (int k = 0; k < n; k++) {
        const hs_kernel *kernel = hs_kernel_select(names[k]);
        if (kernel->write != NULL) {
            test(kernel);
        }
    }
}

static void
random_pairs(const hs_kernel *kernel)
{
    harness_random random = {11};
    int            taken = 0;
    for (int trial = 0; trial < TRIALS(3000); trial++) {
        const bool images = trial & 2, turns = trial & 4, by_S = trial & 8;
        make_scene(2 + (trial & 1), by_S, images, turns, trial % 5 == 0 ? 0.5 : 0.0, &random);
        const hs_write write = write_of(trial & 16, by_S, trial & 32 ? 8 : 4);
        CHECK(are_right(kernel, &write, &taken));
    }
    CHECK(taken > TRIALS(3000) / 10 * 9);
}

static void
pairs_have_the_bits_of_single_ones(void)
{
    with_each_writer(random_pairs);
}

/* Where nothing is measured, the rest is what it is beside d and D. */
static void
unmeasured_pairs(const hs_kernel *kernel)
{
    harness_random random = {12};
    int            taken = 0;
    for (int trial = 0; trial < TRIALS(1000); trial++) {
        make_scene(2 + (trial & 1), false, trial & 2, trial & 4, 0.0, &random);
        hs_write write = write_of(trial & 8, false, trial & 16 ? 8 : 4);
        CHECK(are_right(kernel, &write, &taken));
        memset(it.wide, 1, sizeof it.wide);
        memset(it.narrow, 1, sizeof it.narrow);
        memset(it.shift, 1, sizeof it.shift);
        write.is_measured = false;
        write.distance = write.vector = NULL;
        CHECK(are_right(kernel, &write, &taken));
    }
    CHECK(taken == 2 * TRIALS(1000));
}

static void
pairs_that_are_not_measured_are_the_same(void)
{
    with_each_writer(unmeasured_pairs);
}

/* One pair, of point 0 and a candidate at some distance from it along x. */
static hs_write
make_pair(double p, double q, int32_t image)
{
    harness_random random = {5};
    make_scene(3, false, image != 0, false, 0.0, &random);
    for (int k = 0; k < 3; k++) {
        it.p[k][0] = it.q[7][k] = k == 0 ? 0.0 : 1.5;
    }
    it.p[0][0] = p;
    it.q[7][0] = q;
    memset(it.image, 0, sizeof it.image);
    it.image[7][1] = image; /* row 1 is along x */
    it.first_column = 0;
    it.label[0] = 7;
    for (int32_t t = 0; t < POINTS; t++) {
        it.end[t] = 1;
    }
    return write_of(true, false, 8);
}

/* Too short for the squares of halves, or too far, or next to nothing is left of long terms. */
static void
unsure_pairs(const hs_kernel *kernel)
{
    static const double q[] = {1.25, 0x1p-14, 0x1p-18, 0x1p-59, 0x1p-61, 0x1p-538, 11.0, 12.0, 1e9};
    int                 taken = 0;
    hs_write            write = make_pair(1.25, 1.25, 0);
    CHECK(are_right(kernel, &write, &taken) && taken == 1);
    for (int k = 0; k < (int)(sizeof q / sizeof *q); k++) {
        write = make_pair(0.0, q[k], 0);
        CHECK(are_right(kernel, &write, &taken) && taken == k + 2);
    }
    for (int power = -30; power >= -60; power -= 5) {
        write = make_pair(-5.35, 5.35 - ldexp(1.0, power), -1);
        CHECK(are_right(kernel, &write, &taken));
    }
    write = make_pair(-5.35, 5.35, -1);
    CHECK(are_right(kernel, &write, &taken));
    write = make_pair(0.0, 10.7 * 70.0, -70); /* too many turns for halves */
    CHECK(are_right(kernel, &write, &taken));
    write = make_pair(0x1p26, 0x1p26 + 10.7e6, -1000000); /* a term too large for them */
    CHECK(are_right(kernel, &write, &taken) && taken == 20);
}

static void
what_is_not_sure_is_measured_by_itself(void)
{
    with_each_writer(unsure_pairs);
}

static void
pairs_out_of_reach(const hs_kernel *kernel)
{
    int      taken = 0;
    hs_write write = make_pair(0x1p27, 0x1p27 - 3.0, 0); /* 2^23 times a power of two above 8 */
    CHECK(are_right(kernel, &write, &taken) && taken == 1);
    write = make_pair(0x1.8p27, 0x1.8p27 - 3.0, 0);
    CHECK(are_right(kernel, &write, &taken) && taken == 1);
    write = make_pair(0.0, 3.0, 0);
    write.first = write.second = 0x1p-520;
    CHECK(!kernel->write(&write, &(hs_hits){POINTS, it.point, it.end, it.label}));
    write.first = write.second = 0x1p520;
    CHECK(!kernel->write(&write, &(hs_hits){POINTS, it.point, it.end, it.label}));
}

static void
what_cannot_be_halved_is_declined(void)
{
    with_each_writer(pairs_out_of_reach);
}

/* Up to a quarter of a tile, in these tests, are measured one by one. */
static void
many_unsure_pairs(const hs_kernel *kernel)
{
    int taken = 0;
    for (int32_t n = 1; n <= MOST_HITS; n++) {
        hs_write write = make_pair(0.0, 0x1p-18, 0);
        for (int32_t h = 0; h < n; h++) {
            it.label[h] = 7;
        }
        for (int32_t t = 0; t < POINTS; t++) {
            it.end[t] = n;
        }
        CHECK(are_right(kernel, &write, &taken));
        CHECK(taken == (n < 32 ? n : 32));
    }
}

static void
many_that_are_not_sure_are_declined(void)
{
    with_each_writer(many_unsure_pairs);
}

/* A distance of the cutoff, which is inclusive or not. */
static void
distances_at_the_cutoff(const hs_kernel *kernel)
{
    int      taken = 0;
    hs_write write = make_pair(0.0, 5.0, 0); /* 20 in the caller's unit */
    CHECK(are_right(kernel, &write, &taken) && it.distance[0] == 20.0);
    write.largest = nextafter(20.0, 0.0);
    CHECK(are_right(kernel, &write, &taken) && it.distance[0] < 20.0);
    CHECK(taken == 2);
}

static void
no_distance_passes_the_cutoff(void)
{
    with_each_writer(distances_at_the_cutoff);
}

/* Columns that are not wanted are left alone, and nothing is written far behind the last pair. */
static void
wanted_columns(const hs_kernel *kernel)
{
    harness_random random = {3};
    int            taken = 0;
    for (int without = 0; without < 5; without++) {
        make_scene(3, false, true, true, 0.0, &random);
        hs_write write = write_of(true, false, 4);
        CHECK(are_right(kernel, &write, &taken));
        write.i = without == 0 ? NULL : write.i;
        write.j = without == 1 ? NULL : write.j;
        write.distance = without == 2 ? NULL : write.distance;
        write.vector = without == 3 ? NULL : write.vector;
        write.shift = without == 4 ? NULL : write.shift;
        CHECK(are_right(kernel, &write, &taken)); /* what is left out is there from before */
    }
    CHECK(taken == 10);
}

static void
only_wanted_columns_are_written(void)
{
    with_each_writer(wanted_columns);
}

void
test_write(void)
{
    RUN(pairs_have_the_bits_of_single_ones);
    RUN(pairs_that_are_not_measured_are_the_same);
    RUN(what_is_not_sure_is_measured_by_itself);
    RUN(what_cannot_be_halved_is_declined);
    RUN(many_that_are_not_sure_are_declined);
    RUN(no_distance_passes_the_cutoff);
    RUN(only_wanted_columns_are_written);
}
