/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * box_check.c: exact linear independence, by elimination modulo primes just below 2^62.
 *
 * Multiplying a row by a power of two keeps the rank, so the rows may be taken as integers. If
 * they are independent, some n x n minor is a nonzero integer, at most B by Hadamard's
 * inequality. A prime modulo which the rank is deficient divides every minor. Therefore
 *   - full rank modulo one prime proves independence: some minor is nonzero modulo it;
 *   - deficient rank modulo primes whose product exceeds B proves dependence: their product
 *     divides every minor, and zero is the only multiple of it that small.
 * The first prime settles practically every independent box; only dependent rows and rows made
 * for the purpose go further. Numbers are kept as in Montgomery (1985), scaled by R = 2^64.
 */
#include "box_check.h"

#include <string.h>

/* The largest prime below 2^62, so that the usual call need not look for one. */
#define FIRST_PRIME ((UINT64_C(1) << 62) - 57)

/* Every prime that can be reached exceeds 2^61: there are about 2^61 / 43 between. */
#define PRIME_BITS 61

typedef struct modulus {
    uint64_t p;
    uint64_t negated_inverse; /* -1/p modulo R */
    uint64_t one;             /* R modulo p */
} modulus;

/* A row as integers, mantissa * 2^exponent. */
typedef struct integer_row {
    int64_t mantissa[HS_MAX_DIM];
    int     exponent[HS_MAX_DIM]; /* not negative, least 0 */
} integer_row;

/* 0 <= a, b < p < 2^62: a b / R modulo p. */
HS_ALWAYS_INLINE uint64_t
multiply(const modulus *m, uint64_t a, uint64_t b)
{
#if HS_HAVE_INT128
    hs_uint128 product = (hs_uint128)a * b;
    uint64_t   factor = (uint64_t)product * m->negated_inverse;
    uint64_t   result = (uint64_t)((product + (hs_uint128)factor * m->p) >> 64);
#else
    uint64_t operands[2][2] = {{a, b}, {0, m->p}};
    uint64_t high[2], low = 0;
    for (int k = 0; k < 2; k++) {
        uint64_t x = operands[k][0], y = operands[k][1];
        uint64_t x0 = x & UINT32_MAX, x1 = x >> 32, y0 = y & UINT32_MAX, y1 = y >> 32;
        uint64_t middle = x1 * y0 + ((x0 * y0) >> 32); /* at most 2^64 - 2^32 */
        uint64_t other = x0 * y1 + (middle & UINT32_MAX);
        high[k] = x1 * y1 + (middle >> 32) + (other >> 32);
        if (k == 0) {
            low = x * y;
            operands[1][0] = low * m->negated_inverse;
        }
    }
    /* The low halves cancel: they add up to R, or to nothing where both are zero. */
    uint64_t result = high[0] + high[1] + (low != 0);
#endif
    return result >= m->p ? result - m->p : result;
}

static modulus
make_modulus(uint64_t p)
{
    modulus  m;
    uint64_t inverse = p; /* of p modulo 2^3, as of any odd number; each step doubles the bits */
    for (int bits = 3; bits < 64; bits *= 2) {
        inverse *= 2 - p * inverse;
    }
    m.p = p;
    m.negated_inverse = 0 - inverse;
    m.one = (0 - p) % p;
    return m;
}

/* base: x R modulo p. Returns x^exponent R modulo p. */
static uint64_t
power(const modulus *m, uint64_t base, uint64_t exponent)
{
    uint64_t result = m->one;
    for (; exponent != 0; exponent >>= 1) {
        if (exponent & 1) {
            result = multiply(m, result, base);
        }
        base = multiply(m, base, base);
    }
    return result;
}

HS_ALWAYS_INLINE uint64_t
add(const modulus *m, uint64_t a, uint64_t b)
{
    return a + b >= m->p ? a + b - m->p : a + b;
}

/* Whether odd p passes the strong test of Miller and Rabin to a base: no prime fails. */
static bool
passes(const modulus *m, uint64_t base)
{
    uint64_t minus_one = m->p - m->one;
    uint64_t odd = m->p - 1, x = 0;
    int      halvings = 0;
    while (odd % 2 == 0) {
        odd /= 2;
        halvings++;
    }
    for (int bit = 31; bit >= 0; bit--) { /* x = base R modulo p */
        x = add(m, x, x);
        x = (base >> bit) & 1 ? add(m, x, m->one) : x;
    }
    x = power(m, x, odd);
    if (x == m->one || x == minus_one) {
        return true;
    }
    for (int k = 1; k < halvings; k++) {
        x = multiply(m, x, x);
        if (x == minus_one) {
            return true;
        }
    }
    return false;
}

/* 2^61 < p < 2^62, odd. */
static bool
is_prime(uint64_t p)
{
    /* The first twelve primes as bases decide every number below 3.3e24 (Sorenson and Webster
     * 2015); dividing by them first costs less than a test and drops most numbers. */
    static const uint64_t small[12] = {2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37};
    for (int k = 1; k < 12; k++) {
        if (p % small[k] == 0) {
            return false;
        }
    }
    modulus m = make_modulus(p);
    for (int k = 0; k < 12; k++) {
        if (!passes(&m, small[k])) {
            return false;
        }
    }
    return true;
}

uint64_t
hs_prime_below(uint64_t p)
{
    do {
        p -= 2;
    } while (!is_prime(p));
    return p;
}

/* Returns bits enough for every integer of the row, or -1 if all are zero. */
static int
load_row(int ndim, const double row[], integer_row *integers)
{
    int least = INT32_MAX, bits = -1;
    for (int k = 0; k < ndim; k++) {
        uint64_t word;
        memcpy(&word, &row[k], sizeof word);
        int      biased = (int)((word >> 52) & 2047);
        uint64_t mantissa = word & ((UINT64_C(1) << 52) - 1);
        mantissa |= biased != 0 ? UINT64_C(1) << 52 : 0;
        integers->mantissa[k] = word >> 63 ? -(int64_t)mantissa : (int64_t)mantissa;
        integers->exponent[k] = biased != 0 ? biased - 1 : 0; /* of the least subnormal: 0 */
        if (mantissa != 0 && integers->exponent[k] < least) {
            least = integers->exponent[k];
        }
    }
    for (int k = 0; k < ndim; k++) {
        integers->exponent[k] -= least;
        if (integers->mantissa[k] != 0 && integers->exponent[k] + 53 > bits) {
            bits = integers->exponent[k] + 53;
        }
    }
    return bits;
}

/* out: the row modulo p, times 1/R. */
static void
take_residues(const modulus *m, int ndim, const integer_row *row, uint64_t out[])
{
    for (int k = 0; k < ndim; k++) {
        int64_t  mantissa = row->mantissa[k];
        int      exponent = row->exponent[k];
        uint64_t residue = 0;
        if (mantissa != 0) {
            residue = mantissa > 0 ? (uint64_t)mantissa : m->p - (uint64_t)-mantissa;
            residue = multiply(m, residue, UINT64_C(1) << (exponent % 61));
        }
        if (residue != 0 && exponent >= 61) {
            uint64_t two = add(m, m->one, m->one);
            residue = multiply(m, residue, power(m, two, (uint64_t)(exponent - exponent % 61)));
        }
        out[k] = residue;
    }
}

/*
 * Elimination without division: what is left of a row is multiplied by the pivot instead. For
 * the rank a row's factor is of no account, nor is the 1/R that every product brings.
 */
static bool
full_rank(uint64_t p, int ndim, int n_rows, const integer_row rows[])
{
    modulus  m = make_modulus(p);
    uint64_t a[HS_MAX_DIM][HS_MAX_DIM];
    for (int k = 0; k < n_rows; k++) {
        take_residues(&m, ndim, &rows[k], a[k]);
    }
    for (int k = 0; k < n_rows; k++) {
        int column = 0;
        while (column < ndim && a[k][column] == 0) {
            column++;
        }
        if (column == ndim) {
            return false;
        }
        uint64_t pivot = a[k][column];
        for (int i = k + 1; i < n_rows; i++) {
            uint64_t factor = a[i][column];
            if (factor == 0) {
                continue;
            }
            factor = p - factor;
            for (int c = 0; c < ndim; c++) {
                a[i][c] = add(&m, multiply(&m, pivot, a[i][c]), multiply(&m, factor, a[k][c]));
            }
        }
    }
    return true;
}

bool
hs_rows_independent(int ndim, int n_rows, const double rows[][HS_MAX_DIM])
{
    integer_row integers[HS_MAX_DIM];
    int         bound_bits = 0;
    HS_ASSERT(0 <= n_rows && n_rows <= ndim && ndim <= HS_MAX_DIM);
    for (int k = 0; k < n_rows; k++) {
        int bits = load_row(ndim, rows[k], &integers[k]);
        if (bits < 0) {
            return false;
        }
        bound_bits += bits + 2; /* a minor's row is no longer than sqrt(8) 2^bits */
    }
    /* At most 8 * 2100 bits: some 280 primes. */
    uint64_t p = FIRST_PRIME;
    for (int proven_bits = 0; proven_bits <= bound_bits; proven_bits += PRIME_BITS) {
        if (proven_bits != 0) {
            p = hs_prime_below(p);
        }
        if (full_rank(p, ndim, n_rows, integers)) {
            return true;
        }
    }
    return false;
}

int
hs_zero_row(int ndim, int n_rows, const double rows[][HS_MAX_DIM])
{
    integer_row ignored;
    int         k = 0;
    while (k < n_rows && load_row(ndim, rows[k], &ignored) >= 0) {
        k++;
    }
    return k;
}
