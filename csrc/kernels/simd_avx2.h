/* SPDX-License-Identifier: BSD-3-Clause */
/* simd_avx2.h: the vocabulary of the templates for AVX2 with FMA: 8 lanes. */
#ifndef HS_SIMD_AVX2_H
#define HS_SIMD_AVX2_H

#include "../core/base/base.h"

/* One operation a line. */
/* clang-format off */

enum { LANES = 8 };
typedef __m256   floats;
typedef __m256i  integers; /* int32 */
typedef unsigned mask; /* one bit a lane */

HS_ALWAYS_INLINE floats broadcast(float x) { return _mm256_set1_ps(x); }
HS_ALWAYS_INLINE floats load(const float *p) { return _mm256_loadu_ps(p); }
HS_ALWAYS_INLINE floats add(floats a, floats b) { return _mm256_add_ps(a, b); }
HS_ALWAYS_INLINE floats subtract(floats a, floats b) { return _mm256_sub_ps(a, b); }
HS_ALWAYS_INLINE floats multiply(floats a, floats b) { return _mm256_mul_ps(a, b); }
/* a * b + c, rounded once. */
HS_ALWAYS_INLINE floats
multiply_add(floats a, floats b, floats c)
{
    return _mm256_fmadd_ps(a, b, c);
}
/* Lanes with !(a > b), set for NaN. */
HS_ALWAYS_INLINE mask
not_greater(floats a, floats b)
{
    return (mask)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_NGT_UQ));
}
/* Lanes of m with !(a < b), set for NaN. */
HS_ALWAYS_INLINE mask
and_not_less(mask m, floats a, floats b)
{
    return m & (mask)_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_NLT_UQ));
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

/* Packs the lanes in m to dst, writing LANES entries; returns how many count. */
HS_ALWAYS_INLINE int32_t
append(int32_t *dst, integers a, mask m)
{
    const __m128i bytes = _mm_loadl_epi64((const __m128i *)&packed_lanes[m]);
    _mm256_storeu_si256((__m256i *)dst,
                        _mm256_permutevar8x32_epi32(a, _mm256_cvtepu8_epi32(bytes)));
    return (int32_t)_mm_popcnt_u32(m);
}

/* Packs the floats of the lanes in m to dst, writing LANES entries. */
HS_ALWAYS_INLINE void
append_floats(float *dst, floats a, mask m)
{
    const __m128i bytes = _mm_loadl_epi64((const __m128i *)&packed_lanes[m]);
    _mm256_storeu_ps(dst, _mm256_permutevar8x32_ps(a, _mm256_cvtepu8_epi32(bytes)));
}

HS_ALWAYS_INLINE unsigned popcount(mask m) { return (unsigned)_mm_popcnt_u32(m); }

HS_ALWAYS_INLINE void store(float *p, floats a) { _mm256_storeu_ps(p, a); }
HS_ALWAYS_INLINE integers broadcast_integer(int32_t a) { return _mm256_set1_epi32(a); }
HS_ALWAYS_INLINE integers
load_integers(const int32_t *p)
{
    return _mm256_loadu_si256((const __m256i *)p);
}
HS_ALWAYS_INLINE void
store_integers(int32_t *p, integers a)
{
    _mm256_storeu_si256((__m256i *)p, a);
}
/* Widens to int64. */
HS_ALWAYS_INLINE void
store_wide(int64_t *p, integers a)
{
    _mm256_storeu_si256((__m256i *)p, _mm256_cvtepi32_epi64(_mm256_castsi256_si128(a)));
    _mm256_storeu_si256((__m256i *)(p + 4), _mm256_cvtepi32_epi64(_mm256_extracti128_si256(a, 1)));
}
HS_ALWAYS_INLINE integers smaller(integers a, integers b) { return _mm256_min_epi32(a, b); }
HS_ALWAYS_INLINE integers larger(integers a, integers b) { return _mm256_max_epi32(a, b); }
/* The first n, 1 <= n < LANES; zero elsewhere. */
HS_ALWAYS_INLINE integers
keep_lanes(integers a, int32_t n)
{
    const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    return _mm256_and_si256(a, _mm256_cmpgt_epi32(_mm256_set1_epi32(n), lane));
}
/* (float)((p[lane] + moved - centre) * unit), rounded after each step. */
HS_ALWAYS_INLINE __m128
load_relative_half(const double *p, double moved, double centre, double unit)
{
    const __m256d z = _mm256_add_pd(_mm256_loadu_pd(p), _mm256_set1_pd(moved));
    const __m256d y = _mm256_sub_pd(z, _mm256_set1_pd(centre));
    return _mm256_cvtpd_ps(_mm256_mul_pd(y, _mm256_set1_pd(unit)));
}
HS_ALWAYS_INLINE floats
load_relative(const double *p, double moved, double centre, double unit)
{
    const __m128 low = load_relative_half(p, moved, centre, unit);
    const __m128 high = load_relative_half(p + 4, moved, centre, unit);
    return _mm256_insertf128_ps(_mm256_castps128_ps256(low), high, 1);
}
/* b where one is NaN. */
HS_ALWAYS_INLINE floats larger_of(floats a, floats b) { return _mm256_max_ps(a, b); }
HS_ALWAYS_INLINE floats smaller_of(floats a, floats b) { return _mm256_min_ps(a, b); }
HS_ALWAYS_INLINE integers
lane_numbers(void)
{
    return _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
}
HS_ALWAYS_INLINE integers add_integers(integers a, integers b) { return _mm256_add_epi32(a, b); }
HS_ALWAYS_INLINE integers bits_in_both(integers a, integers b) { return _mm256_and_si256(a, b); }
HS_ALWAYS_INLINE integers bits_of(floats a) { return _mm256_castps_si256(a); }
/* One more in lanes with a > b. */
HS_ALWAYS_INLINE integers
count_greater(integers counts, integers a, integers b)
{
    return _mm256_sub_epi32(counts, _mm256_cmpgt_epi32(a, b));
}
HS_ALWAYS_INLINE int32_t
largest_lane(integers a)
{
    __m128i b = _mm_max_epi32(_mm256_castsi256_si128(a), _mm256_extracti128_si256(a, 1));
    b = _mm_max_epi32(b, _mm_shuffle_epi32(b, 0x4e));
    b = _mm_max_epi32(b, _mm_shuffle_epi32(b, 0xb1));
    return _mm_cvtsi128_si32(b);
}
/* Four floats each of lanes n and n + 4. */
HS_ALWAYS_INLINE floats
load_rows(const float *y, int64_t stride, const int32_t *number)
{
    const __m256 rows = _mm256_castps128_ps256(_mm_loadu_ps(y + number[0] * stride));
    return _mm256_insertf128_ps(rows, _mm_loadu_ps(y + number[4] * stride), 1);
}
/* to[k], lane by lane: y[number * stride + k], for k = 0, 1, 2, 3. */
HS_ALWAYS_INLINE void
load_points(const float *y, int64_t stride, const int32_t *number, floats *to)
{
    const __m256 a = load_rows(y, stride, number), b = load_rows(y, stride, number + 1);
    const __m256 c = load_rows(y, stride, number + 2), d = load_rows(y, stride, number + 3);
    const __m256 ab = _mm256_unpacklo_ps(a, b), cd = _mm256_unpacklo_ps(c, d);
    const __m256 high_ab = _mm256_unpackhi_ps(a, b), high_cd = _mm256_unpackhi_ps(c, d);
    to[0] = _mm256_shuffle_ps(ab, cd, 0x44);
    to[1] = _mm256_shuffle_ps(ab, cd, 0xee);
    to[2] = _mm256_shuffle_ps(high_ab, high_cd, 0x44);
    to[3] = _mm256_shuffle_ps(high_ab, high_cd, 0xee);
}

#endif
