/* SPDX-License-Identifier: BSD-3-Clause */
/* test_dyadic.c: sums, products and comparisons of exact numbers against those of bigint.h. */
#include "../../../csrc/core/exact/dyadic.h"
#include "../support/bigint.h"
#include "../support/harness.h"

void test_dyadic(void);

/* Of any float64, zeros and subnormal ones, few bits and many. */
static double
any_double(harness_random *random)
{
    const int    exponent = (int)(random_bits(random) % 2098) - 1074;
    const double full = 1.0 + random_unit(random), few = 1.0 + (double)(random_bits(random) % 4);
    const double x = ldexp(random_bits(random) % 2 ? full : few, exponent);
    const double size = isfinite(x) ? x : 0x1p1000;
    return random_bits(random) % 16 == 0 ? 0.0 : random_bits(random) % 2 ? size : -size;
}

/* In units of 2^-2148, as a product of bigint.h. */
static big
big_of_product(double a, double b)
{
    return big_product(big_from_double(a), big_from_double(b));
}

/* Whether x is this multiple of 2^-2148: 64 limbs of 32 bits lie below the point, and 4 bits more. */
static bool
is_same(const hs_dyadic *x, const big *expected)
{
    const int places = 34; /* 2^-2176 */
    big       shifted = *expected, found = {0, 0, {0}};
    big       unit = big_from_bits(1, 28, 1);
    shifted = big_product(shifted, unit);
    if (x->n == 0 || shifted.sign == 0) {
        return x->n == 0 && shifted.sign == 0;
    }
    if (x->limb[0] == 0 || x->limb[x->n - 1] == 0 || x->place < -places) {
        return false;
    }
    found.sign = x->negative ? -1 : 1;
    for (int32_t i = 0; i < x->n; i++) {
        const int word = 2 * (x->place + places + i);
        found.word[word] = (uint32_t)x->limb[i];
        found.word[word + 1] = (uint32_t)(x->limb[i] >> 32);
        found.n = word + 2;
    }
    while (found.n > 0 && found.word[found.n - 1] == 0)
        found.n--;
    return found.sign == shifted.sign && big_compare(found, shifted) == 0;
}

static void
products_are_exact(void)
{
    harness_random random = {511};
    int            wrong = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const double a = any_double(&random), b = any_double(&random);
        const big    expected = big_of_product(a, b);
        hs_dyadic    x, y, product;
        hs_dyadic_set(a, 0, &x);
        hs_dyadic_set(b, 0, &y);
        hs_dyadic_multiply(&x, &y, &product);
        wrong += !is_same(&product, &expected);
        wrong += hs_dyadic_sign(&product) != expected.sign;
    }
    CHECK(wrong == 0);
}

/* a b + c d and a b - c d, where c d is anything or a b again. */
static void
sums_are_exact(void)
{
    harness_random random = {512};
    int            wrong = 0, zeros = 0;
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const double a = any_double(&random), b = any_double(&random);
        const bool   same = trial % 8 == 0;
        const double c = same ? -b : any_double(&random), d = same ? a : any_double(&random);
        hs_dyadic    x, y, one, other, sum, copy;
        hs_dyadic_set(a, 0, &x);
        hs_dyadic_set(b, 0, &y);
        hs_dyadic_multiply(&x, &y, &one);
        hs_dyadic_set(c, 0, &x);
        hs_dyadic_set(d, 0, &y);
        hs_dyadic_multiply(&x, &y, &other);
        const big first = big_of_product(a, b), second = big_of_product(c, d);
        const big added = big_sum(first, second), less = big_difference(first, second);
        hs_dyadic_add(&one, &other, false, &sum);
        wrong += !is_same(&sum, &added);
        zeros += sum.n == 0;
        hs_dyadic_copy(&sum, &copy);
        wrong += !is_same(&copy, &added);
        hs_dyadic_add(&one, &other, true, &sum);
        wrong += !is_same(&sum, &less);
        big left = first, right = second;
        left.sign = left.sign != 0;
        right.sign = right.sign != 0;
        wrong += hs_dyadic_compare_sizes(&one, &other) != big_compare(left, right);
        wrong += hs_dyadic_compare_sizes(&one, &one) != 0;
    }
    CHECK(wrong == 0 && zeros > TRIALS(20000) / 16);
}

/* x 2^e is x scaled, beyond what float64 holds as well; integers up to the ends of int64. */
static void
numbers_are_set_exactly(void)
{
    static const int64_t integers[] = {0, 1, -1, 7, INT64_C(1) << 40, INT64_MAX, INT64_MIN};
    harness_random       random = {513};
    int                  wrong = 0;
    for (int trial = 0; trial < TRIALS(5000); trial++) {
        const double x = any_double(&random);
        const int    exponent = (int)(random_bits(&random) % 3000) - 1500;
        hs_dyadic    one, power, product, direct;
        hs_dyadic_set(x, 0, &one);
        hs_dyadic_set(1.0, exponent, &power);
        hs_dyadic_multiply(&one, &power, &product);
        hs_dyadic_set(x, exponent, &direct);
        hs_dyadic_add(&product, &direct, true, &one);
        wrong += one.n != 0 || (x != 0.0) != (direct.n > 0);
    }
    for (size_t e = 0; e < sizeof integers / sizeof integers[0]; e++) {
        const big one = big_product(big_from_int(integers[e]), big_of_product(1.0, 1.0));
        hs_dyadic x;
        hs_dyadic_set_integer(integers[e], &x);
        wrong += !is_same(&x, &one);
    }
    CHECK(wrong == 0);
}

void
test_dyadic(void)
{
    RUN(products_are_exact);
    RUN(sums_are_exact);
    RUN(numbers_are_set_exactly);
}
