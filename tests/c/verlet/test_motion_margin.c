/* SPDX-License-Identifier: BSD-3-Clause */
/* test_motion_margin.c: every rounding on the way from coordinates to a margin is taken off it,
 * with room, and not much more than that. */
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/box/strain.h"
#include "../../../csrc/core/verlet/motion.h"
#include "../support/harness.h"

#include <math.h>

void test_motion_margin(void);

#define UNIT 0x1p-53

enum { N = 6 };

static hs_frame built, now;
static hs_store jumps;

static void
take(const double *x, int64_t n, int d, const hs_box *box, hs_frame *frame)
{
    const hs_points  points = {x, n, d, HS_FLOAT64, d * 8, 8};
    const hs_options options = hs_options_default();
    hs_failure       failure;
    CHECK(hs_frame_take(&points, box, &options, frame, &failure) == HS_OK);
}

static double
margin_of(double radius, double cutoff, bool *jumped)
{
    const hs_options options = hs_options_default();
    const hs_motion  motion = {&built, &now, radius, cutoff};
    double           margin = NAN;
    CHECK(hs_motion_margin(&motion, &options, &margin, jumped, &jumps) == HS_OK);
    return margin;
}

static void
free_all(void)
{
    hs_frame_free(&built);
    hs_frame_free(&now);
    hs_store_free(&jumps);
}

/* What is gone of a skin though nothing has moved but by what all share, between `least`, which the
 * roundings need, and a few times that. */
static void
check_used(double used, double least)
{
    CHECK(used >= least && used <= 6.0 * least);
}

/* Points on a line of whole numbers up to 2^53: where they have gone is rounded, how far apart that
 * brings them is known. */
static void
rounded_ways_are_not_trusted(void)
{
    harness_random random = {53};
    for (int trial = 0; trial < 400; trial++) {
        const int64_t way = INT64_C(1) << (trial % 2 ? 53 : 40);
        double        x[2], y[2];
        int64_t       moved[2];
        bool          jumped;
        for (int i = 0; i < 2; i++) {
            const int64_t from = -way + (int64_t)(random_bits(&random) % 64);
            const int64_t to = way - (int64_t)(random_bits(&random) % 64);
            x[i] = (double)from;
            y[i] = (double)to;
            moved[i] = to - from;
        }
        const double closer = (double)llabs(moved[1] - moved[0]);
        take(x, 2, 1, NULL, &built);
        take(y, 2, 1, NULL, &now);
        CHECK(margin_of(1000.0 + closer, 1000.0, &jumped) <= 0.0 || closer == 0.0);
        CHECK(closer == 0.0 || margin_of(1000.0 + closer - 1.0, 1000.0, &jumped) < 0.0);
        CHECK(margin_of(1000.0 + closer + 0x1p-52 * 64.0 * (double)way, 1000.0, &jumped) > 0.0);
        CHECK(!jumped);
        free_all();
    }
}

/* All go the same way, far beyond where they were. */
static void
a_drift_is_known_to_its_last_place(void)
{
    const double cutoff = 0x1p-30, radius = 0x1p-29;
    double       x[2 * N] = {0.0}, y[2 * N];
    bool         jumped;
    for (int e = 0; e < 2 * N; e++) {
        x[e] = 0x1p-10 * e;
        y[e] = x[e] + 0x1p20;
    }
    take(x, N, 2, NULL, &built);
    take(y, N, 2, NULL, &now);
    /* Two roundings of 2^20 on each axis, of either point. */
    check_used(radius - cutoff - margin_of(radius, cutoff, &jumped),
               2.0 * sqrt(2.0) * 2.0 * UNIT * 0x1p20);
    free_all();
}

/* A box that grows by 2^-10, and points that grow with it: in exact numbers none of them moves. */
static void
a_deformation_costs_what_its_products_round(void)
{
    for (int d = 1; d <= 4; d++) {
        hs_box    before = {.ndim = d}, behind = {.ndim = d};
        double    x[4 * N], y[4 * N], largest = 0.0;
        hs_strain strain;
        bool      jumped;
        for (int k = 0; k < d; k++) {
            before.periodic[k] = behind.periodic[k] = true;
            for (int c = 0; c <= k; c++) {
                before.rows[k][c] = c == k ? 0x1p20 : 0x1p18;
                behind.rows[k][c] = before.rows[k][c] * (1.0 + 0x1p-10);
            }
        }
        for (int e = 0; e < d * N; e++) {
            x[e] = ldexp(1.0 + e, 14);
            y[e] = x[e] * (1.0 + 0x1p-10);
            largest = fmax(x[e], largest);
        }
        take(x, N, d, &before, &built);
        take(y, N, d, &behind, &now);
        CHECK(hs_strain_find(&before, &behind, &strain));
        const double radius = 0x1p-20, cutoff = 0x1p-21;
        const double sizes = largest * (1.0 + 0x1p-10) * 2.0;
        const double left = radius * strain.shrink - cutoff;
        check_used(left - margin_of(radius, cutoff, &jumped),
                   2.0 * sqrt(d) * ((2 * d + 1) * UNIT * sizes + strain.residual * largest));
        CHECK(!jumped && strain.residual > 0.0);
        free_all();
    }
}

/* All jump by many box vectors and a half: what they share is taken away before. */
static void
a_shared_jump_costs_two_differences(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    const double cutoff = 0x1p-31, radius = 0x1p-30;
    double       x[2 * N], y[2 * N];
    bool         jumped;
    for (int e = 0; e < 2 * N; e++) {
        x[e] = 0x1p-8 * e;
        y[e] = x[e] + 0x1p20 + 0.5;
    }
    take(x, N, 2, &box, &built);
    take(y, N, 2, &box, &now);
    const double used = radius - cutoff - margin_of(radius, cutoff, &jumped);
    CHECK(!jumped);
    check_used(used, 2.0 * sqrt(2.0) * 2.0 * UNIT * (0x1p20 + 0x1p20));
    free_all();
}

/* One of them jumps. */
static void
a_jump_of_one_costs_a_difference_and_its_wrapping(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    const double cutoff = 0x1p-31, radius = 0x1p-30;
    double       x[2 * N], y[2 * N];
    bool         jumped;
    for (int e = 0; e < 2 * N; e++)
        x[e] = y[e] = 0x1p-8 * e;
    y[4] += 0x1p20;
    take(x, N, 2, &box, &built);
    take(y, N, 2, &box, &now);
    const double used = radius - cutoff - margin_of(radius, cutoff, &jumped);
    CHECK(jumped && ((const int64_t *)jumps.data)[4] == INT64_C(1) << 20);
    check_used(used, 2.0 * sqrt(2.0) * UNIT * (0x1p20 + 0x1p21));
    free_all();
}

/* Two points that go apart by the whole skin leave nothing; a place less leaves a little. */
static void
motion_counts_twice(void)
{
    double x[2] = {0.0, 1.0}, y[2] = {-0.25, 1.25};
    bool   jumped;
    take(x, 2, 1, NULL, &built);
    take(y, 2, 1, NULL, &now);
    CHECK(margin_of(2.5, 2.0, &jumped) < 0.0);
    CHECK(margin_of(2.75, 2.0, &jumped) < 0.25 && margin_of(2.75, 2.0, &jumped) > 0.2499999999);
    CHECK(margin_of(0.75, 0.0, &jumped) < 0.25 && margin_of(0.75, 0.0, &jumped) > 0.2499999999);
    free_all();
}

void
test_motion_margin(void)
{
    RUN(rounded_ways_are_not_trusted);
    RUN(a_drift_is_known_to_its_last_place);
    RUN(a_deformation_costs_what_its_products_round);
    RUN(a_shared_jump_costs_two_differences);
    RUN(a_jump_of_one_costs_a_difference_and_its_wrapping);
    RUN(motion_counts_twice);
}
