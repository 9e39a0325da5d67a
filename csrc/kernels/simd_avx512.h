/* SPDX-License-Identifier: BSD-3-Clause */
/* simd_avx512.h: the vocabulary of the templates for AVX-512 (F, BW, DQ, VL): 16 lanes. */
#ifndef HS_SIMD_AVX512_H
#define HS_SIMD_AVX512_H

#include "../core/base/base.h"

/* One operation a line. */
/* clang-format off */

enum { LANES = 16 };
typedef __m512   floats;
typedef __m512i  integers; /* int32 */
typedef __mmask16 mask; /* one bit a lane */

HS_ALWAYS_INLINE floats broadcast(float x) { return _mm512_set1_ps(x); }
HS_ALWAYS_INLINE floats load(const float *p) { return _mm512_loadu_ps(p); }
HS_ALWAYS_INLINE floats add(floats a, floats b) { return _mm512_add_ps(a, b); }
HS_ALWAYS_INLINE floats subtract(floats a, floats b) { return _mm512_sub_ps(a, b); }
HS_ALWAYS_INLINE floats multiply(floats a, floats b) { return _mm512_mul_ps(a, b); }
/* a * b + c, rounded once. */
HS_ALWAYS_INLINE floats
multiply_add(floats a, floats b, floats c)
{
    return _mm512_fmadd_ps(a, b, c);
}
/* Lanes with !(a > b), set for NaN. */
HS_ALWAYS_INLINE mask
not_greater(floats a, floats b)
{
    return _mm512_cmp_ps_mask(a, b, _CMP_NGT_UQ);
}
/* Lanes of m with !(a < b), set for NaN. */
HS_ALWAYS_INLINE mask
and_not_less(mask m, floats a, floats b)
{
    return _mm512_mask_cmp_ps_mask(m, a, b, _CMP_NLT_UQ);
}
/* The first n of them, 1 <= n < LANES. */
HS_ALWAYS_INLINE mask first_lanes(int32_t n) { return (mask)((1u << n) - 1); }
/*
 * Packs the lanes in m to dst, writing LANES entries; returns how many count. In a
 * register and then stored: compressing straight to memory takes ten times as long on Zen 4, and
 * the zero-masked form waits for the register's old value.
 */
HS_ALWAYS_INLINE int32_t
append(int32_t *dst, integers a, mask m)
{
    _mm512_storeu_si512(dst, _mm512_mask_compress_epi32(a, m, a));
    return (int32_t)_mm_popcnt_u32(m);
}
/* Packs the floats of the lanes in m to dst, writing LANES entries. */
HS_ALWAYS_INLINE void
append_floats(float *dst, floats a, mask m)
{
    _mm512_storeu_ps(dst, _mm512_mask_compress_ps(a, m, a));
}

HS_ALWAYS_INLINE unsigned popcount(mask m) { return (unsigned)_mm_popcnt_u32(m); }

HS_ALWAYS_INLINE void store(float *p, floats a) { _mm512_storeu_ps(p, a); }
HS_ALWAYS_INLINE integers broadcast_integer(int32_t a) { return _mm512_set1_epi32(a); }
HS_ALWAYS_INLINE integers load_integers(const int32_t *p) { return _mm512_loadu_si512(p); }
HS_ALWAYS_INLINE void store_integers(int32_t *p, integers a) { _mm512_storeu_si512(p, a); }
/* Widens to int64. */
HS_ALWAYS_INLINE void
store_wide(int64_t *p, integers a)
{
    _mm512_storeu_si512(p, _mm512_cvtepi32_epi64(_mm512_castsi512_si256(a)));
    _mm512_storeu_si512(p + 8, _mm512_cvtepi32_epi64(_mm512_extracti64x4_epi64(a, 1)));
}
HS_ALWAYS_INLINE integers smaller(integers a, integers b) { return _mm512_min_epi32(a, b); }
HS_ALWAYS_INLINE integers larger(integers a, integers b) { return _mm512_max_epi32(a, b); }
/* The first n, 1 <= n < LANES; zero elsewhere. */
HS_ALWAYS_INLINE integers
keep_lanes(integers a, int32_t n)
{
    return _mm512_maskz_mov_epi32(first_lanes(n), a);
}
/* (float)((p[lane] + moved - centre) * unit), rounded after each step. */
HS_ALWAYS_INLINE __m256
load_relative_half(const double *p, double moved, double centre, double unit)
{
    const __m512d z = _mm512_add_pd(_mm512_loadu_pd(p), _mm512_set1_pd(moved));
    const __m512d y = _mm512_sub_pd(z, _mm512_set1_pd(centre));
    return _mm512_cvtpd_ps(_mm512_mul_pd(y, _mm512_set1_pd(unit)));
}
HS_ALWAYS_INLINE floats
load_relative(const double *p, double moved, double centre, double unit)
{
    const __m256 low = load_relative_half(p, moved, centre, unit);
    const __m256 high = load_relative_half(p + 8, moved, centre, unit);
    return _mm512_insertf32x8(_mm512_castps256_ps512(low), high, 1);
}
/* b where one is NaN. */
HS_ALWAYS_INLINE floats larger_of(floats a, floats b) { return _mm512_max_ps(a, b); }
HS_ALWAYS_INLINE floats smaller_of(floats a, floats b) { return _mm512_min_ps(a, b); }
HS_ALWAYS_INLINE integers
lane_numbers(void)
{
    return _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}
HS_ALWAYS_INLINE integers add_integers(integers a, integers b) { return _mm512_add_epi32(a, b); }
HS_ALWAYS_INLINE integers bits_in_both(integers a, integers b) { return _mm512_and_si512(a, b); }
HS_ALWAYS_INLINE integers bits_of(floats a) { return _mm512_castps_si512(a); }
/* One more in lanes with a > b. */
HS_ALWAYS_INLINE integers
count_greater(integers counts, integers a, integers b)
{
    const mask greater = _mm512_cmpgt_epi32_mask(a, b);
    return _mm512_mask_add_epi32(counts, greater, counts, broadcast_integer(1));
}
HS_ALWAYS_INLINE int32_t largest_lane(integers a) { return _mm512_reduce_max_epi32(a); }
/* Four floats each of lanes n, n + 4, n + 8, n + 12. */
HS_ALWAYS_INLINE floats
load_rows(const float *y, int64_t stride, const int32_t *number)
{
    __m512 rows = _mm512_castps128_ps512(_mm_loadu_ps(y + number[0] * stride));
    rows = _mm512_insertf32x4(rows, _mm_loadu_ps(y + number[4] * stride), 1);
    rows = _mm512_insertf32x4(rows, _mm_loadu_ps(y + number[8] * stride), 2);
    return _mm512_insertf32x4(rows, _mm_loadu_ps(y + number[12] * stride), 3);
}
/* to[k], lane by lane: y[number * stride + k], for k = 0, 1, 2, 3. */
HS_ALWAYS_INLINE void
load_points(const float *y, int64_t stride, const int32_t *number, floats *to)
{
    const __m512 a = load_rows(y, stride, number), b = load_rows(y, stride, number + 1);
    const __m512 c = load_rows(y, stride, number + 2), d = load_rows(y, stride, number + 3);
    const __m512 ab = _mm512_unpacklo_ps(a, b), cd = _mm512_unpacklo_ps(c, d);
    const __m512 high_ab = _mm512_unpackhi_ps(a, b), high_cd = _mm512_unpackhi_ps(c, d);
    to[0] = _mm512_shuffle_ps(ab, cd, 0x44);
    to[1] = _mm512_shuffle_ps(ab, cd, 0xee);
    to[2] = _mm512_shuffle_ps(high_ab, high_cd, 0x44);
    to[3] = _mm512_shuffle_ps(high_ab, high_cd, 0xee);
}

#endif
