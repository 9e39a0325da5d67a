/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_reach.c: candidates left out because they are far from the box of a group are beyond the
 * cutoff of all its points, in floating-point systems so small that every number can be tried.
 */
#include "../../../csrc/core/exact/filter.h"
#include "../support/harness.h"
#include "../support/tiny_floats.h"

void test_reach(void);

/* Whether |y| + |q| is within the bound for the smallest distance that y and q can mean. used: what
 * share of the bound it is. */
static bool
reach_holds(const tiny_system *system, double y, double q, double error, double *used)
{
    double low, high;
    distance_interval(system, y, q, error, &low, &high);
    const double bound = hs_reach_bound(low, fabs(q), error, system->unit, system->tiny);
    *used = (fabs(y) + fabs(q)) / bound;
    return fabs(y) + fabs(q) <= bound;
}

static void
no_pair_within_reaches_farther(void)
{
    static const int lowest[] = {-12, -3, 0, 3}; /* 3: the flushes dwarf everything else */
    double           numbers[512], used, most_used = 0.0;
    int              wrong = 0;
    for (int digits = 3; digits <= 5; digits++) {
        for (int variant = 0; variant < 8; variant++) {
            const tiny_system system = make_system(digits, lowest[variant / 2], variant & 1, false);
            const int         n = list_numbers(&system, 6, numbers);
            for (int i = 0; i < n; i++) {
                for (int j = 0; j < n; j++) {
                    wrong += !reach_holds(&system, numbers[i], numbers[j], 0.0, &used);
                    most_used = fmax(used, most_used);
                    wrong += !reach_holds(&system, numbers[i], -numbers[j], 0.0, &used);
                    wrong +=
                        !reach_holds(&system, numbers[i], numbers[j], 0.3 * numbers[i / 2], &used);
                }
            }
        }
    }
    CHECK(wrong == 0);
    CHECK(most_used > 0.96); /* the flushes are 1/32 of the largest numbers */
}

/* Infinity and what no float can tell: no bound. */
static void
bounds_are_no_less_than_they_must_be(void)
{
    CHECK(hs_reach_extent(1.0, 2.0, 0.0) >= 5.0 && hs_reach_extent(1.0, 2.0, 0.0) < 5.00001);
    CHECK(hs_reach_extent(0.0, 0.0, 0.0) > 0.0 && hs_reach_extent(0.0, 0.0, 0.0) < 1e-30);
    CHECK(hs_reach_extent(1.0, 2.0, 0.5) >= 6.0 && hs_reach_extent(1.0, 2.0, 0.5) < 6.00001);
    CHECK(hs_reach_extent(1.0, INFINITY, 0.0) == INFINITY);
    CHECK(hs_reach_bound(1.0, 1.0, 0.0, 0.5, 0x1p-9) == HUGE_VAL);
}

enum { AXES = 3, GROUP = 4 };

/* The square of the distance from a box, as a kernel computes it. */
static double
square_from_box(const tiny_system *system, int ndim, const double *y, const double *low,
                const double *high)
{
    double sum = 0.0;
    for (int k = 0; k < ndim; k++) {
        const double below = round_to(system, low[k] - y[k]);
        const double above = round_to(system, y[k] - high[k]);
        const double gap = fmax(fmax(below, above), 0.0);
        sum = round_to(system, sum + round_to(system, gap * gap));
    }
    return sum;
}

/* The smallest distance that a candidate and a point can mean. */
static double
least_distance(const tiny_system *system, int ndim, const double *y, const double *q)
{
    double square = 0.0, low, high;
    for (int k = 0; k < ndim; k++) {
        distance_interval(system, y[k], q[k], 0.0, &low, &high);
        square += low * low;
    }
    return sqrt(square) * (1.0 + 0x1p-48);
}

/* Whether a candidate is kept with any cutoff that it is within of any point of the group. */
static bool
is_kept(const tiny_system *system, int ndim, const double *y, double q[][AXES])
{
    double low[AXES], high[AXES], largest = 0.0;
    bool   kept = true;
    for (int k = 0; k < ndim; k++) {
        low[k] = high[k] = q[0][k];
        for (int p = 0; p < GROUP; p++) {
            low[k] = fmin(low[k], q[p][k]);
            high[k] = fmax(high[k], q[p][k]);
            largest = fmax(largest, fabs(q[p][k]));
        }
    }
    const double s = square_from_box(system, ndim, y, low, high);
    for (int p = 0; p < GROUP; p++) {
        double       in, out;
        const double cutoff = least_distance(system, ndim, y, q[p]);
        const double extent = hs_reach_bound(cutoff, largest, 0.0, system->unit, system->tiny);
        hs_threshold_bounds(ndim, cutoff, extent, 0.0, system->unit, system->tiny, &in, &out);
        kept = kept && s <= out;
    }
    return kept;
}

static void
candidates_within_are_kept(void)
{
    harness_random random = {43};
    double         numbers[512];
    int            wrong = 0;
    for (int trial = 0; trial < 24; trial++) {
        const int         ndim = 1 + trial % AXES;
        const tiny_system system =
            make_system(3 + trial / 3 % 6, trial % 4 * 4 - 10, trial & 1, false);
        const int n = list_numbers(&system, system.digits < 6 ? 5 : 2, numbers);
        for (int i = 0; i < 4000; i++) {
            double y[AXES], q[GROUP][AXES];
            for (int k = 0; k < ndim; k++) {
                y[k] = numbers[random_bits(&random) % (unsigned)n];
                for (int p = 0; p < GROUP; p++) {
                    const double size = numbers[random_bits(&random) % (unsigned)n];
                    q[p][k] = random_bits(&random) & 1 ? size : -size;
                }
            }
            wrong += !is_kept(&system, ndim, y, q);
        }
    }
    CHECK(wrong == 0);
}

void
test_reach(void)
{
    RUN(no_pair_within_reaches_farther);
    RUN(bounds_are_no_less_than_they_must_be);
    RUN(candidates_within_are_kept);
}
