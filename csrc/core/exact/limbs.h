/* SPDX-License-Identifier: BSD-3-Clause */
/* limbs.h: the few operations on 64-bit limbs that long integers are made of. */
#ifndef HS_LIMBS_H
#define HS_LIMBS_H

#include "../base/base.h"

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

#endif
