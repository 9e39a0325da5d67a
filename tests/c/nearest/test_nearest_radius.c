/* SPDX-License-Identifier: BSD-3-Clause */
/* test_nearest_radius.c: a first radius holds about as many points as are wanted, by the density of
 * what is around a group, of its line or plane, or of the box. */
#include "../support/nearest_unit.h"

#include <math.h>

void test_nearest_radius(void);

enum { MOST = 4000 };

static nearest_unit unit;
static double       x[3 * MOST];

static hs_points
points_in(int64_t n, int ndim)
{
    return (hs_points){x, n, ndim, HS_FLOAT64, ndim * 8, 8};
}

static void
exponents_end_at_the_least_radius(void)
{
    CHECK(hs_nearest_exponent(1.0) == 0 && hs_nearest_exponent(1.99) == 0);
    CHECK(hs_nearest_exponent(0.75) == -1 && hs_nearest_exponent(HS_NEAREST_LEAST_RADIUS) == -1000);
    CHECK(hs_nearest_exponent(0.0) == -1000 && hs_nearest_exponent(0x1p-1070) == -1000);
}

/* Ranges of X, and of t_k in a box of any shape. */
static void
groups_have_the_range_of_their_points(void)
{
    const hs_box   box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {1.5, 4.0}}};
    harness_random random = {311};
    for (int e = 0; e < 2 * 200; e++)
        x[e] = 6.0 * random_unit(&random);
    for (int tilted = 0; tilted < 2; tilted++) {
        const hs_points points = points_in(200, 2);
        nearest_unit_open(&points, NULL, tilted ? &box : NULL, 3, HS_WANT_J, INFINITY, &unit);
        const hs_bins    *bins = &unit.search.bins;
        const hs_lattice *lattice = &unit.search.scene.lattice;
        for (int32_t first = 0; first < 190; first += 17) {
            hs_nearest_group group;
            hs_nearest_group_set(&unit.near, first, first + 9, &group);
            CHECK(group.first == first && group.last == first + 9 && group.away == 0.0);
            for (int k = 0; k < 2; k++) {
                double low = INFINITY, high = -INFINITY, t_low = INFINITY, t_high = -INFINITY;
                for (int32_t si = first; si < first + 9; si++) {
                    const double at[2] = {bins->x[0][si], bins->x[1][si]};
                    const double t = hs_lattice_coordinate(lattice, at, k);
                    low = fmin(at[k], low);
                    high = fmax(at[k], high);
                    t_low = fmin(t, t_low);
                    t_high = fmax(t, t_high);
                }
                CHECK(group.lower[k] == low && group.upper[k] == high);
                CHECK(group.t_lower[k] == t_low && group.t_upper[k] == t_high);
            }
        }
        nearest_unit_close(&unit);
    }
}

/* Queries above or below a layer are away from all points, whatever their images do. */
static void
groups_beside_a_layer_are_away(void)
{
    const hs_box    box = {.ndim = 2, .periodic = {true, false}, .rows = {{4.0}, {0.0, 1.0}}};
    const double    q[6] = {0.5, 10.0, 0.5, -7.0, 0.5, 0.5};
    const hs_points points = points_in(2, 2), queries = {q, 3, 2, HS_FLOAT64, 16, 8};
    x[0] = x[2] = 0.0;
    x[1] = 0.0;
    x[3] = 2.0;
    nearest_unit_open(&points, &queries, &box, 1, HS_WANT_J, INFINITY, &unit);
    CHECK(unit.near.has_layer);
    for (int32_t si = 0; si < 3; si++) {
        hs_nearest_group group;
        const double     y = q[2 * unit.search.query_bins.order[si] + 1];
        const double     away = y > 2.0 ? y - 2.0 : y < 0.0 ? -y : 0.0;
        hs_nearest_group_set(&unit.near, si, si + 1, &group);
        CHECK(group.away <= away && group.away >= away * (1.0 - 0x1p-30));
    }
    nearest_unit_close(&unit);
}

static void
nothing_is_farther_than_all_points_or_the_largest_distance(void)
{
    const hs_box     box = {.ndim = 2, .periodic = {true, false}, .rows = {{9.0}, {0.0, 1.0}}};
    const hs_points  points = points_in(3, 2);
    const double     line[6] = {0.0, 0.0, 3.0, 0.0, 3.0, 4.0};
    hs_nearest_group group;
    memcpy(x, line, sizeof line);
    nearest_unit_open(&points, NULL, NULL, 1, HS_WANT_J, INFINITY, &unit);
    hs_nearest_group_set(&unit.near, 0, 1, &group); /* one of the corners: 3 and 4 along the axes */
    double farthest = hs_nearest_farthest(&unit.near, &group);
    CHECK(farthest >= 5.0 && farthest <= 7.001);
    nearest_unit_close(&unit);
    nearest_unit_open(&points, NULL, NULL, 1, HS_WANT_J, 2.0, &unit);
    farthest = hs_nearest_farthest(&unit.near, &group);
    CHECK(farthest >= 2.0 && farthest < 2.001);
    nearest_unit_close(&unit);
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
    CHECK(hs_nearest_farthest(&unit.near, &group) == INFINITY);
    nearest_unit_close(&unit);
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, 2000.0, &unit);
    farthest = hs_nearest_farthest(&unit.near, &group);
    CHECK(farthest >= 2000.0 && farthest < 2000.1);
    nearest_unit_close(&unit);
}

/* Of a first radius for each point, or for every tenth: the mean number of points within it, in
 * open space. */
static double
mean_within(int64_t n, int ndim, int64_t k)
{
    const hs_points points = points_in(n, ndim);
    int64_t         sum = 0, asked = 0;
    nearest_unit_open(&points, NULL, NULL, k, HS_WANT_J, INFINITY, &unit);
    const hs_bins *bins = &unit.search.bins;
    for (int32_t si = 0; si < n; si += 10, asked++) {
        hs_nearest_group group;
        hs_nearest_group_set(&unit.near, si, si + 1, &group);
        hs_nearest_guess(&unit.near, &group);
        for (int64_t sj = 0; sj < n; sj++) {
            double square = 0.0;
            for (int c = 0; c < ndim; c++) {
                const double along = bins->x[c][sj] - bins->x[c][si];
                square += along * along;
            }
            sum += square <= group.radius * group.radius;
        }
        CHECK(!group.is_complete);
    }
    nearest_unit_close(&unit);
    return (double)sum / (double)asked;
}

/* k, itself, and three and a half deviations: 11 + 3.5 * 3.3 + 1 for ten. Edges, for which room is
 * made, and leaves that are cut askew change that by less than half. */
static void
first_radii_hold_what_is_wanted(void)
{
    for (int d = 1; d <= 3; d++) {
        harness_random random = {317 + (uint64_t)d};
        for (int e = 0; e < d * MOST; e++)
            x[e] = random_unit(&random);
        const double ten = mean_within(MOST, d, 10), hundred = mean_within(MOST, d, 100);
        CHECK(ten > 16.0 && ten < 36.0 && hundred > 100.0 && hundred < 210.0);
    }
}

/* In three dimensions, points on a line or in a plane, which may be a little rough. Across it the
 * ball sticks out on both sides, for which there is more room. */
static void
flat_points_have_the_density_of_their_plane(void)
{
    for (int flat = 1; flat <= 2; flat++) {
        harness_random random = {330 + (uint64_t)flat};
        for (int i = 0; i < MOST; i++) {
            for (int k = 0; k < 3; k++)
                x[3 * i + k] = random_unit(&random) * (k < flat ? 1.0 : 1e-6);
        }
        const double ten = mean_within(MOST, 3, 10);
        CHECK(ten > 23.0 && ten < 60.0);
    }
}

/* Few points in open space: all their sides count, in one dimension or eight, and those of other
 * points asked before do not. A ball at a corner makes room for what is outside, on every axis. */
static void
few_points_have_the_density_of_all_of_them(void)
{
    enum { FEW = 50 };
    static const double ball[] = {2.0, 3.1416, 4.1888, 4.9348, 5.2638, 5.1677, 4.7248, 4.0587};
    harness_random      random = {340};
    for (int trial = 0; trial < 2 * HS_MAX_DIM; trial++) {
        const int        d = 1 + trial / 2;
        const double     side = trial % 2 ? 1e6 : 1.0, wanted = 2.0 + 3.5 * sqrt(2.0) + 1.0;
        const hs_points  points = points_in(FEW, d);
        const double     radius = side * pow(wanted / FEW / ball[d - 1], 1.0 / d);
        hs_nearest_group group;
        for (int e = 0; e < d * FEW; e++)
            x[e] = e < d ? 0.0 : e < 2 * d ? side : side * random_unit(&random);
        nearest_unit_open(&points, NULL, NULL, 1, HS_WANT_J, INFINITY, &unit);
        for (int32_t si = 0; si < FEW; si++) {
            hs_nearest_group_set(&unit.near, si, si + 1, &group);
            hs_nearest_guess(&unit.near, &group);
            CHECK(group.radius > 0.999 * radius && group.radius < 2.001 * radius);
        }
        nearest_unit_close(&unit);
    }
}

/* Few points, all in one corner: the box counts. The ball of as many points as are wanted, in
 * periodic boxes of 1000 times 30 points. */
static void
few_points_have_the_density_of_their_box(void)
{
    harness_random random = {341};
    for (int e = 0; e < 3 * 30; e++)
        x[e] = 0.001 * random_unit(&random);
    for (int tilted = 0; tilted < 2; tilted++) {
        const hs_box     box = {.ndim = 3,
                                .periodic = {true, true, true},
                                .rows = {{10.0}, {tilted * 3.0, 20.0}, {0.0, 0.0, 5.0}}};
        const hs_points  points = points_in(30, 3);
        hs_nearest_group group;
        nearest_unit_open(&points, NULL, &box, 4, HS_WANT_J, INFINITY, &unit);
        hs_nearest_group_set(&unit.near, 0, 1, &group);
        hs_nearest_guess(&unit.near, &group);
        const double wanted = 5.0 + 3.5 * sqrt(5.0) + 1.0;
        const double radius = cbrt(wanted / 30.0 * 1000.0 / 4.1888);
        CHECK(group.radius >= 0.999 * radius && !group.is_complete);
        /* Skewed boxes make room for edges, up to half of the ball along each axis. */
        CHECK(group.radius <= (tilted ? 2.001 : 1.001) * radius);
        nearest_unit_close(&unit);
    }
}

/* A layer: its open axis has the points' own width. */
static void
layers_are_as_thick_as_their_points(void)
{
    const hs_box   box = {.ndim = 2, .periodic = {true, false}, .rows = {{100.0}, {0.0, 1.0}}};
    harness_random random = {342};
    for (int i = 0; i < 30; i++) {
        x[2 * i] = 0.001 * random_unit(&random);
        x[2 * i + 1] = 500.0 * random_unit(&random);
    }
    x[1] = 0.0;
    x[3] = 500.0;
    const hs_points points = points_in(30, 2);
    nearest_unit_open(&points, NULL, &box, 1, HS_WANT_J, INFINITY, &unit);
    for (int32_t si = 0; si < 30; si++) {
        hs_nearest_group group;
        hs_nearest_group_set(&unit.near, si, si + 1, &group);
        hs_nearest_guess(&unit.near, &group);
        const double wanted = 2.0 + 3.5 * sqrt(2.0) + 1.0;
        const double radius = sqrt(wanted / 30.0 * 100.0 * 500.0 / 3.1416);
        CHECK(group.radius > 0.999 * radius && group.radius < 1.42 * radius);
    }
    nearest_unit_close(&unit);
}

/* A query far from all points looks as far as they are, and a little farther. */
static void
queries_outside_look_as_far_as_the_points_are(void)
{
    const double     q[2] = {1000.5, 0.5};
    harness_random   random = {343};
    const hs_points  points = points_in(MOST, 2), query = {q, 1, 2, HS_FLOAT64, 16, 8};
    hs_nearest_group group;
    for (int e = 0; e < 2 * MOST; e++)
        x[e] = random_unit(&random);
    nearest_unit_open(&points, &query, NULL, 1, HS_WANT_J, INFINITY, &unit);
    hs_nearest_group_set(&unit.near, 0, 1, &group);
    hs_nearest_guess(&unit.near, &group);
    CHECK(group.radius > 999.5 && group.radius < 1001.5);
    nearest_unit_close(&unit);
}

/* Where all points are wanted, or the radius passes the largest distance, nothing is beyond. */
static void
radii_that_hold_everything_are_complete(void)
{
    harness_random  random = {344};
    const hs_points points = points_in(100, 2);
    for (int e = 0; e < 2 * 100; e++)
        x[e] = random_unit(&random);
    for (int64_t k = 99; k <= 100; k++) {
        hs_nearest_group group;
        nearest_unit_open(&points, NULL, NULL, k, HS_WANT_J, INFINITY, &unit);
        hs_nearest_group_set(&unit.near, 0, 100, &group);
        hs_nearest_guess(&unit.near, &group);
        CHECK(group.is_complete && group.radius == hs_nearest_farthest(&unit.near, &group));
        nearest_unit_close(&unit);
    }
    for (int e = 0; e < 2; e++) {
        hs_nearest_group group;
        nearest_unit_open(&points, NULL, NULL, 2, HS_WANT_J, e ? 0.01 : 0.0, &unit);
        hs_nearest_group_set(&unit.near, 0, 1, &group);
        hs_nearest_guess(&unit.near, &group);
        CHECK(group.is_complete && group.radius < 0.0101);
        CHECK(e ? group.radius >= 0.01 : group.radius == HS_NEAREST_LEAST_RADIUS);
        nearest_unit_close(&unit);
    }
}

void
test_nearest_radius(void)
{
    RUN(exponents_end_at_the_least_radius);
    RUN(groups_have_the_range_of_their_points);
    RUN(groups_beside_a_layer_are_away);
    RUN(nothing_is_farther_than_all_points_or_the_largest_distance);
    RUN(first_radii_hold_what_is_wanted);
    RUN(flat_points_have_the_density_of_their_plane);
    RUN(few_points_have_the_density_of_all_of_them);
    RUN(few_points_have_the_density_of_their_box);
    RUN(layers_are_as_thick_as_their_points);
    RUN(queries_outside_look_as_far_as_the_points_are);
    RUN(radii_that_hold_everything_are_complete);
}
