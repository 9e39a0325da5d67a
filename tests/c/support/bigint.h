/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * bigint.h: exact arithmetic for the tests, as plain as possible and sharing no code with the
 * library: sign and magnitude, words of 32 bits, schoolbook everything.
 *
 * A double is held as a multiple of 2^-1074, so a product of two is a multiple of 2^-2148.
 */
#ifndef HS_TEST_BIGINT_H
#define HS_TEST_BIGINT_H

#include <math.h>
#include <stdint.h>
#include <string.h>

/* The truth that the library is held against: sanitizers, which look for errors of the library,
 * need not slow it down. */
#if defined(__GNUC__)
#define TRUTH static inline __attribute__((no_sanitize("address", "undefined", "thread")))
#else
#define TRUTH static inline
#endif

#define BIG_WORDS 150 /* 4800 bits: |D|^2 of the largest D takes 4336 */

typedef struct big {
    int      sign; /* -1, 0, 1 */
    int      n;    /* words in use; the highest is not zero */
    uint32_t word[BIG_WORDS];
} big;

TRUTH big
big_from_bits(uint64_t magnitude, int shift, int sign)
{
    big b;
    b.sign = magnitude == 0 ? 0 : sign;
    b.n = 0;
    if (magnitude == 0)
        return b;
    b.n = shift / 32 + 3;
    memset(b.word, 0, (size_t)b.n * sizeof b.word[0]);
    for (int bit = 0; bit < 64; bit++)
        if (magnitude >> bit & 1)
            b.word[(shift + bit) / 32] |= UINT32_C(1) << ((shift + bit) % 32);
    while (b.word[b.n - 1] == 0)
        b.n--;
    return b;
}

TRUTH big
big_from_double(double x)
{
    int          exponent;
    const double fraction = frexp(fabs(x), &exponent); /* [1/2, 1), or 0 */
    uint64_t     significand = (uint64_t)ldexp(fraction, 53);
    int          shift = exponent - 53 + 1074;
    while (significand != 0 && shift < 0) { /* subnormal: the low bits are zero */
        significand >>= 1;
        shift++;
    }
    return big_from_bits(significand, shift, x < 0 ? -1 : 1);
}

TRUTH big
big_from_int(int64_t x)
{
    return big_from_bits(x < 0 ? ~(uint64_t)x + 1 : (uint64_t)x, 0, x < 0 ? -1 : 1);
}

TRUTH int
big_compare_magnitude(const big *a, const big *b)
{
    if (a->n != b->n)
        return a->n < b->n ? -1 : 1;
    for (int i = a->n - 1; i >= 0; i--)
        if (a->word[i] != b->word[i])
            return a->word[i] < b->word[i] ? -1 : 1;
    return 0;
}

TRUTH big
big_negated(big a)
{
    a.sign = -a.sign;
    return a;
}

TRUTH big
big_sum(big a, big b)
{
    if (a.sign == 0)
        return b;
    if (b.sign == 0)
        return a;
    const int order = big_compare_magnitude(&a, &b);
    if (order < 0) {
        const big swap = a;
        a = b;
        b = swap;
    }
    int64_t   carry = 0;
    const int same = a.sign == b.sign;
    for (int i = 0; i < a.n; i++) {
        const int64_t other = i < b.n ? (int64_t)b.word[i] : 0;
        carry += (int64_t)a.word[i] + (same ? other : -other);
        a.word[i] = (uint32_t)carry;
        carry >>= 32; /* arithmetic: borrows are -1 */
    }
    if (carry > 0)
        a.word[a.n++] = (uint32_t)carry;
    while (a.n > 0 && a.word[a.n - 1] == 0)
        a.n--;
    if (a.n == 0)
        a.sign = 0;
    return a;
}

TRUTH big
big_difference(big a, big b)
{
    return big_sum(a, big_negated(b));
}

TRUTH big
big_product(big a, big b)
{
    big c;
    c.sign = a.sign * b.sign;
    c.n = c.sign == 0 ? 0 : a.n + b.n;
    if (c.sign == 0)
        return c;
    memset(c.word, 0, (size_t)c.n * sizeof c.word[0]);
    for (int i = 0; i < a.n; i++) {
        uint64_t carry = 0;
        if (a.word[i] == 0)
            continue;
        for (int j = 0; j < b.n; j++) {
            carry += (uint64_t)a.word[i] * b.word[j] + c.word[i + j];
            c.word[i + j] = (uint32_t)carry;
            carry >>= 32;
        }
        c.word[i + b.n] = (uint32_t)carry;
    }
    while (c.word[c.n - 1] == 0)
        c.n--;
    return c;
}

/* -1, 0 or 1 as a is less than, equal to or more than b. */
TRUTH int
big_compare(big a, big b)
{
    return big_difference(a, b).sign;
}

/* a * 2^exponent as a double, truncated to its leading 64 bits first. */
TRUTH double
big_to_double(const big *a, int exponent)
{
    double value = 0.0;
    for (int i = a->n - 1; i >= 0 && i >= a->n - 3; i--)
        value += ldexp((double)a->word[i], exponent + 32 * i);
    return a->sign * value;
}

/* Component k of D = q - p + shift * rows, in units of 2^-1074. */
TRUTH big
big_component(int n_rows, const double rows[][8], const double *p, const double *q,
              const int64_t *shift, int k)
{
    big component = big_difference(big_from_double(q[k]), big_from_double(p[k]));
    for (int l = 0; l < n_rows && shift != NULL; l++)
        component =
            big_sum(component, big_product(big_from_int(shift[l]), big_from_double(rows[l][k])));
    return component;
}

/* |D|^2, in units of 2^-2148. */
TRUTH big
big_square(int ndim, int n_rows, const double rows[][8], const double *p, const double *q,
           const int64_t *shift)
{
    big sum = big_from_int(0);
    for (int k = 0; k < ndim; k++) {
        const big component = big_component(n_rows, rows, p, q, shift, k);
        sum = big_sum(sum, big_product(component, component));
    }
    return sum;
}

#endif
