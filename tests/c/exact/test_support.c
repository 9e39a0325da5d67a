/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_support.c: which matrices are positive definite and how far their ellipsoids reach, against
 * leading minors as integers: certain for every float64, and nearly as short as can be.
 */
#include "../../../csrc/core/exact/support.h"
#include "../support/bigint.h"
#include "../support/harness.h"

void test_support(void);

/* Scaled, so that three of them fit bigint.h, of whose unit 2^-1074 they are multiples. */
static big
entry(const double *h, double less, int k, int l)
{
    const big own = big_from_double(ldexp(h[hs_support_at(k, l)], -700));
    return k == l ? big_difference(own, big_from_double(ldexp(less, -700))) : own;
}

static big
minor_of(const double *h, double less, int a, int b, int c, int d)
{
    return big_difference(big_product(entry(h, less, a, c), entry(h, less, b, d)),
                          big_product(entry(h, less, a, d), entry(h, less, b, c)));
}

/* Whether H - less I is positive definite. */
static bool
is_definite(int ndim, const double *h, double less)
{
    const big one = entry(h, less, 0, 0);
    if (one.sign <= 0 || (ndim > 1 && minor_of(h, less, 0, 1, 0, 1).sign <= 0)) {
        return false;
    }
    if (ndim < 3) {
        return true;
    }
    const big first = big_product(one, minor_of(h, less, 1, 2, 1, 2));
    const big second = big_product(entry(h, less, 0, 1), minor_of(h, less, 1, 2, 0, 2));
    const big third = big_product(entry(h, less, 0, 2), minor_of(h, less, 1, 2, 0, 1));
    return big_sum(big_difference(first, second), third).sign > 0;
}

/* The sum of d - 1 or more squares of small integer vectors: singular with d - 1. */
static void
fill(harness_random *random, int ndim, int n_vectors, double *h)
{
    for (int e = 0; e < HS_SUPPORT_ENTRIES; e++)
        h[e] = 0.0;
    for (int v = 0; v < n_vectors; v++) {
        double x[3];
        for (int k = 0; k < ndim; k++)
            x[k] = (double)(random_bits(random) % 64) - 32.0;
        for (int k = 0; k < ndim; k++)
            for (int l = 0; l <= k; l++)
                h[hs_support_at(k, l)] += x[k] * x[l];
    }
}

/* Indefinite ones, singular ones and those a hair beside, at any scale. */
static void
definite_is_decided_exactly(void)
{
    harness_random random = {601};
    int            wrong = 0, count[2] = {0, 0};
    for (int trial = 0; trial < TRIALS(30000); trial++) {
        const int ndim = 1 + trial % 3;
        double    h[HS_SUPPORT_ENTRIES], scaled[HS_SUPPORT_ENTRIES], reach;
        const int scale = (int)(random_bits(&random) % 1600) - 800;
        fill(&random, ndim, ndim - (trial / 3 % 2), h);
        if (trial / 6 % 3 > 0) {
            const int k = (int)(random_bits(&random) % (uint64_t)ndim);
            const int hair = (int)(random_bits(&random) % 30);
            h[hs_support_at(k, k)] += ldexp(trial / 18 % 2 ? 1.0 : -1.0, -hair);
        }
        for (int e = 0; e < HS_SUPPORT_ENTRIES; e++)
            scaled[e] = ldexp(h[e], scale);
        const bool             expected = is_definite(ndim, h, 0.0);
        const hs_support_state state = hs_support_reach(ndim, scaled, ldexp(1.0, scale), &reach);
        wrong += (state == HS_SUPPORT_FITS) != expected || state == HS_SUPPORT_TOO_LONG;
        count[expected]++;
    }
    CHECK(wrong == 0 && count[0] > TRIALS(30000) / 4 && count[1] > TRIALS(30000) / 4);
}

/* extent / reach is below all eigenvalues, and 1.02 of it is not. */
static void
reaches_are_bounds_and_not_far_off(void)
{
    harness_random random = {602};
    int            wrong = 0, far = 0, seen = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const int    ndim = 1 + trial % 3;
        const double extent = ldexp(1.0, (int)(random_bits(&random) % 20));
        double       h[HS_SUPPORT_ENTRIES], reach;
        fill(&random, ndim, ndim + 1 - trial / 3 % 2, h);
        if (trial % 5 == 0) /* a needle, or what is nearly singular */
            h[0] += ldexp(1.0, (int)(random_bits(&random) % 40) - 10);
        if (hs_support_reach(ndim, h, extent, &reach) != HS_SUPPORT_FITS)
            continue;
        seen++;
        /* Rounded the other way, so that the tests are strict. */
        wrong += !is_definite(ndim, h, nextafter(extent / reach, 0.0) * (1.0 - 0x1p-50));
        far += is_definite(ndim, h, 1.02 * (extent / reach));
    }
    CHECK(wrong == 0 && far == 0 && seen > TRIALS(20000) / 2);
}

/* Where the axes differ by less than a factor of 100, by less than a millionth. */
static void
reaches_of_round_supports_are_near(void)
{
    harness_random random = {603};
    int            far = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const int ndim = 1 + trial % 3;
        double    h[HS_SUPPORT_ENTRIES], reach;
        fill(&random, ndim, ndim, h);
        for (int k = 0; k < ndim; k++)
            h[hs_support_at(k, k)] += 1024.0 * 64.0 / 60.0; /* the largest one is below 3 * 2^15 */
        CHECK(hs_support_reach(ndim, h, 1.0, &reach) == HS_SUPPORT_FITS);
        far += is_definite(ndim, h, (1.0 + 1e-6) / reach);
    }
    CHECK(far == 0);
}

/* Diagonal ones, whose eigenvalues are known, of all sizes; the identity is no needle. */
static void
extremes_fit_or_are_refused(void)
{
    const double thin[] = {0x1p-1000, 0.0, 0x1p60, 0.0, 0.0, 1.0};
    const double tiny[] = {0x1p-1074, 0.0, 1.0, 0.0, 0.0, 1.0};
    const double flat[] = {1.0, 0.0, 0x1p1000, 0.0, 0.0, 0x1p1000};
    const double huge[] = {0x1p-600, 0.0, 0x1p600, 0.0, 0.0, 1.0};
    const double one[] = {1.0, 0.0, 1.0, 0.0, 0.0, 1.0};
    double       reach = -1.0;
    CHECK(hs_support_reach(3, one, 0.0, &reach) == HS_SUPPORT_FITS && reach == 0.0);
    CHECK(hs_support_reach(3, one, 0x1p1021, &reach) == HS_SUPPORT_FITS && reach >= 0x1p1021);
    CHECK(hs_support_reach(3, one, 0x1p1023, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(1, one, 5e-324, &reach) == HS_SUPPORT_FITS && reach >= 5e-324);
    CHECK(hs_support_reach(3, flat, 3.0, &reach) == HS_SUPPORT_FITS);
    CHECK(reach >= 3.0 && reach < 3.05);
    CHECK(hs_support_reach(3, huge, 1.0, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(2, huge, 1.0, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(3, tiny, 1.0, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(3, tiny, 0x1p-100, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(3, thin, 0x1p-30, &reach) == HS_SUPPORT_FITS);
    CHECK(reach >= 0x1p970 && reach < 0x1.05p970);
    CHECK(hs_support_reach(3, thin, 0x1p200, &reach) == HS_SUPPORT_TOO_LONG);
    CHECK(hs_support_reach(1, tiny, 0x1p-1074, &reach) == HS_SUPPORT_FITS);
    CHECK(reach >= 1.0 && reach < 1.001);
}

/* Two negative eigenvalues and a positive one, which lies above the diagonal, and a determinant that
 * is positive: what passes for the smallest eigenvalue is the largest. */
static void
two_negative_eigenvalues_are_none_positive(void)
{
    for (int beside = 2; beside < 1000;
         beside++) { /* eigenvalues 1 - beside, twice, 1 + 2 beside */
        const double of = beside, h[] = {1.0, of, 1.0, of, of, 1.0};
        double       reach;
        CHECK(!is_definite(3, h, 0.0));
        CHECK(hs_support_reach(3, h, 1.0, &reach) == HS_SUPPORT_NOT_DEFINITE && reach == 0.0);
    }
}

/* No smaller than the root of the sum of all squares, which for these is a whole number. */
static void
sizes_are_bounds(void)
{
    const double h[] = {1.0, 2.0, 4.0, 2.0, -2.0, 8.0}; /* 1 + 16 + 64 + 2 * 12 = 105 */
    const double plane[] = {1.0, 2.0, 4.0};             /* 25 */
    for (int scale = -1060; scale <= 1018; scale += 20) {
        double scaled[6];
        for (int e = 0; e < 6; e++)
            scaled[e] = ldexp(h[e], scale);
        const double size = hs_support_size(3, scaled);
        CHECK(size >= ldexp(sqrt(105.0), scale) * (1.0 - 0x1p-52));
        CHECK(scale < -1000 || size <= ldexp(sqrt(105.0), scale) * (1.0 + 0x1p-46));
    }
    CHECK(hs_support_size(2, plane) >= 5.0 && hs_support_size(2, plane) < 5.0 + 1e-12);
    CHECK(hs_support_size(1, plane) >= 1.0 && hs_support_size(1, plane) < 1.0 + 1e-12);
    const double largest[] = {0x1.fffffffffffffp1023, 0.0, 0x1.fffffffffffffp1023};
    CHECK(hs_support_size(2, largest) == HUGE_VAL);
}

void
test_support(void)
{
    RUN(definite_is_decided_exactly);
    RUN(reaches_are_bounds_and_not_far_off);
    RUN(reaches_of_round_supports_are_near);
    RUN(extremes_fit_or_are_refused);
    RUN(two_negative_eigenvalues_are_none_positive);
    RUN(sizes_are_bounds);
}
