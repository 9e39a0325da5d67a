/* SPDX-License-Identifier: BSD-3-Clause */
/* test_wrap_skewed.c: wrapping many points at once gives the bits of wrapping them one by one. */
#include <math.h>

#include "../../../csrc/core/box/wrap.h"
#include "../support/harness.h"
#include "../support/random_scenes.h"

void test_wrap_skewed(void);

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
along_an_axis(void)
{
    static const double reaches[] = {0.4, 1.0, 1.25, 1.5, 3.0, 0x1p40, 0x1p60};
    harness_random      random = {112358};
    int                 moved = 0;
    for (int trial = 0; trial < 700; trial++) {
        const double length = ldexp(1.0 + random_unit(&random), random_below(&random, 60) - 30);
        const double reach = reaches[trial % 7];
        hs_lattice   lattice = {.ndim = 1, .n_periodic = 1, .aligned = true, .period = {length}};
        hs_folded    found = hs_folded_none();
        double       largest = 0.0;
        bool         right = true;
        int64_t      failed = -1;
        for (int i = 0; i < POINTS; i++) {
            given[0][i] = folded_x[0][i] = place_near(&random, length, reach);
            largest = fmax(largest, fabs(given[0][i]));
        }
        const hs_turns turns = turns_here(trial % 2 && reach < 0x1p30);
        hs_fold_axis(&lattice, 0, folded_x[0], 0, POINTS, largest, trial % 3 ? &turns : NULL,
                     &found);
        for (int i = 0; i < POINTS; i++) {
            int64_t      turned;
            const double inside = hs_wrap_axis(given[0][i], length, &turned);
            right = right && same_bits(inside, folded_x[0][i]);
            right = right && fabs(inside) <= found.x_largest[0];
            if (turned == HS_WRAP_UNKNOWN) {
                failed = failed < 0 ? i : failed;
            } else if (trial % 3) {
                right = right && hs_turns_get(&turns, 0, i) == turned;
            }
            moved += turned != 0;
        }
        CHECK(right);
        CHECK(found.failed == (trial % 3 ? failed : -1));
    }
    CHECK(moved > 100000);
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

/* Turns over the rows of B, and over the box vectors as given, of points this far out: no more than
 * are told, which are as many as the largest of both may be. The lattice is set as far as the box
 * has vectors, and nothing behind that counts. */
static void
turns_are_bounded(void)
{
    static const double skews[] = {0.5, 30.0, 1e6};
    harness_random      random = {271828};
    int                 skewed = 0;
    for (int trial = 0; trial < 600; trial++) {
        const int    ndim = 1 + trial % 4;
        const double skew = skews[trial / 4 % 3], largest = ldexp(1.0, trial % 20);
        hs_box       box = {.ndim = ndim};
        hs_lattice   lattice;
        double       most = 4.0, over_given = 0.0, sums = 0.0;
        for (int l = 0; l < ndim; l++) { /* each vector in turn is the long one */
            box.periodic[l] = ndim < 3 || l != trial % 5;
            box.rows[l][l] = 0.5 + random_unit(&random);
            if (l == trial / 12 % ndim)
                box.rows[l][(l + 1) % ndim] += ndim > 1 ? skew * random_unit(&random) : 0.0;
        }
        memset(&lattice, 0x7b, sizeof lattice);
        hs_lattice_init(&box, ndim, hs_scale_of(0), &lattice);
        for (int r = 0; r < lattice.n_periodic; r++) {
            for (int l = 0; l < lattice.n_periodic; l++) {
                sums = fmax(sums, fabs((double)lattice.U[r][l]));
            }
        }
        const double told = hs_fold_turns(&lattice, largest);
        for (int p = 0; p < 50 && lattice.n_periodic > 0; p++) {
            double  x[HS_MAX_DIM], inside[HS_MAX_DIM], magnitude = 0.0;
            int64_t turns[HS_MAX_DIM], of_given[HS_MAX_DIM];
            for (int k = 0; k < ndim; k++)
                x[k] = p == 0 ? largest : largest * (2.0 * random_unit(&random) - 1.0);
            CHECK(hs_wrap_point(&lattice, x, inside, turns, &magnitude));
            CHECK(hs_lattice_shift(&lattice, turns, of_given));
            for (int r = 0; r < lattice.n_periodic; r++) {
                CHECK(fabs((double)turns[r]) <= told && fabs((double)of_given[r]) <= told);
                over_given = fmax(over_given, fabs((double)of_given[r]));
            }
        }
        for (int k = 0; k < ndim; k++) {
            if (lattice.row_of_axis[k] >= 0)
                most = fmax(most, ndim * largest / lattice.period[k] + 4.0);
        }
        CHECK(told <= most * fmax(1.0, sums) * ndim);
        CHECK(lattice.n_periodic > 0 || told == 0.0);
        skewed += over_given > 100.0 * most;
    }
    CHECK(skewed > 50);
}

/* The range of both, and the lowest point that failed in either. */
static void
what_is_found_is_joined(void)
{
    static const int64_t failed[][3] = {{-1, -1, -1}, {-1, 7, 7}, {7, -1, 7}, {3, 7, 3}, {7, 3, 3}};
    for (int f = 0; f < 5; f++) {
        hs_folded one = hs_folded_none(), other = hs_folded_none();
        one.failed = failed[f][0];
        other.failed = failed[f][1];
        one.lower[1] = one.upper[1] = 2.0;
        other.lower[1] = -3.0;
        other.upper[1] = 1.0;
        one.x_largest[1] = 5.0;
        other.magnitude = 8.0;
        hs_folded_join(&one, &other);
        CHECK(one.failed == failed[f][2]);
        CHECK(one.lower[1] == -3.0 && one.upper[1] == 2.0);
        CHECK(one.x_largest[1] == 5.0 && one.magnitude == 8.0);
        CHECK(one.lower[0] == INFINITY && one.upper[0] == -INFINITY);
    }
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
test_wrap_skewed(void)
{
    RUN(what_is_found_is_joined);
    RUN(coordinates_are_summed_in_one_order);
    RUN(turns_are_bounded);
    RUN(along_an_axis);
    RUN(in_any_box);
}
