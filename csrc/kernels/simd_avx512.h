/* SPDX-License-Identifier: BSD-3-Clause */
/* simd_avx512.h: the vocabulary of scan_template.h for AVX-512 (F, BW, DQ, VL): 16 lanes. */
#ifndef HS_SIMD_AVX512_H
#define HS_SIMD_AVX512_H

#include "../core/base.h"

enum { LANES = 16 };
typedef __m512   floats;
typedef unsigned mask; /* one bit a lane */

HS_ALWAYS_INLINE floats broadcast(float x) { return _mm512_set1_ps(x); }
HS_ALWAYS_INLINE floats load(const float *p) { return _mm512_loadu_ps(p); }
HS_ALWAYS_INLINE floats add(floats a, floats b) { return _mm512_add_ps(a, b); }
HS_ALWAYS_INLINE floats subtract(floats a, floats b) { return _mm512_sub_ps(a, b); }
HS_ALWAYS_INLINE floats square(floats a) { return _mm512_mul_ps(a, a); }
/* a * a + b, rounded once. */
HS_ALWAYS_INLINE floats square_add(floats a, floats b) { return _mm512_fmadd_ps(a, a, b); }
/* Lanes with !(a > b), set for NaN. */
HS_ALWAYS_INLINE mask
not_greater(floats a, floats b)
{
    return _mm512_cmp_ps_mask(a, b, _CMP_NGT_UQ);
}
/* Lanes with !(a < b), set for NaN. */
HS_ALWAYS_INLINE mask
not_less(floats a, floats b)
{
    return _mm512_cmp_ps_mask(a, b, _CMP_NLT_UQ);
}
/* The first n of them, 1 <= n < LANES. */
HS_ALWAYS_INLINE mask first_lanes(int32_t n) { return (1u << n) - 1; }
/*
 * Packs the labels of the lanes in m to dst, writing LANES entries; returns how many count. In a
 * register and then stored: compressing straight to memory takes ten times as long on Zen 4, and
 * the zero-masked form waits for the register's old value.
 */
HS_ALWAYS_INLINE int32_t
append(int32_t *dst, const int32_t *label, mask m)
{
    const __m512i all = _mm512_loadu_si512(label);
    _mm512_storeu_si512(dst, _mm512_mask_compress_epi32(all, (__mmask16)m, all));
    return (int32_t)_mm_popcnt_u32(m);
}

#endif
