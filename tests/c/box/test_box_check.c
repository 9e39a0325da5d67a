/* SPDX-License-Identifier: BSD-3-Clause */
/* test_box_check.c: independence is decided for the numbers given, not for rounded determinants. */
#include "../../../csrc/core/box/box_check.h"
#include "../support/basis_checks.h"
#include "../support/harness.h"

#include <math.h>

void test_box_check(void);

static bool
independent(int ndim, int n, matrix a)
{
    return hs_rows_independent(ndim, n, as_const(a));
}

static void
swap_rows(int ndim, matrix a, int k, int l)
{
    for (int c = 0; c < ndim; c++) {
        double other = a[k][c];
        a[k][c] = a[l][c];
        a[l][c] = other;
    }
}

/* Random integers with this many bits. */
static void
fill_integers(harness_random *random, int ndim, int n, int bits, matrix a)
{
    memset(a, 0, sizeof(matrix));
    for (int k = 0; k < n; k++) {
        for (int c = 0; c < ndim; c++) {
            a[k][c] = (double)((int64_t)(random_bits(random) >> (64 - bits)) -
                               (INT64_C(1) << (bits - 1)));
        }
    }
}

static void
no_rows_are_independent(void)
{
    matrix a = {{0.0}};
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        CHECK(independent(ndim, 0, a));
    }
}

static void
a_zero_row_is_dependent(void)
{
    harness_random random = {1};
    for (int n = 1; n <= HS_MAX_DIM; n++) {
        for (int k = 0; k < n; k++) {
            matrix a;
            fill_integers(&random, HS_MAX_DIM, n, 50, a);
            CHECK(independent(HS_MAX_DIM, n, a));
            for (int c = 0; c < HS_MAX_DIM; c++) {
                a[k][c] = c % 2 == 0 ? 0.0 : -0.0;
            }
            CHECK(!independent(HS_MAX_DIM, n, a));
        }
    }
}

static void
the_first_zero_row_is_named(void)
{
    double rows[3][HS_MAX_DIM] = {{0x1p-1074, 0, 0}, {0, -0.0, 0}, {0, 0, 0}};
    CHECK(hs_zero_row(3, 3, rows) == 1 && hs_zero_row(3, 1, rows) == 1);
    CHECK(hs_zero_row(3, 0, rows) == 0);
    rows[1][2] = 1e300;
    CHECK(hs_zero_row(3, 3, rows) == 2);
    rows[2][0] = -1.0;
    CHECK(hs_zero_row(3, 3, rows) == 3);
}

static void
aligned_boxes_of_any_length_are_independent(void)
{
    static const double lengths[] = {1.0, 5e-324, -1.7e308, 0x1p-1022, 0.1, -1e12, 3e-310, 1e300};
    for (int turn = 0; turn < 64; turn++) {
        for (int n = 1; n <= HS_MAX_DIM; n++) {
            matrix a = {{0.0}};
            for (int k = 0; k < n; k++) {
                a[k][(k + turn) % HS_MAX_DIM] = lengths[(k * (turn / 8) + turn) % 8];
            }
            CHECK(independent(HS_MAX_DIM, n, a));
        }
    }
}

static void
equal_and_opposite_rows_are_dependent(void)
{
    harness_random random = {2};
    for (int repeat = 0; repeat < 300; repeat++) {
        int    ndim = 2 + repeat % 7, n = 2 + repeat % (ndim - 1);
        matrix a;
        fill_integers(&random, ndim, n, 53, a);
        CHECK(independent(ndim, n, a));
        for (int c = 0; c < ndim; c++) { /* any power of two between them */
            a[n - 1][c] = ldexp(repeat % 2 == 0 ? a[0][c] : -a[0][c], repeat % 5 * 200 - 400);
        }
        swap_rows(ndim, a, n - 1, repeat % n == 0 ? n - 1 : repeat % n);
        CHECK(!independent(ndim, n, a));
    }
}

/* Sums that are exact in doubles are dependent, and the next double is not. */
static void
one_ulp_tells_sums_apart(void)
{
    harness_random random = {3};
    for (int repeat = 0; repeat < 300; repeat++) {
        int    ndim = 2 + repeat % 7, last = 2 + repeat % (ndim - 1) - 1;
        double unit = ldexp(1.0, (int)(random_bits(&random) % 2000) - 1050);
        matrix a;
        fill_integers(&random, ndim, last, 40, a);
        for (int k = 0; k < last; k++) {
            for (int c = 0; c < ndim; c++) {
                a[k][c] *= unit;
                a[last][c] += (double)(k % 3 - 1 + (k == 0) * 3) * a[k][c]; /* 2, 0, 1, -1 ... */
            }
        }
        CHECK(!independent(ndim, last + 1, a));
        int at = repeat % ndim;
        a[last][at] = nextafter(a[last][at], repeat % 2 == 0 ? INFINITY : -INFINITY);
        CHECK(independent(ndim, last + 1, a));
    }
}

/* a + b = c, where the sum is rounded: independent, unless it happened to be exact. */
static void
rounded_sums_are_independent(void)
{
    harness_random random = {4};
    int            n_exact = 0;
    for (int repeat = 0; repeat < 1000; repeat++) {
        matrix a = {{0.0}};
        bool   exact = true;
        for (int c = 0; c < 3; c++) {
            double x = random_unit(&random), y = random_unit(&random), sum = x + y;
            double y_part = sum - x;
            exact = exact && x - (sum - y_part) == 0.0 && y - y_part == 0.0;
            a[0][c] = x;
            a[1][c] = y;
            a[2][c] = sum;
        }
        n_exact += exact;
        CHECK(independent(3, 3, a) == !exact);
    }
    CHECK(n_exact > 10 && n_exact < 990);
}

static void
determinants_that_floats_get_wrong(void)
{
    static const struct {
        double rows[3][3];
        int    n;
        bool   independent;
    } cases[] = {
        {{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}}, 3, false},
        {{{0.1, 0.2, 0.3}, {0.4, 0.5, 0.6}, {0.7, 0.8, 0.9}}, 3, true}, /* as doubles */
        {{{0.1, 0.3}, {0.2, 0.6}}, 2, false},
        {{{0.1, 0.3}, {0.3, 0.9}}, 2, true},
        {{{1e-200, 0, 0}, {0, 1e-200, 0}, {0, 0, 1e-200}}, 3, true},   /* underflow */
        {{{1e200, 1, 0}, {0, 1e200, 0}, {0, 0, 1e200}}, 3, true},      /* overflow */
        {{{1e200, 1e200, 0}, {1e200, 1e200, 0}, {0, 0, 1}}, 3, false}, /* inf - inf */
        {{{1e300, 1e-300, 0}, {1e300, 5e-324, 0}, {0, 0, 1}}, 3, true},
        {{{1, 1e-300, 0}, {1, 0, 0}, {0, 0, 1}}, 3, true},
        {{{0x1p53, 0x1p53 - 1}, {0x1p53 - 1, 0x1p53 - 2}}, 2, true}, /* -1 of 2^106 */
        {{{0x1p53 - 2, 0x1p53 - 4}, {0x1p52 - 1, 0x1p52 - 2}}, 2, false},
        {{{1, 0x1p-1074, 0}, {0x1p-1074, 0, 0}}, 2, true},
        {{{0x1p-1074, 0x1p-1073, 0}, {0x1p1000, 0x1p1001, 0}}, 2, false},
        {{{0x1p-1074, 0x1p-1073, 0}, {0x1p1000, 0x1p1001, 0x1p-1074}}, 2, true},
        {{{0x1p-1074, 0x1p-1020, 0}, {1.0, 0x1p54, 0}}, 2, false},
        {{{3, 0, 0}, {0, 5, 0}, {0x1p1000, 0x1p-1000, 0}}, 3, false},
        {{{3, 0, 0}, {0, 5, 0}, {0x1p1000, 0x1p-1000, 5e-324}}, 3, true},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        matrix a = {{0.0}};
        int    n = cases[k].n;
        for (int i = 0; i < 9; i++) {
            a[i / 3][i % 3] = cases[k].rows[i / 3][i % 3];
        }
        for (int turn = 0; turn < 2 * n; turn++) {
            swap_rows(3, a, turn % n, (turn + 1) % n);
            CHECK(independent(3, n, a) == cases[k].independent);
        }
    }
}

/*
 * Determinants that vanish modulo the primes that are tried first, one of them or up to four:
 * whoever trusts these primes alone calls the rows dependent.
 */
static void
multiples_of_primes_are_not_zero(void)
{
    static const int below[] = {57, 87, 117, 143, 153, 167, 171, 195}; /* p = 2^62 - these */
    for (int k = 0; k < 8; k++) {
        matrix a = {{0x1p62, below[k]}, {1.0, 1.0}};
        CHECK(independent(2, 2, a));
        a[0][1] = 0x1p62;
        CHECK(!independent(2, 2, a));
    }
    for (int n = 1; n <= 4; n++) {
        matrix a = {{0.0}};
        for (int k = 0; k < 2 * n; k += 2) { /* diagonal blocks of determinant p */
            a[k][k] = 0x1p62;
            a[k][k + 1] = below[k / 2];
            a[k + 1][k] = 1.0;
            a[k + 1][k + 1] = 1.0;
        }
        CHECK(independent(HS_MAX_DIM, 2 * n, a));
    }
}

/* Every entry far from its neighbours: the bound takes hundreds of primes. */
static void
huge_spreads_are_decided(void)
{
    harness_random random = {5};
    for (int repeat = 0; repeat < 12; repeat++) {
        int    n = 2 + repeat % 7;
        matrix a = {{0.0}};
        for (int k = 0; k < n; k++) {
            for (int c = 0; c < n; c++) {
                double unit = (k + c) % 2 == 0 ? 0x1p1000 : 0x1p-1074;
                a[k][c] = (double)(1 + random_bits(&random) % 1000) * unit;
            }
        }
        CHECK(independent(n, n, a));
        for (int c = 0; c < n; c++) {
            a[n - 1][c] = a[0][c] + (n > 3 ? a[2][c] : 0.0);
        }
        CHECK(!independent(n, n, a));
        a[n - 1][1] += 0x1p-1074;
        CHECK(independent(n, n, a));
    }
}

/* The last row is the sum of the others, and entries of a row differ by up to 2^1007. */
static void
sums_of_far_magnitudes_are_dependent(void)
{
    for (int exponent = 0; exponent < 1000; exponent++) {
        const double one = ldexp(1.0, exponent), other = ldexp(256.0, exponent);
        matrix       a = {{1.0, other, 1.0}, {1.0, one, 3.0}, {2.0, one + other, 4.0}};
        CHECK(!independent(3, 3, a));
        a[2][1] = nextafter(a[2][1], INFINITY);
        CHECK(independent(3, 3, a));
    }
}

/* Rows in a subspace, mixed by integers, in every shape. */
static void
dimension_counts(void)
{
    harness_random random = {6};
    for (int repeat = 0; repeat < 400; repeat++) {
        int    ndim = 1 + repeat % HS_MAX_DIM, rank = 1 + repeat / 8 % ndim;
        matrix basis, weight, a = {{0.0}};
        fill_integers(&random, ndim, rank, 22, basis);
        fill_integers(&random, rank, HS_MAX_DIM, 22, weight);
        for (int k = 0; k < ndim; k++) {
            for (int c = 0; c < ndim; c++) {
                for (int r = 0; r < rank; r++) {
                    a[k][c] += weight[k][r] * basis[r][c]; /* below 2^47: exact */
                }
            }
        }
        for (int n = 0; n <= ndim; n++) {
            CHECK(independent(ndim, n, a) == (n <= rank));
        }
    }
}

/* a b modulo p < 2^63, by doubling. */
static uint64_t
product_modulo(uint64_t a, uint64_t b, uint64_t p)
{
    uint64_t product = 0;
    for (int bit = 62; bit >= 0; bit--) {
        product = product + product >= p ? product + product - p : product + product;
        if (a >> bit & 1)
            product = product + b >= p ? product + b - p : product + b;
    }
    return product;
}

/* Whether p passes the strong test to a base, the plain way. */
static bool
is_strong(uint64_t p, uint64_t base)
{
    int      halvings = 0;
    uint64_t odd = p - 1, x = 1;
    for (; odd % 2 == 0; odd /= 2)
        halvings++;
    for (int bit = 62; bit >= 0; bit--) {
        x = product_modulo(x, x, p);
        if (odd >> bit & 1)
            x = product_modulo(x, base, p);
    }
    bool passes = x == 1;
    for (int k = 0; k < halvings; k++) {
        passes = passes || x == p - 1;
        x = product_modulo(x, x, p);
    }
    return passes;
}

/* Every prime is found, and nothing else: a composite number does not tell the rank. */
static void
moduli_are_the_next_primes(void)
{
    uint64_t p = UINT64_C(1) << 62, wrong = 0;
    for (int n = 0; n < 60; n++) {
        const uint64_t next = hs_prime_below(n == 0 ? p + 1 : p);
        for (uint64_t q = p - (n == 0 ? 1 : 2); q >= next; q -= 2) {
            bool is_prime = q % 3 != 0 && q % 5 != 0 && q % 7 != 0;
            for (uint64_t base = 2; is_prime && base < 40; base++)
                is_prime = is_strong(q, base);
            wrong += is_prime != (q == next);
        }
        CHECK(n > 0 || next == p - 57);
        p = next;
    }
    CHECK(wrong == 0);
}

void
test_box_check(void)
{
    RUN(moduli_are_the_next_primes);
    RUN(no_rows_are_independent);
    RUN(a_zero_row_is_dependent);
    RUN(the_first_zero_row_is_named);
    RUN(aligned_boxes_of_any_length_are_independent);
    RUN(equal_and_opposite_rows_are_dependent);
    RUN(one_ulp_tells_sums_apart);
    RUN(rounded_sums_are_independent);
    RUN(determinants_that_floats_get_wrong);
    RUN(multiples_of_primes_are_not_zero);
    RUN(huge_spreads_are_decided);
    RUN(sums_of_far_magnitudes_are_dependent);
    RUN(dimension_counts);
}
