/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_EXACT_ARITHMETIC_H
#define HS_EXACT_ARITHMETIC_H

#include "../base/base.h"

#include <float.h>
#include <math.h>
#include <string.h>

/*
 * arithmetic.h: numbers beyond float64: pairs of float64, integers of many limbs, and sums and
 * products of doubles that lose nothing.
 */

/*
 * Error-free transformations and double-word arithmetic. A double-word is an unevaluated sum
 * hi + lo with |lo| at most half a unit in the last place of hi: about 106 bits.
 *
 * v = 2^-53. Every statement assumes round to nearest and neither overflow nor underflow; callers
 * keep to a safe range (HS_RANGE_GUARD). Sources: [D] Dekker, Numer. Math. 18 (1971) 224; [K]
 * Knuth, The Art of Computer Programming 2, 4.2.2; [JMP] Joldes, Muller, Popescu, ACM Trans. Math.
 * Softw. 44 (2017) 15.
 */

#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD == 2
#error "doubles must be computed as doubles: on 32-bit x86 compile with -msse2 -mfpmath=sse"
#endif

#if defined(__FMA__) || defined(__ARM_FEATURE_FMA) || defined(FP_FAST_FMA)
#define HS_FAST_FMA 1
#else
#define HS_FAST_FMA 0 /* fma() may be a library call of a hundred instructions */
#endif

typedef struct hs_dw {
    double hi, lo;
} hs_dw;

/* hi + lo == a + b exactly. [K] Holds for subnormal numbers too. */
HS_ALWAYS_INLINE hs_dw
hs_two_sum(double a, double b)
{
    const double sum = a + b;
    const double b_part = sum - a;
    const double a_part = sum - b_part;
    return (hs_dw){sum, (a - a_part) + (b - b_part)};
}

/* hi + lo == a + b exactly, if a is 0 or |a| >= |b|. [D] */
HS_ALWAYS_INLINE hs_dw
hs_fast_two_sum(double a, double b)
{
    const double sum = a + b;
    return (hs_dw){sum, b - (sum - a)};
}

#if !HS_FAST_FMA
/* hi + lo == a exactly, of at most 26 bits each, so that their products are exact. Veltkamp, [D] */
HS_ALWAYS_INLINE hs_dw
hs_split(double a)
{
    const double scaled = 0x1.0000002p27 * a; /* 2^27 + 1 */
    const double hi = scaled - (scaled - a);
    return (hs_dw){hi, a - hi};
}
#endif

/* hi + lo == a * b exactly. [D] */
HS_ALWAYS_INLINE hs_dw
hs_two_product(double a, double b)
{
    const double product = a * b;
#if HS_FAST_FMA
    return (hs_dw){product, fma(a, b, -product)};
#else
    const hs_dw x = hs_split(a), y = hs_split(b);
    return (hs_dw){product, ((x.hi * y.hi - product) + x.hi * y.lo + x.lo * y.hi) + x.lo * y.lo};
#endif
}

/* hi + lo == a * a exactly. [D] */
HS_ALWAYS_INLINE hs_dw
hs_two_square(double a)
{
    const double square = a * a;
#if HS_FAST_FMA
    return (hs_dw){square, fma(a, a, -square)};
#else
    const hs_dw x = hs_split(a);
    return (hs_dw){square, ((x.hi * x.hi - square) + 2.0 * (x.hi * x.lo)) + x.lo * x.lo};
#endif
}

/* x + y, relative error at most 3 v^2 + 13 v^3, also where they cancel. [JMP] algorithm 6 */
HS_ALWAYS_INLINE hs_dw
hs_dw_add(hs_dw x, hs_dw y)
{
    const hs_dw s = hs_two_sum(x.hi, y.hi);
    const hs_dw t = hs_two_sum(x.lo, y.lo);
    const hs_dw r = hs_fast_two_sum(s.hi, s.lo + t.hi);
    return hs_fast_two_sum(r.hi, t.lo + r.lo);
}

/*
 * x + y as hs_dw_add. *lost, not negative, grows unless the sum is exact: of the operations above
 * only s.lo + t.hi and t.lo + r.lo are rounded, and here what they lose is computed too. Exact for
 * any x and y, normalised or not, because each transformation is [K].
 */
HS_ALWAYS_INLINE hs_dw
hs_dw_add_watched(hs_dw x, hs_dw y, double *lost)
{
    const hs_dw s = hs_two_sum(x.hi, y.hi);
    const hs_dw t = hs_two_sum(x.lo, y.lo);
    const hs_dw inner = hs_two_sum(s.lo, t.hi);
    const hs_dw r = hs_two_sum(s.hi, inner.hi);
    const hs_dw outer = hs_two_sum(t.lo, r.lo);
    *lost += fabs(inner.lo) + fabs(outer.lo);
    return hs_two_sum(r.hi, outer.hi);
}

/*
 * x * x with a relative error of at most 6 v^2. In units of v^2 x^2: 2 x.hi x.lo is at most 2 / v
 * and its rounding costs 2; the sum with the low word of x.hi^2 (1 / v) costs 3; x.lo^2, which is
 * left out, is 1.
 */
HS_ALWAYS_INLINE hs_dw
hs_dw_square(hs_dw x)
{
    const hs_dw s = hs_two_square(x.hi);
    return hs_fast_two_sum(s.hi, s.lo + (x.hi + x.hi) * x.lo);
}

/* sqrt(x) rounded once, from x > 0: one Newton step on a rounded square root doubles its digits,
 * so that beside the last rounding there is only an error of a few v^2. */
HS_ALWAYS_INLINE double
hs_dw_sqrt(hs_dw x)
{
    const double root = sqrt(x.hi);
    const hs_dw  square = hs_two_square(root);
    return root + (((x.hi - square.hi) - square.lo) + x.lo) / (root + root);
}

/* The floats next to a float, for bounds that must not be rounded the wrong way. */

/* The next double above x >= 0; infinity stays. Not below what x was rounded from. */
HS_ALWAYS_INLINE double
hs_next_up(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits += x <= 0x1.fffffffffffffp1023; /* not for infinity and NaN */
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* The next double below x > 0; 0 and infinity stay. Not above what x was rounded from. */
HS_ALWAYS_INLINE double
hs_next_down(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits -= x > 0.0 && x <= 0x1.fffffffffffffp1023;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* Products of numbers >= 0, not below and not above the true ones. */
HS_ALWAYS_INLINE double
hs_multiply_up(double a, double b)
{
    return hs_next_up(a * b);
}

HS_ALWAYS_INLINE double
hs_multiply_down(double a, double b)
{
    return hs_next_down(a * b);
}

/* The few operations on 64-bit limbs that long integers are made of. */

#if defined(_MSC_VER)
#include <intrin.h>
#endif

/* Number of bits of x: 0 for 0, 64 for 2^63 and more. */
HS_ALWAYS_INLINE int
hs_bit_length(uint64_t x)
{
#if defined(__GNUC__)
    return x == 0 ? 0 : 64 - __builtin_clzll(x);
#elif defined(_MSC_VER) && (defined(_M_X64) || defined(_M_ARM64))
    unsigned long index;
    return _BitScanReverse64(&index, x) ? (int)index + 1 : 0;
#else
    int bits = 0;
    for (int step = 32; step > 0; step /= 2) {
        if (x >> step) {
            x >>= step;
            bits += step;
        }
    }
    return bits + (x != 0);
#endif
}

/* Number of zero bits below the lowest one of x > 0. */
HS_ALWAYS_INLINE int
hs_trailing_zeros(uint64_t x)
{
#if defined(__GNUC__)
    return __builtin_ctzll(x);
#else
    return hs_bit_length(x & (~x + 1)) - 1;
#endif
}

/* The low limb of a * b + c + *carry, which always fits two limbs; *carry becomes the high one. */
HS_ALWAYS_INLINE uint64_t
hs_multiply_add(uint64_t a, uint64_t b, uint64_t c, uint64_t *carry)
{
#if HS_HAVE_INT128
    const hs_uint128 sum = (hs_uint128)a * b + c + *carry;
    *carry = (uint64_t)(sum >> 64);
    return (uint64_t)sum;
#else
    const uint64_t mask = UINT32_MAX;
    const uint64_t low = (a & mask) * (b & mask);
    const uint64_t mid = (a >> 32) * (b & mask) + (low >> 32);    /* at most 2^64 - 2^32 */
    const uint64_t other = (a & mask) * (b >> 32) + (mid & mask); /* at most 2^64 - 2^32 */
    uint64_t       high = (a >> 32) * (b >> 32) + (mid >> 32) + (other >> 32);
    uint64_t       sum = (other << 32) | (low & mask);
    sum += c;
    high += sum < c;
    sum += *carry;
    high += sum < *carry;
    *carry = high;
    return sum;
#endif
}

/* a + b + *carry modulo 2^64; *carry (0 or 1) becomes what is carried. */
HS_ALWAYS_INLINE uint64_t
hs_add_carry(uint64_t a, uint64_t b, uint64_t *carry)
{
    const uint64_t partial = a + b;
    const uint64_t sum = partial + *carry;
    *carry = (uint64_t)(partial < a) | (uint64_t)(sum < partial);
    return sum;
}

/*
 * Numbers m 2^e with integers m and e, added and multiplied exactly: every float64 is one, and so
 * is every determinant of them. For the few decisions that float stages leave over; there is no
 * allocation and no rounding.
 */

/*
 * Room for the largest of them, the determinant of three rows less an eigenvalue: entries are
 * multiples of 2^-2148 (an eigenvalue of a scaled matrix, scaled back) below 2^1025, that is 51
 * limbs, and three of them multiplied 153. The square of |H D| has 2 (17 + 18 + 35) and one more.
 */
#define HS_DYADIC_LIMBS 160

/* The sum of limb[i] 2^(64 (place + i)); no limbs for zero, otherwise the first and the last one
 * are not zero. */
typedef struct hs_dyadic {
    bool     negative;
    int32_t  n, place;
    uint64_t limb[HS_DYADIC_LIMBS];
} hs_dyadic;

/* x 2^exponent of a finite x. */
void hs_dyadic_set(double x, int exponent, hs_dyadic *to);
void hs_dyadic_set_integer(int64_t x, hs_dyadic *to);

/* a + b, or a - b. `to` must be neither. */
void hs_dyadic_add(const hs_dyadic *a, const hs_dyadic *b, bool subtract, hs_dyadic *to);

/* sum += a. */
void hs_dyadic_add_to(hs_dyadic *sum, const hs_dyadic *a);

/* a b. `to` must be neither. */
void hs_dyadic_multiply(const hs_dyadic *a, const hs_dyadic *b, hs_dyadic *to);

/* Sign of |a| - |b|: -1, 0 or 1. */
int hs_dyadic_compare_sizes(const hs_dyadic *a, const hs_dyadic *b);

/* -1, 0 or 1. */
HS_ALWAYS_INLINE int
hs_dyadic_sign(const hs_dyadic *x)
{
    return x->n == 0 ? 0 : x->negative ? -1 : 1;
}

#endif
