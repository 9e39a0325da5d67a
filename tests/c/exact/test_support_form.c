/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_support_form.c: the thresholds of supports in float32, against |N D| in float64, which is
 * exact enough: they hold it between them however entries, coordinates and sums are rounded, and
 * the roundings of one term come near their bound.
 */
#include "../../../csrc/core/exact/filter.h"

#include "../../../csrc/kernels/kernel.h"
#include "../support/harness.h"

#include <float.h>
#include <math.h>

void test_support_form(void);

static const double u = 0x1p-24;

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
test_support_form(void)
{
    RUN(thresholds_hold);
    RUN(roundings_of_a_term_come_near_their_bound);
    RUN(roundings_grow_with_the_axes);
    RUN(nothing_is_sure_of_what_float32_does_not_hold);
}
