/* SPDX-License-Identifier: BSD-3-Clause */
/* test_filter.c: what thresholds leave unsure is little, and what they call sure is so. */
#include "../../../csrc/core/exact/arithmetic.h"
#include "../../../csrc/core/exact/filter.h"
#include "../../../csrc/kernels/kernel.h"
#include "../support/harness.h"

#include <float.h>
#include <math.h>

void test_filter(void);

/* ---- floating-point systems so small that every number can be tried, in double ---- */

typedef struct tiny_system {
    int    digits; /* bits of a significand: unit roundoff 2^-digits */
    int    lowest; /* smallest normal number: 2^lowest */
    bool   flush;  /* numbers below it become zero */
    bool   fused;  /* sums of squares use a fused multiply-add */
    double unit, tiny;
} tiny_system;

static tiny_system
make_system(int digits, int lowest, bool flush, bool fused)
{
    return (tiny_system){digits, lowest, flush, fused, ldexp(1.0, -digits), ldexp(1.0, lowest)};
}

/* x rounded to the system; exact in double because its significands are so short. */
static double
round_to(const tiny_system *system, double x)
{
    int exponent;
    if (x == 0.0)
        return 0.0;
    (void)frexp(x, &exponent); /* |x| in [2^(exponent - 1), 2^exponent) */
    if (exponent - 1 < system->lowest)
        exponent = system->lowest + 1;
    const double spacing = ldexp(1.0, exponent - system->digits);
    const double rounded = nearbyint(x / spacing) * spacing;
    return system->flush && fabs(rounded) < system->tiny ? 0.0 : rounded;
}

/* How far the real number may lie on either side of a float: half the gap, or all of a flush. */
static void
real_interval(const tiny_system *system, double y, double *low, double *high)
{
    const double size = fabs(y);
    int          exponent;
    if (size == 0.0 && system->flush) {
        *low = -system->tiny;
        *high = system->tiny;
        return;
    }
    (void)frexp(size, &exponent);
    if (size == 0.0 || exponent - 1 < system->lowest)
        exponent = system->lowest + 1;
    const double spacing = ldexp(1.0, exponent - system->digits);
    const bool   power = size == ldexp(0.5, exponent) && exponent - 1 > system->lowest;
    const double far = size + 0.5 * spacing;
    const double near = size - (power ? 0.25 : 0.5) * spacing;
    *low = y < 0.0 ? -far : near;
    *high = y < 0.0 ? -near : far;
}

/* Every nonnegative number below 2^(lowest + binades); returns how many. */
static int
list_numbers(const tiny_system *system, int binades, double *numbers)
{
    int       n = 0;
    const int per_binade = 1 << (system->digits - 1);
    for (int i = 0; i < per_binade; i++)
        if (i == 0 || !system->flush)
            numbers[n++] = ldexp((double)i, system->lowest - system->digits + 1);
    for (int binade = 0; binade < binades; binade++)
        for (int i = 0; i < per_binade; i++)
            numbers[n++] =
                ldexp((double)(per_binade + i), system->lowest + binade - system->digits + 1);
    return n;
}

/* Smallest and largest |Y - Q| over the reals that y and q may stand for, each wrong by `error`
 * and by 2^-18 of a rounding more. */
static void
distance_interval(const tiny_system *system, double y, double q, double error, double *low,
                  double *high)
{
    double       y_low, y_high, q_low, q_high;
    const double more = 2.0 * error + 0x1p-18 * system->unit * (fabs(y) + fabs(q));
    real_interval(system, y, &y_low, &y_high);
    real_interval(system, q, &q_low, &q_high);
    const double from = y_low - q_high - more, to = y_high - q_low + more;
    *high = fabs(from) > fabs(to) ? fabs(from) : fabs(to);
    *low = from <= 0.0 && to >= 0.0 ? 0.0 : fabs(from) < fabs(to) ? fabs(from) : fabs(to);
}

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

/* The smallest and the largest distance that a pair may have. */
static void
distance_bounds(const tiny_system *system, int ndim, const double *y, const double *q, double error,
                double *low, double *high)
{
    double low_square = 0.0, high_square = 0.0;
    for (int k = 0; k < ndim; k++) {
        double least, most;
        distance_interval(system, y[k], q[k], error, &least, &most);
        low_square += least * least;
        high_square += most * most;
    }
    *low = ndim == 1 ? sqrt(low_square) : sqrt(low_square) * (1.0 + 0x1p-48);
    *high = ndim == 1 ? sqrt(high_square) : sqrt(high_square) * (1.0 - 0x1p-48);
}

/* A pair within the smallest possible distance must not be out, one beyond the largest not in. */
static bool
is_judged_right(const tiny_system *system, int ndim, const double *y, const double *q, double error)
{
    double extent_y = 0.0, extent_q = 0.0, low, high, in, out, unused;
    distance_bounds(system, ndim, y, q, error, &low, &high);
    for (int k = 0; k < ndim; k++) {
        extent_y = fmax(extent_y, fabs(y[k]));
        extent_q = fmax(extent_q, fabs(q[k]));
    }
    const double sum = tiny_kernel(system, ndim, y, q), extent = extent_y + extent_q;
    hs_threshold_bounds(ndim, low, extent, error, system->unit, system->tiny, &unused, &out);
    hs_threshold_bounds(ndim, high, extent, error, system->unit, system->tiny, &in, &unused);
    return sum <= out && sum >= in;
}

static double most_used; /* of the bound of reaches, without errors of the caller */

/* |y| + |q| is within the bound for the smallest distance that y and q can mean. */
static bool
reach_holds(const tiny_system *system, int ndim, const double *y, const double *q, double error)
{
    double low, high;
    distance_bounds(system, ndim, y, q, error, &low, &high);
    const double bound = hs_reach_bound(low, fabs(*q), error, system->unit, system->tiny);
    most_used = error == 0.0 ? fmax(most_used, (fabs(*y) + fabs(*q)) / bound) : most_used;
    return fabs(*y) + fabs(*q) <= bound;
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
            for (int e = 0; e < 3 * n * n; e++) {
                const double y = numbers[e / 3 / n], q = numbers[e / 3 % n] * (e % 3 == 1 ? -1 : 1);
                const double error = e % 3 == 2 ? 0.3 * numbers[e / 3 / n / 2] : 0.0;
                wrong += !is_judged_right(&system, 1, &y, &q, error);
                wrong += !reach_holds(&system, 1, &y, &q, error);
            }
        }
    }
    CHECK(wrong == 0);
    CHECK(most_used > 0.96); /* the flushes are 1/32 of the largest numbers */
}

static void
samples_of_tiny_systems_are_judged_right(void)
{
    harness_random random = {41};
    double         numbers[512];
    int            wrong = 0;
    for (int trial = 0; trial < 96; trial++) {
        const int         ndim = 2 + trial % 3;
        const tiny_system system =
            make_system(3 + trial / 3 % 6, trial % 4 * 4 - 10, trial & 1, trial / 2 % 2);
        const int  n = list_numbers(&system, system.digits < 6 ? 5 : 2, numbers);
        const bool near = trial & 32; /* close together */
        for (int i = 0; i < 4000; i++) {
            double y[4], q[4];
            for (int k = 0; k < ndim; k++) {
                const int at = (int)(random_bits(&random) % (unsigned)n);
                const int by = near ? (int)(random_bits(&random) % 3) : at + 1;
                y[k] = numbers[at];
                q[k] = near ? numbers[at >= by ? at - by : at]
                            : numbers[random_bits(&random) % (unsigned)n];
                q[k] = near || random_bits(&random) & 1 ? q[k] : -q[k];
            }
            wrong += !is_judged_right(&system, ndim, y, q, 0.0);
        }
    }
    CHECK(wrong == 0);
}

/* ---- candidates left out because they are far from the box of a group are beyond the cutoff ---- */

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
        double in, out;
        double cutoff, unused;
        distance_bounds(system, ndim, y, q[p], 0.0, &cutoff, &unused);
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

/* ---- in float32 ---- */

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

/*
 * ---- limit form ----
 *
 * The thresholds that kernels compute of two radii, fleft or not, against those of filter.h for the
 * real sum, the larger or the smaller: they must hold it between them, and not by much.
 */

static const double tiny = 0x1p-126;

/* One limit of a pair, all that it is made of. */
typedef struct limit_case {
    int     ndim;
    hs_rule rule;
    double  a, b, bound, extent, error;
} limit_case;

/* As a kernel that fuses: one rounding for product and sum, by way of float64, which holds the
 * product. */
static hs_thresholds
fleft_thresholds(const hs_limit_scan *limits, float limit)
{
    const hs_limit_form form = limits->form;
    const float         in = fmaf(limit, form.in_factor, -form.in_less);
    const float         out = fmaf(limit, form.out_factor, form.out_more);
    return (hs_thresholds){in > 0.0f ? in * in : 0.0f, out * out};
}

static float
float_limit(const hs_limit_scan *limits, float a, float b)
{
    const float made = limits->rule == HS_RULE_MAX   ? fmaxf(a, b)
                       : limits->rule == HS_RULE_MIN ? fminf(a, b)
                                                     : a + b;
    return fminf(made, limits->bound);
}

/* The real limit, to its float64 neighbours: below it and above it. */
static void
real_limit(const limit_case *c, double *low, double *high)
{
    const bool  is_one = c->rule == HS_RULE_MAX || c->rule == HS_RULE_MIN;
    const hs_dw sum = hs_two_sum(c->a, c->b);
    *low = c->rule == HS_RULE_MAX   ? fmax(c->a, c->b)
           : c->rule == HS_RULE_MIN ? fmin(c->a, c->b)
                                    : sum.hi;
    *high = *low;
    if (!is_one) {
        *low = sum.lo < 0.0 ? nextafter(sum.hi, 0.0) : sum.hi;
        *high = sum.lo > 0.0 ? nextafter(sum.hi, HUGE_VAL) : sum.hi;
    }
    *low = fmin(*low, c->bound);
    *high = fmin(*high, c->bound);
}

/* Whether both thresholds are on the safe side of the exact ones; left: how far off these they are,
 * in units of u, `in` and `out`. */
static bool
holds(const limit_case *c, double left[2])
{
    const hs_limit_scan limits = {.rule = c->rule,
                                  .bound = (float)c->bound,
                                  .form = hs_limit_form_of(c->ndim, c->extent, c->error)};
    const float         a = (float)c->a, b = (float)c->b;
    const hs_thresholds plain = hs_limit_thresholds(&limits, a, b);
    const hs_thresholds fleft = fleft_thresholds(&limits, float_limit(&limits, a, b));
    double              low, high, in, out, unused;
    real_limit(c, &low, &high);
    hs_threshold_bounds(c->ndim, low, c->extent, c->error, u, tiny, &in, &unused);
    hs_threshold_bounds(c->ndim, high, c->extent, c->error, u, tiny, &unused, &out);
    const double largest = fmax(plain.in, fleft.in), least = fmin(plain.out, fleft.out);
    left[0] = (in - largest) / (in * u);
    left[1] = (least - out) / (out * u);
    return least >= out && (largest == 0.0 || largest <= in);
}

/* A radius whose rounding goes to this side, by nearly all that it can: it is a little off the middle
 * between two floats, and near a power of two more often than not. */
static double
beside_a_middle(harness_random *random, int side)
{
    const int64_t first = INT64_C(1) << 23, more = INT64_C(1) << (12 + random_bits(random) % 11);
    const int64_t m = first + (int64_t)(random_bits(random) % (uint64_t)more);
    const int     exponent = (int)(random_bits(random) % 3) - 24;
    return ldexp((double)m + 0.5 + side * 0x1p-12, exponent);
}

static void
limits_of_any_radii_hold(void)
{
    static const hs_rule rules[] = {HS_RULE_SUM, HS_RULE_MAX, HS_RULE_MIN, HS_RULE_MEAN};
    harness_random       random = {1213};
    int                  wrong = 0;
    for (int trial = 0; trial < TRIALS(400000); trial++) {
        const int  side = trial / 4 % 3 - 1;
        limit_case c = {.ndim = 1 + trial % 8,
                        .rule = rules[random_bits(&random) % 4],
                        .a = ldexp(random_unit(&random), (int)(random_bits(&random) % 12) - 6),
                        .b = ldexp(random_unit(&random), (int)(random_bits(&random) % 12) - 6),
                        .bound = HUGE_VAL,
                        .extent = ldexp(random_unit(&random), (int)(random_bits(&random) % 9)),
                        .error = trial % 3 == 0 ? 0x1p-20 * random_unit(&random) : 0.0};
        double     left[2];
        if (side != 0) {
            c.a = beside_a_middle(&random, side);
            c.b = beside_a_middle(&random, side);
        }
        if (trial % 5 == 0)
            c.extent = 0.0;
        if (trial % 7 == 0)
            c.bound = beside_a_middle(&random, trial % 2 ? 1 : -1);
        wrong += !holds(&c, left);
    }
    CHECK(wrong == 0);
}

/* Without an extent, all that there is between both thresholds are roundings. For some of these radii
 * most of them go one way, and little more is left than the roundings of the factors to float32,
 * which take up to 2 u and 4 u of the squares: with half of the bound, thresholds would be wrong. */
static void
bounds_are_nearly_reached(void)
{
    for (int ndim = 1; ndim <= 8; ndim++) {
        harness_random random = {1000 + (uint64_t)ndim};
        double         least[2] = {HUGE_VAL, HUGE_VAL};
        int            wrong = 0;
        for (int trial = 0; trial < TRIALS(400000); trial++) {
            const int        side = trial % 2 ? 1 : -1;
            const limit_case c = {.ndim = ndim,
                                  .rule = HS_RULE_SUM,
                                  .a = beside_a_middle(&random, side),
                                  .b = beside_a_middle(&random, side),
                                  .bound = HUGE_VAL};
            double           left[2];
            wrong += !holds(&c, left);
            least[0] = fmin(least[0], left[0]);
            least[1] = fmin(least[1], left[1]);
        }
        CHECK(wrong == 0);
        CHECK(least[0] >= 0.0 && least[0] < 6.0);
        CHECK(least[1] >= 0.0 && least[1] < 8.0);
    }
}

/* Radii so small that their floats are subnormal, or zero, are not taken for more than they may be. */
static void
what_is_lost_of_small_radii_is_not_sure(void)
{
    harness_random random = {1415};
    int            wrong = 0;
    for (int trial = 0; trial < TRIALS(100000); trial++) {
        const limit_case c = {.ndim = 1 + trial % 8,
                              .rule = HS_RULE_SUM,
                              .a = ldexp(random_unit(&random), -(int)(random_bits(&random) % 200)),
                              .b = ldexp(random_unit(&random), -(int)(random_bits(&random) % 200)),
                              .bound = HUGE_VAL,
                              .extent = trial % 2 ? 0x1p-120 : 0.0};
        double           left[2];
        wrong += !holds(&c, left);
    }
    CHECK(wrong == 0);
}

/* Nothing but equal points, and what may be lost, is within 0; that is not sure either. */
static void
zero_radii_make_nothing_sure(void)
{
    for (int ndim = 1; ndim <= 8; ndim++) {
        for (int rule = 0; rule < HS_RULE_END; rule++) {
            const hs_limit_scan limits = {
                .rule = (hs_rule)rule, .bound = INFINITY, .form = hs_limit_form_of(ndim, 2.0, 0.0)};
            const hs_thresholds none = hs_limit_thresholds(&limits, 0.0f, 0.0f);
            CHECK(none.in == 0.0f && none.out > 0.0f && none.out < 1e-12f);
            const hs_limit_scan bounded = {
                .rule = (hs_rule)rule, .bound = 0.0f, .form = limits.form};
            const hs_thresholds at_most = hs_limit_thresholds(&bounded, 5.0f, 7.0f);
            CHECK(at_most.in == none.in && at_most.out == none.out);
        }
    }
}

/* A radius that no float32 holds is beyond all squares; within a bound, nothing of it is left. */
static void
huge_radii_are_beyond_all(void)
{
    const hs_limit_form form = hs_limit_form_of(3, 64.0, 0x1p-40);
    hs_limit_scan       limits = {.rule = HS_RULE_SUM, .bound = INFINITY, .form = form};
    hs_thresholds       t = hs_limit_thresholds(&limits, INFINITY, 1.0f);
    CHECK(t.in == INFINITY && t.out == INFINITY);
    t = hs_limit_thresholds(&limits, FLT_MAX, FLT_MAX);
    CHECK(t.in == INFINITY && t.out == INFINITY);
    limits.rule = HS_RULE_MIN;
    t = hs_limit_thresholds(&limits, INFINITY, 1.0f);
    CHECK(t.in > 0.99f && t.in < 1.0f && t.out > 1.0f && t.out < 1.01f);
    limits.rule = HS_RULE_MAX;
    limits.bound = 2.0f;
    t = hs_limit_thresholds(&limits, INFINITY, 1.0f);
    CHECK(t.in > 3.99f && t.in < 4.0f && t.out > 4.0f && t.out < 4.01f);
}

/* A negative limit is that of no pair: nothing is sure, and nothing beyond what may be lost is a
 * hit. */
static void
negative_limits_are_of_no_pair(void)
{
    hs_limit_scan limits = {
        .rule = HS_RULE_SCATTER, .bound = INFINITY, .form = hs_limit_form_of(3, 2.0, 0.0)};
    hs_thresholds t = hs_limit_thresholds(&limits, 0.0f, -1.0f);
    CHECK(t.in == 0.0f && t.out == 0.0f);
    limits.form = hs_limit_form_of(3, 0x1p25, 0.0);
    t = hs_limit_thresholds(&limits, 0.0f, -1.0f);
    CHECK(t.in == 0.0f && t.out > 1.0f);
    limits.form = (hs_limit_form){1.0f, 0.0f, 1.0f, 0.0f};
    t = hs_limit_thresholds(&limits, 0.0f, -1.0f);
    CHECK(t.in == 0.0f && t.out == 0.0f);
}

/* Each rule takes the radii that it names, whichever of the two points has them. */
static void
rules_take_their_radii(void)
{
    static const struct {
        hs_rule rule;
        float   a, b, limit;
    } cases[] = {{HS_RULE_SUM, 1.0f, 3.0f, 4.0f},    {HS_RULE_MEAN, 1.0f, 3.0f, 4.0f},
                 {HS_RULE_MAX, 1.0f, 3.0f, 3.0f},    {HS_RULE_MAX, 3.0f, 1.0f, 3.0f},
                 {HS_RULE_MIN, 1.0f, 3.0f, 1.0f},    {HS_RULE_MIN, 3.0f, 1.0f, 1.0f},
                 {HS_RULE_GATHER, 2.0f, 0.0f, 2.0f}, {HS_RULE_SCATTER, 0.0f, 2.0f, 2.0f}};
    for (size_t e = 0; e < sizeof cases / sizeof cases[0]; e++) {
        const hs_limit_scan limits = {
            .rule = cases[e].rule, .bound = INFINITY, .form = {1.0f, 0.0f, 1.0f, 0.0f}};
        const hs_thresholds t = hs_limit_thresholds(&limits, cases[e].a, cases[e].b);
        CHECK(t.in == cases[e].limit * cases[e].limit && t.out == t.in);
    }
}

static void
no_limit_is_sure_without_finite_inputs(void)
{
    const double bad[] = {NAN, INFINITY};
    for (int e = 0; e < 4; e++) {
        const hs_limit_scan limits = {
            .rule = HS_RULE_SUM,
            .bound = INFINITY,
            .form = hs_limit_form_of(3, e < 2 ? bad[e] : 1.0, e < 2 ? 0.0 : bad[e - 2])};
        for (int size = 0; size < 3; size++) {
            const float         radius = size == 0 ? 0.0f : size == 1 ? 1.0f : INFINITY;
            const hs_thresholds t = hs_limit_thresholds(&limits, radius, radius);
            CHECK(!(t.in > 0.0f) && t.out == INFINITY);
        }
    }
}

/* A thousandth off the limit everything is sure, or the filter would be of no use. */
static void
limit_thresholds_are_narrow(void)
{
    for (int ndim = 1; ndim <= 8; ndim++) {
        const hs_limit_scan limits = {
            .rule = HS_RULE_SUM, .bound = INFINITY, .form = hs_limit_form_of(ndim, 2.0, 0.0)};
        const hs_thresholds t = hs_limit_thresholds(&limits, 0.25f, 0.75f);
        const double        width = ((double)t.out - (double)t.in) / u;
        CHECK(t.in < 1.0f && t.out > 1.0f);
        CHECK(width < 8.0 * sqrt((double)ndim) + 2.0 * ndim + 40.0);
    }
}

/*
 * ---- support form ----
 *
 * The thresholds of supports in float32, against |N D| in float64, which is exact enough: they hold
 * it between them however entries, coordinates and sums are rounded, and the roundings of one term
 * come near their bound.
 */

/* A number of float64, and mostly near a power of two, where roundings are largest. */
static double
any_number(harness_random *random)
{
    const int64_t many = INT64_C(1) << (10 + random_bits(random) % 42);
    const double  x = 1.0 + ldexp((double)(random_bits(random) % (uint64_t)many), -52);
    const double  size = ldexp(x, (int)(random_bits(random) % 3) - 1);
    return random_bits(random) % 2 ? size : -size;
}

typedef struct term_case {
    int    ndim;
    double n[HS_SUPPORT_ENTRIES], y[3], q[3]; /* y and q relative to a centre, in float64 */
} term_case;

/* |N D|^2 in float64, and as a kernel computes it, fused or not. */
static double
true_square(const term_case *c)
{
    double square = 0.0;
    for (int k = 0; k < c->ndim; k++) {
        double z = 0.0;
        for (int l = 0; l < c->ndim; l++)
            z += c->n[hs_support_at(k, l)] * (c->y[l] - c->q[l]);
        square += z * z;
    }
    return square;
}

static float
float_square(const term_case *c, bool fused)
{
    volatile float square = 0.0f;
    for (int k = 0; k < c->ndim; k++) {
        volatile float z = 0.0f;
        for (int l = 0; l < c->ndim; l++) {
            const float          n = (float)c->n[hs_support_at(k, l)];
            const volatile float d = (float)c->y[l] - (float)c->q[l];
            const volatile float product = n * d;
            z = fused ? fmaf(n, d, z) : z + product;
        }
        const volatile float one = z * z;
        square = fused ? fmaf(z, z, square) : square + one;
    }
    return square;
}

static double
size_of(const term_case *c)
{
    double sum = 0.0;
    for (int k = 0; k < c->ndim; k++)
        for (int l = 0; l < c->ndim; l++)
            sum += c->n[hs_support_at(k, l)] * c->n[hs_support_at(k, l)];
    return sqrt(sum);
}

/* Needles and round ones, scaled so that |N D| is near 1: s must not be beyond a threshold that says
 * otherwise. Where N D cancels, the bound is that of what cancels. */
static void
thresholds_hold(void)
{
    harness_random random = {801};
    int            wrong = 0, sure_in = 0, sure_out = 0;
    for (int trial = 0; trial < TRIALS(400000); trial++) {
        term_case c = {.ndim = 1 + trial % 3};
        double    largest = 0.0;
        for (int k = 0; k < c.ndim; k++) {
            c.y[k] = any_number(&random);
            c.q[k] = any_number(&random);
            largest = fmax(largest, fabs((double)(float)c.y[k]) + fabs((double)(float)c.q[k]));
            for (int l = 0; l <= k; l++)
                c.n[hs_support_at(k, l)] = any_number(&random) * (trial / 3 % 2 && k ? 30.0 : 1.0);
        }
        const double square = true_square(&c);
        const double beside = 1.0 + (random_unit(&random) - 0.5) * (trial % 2 ? 1e-5 : 1e-6);
        if (!(square > 1e-6))
            continue;
        for (int e = 0; e < HS_SUPPORT_ENTRIES; e++)
            c.n[e] *= beside / sqrt(square);
        const double        value = true_square(&c);
        const hs_limit_form form = hs_support_form_of(c.ndim, largest, 0.0);
        const hs_thresholds near =
            hs_support_thresholds(form, (float)(size_of(&c) * (1.0 + 0x1p-22)));
        for (int fused = 0; fused < 2; fused++) {
            const float s = float_square(&c, fused);
            wrong += s < near.in && value > 1.0 - 1e-12;
            wrong += s > near.out && value < 1.0 + 1e-12;
            sure_in += s < near.in;
            sure_out += s > near.out;
        }
    }
    CHECK(wrong == 0);
    CHECK(sure_in > TRIALS(400000) / 20 && sure_out > TRIALS(400000) / 20);
}

/* One term: an entry, a difference and their product are rounded, all of them the same way and by
 * nearly as much as can be. */
static void
roundings_of_a_term_come_near_their_bound(void)
{
    harness_random random = {802};
    const double   bound = hs_support_roundings(1, u);
    double         most = 0.0;
    for (int trial = 0; trial < 2000000; trial++) {
        /* N and y - q a little below the middle above a float; and a product that is so, too. */
        const int64_t j = 1024 + (int64_t)(random_bits(&random) % 8192);
        const double  middle = ((double)(random_bits(&random) % 8) + 0.5) * 0x1p23;
        const double  i = floor(middle / (double)j) - (double)(trial % 2);
        const double  n = 1.0 + ldexp(i + 0.49999, -23);
        const double  y = 1.0 + ldexp((double)j, -23), q = -0.49999 * 0x1p-23;
        const float   d = (float)y - (float)q;
        const float   z = (float)n * d;
        const double  real = n * ((double)(float)y - (double)(float)q);
        most = fmax(most, fabs(real - (double)z) / real);
    }
    CHECK(most <= bound && most > 0.9 * bound);
}

/* With more axes the bound grows by one rounding each. */
static void
roundings_grow_with_the_axes(void)
{
    for (int ndim = 1; ndim <= 3; ndim++) {
        const double roundings = hs_support_roundings(ndim, u) / u;
        CHECK(roundings >= ndim + 2.0 && roundings < ndim + 2.1);
    }
}

/* Where extents are beyond float32, nothing is sure. */
static void
nothing_is_sure_of_what_float32_does_not_hold(void)
{
    const double extents[] = {HUGE_VAL, NAN, 0x1p200, 0x1p130, 0x1p123}; /* or flushes */
    for (int e = 0; e < 5; e++) {
        const hs_thresholds near =
            hs_support_thresholds(hs_support_form_of(3, extents[e], 0.0), 1.0f);
        CHECK(!(near.in > 0.0f) && near.out == INFINITY);
    }
    const hs_limit_form form = hs_support_form_of(3, 1.0, 0.0);
    const hs_thresholds none = hs_support_thresholds(form, INFINITY);
    CHECK(!(none.in > 0.0f) && none.out == INFINITY);
    const hs_thresholds some = hs_support_thresholds(form, 1.0f);
    CHECK(some.in > 0.9999f && some.in < 1.0f && some.out > 1.0f && some.out < 1.0001f);
    const hs_thresholds doubtful = hs_support_thresholds(hs_support_form_of(3, 1.0, 0.125), 4.0f);
    CHECK(doubtful.in == 0.0f && doubtful.out > 4.0f);
}

void
test_filter(void)
{
    RUN(every_pair_of_a_tiny_system_is_judged_right);
    RUN(samples_of_tiny_systems_are_judged_right);
    RUN(bounds_are_no_less_than_they_must_be);
    RUN(candidates_within_are_kept);
    RUN(bounds_are_reached_in_one_dimension);
    RUN(bounds_are_reached_far_from_the_centre);
    RUN(flushed_squares_are_not_sure);
    RUN(float32_thresholds_hold_near_the_cutoff);
    RUN(climbing_stays_within_the_bounds);
    RUN(thresholds_are_narrow);
    RUN(nothing_is_sure_without_finite_inputs);
    RUN(extreme_cutoffs_round_outwards);
    RUN(limits_of_any_radii_hold);
    RUN(bounds_are_nearly_reached);
    RUN(what_is_lost_of_small_radii_is_not_sure);
    RUN(zero_radii_make_nothing_sure);
    RUN(huge_radii_are_beyond_all);
    RUN(negative_limits_are_of_no_pair);
    RUN(rules_take_their_radii);
    RUN(no_limit_is_sure_without_finite_inputs);
    RUN(limit_thresholds_are_narrow);
    RUN(thresholds_hold);
    RUN(roundings_of_a_term_come_near_their_bound);
    RUN(roundings_grow_with_the_axes);
    RUN(nothing_is_sure_of_what_float32_does_not_hold);
}
