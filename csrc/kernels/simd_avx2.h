/* SPDX-License-Identifier: BSD-3-Clause */
/* simd_avx2.h: the vocabulary of scan_template.h for AVX2 with FMA: 8 lanes. */
#ifndef HS_SIMD_AVX2_H
#define HS_SIMD_AVX2_H

#include "../core/base.h"

enum { LANES = 8 };
typedef __m256   floats;
typedef unsigned mask; /* one bit a lane */

HS_ALWAYS_INLINE floats broadcast(float x) { return _mm256_set1_ps(x); }
HS_ALWAYS_INLINE floats load(const float *p) { return _mm256_loadu_ps(p); }
HS_ALWAYS_INLINE floats add(floats a, floats b) { return _mm256_add_ps(a, b); }
HS_ALWAYS_INLINE floats subtract(floats a, floats b) { return _mm256_sub_ps(a, b); }
HS_ALWAYS_INLINE floats square(floats a) { return _mm256_mul_ps(a, a); }
/* a * a + b, rounded once. */
HS_ALWAYS_INLINE floats square_add(floats a, floats b) { return _mm256_fmadd_ps(a, a, b); }
/* Lanes with !(a > b), set for NaN. */
HS_ALWAYS_INLINE mask
not_greater(floats a, floats b)
{
    return (mask)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_NGT_UQ));
}
/* Lanes with !(a < b), set for NaN. */
HS_ALWAYS_INLINE mask
not_less(floats a, floats b)
{
    return (mask)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_NLT_UQ));
}
/* The first n of them, 1 <= n < LANES. */
HS_ALWAYS_INLINE mask first_lanes(int32_t n) { return (1u << n) - 1; }

/* For each mask the lanes that are set, packed to the front, one byte each: 2 kB. As a macro of
 * constants, so that it needs no start-up code. */
#define PACK_BIT(m, lane, at) ((uint64_t)(lane) << (8 * (at)))
#define COUNT(m) (((m)&1) + ((m) >> 1 & 1) + ((m) >> 2 & 1) + ((m) >> 3 & 1) + ((m) >> 4 & 1) + \
                  ((m) >> 5 & 1) + ((m) >> 6 & 1) + ((m) >> 7 & 1))
#define LANE(m, lane) \
    (((m) >> (lane)&1) ? PACK_BIT(m, lane, COUNT((m) & ((1 << (lane)) - 1))) : UINT64_C(0))
#define PACK(m) \
    (LANE(m, 0) | LANE(m, 1) | LANE(m, 2) | LANE(m, 3) | LANE(m, 4) | LANE(m, 5) | LANE(m, 6) | \
     LANE(m, 7))
#define PACK4(m) PACK(m), PACK((m) + 1), PACK((m) + 2), PACK((m) + 3)
#define PACK16(m) PACK4(m), PACK4((m) + 4), PACK4((m) + 8), PACK4((m) + 12)
#define PACK64(m) PACK16(m), PACK16((m) + 16), PACK16((m) + 32), PACK16((m) + 48)
static const uint64_t packed_lanes[256] = {PACK64(0), PACK64(64), PACK64(128), PACK64(192)};
#undef PACK_BIT
#undef COUNT
#undef LANE
#undef PACK
#undef PACK4
#undef PACK16
#undef PACK64

/* Packs the labels of the lanes in m to dst, writing LANES entries; returns how many count. */
HS_ALWAYS_INLINE int32_t
append(int32_t *dst, const int32_t *label, mask m)
{
    const __m128i bytes = _mm_loadl_epi64((const __m128i *)&packed_lanes[m]);
    const __m256i all = _mm256_loadu_si256((const __m256i *)label);
    _mm256_storeu_si256((__m256i *)dst,
                        _mm256_permutevar8x32_epi32(all, _mm256_cvtepu8_epi32(bytes)));
    return (int32_t)_mm_popcnt_u32(m);
}

#endif
