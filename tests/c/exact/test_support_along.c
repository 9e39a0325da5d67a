/* SPDX-License-Identifier: BSD-3-Clause */
/* test_support_along.c: how wide supports are along a normal, against cofactors as integers. */
#include "../../../csrc/core/exact/support.h"
#include "../../../csrc/core/exact/support_along.h"
#include "../support/bigint.h"
#include "../support/harness.h"

#include <math.h>

void test_support_along(void);

static big
whole(double x)
{
    return big_from_double(ldexp(x, -700));
}

/* The cofactor of an entry of three rows. */
static big
cofactor(const double *h, int k, int l)
{
    const int a = k == 0, b = k == 2 ? 1 : 2, c = l == 0, d = l == 2 ? 1 : 2;
    const big plus = big_product(whole(h[hs_support_at(a, c)]), whole(h[hs_support_at(b, d)]));
    const big minus = big_product(whole(h[hs_support_at(a, d)]), whole(h[hs_support_at(b, c)]));
    const big difference = big_difference(plus, minus);
    return (k + l) % 2 ? big_negated(difference) : difference;
}

/* Sign of |H^-1 normal| - width, for three rows and an extent of 1. */
static int
compare_width(const double *h, const double *normal, double width)
{
    big sum = big_from_int(0), determinant = big_from_int(0);
    for (int k = 0; k < 3; k++) {
        big y = big_from_int(0);
        for (int l = 0; l < 3; l++)
            y = big_sum(y, big_product(cofactor(h, k, l), whole(normal[l])));
        sum = big_sum(sum, big_product(y, y));
        determinant =
            big_sum(determinant, big_product(whole(h[hs_support_at(0, k)]), cofactor(h, 0, k)));
    }
    /* y is cofactor times normal: as many factors as the determinant; the width is one more. */
    const big one = whole(1.0), limit = big_product(determinant, whole(width));
    return big_compare(big_product(sum, big_product(one, one)), big_product(limit, limit));
}

static void
fill(harness_random *random, double needle, double *h)
{
    double v[3][3];
    for (int e = 0; e < HS_SUPPORT_ENTRIES; e++)
        h[e] = 0.0;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            v[i][k] = (double)(random_bits(random) % 64) - 32.0;
            for (int l = 0; l <= k; l++)
                h[hs_support_at(k, l)] += v[i][k] * v[i][l];
        }
    }
    for (int k = 0; k < 3; k++)
        h[hs_support_at(k, k)] += needle;
}

static void
widths_are_bounds_and_near(void)
{
    harness_random random = {901};
    int            wrong = 0, far = 0, seen = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        double       h[HS_SUPPORT_ENTRIES], reach;
        const double normals[4][3] = {
            {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.6, 0.8}, {-0.48, 0.36, 0.8}};
        const double *normal = normals[trial % 4];
        fill(&random, ldexp(1.0, -(trial / 4 % 30)), h);
        if (hs_support_reach(3, h, 1.0, &reach) != HS_SUPPORT_FITS)
            continue;
        const double width = hs_support_width(3, h, hs_support_size(3, h), 1.0, reach, normal);
        wrong += compare_width(h, normal, width) > 0 || !(width <= reach * 1.0001);
        far += compare_width(h, normal, 0.99 * width) < 0;
        seen++;
    }
    CHECK(wrong == 0 && far == 0 && seen > TRIALS(20000) / 2);
}

/* Beside diagonal ones, and of what float64 hardly holds. */
static void
widths_of_any_dimension_and_size(void)
{
    const double h[] = {2.0, 0.0, 8.0, 0.0, 0.0, 0.5}, x[] = {1.0, 0.0, 0.0}, y[] = {0.0, 1.0, 0.0};
    for (int ndim = 1; ndim <= 3; ndim++) {
        const double reach = ndim < 3 ? 1.0 : 4.0, size = hs_support_size(ndim, h);
        const double along = hs_support_width(ndim, h, size, 2.0, reach, x);
        CHECK(along >= 1.0 && along < 1.0 + 1e-12);
        if (ndim > 1) {
            const double across = hs_support_width(ndim, h, size, 2.0, reach, y);
            CHECK(across >= 0.25 && across < 0.25 + 1e-12);
        }
    }
    /* What is not moderate, the solution, the extent or the reach: as wide as a ball, and little more. */
    const double thin[] = {1.0, 0.0, 0x1p-210}, needle[] = {1.0, 0.0, 0x1p-150};
    const double round[] = {1.0, 0.0, 1.0};
    const struct {
        const double *h, *normal;
        double        extent, reach;
    } balls[] = {{thin, y, 0x1p-30, 0x1p180},
                 {round, x, 0x1p-300, 0x1p-300},
                 {round, x, 0x1p300, 0x1p300},
                 {needle, x, 0x1p100, 0x1p250}};
    for (size_t b = 0; b < sizeof balls / sizeof *balls; b++) {
        const double size = hs_support_size(2, balls[b].h), reach = balls[b].reach;
        const double width =
            hs_support_width(2, balls[b].h, size, balls[b].extent, reach, balls[b].normal);
        CHECK(width >= reach && width <= reach * (1.0 + 0x1p-47));
    }
    const double large[] = {0x1p600, 0.0, 0x1p602}, tiny[] = {0x1p-600, 0.0, 0x1p-598};
    CHECK(hs_support_width(2, large, hs_support_size(2, large), 1.0, 0x1p-600, y) >= 0x1p-600);
    CHECK(hs_support_width(2, tiny, hs_support_size(2, tiny), 1.0, 0x1p600, y) >= 0x1p600);
}

void
test_support_along(void)
{
    RUN(widths_are_bounds_and_near);
    RUN(widths_of_any_dimension_and_size);
}
