/* SPDX-License-Identifier: BSD-3-Clause */
/* test_weights.c: sums of products are exact until they are rounded once, whoever adds them. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/histogram/weights.h"
#include "../support/bigint.h"
#include "../support/harness.h"

#include <float.h>

void test_weights(void);

enum { N = 40 };

static const int32_t identity[N] = {0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11, 12, 13,
                                    14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27,
                                    28, 29, 30, 31, 32, 33, 34, 35, 36, 37, 38, 39};

static hs_weights
weights_of(const double *weights, int64_t n)
{
    hs_weights taken;
    hs_failure failure;
    CHECK(hs_weights_init(NULL, weights, identity, n, &taken, &failure) == HS_OK);
    return taken;
}

static void
add(hs_sums *sums, int64_t k, const hs_weights *a, int i, const hs_weights *b, int j)
{
    const int32_t place =
        (a->place != NULL ? a->place[i] : 0) + (b->place != NULL ? b->place[j] : 0);
    hs_sums_expect(sums, 1);
    hs_sums_add(sums->limbs + k * sums->n_limbs, a->value != NULL ? a->value[i] : 1,
                b->value != NULL ? b->value[j] : 1, place);
}

/* Is `rounded` the float64 nearest to the sum, the even one of two? `exact` is in units of
 * 2^-2148. */
static bool
is_nearest(big exact, double rounded)
{
    const big unit = big_from_double(1.0), two = big_from_int(2);
    const big twice = big_product(exact, two);
    if (isinf(rounded)) {
        const big limit = big_product(big_from_double(DBL_MAX), unit);
        return big_compare_magnitude(&limit, &exact) < 0 && (exact.sign < 0) == (rounded < 0.0);
    }
    const double below = nextafter(rounded, -INFINITY), above = nextafter(rounded, INFINITY);
    uint64_t     bits;
    memcpy(&bits, &rounded, sizeof bits);
    const big self = big_product(big_from_double(rounded), unit);
    int       low = 1, high = -1;
    if (!isinf(below))
        low = big_compare(twice, big_sum(self, big_product(big_from_double(below), unit)));
    if (!isinf(above))
        high = big_compare(twice, big_sum(self, big_product(big_from_double(above), unit)));
    return bits & 1 ? low > 0 && high < 0 : low >= 0 && high <= 0;
}

/* 0: one size; 1: charges; 2: sizes far apart; 3: all there are; 4: few bits, so that ties and
 * cancellation are common; 5: tiny. */
static double
random_weight(harness_random *random, int kind)
{
    const double x = 2.0 * random_unit(random) - 1.0;
    const int    any = (int)(random_bits(random) % 2000);
    switch (kind) {
    case 0: return x;
    case 1: return 0.01 * floor(100.0 * x);
    case 2: return ldexp(x, any % 120 - 60);
    case 3: return ldexp(x, any - 1050);
    case 4: return ldexp(floor(8.0 * x), any % 2 ? 0 : any % 3 ? 53 : -53);
    default: return ldexp(x, -530 - any % 20);
    }
}

static void
sums_are_rounded_once(void)
{
    harness_random random = {2718281};
    for (int trial = 0; trial < 3000; trial++) {
        const int kind = trial % 6, n = 1 + (int)(random_bits(&random) % N);
        double    a[N], b[N];
        for (int i = 0; i < N; i++) {
            a[i] = random_weight(&random, kind);
            b[i] = trial % 7 ? random_weight(&random, kind) : 1.0;
        }
        hs_weights of_a = weights_of(a, N);
        hs_weights of_b = weights_of(trial % 7 ? b : NULL, N);
        hs_sums    sums, others;
        CHECK(hs_sums_init(NULL, 2, &of_a, &of_b, &sums) == HS_OK);
        CHECK(hs_sums_init(NULL, 2, &of_a, &of_b, &others) == HS_OK);
        big exact = big_from_int(0);
        for (int e = 0; e < n; e++) {
            const int i = (int)(random_bits(&random) % N), j = (int)(random_bits(&random) % N);
            exact = big_sum(exact, big_product(big_from_double(a[i]), big_from_double(b[j])));
            add(e % 3 ? &sums : &others, 1, &of_a, i, &of_b, j);
        }
        hs_sums_join(&sums, &others);
        const double rounded = hs_sums_round(&sums, 1);
        CHECK(is_nearest(exact, rounded));
        CHECK(hs_sums_round(&sums, 0) == 0.0);
        hs_sums_free(NULL, &sums);
        hs_sums_free(NULL, &others);
        hs_weights_free(NULL, &of_a);
        hs_weights_free(NULL, &of_b);
    }
}

/* As often as limbs bear without being carried, and again after that. */
static void
limbs_do_not_overflow(void)
{
    const double weight = ldexp(1.0, 53) - 1.0;
    hs_weights   of = weights_of(&weight, 1);
    hs_sums      sums;
    CHECK(hs_sums_init(NULL, 1, &of, &of, &sums) == HS_OK);
    for (int round = 0; round < 3; round++) {
        sums.n_added = HS_SUMS_MOST_ADDED;
        for (int e = 0; e < sums.n_limbs - 1; e++) {
            sums.limbs[e] += UINT32_MAX * (HS_SUMS_MOST_ADDED - 1);
        }
        hs_sums_expect(&sums, 1);
        CHECK(sums.n_added == 1);
        for (int e = 0; e < sums.n_limbs - 1; e++) {
            CHECK(sums.limbs[e] >= 0 && sums.limbs[e] <= UINT32_MAX);
            sums.limbs[e] = 0;
        }
        sums.limbs[sums.n_limbs - 1] = 0;
        hs_sums_add(sums.limbs, of.value[0], -of.value[0], 0);
        hs_sums_carry(&sums);
        CHECK(hs_sums_round(&sums, 0) == -(weight * weight));
        memset(sums.limbs, 0, (size_t)sums.n_limbs * sizeof *sums.limbs);
    }
    hs_sums_free(NULL, &sums);
    hs_weights_free(NULL, &of);
}

/* 96 bits, of which 53 are kept: half of the last one, with and without the very last bit. */
static void
the_last_bit_breaks_ties(void)
{
    const double   weight = ldexp(1.0, 53) - 1.0;
    const uint32_t digits[][3] = {
        {0, 0x400, 0x80000000}, {1, 0x400, 0x80000000}, {0x800, 0, 1}, {0x801, 0, 1}};
    const double kept[] = {0x1p63, 0x1p63 + 0x1p11, 0x1p32, 0x1p32 + 0x1p-20};
    hs_weights   of = weights_of(&weight, 1);
    hs_sums      sums;
    CHECK(hs_sums_init(NULL, 1, &of, &of, &sums) == HS_OK && sums.n_limbs >= 4);
    /* Room for the largest product 2^62 times, and its sign. */
    CHECK(32 * sums.n_limbs >= 2 * of.bits + 2 * of.most_place + 63);
    CHECK(32 * sums.n_limbs < 2 * of.bits + 2 * of.most_place + 63 + 64);
    for (int c = 0; c < 4; c++) {
        memset(sums.limbs, 0, (size_t)sums.n_limbs * sizeof *sums.limbs);
        for (int e = 0; e < 3; e++)
            sums.limbs[e] = digits[c][e];
        CHECK(hs_sums_round(&sums, 0) == ldexp(kept[c], sums.exponent + 32));
    }
    hs_sums_free(NULL, &sums);
    hs_weights_free(NULL, &of);
}

/* Weights of 0 have no bits, and the lowest exponent is as good as any. */
static void
zeros_take_no_bits(void)
{
    const double zeros[N] = {0.0, -0.0};
    for (int n = 0; n <= N; n += N / 2) {
        hs_weights taken = weights_of(zeros, n);
        CHECK(taken.exponent == 0 && taken.bits == 0 && taken.most_place == 0);
        CHECK(taken.place == NULL);
        for (int i = 0; i < n; i++)
            CHECK(taken.value[i] == 0);
        hs_weights_free(NULL, &taken);
    }
}

static void
weights_must_be_finite(void)
{
    const double bad[] = {NAN, INFINITY, -INFINITY};
    for (int e = 0; e < 3; e++) {
        const double weights[] = {1.0, 0.0, bad[e]};
        hs_weights   taken;
        hs_failure   failure = {.row = -1};
        CHECK(hs_weights_init(NULL, weights, identity, 3, &taken, &failure) == HS_ERR_WEIGHTS);
        CHECK(failure.row == 2);
    }
}

/* Weights with places of their own need two arrays; more sums than can be counted are refused. */
static void
sums_need_memory(void)
{
    const double  weights[] = {0x1p400, 0x1p-400};
    const int64_t before = hs_test_live_blocks();
    hs_weights    taken;
    hs_failure    failure;
    hs_sums       sums;
    for (int nth = 1; nth <= 2; nth++) {
        hs_test_fail_allocation(nth);
        CHECK(hs_weights_init(NULL, weights, identity, 2, &taken, &failure) == HS_ERR_MEMORY);
        hs_test_fail_allocation(0);
        CHECK(taken.value == NULL && taken.place == NULL && hs_test_live_blocks() == before);
    }
    CHECK(hs_weights_init(NULL, weights, identity, 2, &taken, &failure) == HS_OK);
    CHECK(hs_sums_init(NULL, INT64_MAX / 2, &taken, &taken, &sums) == HS_ERR_MEMORY);
    CHECK(hs_sums_init(NULL, 2, &taken, &taken, &sums) == HS_OK);
    hs_sums_free(NULL, &sums);
    hs_weights_free(NULL, &taken);
    CHECK(hs_test_live_blocks() == before);
}

void
test_weights(void)
{
    RUN(sums_are_rounded_once);
    RUN(limbs_do_not_overflow);
    RUN(the_last_bit_breaks_ties);
    RUN(zeros_take_no_bits);
    RUN(weights_must_be_finite);
    RUN(sums_need_memory);
}
