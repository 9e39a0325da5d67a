/* SPDX-License-Identifier: BSD-3-Clause */
/* test_unit.c: the power of two that a scene is scaled by, and how far far is. */
#include "../../../csrc/core/scene/unit.h"
#include "../support/harness.h"

#include <float.h>
#include <math.h>

void test_unit(void);

/* Points from low to high along each axis; `x` is theirs. */
static hs_cloud
cloud_of(int ndim, double low, double high, double *x)
{
    hs_cloud cloud = {.n = 2, .ndim = ndim, .largest = fmax(-low, high)};
    x[0] = low;
    x[1] = high;
    for (int k = 0; k < ndim; k++) {
        cloud.x[k] = x;
        cloud.lower[k] = low;
        cloud.upper[k] = high;
    }
    return cloud;
}

static void
exponents_of_all_numbers(void)
{
    CHECK(hs_exponent_of(1.0) == 0 && hs_exponent_of(1.9) == 0 && hs_exponent_of(2.0) == 1);
    CHECK(hs_exponent_of(-0.75) == -1 && hs_exponent_of(DBL_MAX) == 1023);
    CHECK(hs_exponent_of(0x1p-1074) == -1074 && hs_exponent_of(0x1.8p-1060) == -1060);
    CHECK(hs_exponent_of(0.0) < -4000 && hs_exponent_of(INFINITY) > 4000);
    CHECK(hs_exponent_of(0.0) == -hs_exponent_of(INFINITY));
    CHECK(hs_exponent_of(0.0) - hs_exponent_of(INFINITY) < 0); /* no overflow */
}

static void
sizes_of_a_box_are_those_of_periodic_rows(void)
{
    const hs_box box = {.ndim = 3,
                        .periodic = {true, false, true},
                        .rows = {{-8.0, 0.25, 0.0}, {1e9, 1e-9, 1e9}, {0.0, 0.5, 2.0}}};
    const hs_box open = {.ndim = 2, .rows = {{1.0, 0.0}, {0.0, 1.0}}};
    hs_box_size  size = hs_box_size_of(&box);
    CHECK(size.largest == 8.0 && size.smallest == 0.25 && size.short_row == 2.0);
    CHECK(size.moved == 7 && size.is_coupled);
    for (int none = 0; none < 2; none++) {
        size = hs_box_size_of(none ? NULL : &open);
        CHECK(size.largest == 0.0 && size.smallest == INFINITY && size.short_row == INFINITY);
        CHECK(size.moved == 0 && !size.is_coupled);
    }
}

/* What one row alone moves, for rows of a box and among those that count. */
static void
one_row_moves_a_column(void)
{
    const hs_box box = {.ndim = 3,
                        .periodic = {true, true, false},
                        .rows = {{0.0, 2.0, 0.0}, {3.0, 0.0, 0.0}, {1.0, 1.0, 1.0}}};
    const bool   all[3] = {true, true, true};
    CHECK(hs_mover_of(NULL, 0) == HS_OPEN && hs_mover_of(&box, 2) == HS_OPEN);
    CHECK(hs_mover_of(&box, 0) == 1 && hs_mover_of(&box, 1) == 0);
    hs_box coupled = box;
    memcpy(coupled.periodic, all, sizeof all);
    for (int k = 0; k < 3; k++)
        CHECK(hs_mover_of(&coupled, k) == HS_COUPLED);
    const hs_box_size size = hs_box_size_of(&box), of_coupled = hs_box_size_of(&coupled);
    CHECK(!size.is_coupled && size.moved == 3 && of_coupled.is_coupled && of_coupled.moved == 7);
    CHECK(hs_is_far(0x1.8p60, 6, 54) && !hs_is_far(0x1p60, 6, 54));
    CHECK(hs_is_far(0x1p-1074, hs_exponent_of(0.0), 54));
    CHECK(!hs_is_far(0x1p1023, hs_exponent_of(INFINITY), 54));
}

/* A cutoff far beyond all distances is as good as one that is 2^8 times the largest coordinate. */
static void
cutoffs_beyond_everything_become_smaller(void)
{
    const hs_box      box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const hs_box_size none = hs_box_size_of(NULL), some = hs_box_size_of(&box);
    double            x[2];
    hs_cloud          cloud = cloud_of(1, -3.0, 1.0, x);
    CHECK(hs_enough_cutoff(&cloud, &none, 192.0) == 192.0); /* 64 times as much is not enough */
    CHECK(hs_enough_cutoff(&cloud, &none, 256.0) == 256.0);
    CHECK(hs_enough_cutoff(&cloud, &none, 512.0) == 512.0);
    CHECK(hs_enough_cutoff(&cloud, &none, 513.0) == 512.0);
    CHECK(hs_enough_cutoff(&cloud, &none, DBL_MAX) == 512.0);
    CHECK(hs_enough_cutoff(&cloud, &some, 513.0) == 513.0); /* images are at any distance */
    cloud = cloud_of(1, 0.0, 0.0, x);
    CHECK(hs_enough_cutoff(&cloud, &none, 513.0) == 513.0);
    cloud = cloud_of(1, 0.0, 0x1p1015, x);
    CHECK(hs_enough_cutoff(&cloud, &none, DBL_MAX) == 0x1p1023);
    cloud = cloud_of(1, 0.0, 0x1p1016, x);
    CHECK(hs_enough_cutoff(&cloud, &none, DBL_MAX) == DBL_MAX);
}

static void
the_unit_is_the_cutoff_or_the_box_or_the_points(void)
{
    const hs_box      box = {.ndim = 1, .periodic = {true}, .rows = {{-40.0}}};
    const hs_box_size none = hs_box_size_of(NULL), some = hs_box_size_of(&box);
    double            x[2];
    const hs_cloud    cloud = cloud_of(1, -3.0, 1.0, x), spot = cloud_of(1, 0.0, 0.0, x);
    CHECK(hs_unit_exponent(&cloud, &some, 0.25) == -2);
    CHECK(hs_unit_exponent(&cloud, &some, 0.0) == 5);
    CHECK(hs_unit_exponent(&cloud, &none, 0.0) == 1);
    CHECK(hs_unit_exponent(&spot, &none, 0.0) == hs_exponent_of(0.0));
}

static void
one_scale_holds_so_many_powers(void)
{
    const hs_box      box = {.ndim = 1, .periodic = {true}, .rows = {{0x1p20}}};
    const hs_box_size none = hs_box_size_of(NULL), some = hs_box_size_of(&box);
    double            x[2];
    const hs_cloud    cloud = cloud_of(1, -0x1p10, 0x1p9, x);
    CHECK(hs_fits_one_scale(&cloud, &none, 4, 6) && !hs_fits_one_scale(&cloud, &none, 4, 5));
    CHECK(hs_fits_one_scale(&cloud, &some, 4, 16) && !hs_fits_one_scale(&cloud, &some, 4, 15));
}

/* A coupled box drowns in what lies along open axes; an aligned one never does. */
static void
open_axes_drown_coupled_boxes(void)
{
    hs_box   box = {.ndim = 3, .periodic = {true, true, false}, .rows = {{1.0, 0.5}, {0.0, 1.0}}};
    double   x[2];
    hs_cloud cloud = cloud_of(3, 0.0, 1.0, x);
    cloud.lower[2] = -0x1p88;
    hs_box_size size = hs_box_size_of(&box);
    CHECK(!hs_open_drowns_box(&cloud, &size, 0.5));
    cloud.lower[2] = -0x1.001p88;
    CHECK(hs_open_drowns_box(&cloud, &size, 0.5) && !hs_open_drowns_box(&cloud, &size, 2.0));
    cloud.lower[2] = 0.0;
    cloud.upper[2] = 0x1.001p88;
    CHECK(hs_open_drowns_box(&cloud, &size, 0.5));
    cloud.upper[2] = 1.0;
    cloud.upper[1] = 0x1.001p88; /* wrapping takes that away */
    CHECK(!hs_open_drowns_box(&cloud, &size, 0.5));
    cloud.upper[2] = 0x1p1000;
    box.rows[0][1] = 0.0;
    size = hs_box_size_of(&box);
    CHECK(!hs_open_drowns_box(&cloud, &size, 0.5));
}

/* Ordinary cutoffs are not scaled at all; others become 1, unless other numbers get too large. */
static void
ordinary_cutoffs_are_not_scaled(void)
{
    const int         asked[] = {-20, -21, 0, 20, 21, 300}, chosen[] = {0, -21, 0, 0, 21, 300};
    const hs_box_size none = hs_box_size_of(NULL);
    double            x[2];
    hs_cloud          cloud = cloud_of(1, -1.0, 1.0, x);
    bool              extreme = true;
    for (int e = 0; e < 6; e++) {
        CHECK(hs_choose_exponent(&cloud, &none, ldexp(1.0, asked[e]), asked[e], 56, &extreme) ==
              chosen[e]);
        CHECK(!extreme);
    }
    CHECK(hs_choose_exponent(&cloud, &none, 0.0, hs_exponent_of(0.0), 56, &extreme) == 0);
    cloud = cloud_of(1, -0x1p56, 0.5, x);
    CHECK(hs_choose_exponent(&cloud, &none, 1.0, 0, 56, &extreme) == 0);
    cloud = cloud_of(1, -0x1p57, 0.5, x);
    CHECK(hs_choose_exponent(&cloud, &none, 1.0, 0, 56, &extreme) == 1 && !extreme);
    cloud = cloud_of(1, 0.0, 0x1p950, x);
    CHECK(hs_choose_exponent(&cloud, &none, 1.0, 0, 900, &extreme) == 50 && !extreme);
    cloud = cloud_of(1, -0x1p-1000, 0x1p-1000, x);
    CHECK(hs_choose_exponent(&cloud, &none, 0x1p-1001, -1001, 56, &extreme) == -1001);
}

/* Points are 2^52 box vectors away at most, by the time they are scaled; along open axes
 * anywhere. */
static void
what_is_wrapped_does_not_choose(void)
{
    const hs_box      box = {.ndim = 2, .periodic = {true, false}, .rows = {{4.0}}};
    const hs_box_size size = hs_box_size_of(&box);
    double            x[2];
    bool              extreme;
    hs_cloud          cloud = cloud_of(2, -0x1p600, 0x1p600, x);
    cloud.lower[1] = -1.0;
    cloud.upper[1] = 1.0;
    CHECK(hs_choose_exponent(&cloud, &size, 1.0, 0, 52, &extreme) == 2);
    cloud.upper[1] = 0x1p920;
    CHECK(hs_choose_exponent(&cloud, &size, 1.0, 0, 52, &extreme) == 20);
}

/* Scaling loses digits from the first number on that would be subnormal. */
static void
scaling_is_extreme_from_the_subnormal_numbers_on(void)
{
    for (int below = 0; below < 4; below++) {
        double            x[1] = {ldexp(1.75, -722 - below)};
        const hs_box_size none = hs_box_size_of(NULL);
        bool              extreme;
        hs_cloud          cloud = {.n = 1, .ndim = 1, .x = {x}, .largest = x[0]};
        cloud.lower[0] = cloud.upper[0] = x[0];
        const int exponent =
            hs_choose_exponent(&cloud, &none, 0x1p300, 300, HS_LARGEST_EXPONENT, &extreme);
        CHECK(exponent == 300 && extreme == (below > 0));
    }
}

/* The smallest of all that must not lose digits: box entries and the cutoff, too. */
static void
the_box_and_the_cutoff_may_be_extreme(void)
{
    double   x[2];
    hs_cloud cloud = cloud_of(1, 1.0, 2.0, x);
    for (int below = 0; below < 2; below++) {
        const hs_box      box = {.ndim = 2,
                                 .periodic = {true, true},
                                 .rows = {{0x1p300}, {0.0, ldexp(1.0, -722 - below)}}};
        const hs_box_size size = hs_box_size_of(&box), none = hs_box_size_of(NULL);
        bool              extreme;
        CHECK(hs_choose_exponent(&cloud, &size, 0x1p300, 300, 56, &extreme) == 300);
        CHECK(extreme == (below > 0));
        (void)hs_choose_exponent(&cloud, &none, ldexp(1.0, -722 - below), 300, 56, &extreme);
        CHECK(extreme == (below > 0));
        (void)hs_choose_exponent(&cloud, &none, 0.0, 300, 56, &extreme);
        CHECK(!extreme);
        (void)hs_choose_exponent(&cloud, &size, 0x1p300, -300, 2000, &extreme); /* up, not down */
        CHECK(!extreme);
    }
}

void
test_unit(void)
{
    RUN(exponents_of_all_numbers);
    RUN(sizes_of_a_box_are_those_of_periodic_rows);
    RUN(one_row_moves_a_column);
    RUN(cutoffs_beyond_everything_become_smaller);
    RUN(the_unit_is_the_cutoff_or_the_box_or_the_points);
    RUN(one_scale_holds_so_many_powers);
    RUN(open_axes_drown_coupled_boxes);
    RUN(ordinary_cutoffs_are_not_scaled);
    RUN(what_is_wrapped_does_not_choose);
    RUN(scaling_is_extreme_from_the_subnormal_numbers_on);
    RUN(the_box_and_the_cutoff_may_be_extreme);
}
