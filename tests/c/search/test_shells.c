/* SPDX-License-Identifier: BSD-3-Clause */
/* test_shells.c: the table tells which edges a distance is above, or that it is too near to one;
 * refused memory leaves nothing. */
#include "../../../csrc/core/search/shells.h"
#include "../support/harness.h"
#include "../support/poll_checks.h"

#include <math.h>
#include <string.h>

void test_shells(void);

enum { MOST = 2000 };

static hs_scene  scene;
static hs_shells shells;
static double    cutoffs[MOST];

/* Shells of the first n cutoffs. */
static hs_status
open_shells(int64_t n)
{
    hs_options options = hs_options_default();
    scene.scale = hs_scale_of(0);
    options.want = HS_WANT_SHELL;
    options.n_shells = n;
    options.shells = cutoffs;
    options.cutoff = cutoffs[n - 1];
    return hs_shells_open(NULL, &scene, &options, &shells);
}

/* What is found for one distance is what comparing it with all bands says. */
static void
check_distance(double distance)
{
    int32_t below = 0, maybe = 0, shell, low, high;
    for (int64_t k = 0; k < shells.n; k++) {
        below += shells.high[k] < distance;
        maybe += shells.low[k] <= distance;
    }
    const bool is_open = hs_shells_find(&shells, &distance, 1, &shell);
    CHECK(is_open || (shell == below && maybe == below));
    CHECK(shell <= below && shell >= 0);
    low = shell;
    hs_shells_range(&shells, distance, &low, &high);
    CHECK(low == below && high == maybe);
}

static void
check_shells(int64_t n, uint64_t seed)
{
    harness_random random = {seed};
    CHECK(open_shells(n) == HS_OK && shells.n == n - 1);
    for (int64_t k = 0; k < n; k++) {
        double at = cutoffs[k];
        for (int step = 0; step < 12; step++, at = nextafter(at, 0.0))
            check_distance(at);
        at = cutoffs[k];
        for (int step = 0; k < n - 1 && step < 12 && at < cutoffs[n - 1]; step++) {
            at = nextafter(at, INFINITY);
            check_distance(at);
        }
    }
    for (int t = 0; t < 200; t++)
        check_distance(cutoffs[n - 1] * random_unit(&random));
    hs_shells_free(NULL, &shells);
    hs_shells_free(NULL, &shells);
}

/* Few, on the limits of cells, crowded, from zero on, over the whole range of numbers. */
static void
distances_are_placed_between_edges(void)
{
    for (int64_t n = 2; n <= 8; n++) {
        for (int64_t k = 0; k < n; k++)
            cutoffs[k] = 0.5 * (double)(k + 1);
        check_shells(n, (uint64_t)n);
    }
    for (int64_t k = 0; k < MOST; k++)
        cutoffs[k] = 1.0 + 1e-4 * (double)k;
    check_shells(MOST, 1);
    for (int64_t k = 0; k < 5; k++)
        cutoffs[k] = k < 3 ? 0.0 : 0.25 * (double)k;
    check_shells(5, 2);
    for (int64_t k = 0; k < 3; k++)
        cutoffs[k] = 0.0;
    check_shells(3, 3);
    for (int64_t k = 0; k < 601; k++)
        cutoffs[k] = ldexp(1.0, (int)(3.4 * (double)k) - 1074);
    check_shells(601, 4);
    cutoffs[0] = 0x1p-1074;
    cutoffs[1] = 1.0;
    cutoffs[2] = cutoffs[3] = 1.0 + 0x1p-52;
    cutoffs[4] = HUGE_VAL / 2 > 1e308 ? 1.7976931348623157e308 : 1e308;
    check_shells(5, 5);
    check_shells(1, 6);
}

/* Where none are wanted there are none, whatever the options hold. */
static void
shells_are_opened_where_they_are_wanted(void)
{
    hs_options options = hs_options_default();
    double     distance = 1.0;
    int32_t    shell = 7;
    options.n_shells = 3;
    CHECK(hs_shells_open(NULL, &scene, &options, &shells) == HS_OK);
    CHECK(shells.n == 0 && shells.edge == NULL);
    CHECK(!hs_shells_find(&shells, &distance, 1, &shell) && shell == 0);
    hs_shells_free(NULL, &shells);
}

/* A scene that lost digits compares in the caller's unit. */
static void
edges_are_those_of_the_metric(void)
{
    cutoffs[0] = 3.0;
    cutoffs[1] = 5.0;
    hs_options options = hs_options_default();
    options.want = HS_WANT_SHELL;
    options.n_shells = 2;
    options.shells = cutoffs;
    options.cutoff = 5.0;
    scene.scale = hs_scale_of(4);
    for (int lost = 0; lost < 2; lost++) {
        scene.extreme = lost;
        CHECK(hs_shells_open(NULL, &scene, &options, &shells) == HS_OK);
        CHECK(shells.edge[0] == 3.0 &&
              shells.at[0] == (lost ? 3.0 : hs_scale_apply(scene.scale, 3.0)));
        hs_shells_free(NULL, &shells);
    }
    scene.extreme = false;
}

/* On the right side of both edges, and no further than that. */
static void
distances_are_kept_between_edges(void)
{
    cutoffs[0] = 1.0;
    cutoffs[1] = 2.0;
    cutoffs[2] = 3.0;
    CHECK(open_shells(3) == HS_OK);
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        shells.inclusive = inclusive;
        const double above = inclusive ? nextafter(1.0, 2.0) : 1.0;
        const double below = inclusive ? 2.0 : nextafter(2.0, 1.0);
        CHECK(hs_shells_keep(&shells, 0, 0.5) == 0.5);
        CHECK(hs_shells_keep(&shells, 0, 1.5) == (inclusive ? 1.0 : nextafter(1.0, 0.0)));
        CHECK(hs_shells_keep(&shells, 1, nextafter(1.0, 0.0)) == above);
        CHECK(hs_shells_keep(&shells, 1, 1.5) == 1.5);
        CHECK(hs_shells_keep(&shells, 1, nextafter(2.0, 3.0)) == below);
        CHECK(hs_shells_keep(&shells, 2, nextafter(2.0, 0.0)) ==
              (inclusive ? nextafter(2.0, 3.0) : 2.0));
        CHECK(hs_shells_keep(&shells, 2, 3.0) == 3.0);
    }
    hs_shells_free(NULL, &shells);
}

static hs_status
open_and_free(void *context)
{
    const hs_status status = open_shells(3);
    (void)context;
    hs_shells_free(NULL, &shells);
    return status;
}

static void
refused_memory_leaves_nothing(void)
{
    CHECK(fail_each_allocation(open_and_free, NULL, 5) == 3);
}

void
test_shells(void)
{
    RUN(distances_are_placed_between_edges);
    RUN(shells_are_opened_where_they_are_wanted);
    RUN(edges_are_those_of_the_metric);
    RUN(distances_are_kept_between_edges);
    RUN(refused_memory_leaves_nothing);
}
