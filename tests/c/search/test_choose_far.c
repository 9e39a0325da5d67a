/* SPDX-License-Identifier: BSD-3-Clause */
/* test_choose_far.c: excluded pairs of points that are many periods apart, in a box so skewed that S
 * over its vectors is far larger still: what S says does not depend on that, until it does not fit.
 */
#include "../support/among.h"
#include "../support/harness.h"

#include <math.h>

void test_choose_far(void);

enum { N = 300 }; /* more than are looked up together */

#define SIDE 8.0
#define TILT 0x1p20 /* S is so many times the number of periods */

static const hs_box box = {
    .ndim = 2, .periodic = {true, true}, .rows = {{SIDE}, {SIDE * TILT, SIDE}}};

static double  x[2 * N];
static int64_t labels[N];

/* Points on a fine lattice, all with one label. */
static void
make_points(void)
{
    harness_random random = {86};
    for (int e = 0; e < 2 * N; e++)
        x[e] = (double)(random_bits(&random) % 128) / 16.0;
    memset(labels, 0, sizeof labels);
}

/* Moves a point by a vector of the lattice along the second axis: that is exact. */
static void
move(int point, double periods)
{
    x[2 * point + 1] += SIDE * periods;
}

/* Pairs whose labels differ, and images other than the nearest of those whose do not; as many as
 * are counted. */
static hs_status
find(double min_distance, hs_pairs **pairs, hs_failure *failure)
{
    const hs_points    points = {x, N, 2, HS_FLOAT64, 16, 8};
    const hs_selection selection = {.labels = labels, .min_distance = min_distance};
    const hs_among     among = {.points = &points, .box = &box, .selection = &selection};
    hs_options         options = hs_options_default();
    options.cutoff = 0.75 * SIDE + 0x1p-13; /* which no pair is so near that S decides */
    int64_t         n = 0;
    const hs_status status = hs_pairs_find(&among, &options, pairs, failure);
    CHECK(hs_pairs_count(&among, &options, &n, NULL) == status);
    CHECK(status != HS_OK || n == hs_pairs_length(*pairs));
    return status;
}

static bool
same_pairs(const hs_pairs *one, const hs_pairs *other)
{
    const int64_t n = hs_pairs_length(one);
    const size_t  size = (size_t)n * sizeof(int64_t);
    return n == hs_pairs_length(other) &&
           memcmp(hs_pairs_array(one, HS_WANT_I), hs_pairs_array(other, HS_WANT_I), size) == 0 &&
           memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(other, HS_WANT_J), size) == 0;
}

/* The nearest image is the same one, wherever its points are. */
static void
far_points_have_the_pairs_of_near_ones(void)
{
    for (int least = 0; least < 2; least++) {
        hs_pairs *near, *far;
        make_points();
        CHECK(find(least, &near, NULL) == HS_OK && hs_pairs_length(near) > N);
        for (int i = 0; i < N; i++)
            move(i, (i % 3 - 1) * 0x1p40);
        CHECK(find(least, &far, NULL) == HS_OK);
        CHECK(same_pairs(near, far));
        hs_pairs_free(near);
        hs_pairs_free(far);
    }
}

/* An S beyond 2^62 is not known: the search ends, unless it need not be known. */
static void
shifts_that_are_not_known_are_told(void)
{
    for (int every = 1; every < N; every *= 7) {
        hs_pairs  *near, *far;
        hs_failure failure;
        make_points();
        for (int i = every; i < N; i += 2 * every)
            move(i, 0x1p42);
        CHECK(find(0.0, &far, &failure) == HS_ERR_SHIFT_RANGE && far == NULL);
        CHECK(failure.row >= 0 && failure.row < N);
        for (int i = every; i < N; i += 2 * every)
            labels[i] = -i;
        CHECK(find(0.0, &far, NULL) == HS_OK);
        for (int i = every; i < N; i += 2 * every)
            move(i, -0x1p42);
        CHECK(find(0.0, &near, NULL) == HS_OK);
        CHECK(same_pairs(near, far) && hs_pairs_length(near) > N);
        hs_pairs_free(near);
        hs_pairs_free(far);
    }
}

void
test_choose_far(void)
{
    RUN(far_points_have_the_pairs_of_near_ones);
    RUN(shifts_that_are_not_known_are_told);
}
