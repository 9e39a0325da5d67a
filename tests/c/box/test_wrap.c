/* SPDX-License-Identifier: BSD-3-Clause */
/* test_wrap.c: points come into the box by the turns that are told, to the nearest image if that
 * is wanted. */
#include "../../../csrc/core/box/wrap.h"
#include "../support/harness.h"
#include "../support/random_scenes.h"

#include <float.h>
#include <math.h>

void test_wrap(void);

/* Wrap: wrapped coordinates against big integers: nothing may get lost, however far away. */

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

/* Of parts that are joined in any order, the lowest point that failed. */
static void
the_lowest_failure_is_told(void)
{
    const int64_t failed[4] = {-1, 0, 3, 5};
    for (int a = 0; a < 4; a++) {
        for (int b = 0; b < 4; b++) {
            hs_folded       joined = hs_folded_none();
            const hs_folded none = hs_folded_none();
            hs_folded       parts[2] = {none, none};
            parts[0].failed = failed[a];
            parts[1].failed = failed[b];
            hs_folded_join(&joined, &parts[0]);
            hs_folded_join(&joined, &parts[1]);
            CHECK(joined.failed == (a == 0 || b == 0 ? failed[a + b] : failed[a < b ? a : b]));
        }
    }
}

/* Wrap skewed: wrapping many points at once gives the bits of wrapping them one by one. */

enum { POINTS = 700 }; /* two whole tiles and a part of one */

static double  given[HS_MAX_DIM][POINTS], folded_x[HS_MAX_DIM][POINTS];
static int32_t narrow[HS_MAX_DIM][POINTS];
static int64_t wide[HS_MAX_DIM][POINTS];

static bool
same_bits(double a, double b)
{
    return memcmp(&a, &b, sizeof a) == 0;
}

static hs_turns
turns_here(bool is_narrow)
{
    hs_turns turns = {.known = true};
    for (int r = 0; r < HS_MAX_DIM; r++) {
        turns.narrow[r] = is_narrow ? narrow[r] : NULL;
        turns.wide[r] = is_narrow ? NULL : wide[r];
    }
    return turns;
}

/* Near a multiple of half the length, a few doubles off, or anywhere up to `reach` lengths. */
static double
place_near(harness_random *random, double length, double reach)
{
    double x = (2.0 * random_unit(random) - 1.0) * reach * length;
    if (random_below(random, 3) == 0) {
        x = rint(2.0 * x / length) * (0.5 * length);
        for (int step = random_below(random, 3); step > 0; step--) {
            x = nextafter(x, random_below(random, 2) ? INFINITY : -INFINITY);
        }
    }
    return random_below(random, 20) ? x : random_below(random, 2) ? -0.0 : 0.0;
}

static void
set_skewed_box(harness_random *random, int ndim, hs_box *box)
{
    *box = (hs_box){.ndim = ndim};
    for (int l = 0; l < ndim; l++) {
        box->periodic[l] = l < 2 || random_below(random, 4) > 0;
        for (int k = 0; k < ndim; k++) {
            const double skew = random_below(random, 4) ? random_unit(random) - 0.5 : 0.0;
            box->rows[l][k] = l == k ? 5.0 + random_unit(random) : 4.0 * skew;
        }
    }
}

/* Checks the folded points against hs_wrap_point; returns how many took turns. */
static int
check_points(const hs_lattice *lattice, const hs_turns *turns, const hs_folded *found)
{
    double magnitude = 0.0;
    bool   right = true;
    int    moved = 0;
    for (int i = 0; i < POINTS; i++) {
        double  r[HS_MAX_DIM], inside[HS_MAX_DIM];
        int64_t turned[HS_MAX_DIM];
        bool    moves = false;
        for (int k = 0; k < lattice->ndim; k++) {
            r[k] = given[k][i];
        }
        CHECK(hs_wrap_point(lattice, r, inside, turned, &magnitude));
        for (int row = 0; row < lattice->n_periodic; row++) {
            right = right && hs_turns_get(turns, row, i) == turned[row];
            moves = moves || turned[row] != 0;
        }
        for (int k = 0; k < lattice->ndim; k++) {
            const double t = hs_lattice_coordinate(lattice, inside, k);
            right = right && same_bits(inside[k], folded_x[k][i]);
            right = right && t >= found->lower[k] && t <= found->upper[k];
            right = right && fabs(inside[k]) <= found->x_largest[k];
        }
        moved += moves;
    }
    CHECK(right);
    CHECK(same_bits(magnitude, found->magnitude));
    return moved;
}

static void
in_any_box(void)
{
    static const double reaches[] = {0.6, 1.5, 40.0, 0x1p18, 0x1p25};
    harness_random      random = {314159};
    int                 quick = 0, moved = 0;
    for (int trial = 0; trial < 600; trial++) {
        const int  ndim = 2 + trial / 5 % 5;
        hs_box     box;
        hs_lattice lattice;
        hs_folded  found = hs_folded_none();
        double     largest = 0.0;
        double    *r[HS_MAX_DIM], *x[HS_MAX_DIM];
        set_skewed_box(&random, ndim, &box);
        hs_lattice_init(&box, ndim, hs_scale_of(0), &lattice);
        if (lattice.aligned) {
            continue;
        }
        for (int k = 0; k < ndim; k++) {
            r[k] = given[k];
            x[k] = folded_x[k];
            for (int i = 0; i < POINTS; i++) {
                given[k][i] = place_near(&random, box.rows[k][k], reaches[trial % 5]);
                largest = fmax(largest, fabs(given[k][i]));
            }
        }
        const bool     few = hs_fold_turns(&lattice, largest) <= HS_FOLD_TURNS;
        const hs_turns turns = turns_here(trial % 2 && few);
        const bool     said = few && trial % 3; /* or else looked at, to the same bits */
        hs_fold_points(&lattice, said, r, 0, 100, x, &turns, &found);
        hs_fold_points(&lattice, said, r, 100, POINTS, x, &turns, &found);
        CHECK(found.failed == -1);
        moved += check_points(&lattice, &turns, &found);
        quick += few;
    }
    CHECK(quick > 200);
    CHECK(moved > 100000);
}

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

void
test_wrap(void)
{
    RUN(the_lowest_failure_is_told);
    RUN(what_does_not_settle_is_as_many_rows_away);
    RUN(coordinates_are_summed_in_one_order);
    RUN(in_any_box);
}
