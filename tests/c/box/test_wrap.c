/* SPDX-License-Identifier: BSD-3-Clause */
/* test_wrap.c: points come into the box by the turns that are told, to the nearest image if that
 * is wanted. */
#include "../../../csrc/core/box/wrap.h"
#include "../support/harness.h"
#include "../support/random_scenes.h"

#include <math.h>

void test_wrap(void);

/* ---- wrapped coordinates against big integers: nothing may get lost, however far away ---- */

/* A lattice whose period is not that of its row: every pass finds turns anew, and what is left
 * after the last one is the point less as many rows. */
static void
what_does_not_settle_is_as_many_rows_away(void)
{
    hs_lattice lattice;
    memset(&lattice, 0, sizeof lattice);
    lattice.ndim = lattice.n_periodic = 1;
    lattice.scaled[0][0] = lattice.rows[0][0] = lattice.normal[0][0] = 1.0;
    lattice.U[0][0] = 1;
    for (int trial = 0; trial < 2; trial++) {
        const double r = 0.75 + trial;
        double       inside = NAN, magnitude = 0.0;
        int64_t      turns = -1;
        lattice.period[0] = 0.375;
        CHECK(hs_wrap_point(&lattice, &r, &inside, &turns, &magnitude));
        CHECK(turns != 0 && inside == r - (double)turns && fabs(inside) > 0.5);
        CHECK(magnitude >= fabs(r) + fabs((double)turns));
        lattice.period[0] = 1.0;
        CHECK(hs_wrap_point(&lattice, &r, &inside, &turns, &magnitude));
        CHECK(inside == r - (double)turns && fabs(inside) <= 0.5);
    }
}

/* ---- wrapping many points at once gives the bits of wrapping them one by one ---- */

enum { POINTS = 700 }; /* two whole tiles and a part of one */

static double given[HS_MAX_DIM][POINTS], folded_x[HS_MAX_DIM][POINTS];

/* Coordinates of many points have the bits of those of one. */
static void
coordinates_are_summed_in_one_order(void)
{
    harness_random random = {77};
    for (int trial = 0; trial < 200; trial++) {
        const int     ndim = 1 + trial % HS_MAX_DIM;
        const double *x[HS_MAX_DIM];
        hs_lattice    lattice = {.ndim = ndim};
        bool          same = true;
        for (int k = 0; k < ndim; k++) {
            x[k] = given[k];
            lattice.normal[0][k] = random_unit(&random) - 0.5;
            for (int i = 0; i < POINTS; i++) {
                given[k][i] = ldexp(random_unit(&random) - 0.5, random_below(&random, 40) - 20);
            }
        }
        hs_fold_coordinates(&lattice, 0, x, POINTS, folded_x[0]);
        for (int i = 0; i < POINTS; i++) {
            double r[HS_MAX_DIM];
            for (int k = 0; k < ndim; k++) {
                r[k] = given[k][i];
            }
            same = same && same_bits(hs_lattice_coordinate(&lattice, r, 0), folded_x[0][i]);
        }
        CHECK(same);
    }
}

/* The magnitude is that of all numbers that went in, also of a point that stays where it is. */
static void
points_that_stay_have_a_magnitude(void)
{
    const hs_box box = {.ndim = 2, .rows = {{4.0, 1.0}}, .periodic = {true, false}};
    const double r[2] = {0.5, -300.0};
    double       inside[2], magnitude = 0.0;
    int64_t      turns;
    hs_lattice   lattice;
    hs_lattice_init(&box, 2, hs_scale_of(0), &lattice);
    const double along = r[0] * 4.0 + r[1];
    CHECK(fabs(along) > 8.5); /* so that this one moves */
    CHECK(hs_wrap_point(&lattice, r, inside, &turns, &magnitude) && magnitude >= 300.0);
    const double near_zero[2] = {0.5, 0.25};
    magnitude = 0.0;
    CHECK(hs_wrap_point(&lattice, near_zero, inside, &turns, &magnitude));
    CHECK(turns == 0 && magnitude == 0.5);
}

/* The unit is that of the longest component: squares of others do not tell whether these fit. */
static void
rows_may_be_long_along_any_axis(void)
{
    const double p[2] = {0.0, 0.0};
    for (int k = 0; k < 2; k++) {
        hs_box       box = {.ndim = 2, .periodic = {true, false}};
        double       q[2];
        hs_image_box images;
        int64_t      shift = 99;
        box.rows[0][k] = 0x1p1000;
        box.rows[0][1 - k] = 1.0;
        q[k] = 0.75 * 0x1p1000;
        q[1 - k] = 0.75;
        CHECK(hs_image_box_init(&box, 2, &images) == HS_OK);
        CHECK(hs_near_image(&images, p, q, &shift) == HS_OK && shift == -1);
        CHECK(hs_near_image(&images, q, p, &shift) == HS_OK && shift == 1);
    }
}

void
test_wrap(void)
{
    RUN(what_does_not_settle_is_as_many_rows_away);
    RUN(coordinates_are_summed_in_one_order);
    RUN(points_that_stay_have_a_magnitude);
    RUN(rows_may_be_long_along_any_axis);
}
