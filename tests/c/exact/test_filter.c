/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_filter.c: the thresholds of the float32 filter's direct form, in float32 and in
 * floating-point systems so small that every number can be tried.
 */
#include "../../../csrc/core/exact/filter.h"

#include "../support/harness.h"
#include "../support/tiny_floats.h"

void test_filter(void);

/* ---- tiny floating-point systems ---- */

/* What a kernel computes. */
static double
tiny_kernel(const tiny_system *system, int ndim, const double *y, const double *q)
{
    double sum = 0.0;
    for (int k = 0; k < ndim; k++) {
        const double difference = round_to(system, y[k] - q[k]);
        const double square = difference * difference;
        if (system->fused && k > 0)
            sum = round_to(system, sum + square);
        else
            sum = k == 0 ? round_to(system, square)
                         : round_to(system, sum + round_to(system, square));
    }
    return sum;
}

/* A pair within the smallest possible distance must not be out, one beyond the largest not in. */
static bool
claims_hold(const tiny_system *system, int ndim, const double *y, const double *q, double error)
{
    double extent_y = 0.0, extent_q = 0.0, low = 0.0, high = 0.0, in, out, unused;
    for (int k = 0; k < ndim; k++) {
        double component_low, component_high;
        extent_y = fmax(extent_y, fabs(y[k]));
        extent_q = fmax(extent_q, fabs(q[k]));
        distance_interval(system, y[k], q[k], error, &component_low, &component_high);
        low += component_low * component_low;
        high += component_high * component_high;
    }
    low = ndim == 1 ? sqrt(low) : sqrt(low) * (1.0 + 0x1p-48);
    high = ndim == 1 ? sqrt(high) : sqrt(high) * (1.0 - 0x1p-48);
    const double sum = tiny_kernel(system, ndim, y, q);
    const double extent = extent_y + extent_q;
    hs_threshold_bounds(ndim, low, extent, error, system->unit, system->tiny, &unused, &out);
    hs_threshold_bounds(ndim, high, extent, error, system->unit, system->tiny, &in, &unused);
    return sum <= out && sum >= in;
}

static void
every_pair_of_a_tiny_system_is_judged_right(void)
{
    static const int lowest[] = {-12, -3, 0, 3}; /* 3: the flushes dwarf everything else */
    double           numbers[512];
    int              wrong = 0;
    for (int digits = 3; digits <= 5; digits++) {
        for (int variant = 0; variant < 8; variant++) {
            const tiny_system system = make_system(digits, lowest[variant / 2], variant & 1, false);
            const int         n = list_numbers(&system, 6, numbers);
            for (int i = 0; i < n; i++) {
                for (int j = 0; j < n; j++) {
                    const double y = numbers[i], q = numbers[j], minus = -q;
                    wrong += !claims_hold(&system, 1, &y, &q, 0.0);
                    wrong += !claims_hold(&system, 1, &y, &minus, 0.0);
                    wrong += !claims_hold(&system, 1, &y, &q, 0.3 * numbers[i / 2]);
                }
            }
        }
    }
    CHECK(wrong == 0);
}

static void
samples_of_tiny_systems_are_judged_right(void)
{
    harness_random random = {41};
    double         numbers[512];
    int            wrong = 0;
    for (int trial = 0; trial < 24; trial++) {
        const int         ndim = 2 + trial % 3;
        const tiny_system system =
            make_system(3 + trial / 3 % 6, trial % 4 * 4 - 10, trial & 1, trial / 2 % 2);
        const int n = list_numbers(&system, system.digits < 6 ? 5 : 2, numbers);
        for (int i = 0; i < 8000; i++) {
            double y[4], q[4];
            for (int k = 0; k < ndim; k++) {
                y[k] = numbers[random_bits(&random) % (unsigned)n];
                q[k] = numbers[random_bits(&random) % (unsigned)n];
                q[k] = random_bits(&random) & 1 ? q[k] : -q[k];
            }
            wrong += !claims_hold(&system, ndim, y, q, 0.0);
        }
    }
    CHECK(wrong == 0);
}

/* ---- float32 ---- */

static const double u = 0x1p-24;

/*
 * One axis, near 2: both inputs, the difference and the square are each rounded by almost as much
 * as rounding can, and in the same direction; d(s) / s is 5 u (1 - 2^-10).
 */
static void
bounds_are_reached_in_one_dimension(void)
{
    for (int side = -1; side <= 1; side += 2) { /* too small, too large */
        /* y - q is halfway between 2 + 4 u m, m even, and a neighbour; m^2 / 2^23 near 1/2 */
        const int    m = 2048 + 2 * side, odd = 2 * m - side;
        const float  y = (float)(1.0 + 2.0 * u * (m - 1));
        const float  q = (float)-(1.0 + 2.0 * u * (odd - (m - 1)));
        const double nearly = u * (1.0 - 0x1p-20);
        const double Y = (double)y - side * nearly, Q = (double)q + side * nearly;
        double       in, out;
        CHECK((float)Y == y && (float)Q == q);
        const float difference = y - q;
        const float sum = difference * difference;
        hs_threshold_bounds(1, fabs(Y - Q), fabs((double)y) + fabs((double)q), 0.0, u, 0x1p-126,
                            &in, &out);
        const double moved = ((double)sum / ((Y - Q) * (Y - Q)) - 1.0) / u;
        CHECK(side * moved > 5.0 * (1.0 - 0x1p-9) && side * moved < 5.0);
        CHECK((double)sum <= out && (double)sum >= in);
    }
}

/* Points far from the centre and close together: only what is known about y and q matters. */
static void
bounds_are_reached_far_from_the_centre(void)
{
    const double more = u * (1.0 + 0x1p-18); /* 2048 float64 roundings before the float32 one */
    const double y = 1.0 + 4.0 * u, q = 1.0;
    const float  sum = (float)((y - q) * (y - q));
    double       in, out;
    hs_threshold_bounds(1, (y - more * y) - (q + more * q), y + q, 0.0, u, 0x1p-126, &in, &out);
    CHECK((double)sum <= out);
    hs_threshold_bounds(1, (y + more * y) - (q - more * q), y + q, 0.0, u, 0x1p-126, &in, &out);
    CHECK((double)sum >= in);
    CHECK((double)sum < in * (1.0 + 8.0 * u));

    const double error = 0x1p-12;
    hs_threshold_bounds(1, 2.0 * error, 2.0, error, u, 0x1p-126, &in, &out);
    CHECK(16.0 * error * error <= out && 0.0 >= in); /* y - q is 4 e, or 0 */
    hs_threshold_bounds(1, 6.0 * error, 2.0, error, u, 0x1p-126, &in, &out);
    CHECK(16.0 * error * error >= in && in > 15.9 * error * error);
}

/* Eight squares, each a little below the smallest normal number and flushed. */
static void
flushed_squares_are_not_sure(void)
{
    const double largest = (1.0 - u) * 0x1p-63;
    for (int ndim = 1; ndim <= 8; ndim++) {
        const double        distance = largest * sqrt((double)ndim) * (1.0 - 0x1p-50);
        const hs_thresholds thresholds = hs_thresholds_of(ndim, distance, largest, 0.0);
        CHECK(!(0.0f < thresholds.in));
        CHECK(!(0.0f > thresholds.out));
    }
    CHECK(hs_thresholds_of(3, 1.0, 3.0, 0.0).in > 0.999f);
}

/* The rounding of the thresholds to float32 keeps the worst case right; half of u would not. */
static void
float32_thresholds_hold_near_the_cutoff(void)
{
    harness_random random = {43};
    int            wrong = 0, sure = 0;
    for (int trial = 0; trial < 300000; trial++) {
        const int    ndim = 1 + trial % 3;
        const double reach = trial % 2 ? 2.0 : 64.0;
        double       Y[3], Q[3], square = 0.0, extent_y = 0.0, extent_q = 0.0;
        float        y[3], q[3], sum = 0.0f, fused = 0.0f;
        for (int k = 0; k < ndim; k++) {
            Y[k] = reach * (random_unit(&random) - 0.5);
            Q[k] = Y[k] + (random_unit(&random) - 0.5) * 2.0;
            square += (Y[k] - Q[k]) * (Y[k] - Q[k]);
            y[k] = (float)Y[k];
            q[k] = (float)Q[k];
            extent_y = fmax(extent_y, fabs((double)y[k]));
            extent_q = fmax(extent_q, fabs((double)q[k]));
            const float difference = y[k] - q[k];
            sum += difference * difference;
            fused = (float)((double)difference * difference + (double)fused); /* nearly fused */
        }
        for (int side = -1; side <= 1; side += 2) {
            const double        cutoff = sqrt(square) * (1.0 + side * 0x1p-46);
            const hs_thresholds t = hs_thresholds_of(ndim, cutoff, extent_y + extent_q, 0.0);
            const float         least = sum < fused ? sum : fused;
            const float         most = sum < fused ? fused : sum;
            wrong += side > 0 ? most > t.out : least < t.in;
            sure += side > 0 ? least < t.in : most > t.out;
        }
    }
    CHECK(wrong == 0);
    CHECK(sure == 0); /* nothing this close to the cutoff is sure */
}

/* |s - |D|^2| over the width of the band on that side, for points Y and Q in exact arithmetic. */
static double
band_used(int ndim, const double *Y, const double *Q)
{
    float  sum = 0.0f;
    double square = 0.0, extent_y = 0.0, extent_q = 0.0, in, out;
    for (int k = 0; k < ndim; k++) {
        const float y = (float)Y[k], q = (float)Q[k], difference = y - q;
        sum += difference * difference;
        square += (Y[k] - Q[k]) * (Y[k] - Q[k]);
        extent_y = fmax(extent_y, fabs((double)y));
        extent_q = fmax(extent_q, fabs((double)q));
    }
    hs_threshold_bounds(ndim, sqrt(square), extent_y + extent_q, 0.0, u, 0x1p-126, &in, &out);
    const double moved = (double)sum - square;
    return moved > 0.0 ? moved / (out - square) : moved / (in - square);
}

/* Hill climbing comes close to the bounds, and never past them. */
static void
climbing_stays_within_the_bounds(void)
{
    harness_random random = {7};
    for (int ndim = 1; ndim <= 3; ndim++) {
        double most = 0.0;
        for (int start = 0; start < 60; start++) {
            const double reach = (double)(1 << start % 7);
            double       Y[3], Q[3], best = 0.0;
            for (int k = 0; k < ndim; k++) {
                Y[k] = reach * (2.0 * random_unit(&random) - 1.0);
                Q[k] = Y[k] + 2.0 * random_unit(&random) - 1.0;
            }
            for (int step = 0; step < 4000; step++) {
                double      *x = random_bits(&random) & 1 ? Y : Q;
                const int    k = (int)(random_bits(&random) % (unsigned)ndim);
                const double before = x[k];
                x[k] += ldexp(2.0 * random_unit(&random) - 1.0, -(int)(random_bits(&random) % 26));
                const double used = band_used(ndim, Y, Q);
                if (used < best)
                    x[k] = before;
                else
                    best = used;
            }
            most = best > most ? best : most;
        }
        CHECK(most <= 1.0);
        CHECK(most > (ndim == 1 ? 0.98 : ndim == 2 ? 0.8 : 0.7));
    }
}

/* A thousandth off the cutoff everything is sure, or the filter would be of no use. */
static void
thresholds_are_narrow(void)
{
    for (int ndim = 1; ndim <= 8; ndim++) {
        const hs_thresholds t = hs_thresholds_of(ndim, 1.0, 2.0, 0.0);
        const double        width = ((double)t.out - (double)t.in) / u;
        CHECK(t.in < 1.0f && t.out > 1.0f);
        CHECK(width < 8.0 * sqrt((double)ndim) + 4.0 + 2.0 * ndim + 4.0);
    }
}

static void
nothing_is_sure_without_finite_inputs(void)
{
    const double bad[] = {NAN, INFINITY};
    for (int i = 0; i < 2; i++) {
        const hs_thresholds extent = hs_thresholds_of(3, 1.0, bad[i], 0.0);
        const hs_thresholds error = hs_thresholds_of(3, 1.0, 1.0, bad[i]);
        CHECK(extent.in == -1.0f && extent.out == INFINITY);
        CHECK(error.in == -1.0f && error.out == INFINITY);
    }
}

static void
extreme_cutoffs_round_outwards(void)
{
    hs_thresholds t = hs_thresholds_of(3, 0.0, 1.0, 0.0);
    CHECK(t.in == -1.0f && t.out > 0.0f && t.out < 1e-12f);
    t = hs_thresholds_of(3, 0.0, 0.0, 0.0);
    CHECK(t.in == -1.0f && t.out >= FLT_MIN);
    t = hs_thresholds_of(3, DBL_MAX, 1.0, 0.0);
    CHECK(t.in == FLT_MAX && t.out == INFINITY);
    t = hs_thresholds_of(3, 1e30, 1.0, 0.0);
    CHECK(t.in == FLT_MAX && t.out == INFINITY);
    t = hs_thresholds_of(3, 0x1p-1074, 1.0, 0.0);
    CHECK(t.in == -1.0f && t.out > 0.0f);
    t = hs_thresholds_of(3, 1.0, 1e9, 0.0);
    CHECK(t.in == -1.0f && t.out > 1.0f);
}

void
test_filter(void)
{
    RUN(every_pair_of_a_tiny_system_is_judged_right);
    RUN(samples_of_tiny_systems_are_judged_right);
    RUN(bounds_are_reached_in_one_dimension);
    RUN(bounds_are_reached_far_from_the_centre);
    RUN(flushed_squares_are_not_sure);
    RUN(float32_thresholds_hold_near_the_cutoff);
    RUN(climbing_stays_within_the_bounds);
    RUN(thresholds_are_narrow);
    RUN(nothing_is_sure_without_finite_inputs);
    RUN(extreme_cutoffs_round_outwards);
}
