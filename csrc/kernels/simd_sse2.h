/* SPDX-License-Identifier: BSD-3-Clause */
/* simd_sse2.h: what slab_template.h needs of a vocabulary, for SSE2, which every x86-64 CPU has: 4
 * lanes. */
#ifndef HS_SIMD_SSE2_H
#define HS_SIMD_SSE2_H

#include "../core/base/base.h"

#include <emmintrin.h>

/* One operation a line. */
/* clang-format off */

enum { LANES = 4 };
typedef __m128   floats;
typedef __m128i  integers; /* int32 */
typedef unsigned mask; /* one bit a lane */

HS_ALWAYS_INLINE floats broadcast(float x) { return _mm_set1_ps(x); }
HS_ALWAYS_INLINE floats subtract(floats a, floats b) { return _mm_sub_ps(a, b); }
HS_ALWAYS_INLINE floats multiply(floats a, floats b) { return _mm_mul_ps(a, b); }
/* a * b + c, rounded twice. */
HS_ALWAYS_INLINE floats
multiply_add(floats a, floats b, floats c)
{
    return _mm_add_ps(_mm_mul_ps(a, b), c);
}
/* Lanes with !(a > b), set for NaN. */
HS_ALWAYS_INLINE mask
not_greater(floats a, floats b)
{
    return (mask)_mm_movemask_ps(_mm_cmpngt_ps(a, b));
}
/* Lanes of m with !(a < b), set for NaN. */
HS_ALWAYS_INLINE mask
and_not_less(mask m, floats a, floats b)
{
    return m & (mask)_mm_movemask_ps(_mm_cmpnlt_ps(a, b));
}
/* The first n of them, 1 <= n < LANES. */
HS_ALWAYS_INLINE mask first_lanes(int32_t n) { return (1u << n) - 1; }
/* From a word of 16 digits, one for each mask. */
HS_ALWAYS_INLINE unsigned
popcount(mask m)
{
    return (unsigned)(UINT64_C(0x4332322132212110) >> (4 * m)) & 15;
}
/* Packs the lanes in m to dst, writing up to LANES entries; returns how many count. */
HS_ALWAYS_INLINE int32_t
append(int32_t *dst, integers a, mask m)
{
    int32_t lane[LANES], n = 0;
    _mm_storeu_si128((__m128i *)lane, a);
    for (int l = 0; l < LANES; l++) {
        dst[n] = lane[l];
        n += (int32_t)(m >> l & 1);
    }
    return n;
}
HS_ALWAYS_INLINE integers
load_integers(const int32_t *p)
{
    return _mm_loadu_si128((const __m128i *)p);
}
HS_ALWAYS_INLINE integers bits_of(floats a) { return _mm_castps_si128(a); }
/* to[k], lane by lane: y[number * stride + k], for k = 0, 1, 2, 3. */
HS_ALWAYS_INLINE void
load_points(const float *y, int64_t stride, const int32_t *number, floats *to)
{
    const __m128 a = _mm_loadu_ps(y + number[0] * stride), b = _mm_loadu_ps(y + number[1] * stride);
    const __m128 c = _mm_loadu_ps(y + number[2] * stride), d = _mm_loadu_ps(y + number[3] * stride);
    const __m128 ab = _mm_unpacklo_ps(a, b), cd = _mm_unpacklo_ps(c, d);
    const __m128 high_ab = _mm_unpackhi_ps(a, b), high_cd = _mm_unpackhi_ps(c, d);
    to[0] = _mm_movelh_ps(ab, cd);
    to[1] = _mm_movehl_ps(cd, ab);
    to[2] = _mm_movelh_ps(high_ab, high_cd);
    to[3] = _mm_movehl_ps(high_cd, high_ab);
}

#endif
