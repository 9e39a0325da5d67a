/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_expanded.c: the thresholds of the float32 filter's expanded form, in float32 and in
 * floating-point systems so small that every number can be tried.
 */
#include "../../../csrc/kernels/kernel.h"

#include "../support/harness.h"
#include "../support/tiny_floats.h"

void test_expanded(void);

/* ---- tiny floating-point systems ---- */

/* How a kernel goes about it. */
typedef struct manner {
    bool fused_norm, fused_chain;
    bool threshold_flushes; /* where the system does */
} manner;

static double
rounded_threshold(const tiny_system *system, const manner *way, double x)
{
    tiny_system own = *system;
    own.flush = system->flush && way->threshold_flushes;
    return isinf(x) ? x : round_to(&own, x);
}

/* sum + a b, fused or not. */
static double
add_product(const tiny_system *system, bool fused, double sum, double a, double b)
{
    return round_to(system, sum + (fused ? a * b : round_to(system, a * b)));
}

static double
tiny_chain(const tiny_system *system, const manner *way, int ndim, const double *y, const double *q)
{
    double s = 0.0;
    for (int k = 0; k < ndim; k++) {
        s = add_product(system, way->fused_norm, s, y[k], y[k]);
    }
    for (int k = 0; k < ndim; k++) {
        s = add_product(system, way->fused_chain, s, -2.0 * q[k], y[k]);
    }
    return s;
}

/* A pair within the smallest possible distance must not be out, one beyond the largest not in. */
static bool
claims_hold(const tiny_system *system, const manner *way, int ndim, const double *y,
            const double *q, double error)
{
    double largest = 0.0, low = 0.0, high = 0.0, norm = 0.0, in, out, unused;
    for (int k = 0; k < ndim; k++) {
        double component_low, component_high;
        largest = fmax(largest, fmax(fabs(y[k]), fabs(q[k])));
        distance_interval(system, y[k], q[k], error, &component_low, &component_high);
        low += component_low * component_low;
        high += component_high * component_high;
        norm += q[k] * q[k];
    }
    low = ndim == 1 ? sqrt(low) : sqrt(low) * (1.0 + 0x1p-48);
    high = ndim == 1 ? sqrt(high) : sqrt(high) * (1.0 - 0x1p-48);
    const double s = tiny_chain(system, way, ndim, y, q), extent = 2.0 * largest;
    hs_expanded_bounds(ndim, low, extent, error, system->unit, system->tiny, &unused, &out);
    hs_expanded_bounds(ndim, high, extent, error, system->unit, system->tiny, &in, &unused);
    return s <= rounded_threshold(system, way, out - norm) &&
           s >= rounded_threshold(system, way, in - norm);
}

static void
every_pair_of_a_tiny_system_is_judged_right(void)
{
    static const int lowest[] = {-12, -3, 0, 3}; /* 3: the flushes dwarf everything else */
    double           numbers[512];
    int              wrong = 0;
    for (int digits = 3; digits <= 5; digits++) {
        for (int variant = 0; variant < 32; variant++) {
            const tiny_system system = make_system(digits, lowest[variant / 8], variant & 1, false);
            const manner      way = {false, variant & 2, variant & 4};
            const int         n = list_numbers(&system, 6, numbers);
            for (int i = 0; i < n; i++) {
                for (int j = 0; j < n; j++) {
                    const double y = numbers[i], q = numbers[j], minus = -q;
                    wrong += !claims_hold(&system, &way, 1, &y, &q, 0.0);
                    wrong += !claims_hold(&system, &way, 1, &y, &minus, 0.0);
                    wrong += !claims_hold(&system, &way, 1, &y, &q, 0.3 * numbers[i / 2]);
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
    for (int trial = 0; trial < 96; trial++) {
        const int         ndim = 2 + trial % 3;
        const tiny_system system =
            make_system(3 + trial / 3 % 6, trial % 4 * 4 - 10, trial & 1, false);
        const manner way = {trial & 4, trial & 8, trial & 16};
        const int    n = list_numbers(&system, system.digits < 6 ? 5 : 2, numbers);
        const bool   near = trial & 32; /* close together */
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
            wrong += !claims_hold(&system, &way, ndim, y, q, 0.0);
        }
    }
    CHECK(wrong == 0);
}

/* Small points: every square, product and sum is a little below the smallest normal number and
 * flushed. Scaled so that it is the flushes that count. */
static void
flushed_terms_are_not_sure(void)
{
    const tiny_system system = make_system(24, -126, true, false);
    for (int ndim = 1; ndim <= 8; ndim++) {
        for (int variant = 0; variant < 8; variant++) {
            const manner way = {variant & 1, variant & 2, variant & 4};
            const double last = 1.0 - 0x1p-23;
            double       y[8], q[8], opposite[8];
            for (int k = 0; k < ndim; k++) {
                y[k] = last * 0x1p-63; /* y^2 is flushed, and so is 2 q y */
                q[k] = last * 0x1p-64;
                opposite[k] = -q[k];
            }
            CHECK(tiny_chain(&system, &way, ndim, y, q) == 0.0);
            CHECK(claims_hold(&system, &way, ndim, y, q, 0.0));
            CHECK(claims_hold(&system, &way, ndim, y, opposite, 0.0));
        }
    }
}

/* ---- float32 ---- */

static const double u = 0x1p-24;

/* A pair for a kernel: true points, the floats, and what the two kinds of kernel make of them. */
typedef struct pair {
    int    ndim;
    double Y[HS_MAX_DIM], Q[HS_MAX_DIM];
    float  y[HS_MAX_DIM], q[HS_MAX_DIM];
    double square; /* |Y - Q|^2 */
    double norm;   /* |q|^2 */
    double extent;
    float  s[2];     /* unfused, fused */
    double exact[2]; /* before the last rounding */
} pair;

static void
compute_pair(pair *p)
{
    p->square = p->norm = p->extent = 0.0;
    for (int k = 0; k < p->ndim; k++) {
        p->square += (p->Y[k] - p->Q[k]) * (p->Y[k] - p->Q[k]);
        p->y[k] = (float)p->Y[k];
        p->q[k] = (float)p->Q[k];
        p->norm += (double)p->q[k] * (double)p->q[k];
        p->extent = fmax(p->extent, 2.0 * fmax(fabs((double)p->y[k]), fabs((double)p->q[k])));
    }
    for (int fused = 0; fused < 2; fused++) {
        float s = 0.0f;
        for (int k = 0; k < p->ndim; k++) {
            s = fused ? fmaf(p->y[k], p->y[k], s) : s + p->y[k] * p->y[k];
        }
        for (int k = 0; k < p->ndim; k++) {
            const float c = -2.0f * p->q[k], product = c * p->y[k];
            p->exact[fused] = (double)s + (fused ? (double)c * (double)p->y[k] : (double)product);
            s = fused ? fmaf(c, p->y[k], s) : s + product;
        }
        p->s[fused] = s;
    }
}

/* Neither surely in nor surely out, by a cutoff a little to this side of the distance. */
static bool
is_unsure(const pair *p, int fused, int side, bool *is_wrong)
{
    const double        cutoff = sqrt(p->square) * (1.0 + side * 0x1p-46);
    const hs_expanded   bounds = hs_expanded_of(p->ndim, cutoff, p->extent, 0.0);
    const hs_thresholds t = hs_expanded_thresholds(bounds, p->q, p->ndim);
    const bool is_in = p->s[fused]<t.in, is_out = p->s[fused]> t.out;
    *is_wrong = side > 0 ? is_out : is_in;
    return !is_in && !is_out;
}

static void
float32_thresholds_hold_near_the_cutoff(void)
{
    harness_random random = {43};
    int            wrong = 0, sure = 0;
    for (int trial = 0; trial < 100000; trial++) {
        const double reach = trial % 2 ? 2.0 : 64.0;
        pair         p = {.ndim = 1 + trial % 4};
        for (int k = 0; k < p.ndim; k++) {
            p.Y[k] = reach * (random_unit(&random) - 0.5);
            p.Q[k] = p.Y[k] + (random_unit(&random) - 0.5) * 2.0;
        }
        compute_pair(&p);
        for (int variant = 0; variant < 4; variant++) {
            bool is_wrong;
            sure += !is_unsure(&p, variant & 1, variant & 2 ? 1 : -1, &is_wrong);
            wrong += is_wrong;
        }
    }
    CHECK(wrong == 0);
    CHECK(sure == 0); /* nothing this close to the cutoff is sure */
}

/* Where |q|^2 nearly equals the threshold, their difference has few digits, or is subnormal. */
static void
thresholds_near_zero_hold(void)
{
    harness_random random = {47};
    int            wrong = 0;
    for (int trial = 0; trial < 60000; trial++) {
        const double size = ldexp(1.0, -(trial % 75)); /* squares down to 2^-148 */
        pair         p = {.ndim = 1 + trial % 3};
        for (int k = 0; k < p.ndim; k++) {
            p.Q[k] = size * (random_unit(&random) + 0.5);
            p.Y[k] = trial % 2 ? 0.0 : p.Q[k] * ldexp(random_unit(&random), -20);
        }
        compute_pair(&p);
        for (int variant = 0; variant < 4; variant++) {
            bool is_wrong;
            (void)is_unsure(&p, variant & 1, variant & 2 ? 1 : -1, &is_wrong);
            wrong += is_wrong;
        }
    }
    CHECK(wrong == 0);
}

/* Share of the band on that side that the errors of a pair take, the last rounding left out. */
static double
band_used(pair *p, int fused)
{
    double in, out;
    compute_pair(p);
    hs_expanded_bounds(p->ndim, sqrt(p->square), p->extent, 0.0, u, 0x1p-126, &in, &out);
    const double moved = p->exact[fused] + p->norm - p->square;
    return moved > 0.0 ? moved / (out - p->square) : isinf(in) ? 0.0 : moved / (in - p->square);
}

static double
climb(harness_random *random, int ndim, int fused, double distance)
{
    pair   p = {.ndim = ndim};
    double best = 0.0;
    for (int k = 0; k < ndim; k++) {
        p.Y[k] = 2.0 * random_unit(random) - 1.0;
        p.Q[k] = p.Y[k] + distance * (2.0 * random_unit(random) - 1.0);
    }
    for (int step = 0; step < 4000; step++) {
        double      *x = random_bits(random) & 1 ? p.Y : p.Q;
        const int    k = (int)(random_bits(random) % (unsigned)ndim);
        const double before = x[k];
        const double step_size = ldexp(1.0, -(int)(random_bits(random) % 30));
        x[k] += step_size * (2.0 * random_unit(random) - 1.0);
        const double used = band_used(&p, fused);
        if (used < best) {
            x[k] = before;
        } else {
            best = used;
        }
    }
    return best;
}

/* Hill climbing comes close to the bounds where it can, and never past them. */
static void
climbing_stays_within_the_bounds(void)
{
    static const double least[2][3] = {{0.95, 0.75, 0.5}, {0.75, 0.65, 0.5}};
    harness_random      random = {7};
    for (int ndim = 1; ndim <= 3; ndim++) {
        for (int fused = 0; fused < 2; fused++) {
            double most = 0.0;
            for (int start = 0; start < 60; start++) {
                const double distance = ldexp(1.0, -(start % 10));
                most = fmax(most, climb(&random, ndim, fused, distance));
            }
            CHECK(most <= 1.0);
            CHECK(most > least[fused][ndim - 1]);
        }
    }
}

/* What the caller states of errors is paid for twice. */
static void
errors_of_the_caller_are_paid_for(void)
{
    const double error = 0x1p-12;
    double       in, out;
    hs_expanded_bounds(1, 2.0 * error, 0.0, error, u, 0x1p-126, &in, &out);
    CHECK(16.0 * error * error <= out && isinf(in)); /* y - q is 4 e, or 0 */
    hs_expanded_bounds(1, 6.0 * error, 0.0, error, u, 0x1p-126, &in, &out);
    CHECK(16.0 * error * error >= in && in > 15.9 * error * error);
}

/* In the worst case that the walk uses the form for, one pair in a thousand is unsure. */
static void
thresholds_are_narrow(void)
{
    for (int ndim = 1; ndim <= 8; ndim++) {
        for (double extent = 1.0; hs_expanded_pays(1.0, extent); extent += 1.0) {
            const hs_expanded t = hs_expanded_of(ndim, 1.0, extent, 0.0);
            const double      d = ndim, half = 0.5 * extent;
            const double      band = 4.0 * sqrt(d) * extent + 6.0 * d * d * half * half;
            CHECK(t.in < 1.0 && t.out > 1.0);
            CHECK((t.out - t.in) / u < band * 1.001);
            CHECK(t.out - t.in < 2e-3);
        }
    }
    CHECK(!hs_expanded_pays(1.0, 17.0) && !hs_expanded_pays(0.0, 1.0));
    CHECK(!hs_expanded_pays(1.0, NAN) && !hs_expanded_pays(1.0, INFINITY));
}

static bool
nothing_is_sure(hs_expanded bounds)
{
    return bounds.in == -INFINITY && bounds.out == INFINITY;
}

static void
nothing_is_sure_beyond_the_range_of_float32(void)
{
    const double bad[] = {NAN, INFINITY, 1e200};
    for (int i = 0; i < 3; i++) {
        CHECK(nothing_is_sure(hs_expanded_of(3, 1.0, bad[i], 0.0)));
        CHECK(nothing_is_sure(hs_expanded_of(3, 1.0, 1.0, bad[i])));
    }
    CHECK(nothing_is_sure(hs_expanded_of(3, DBL_MAX, 1.0, 0.0)));
    CHECK(nothing_is_sure(hs_expanded_of(3, 1e20, 1.0, 0.0)));
    CHECK(nothing_is_sure(hs_expanded_of(1, 1.0, 1e20, 0.0)));
    /* A point and itself, and its opposite, as far out as float32 goes: not lost, not taken. */
    for (int exponent = 0; exponent < 128; exponent++) {
        for (int ndim = 1; ndim <= 8; ndim++) {
            pair p = {.ndim = ndim}, other = {.ndim = ndim};
            for (int k = 0; k < ndim; k++) {
                p.Y[k] = p.Q[k] = other.Y[k] = ldexp(1.0 - 0x1p-20, exponent);
                other.Q[k] = -p.Q[k];
            }
            compute_pair(&p);
            compute_pair(&other);
            const hs_expanded   bounds = hs_expanded_of(ndim, 1.0, p.extent, 0.0);
            const hs_thresholds t = hs_expanded_thresholds(bounds, p.q, ndim);
            CHECK(!(p.s[0] > t.out) && !(p.s[1] > t.out));
            CHECK(!(other.s[0] < t.in) && !(other.s[1] < t.in));
        }
    }
}

static void
extreme_cutoffs_are_safe(void)
{
    hs_expanded t = hs_expanded_of(3, 0.0, 1.0, 0.0);
    CHECK(t.in == -INFINITY && t.out > 0.0 && t.out < 1e-5);
    t = hs_expanded_of(3, 0.0, 0.0, 0.0);
    CHECK(t.in == -INFINITY && t.out >= 6.0 * 0x1p-126);
    t = hs_expanded_of(3, 0x1p-1074, 1.0, 0.0);
    CHECK(t.in == -INFINITY && t.out > 0.0);
    t = hs_expanded_of(3, 1.0, 1e9, 0.0);
    CHECK(t.in == -INFINITY && t.out > 1e9);
    t = hs_expanded_of(3, 1.0, 1e4, 0.0);
    CHECK(t.in < 0.0 && t.out > 1.0); /* below zero is no mistake: s may be */
    t = hs_expanded_of(3, 1e18, 1.0, 0.0);
    CHECK(t.in > 0.99e36 && t.out < 1.01e36);
}

void
test_expanded(void)
{
    RUN(every_pair_of_a_tiny_system_is_judged_right);
    RUN(samples_of_tiny_systems_are_judged_right);
    RUN(flushed_terms_are_not_sure);
    RUN(float32_thresholds_hold_near_the_cutoff);
    RUN(thresholds_near_zero_hold);
    RUN(climbing_stays_within_the_bounds);
    RUN(errors_of_the_caller_are_paid_for);
    RUN(thresholds_are_narrow);
    RUN(nothing_is_sure_beyond_the_range_of_float32);
    RUN(extreme_cutoffs_are_safe);
}
