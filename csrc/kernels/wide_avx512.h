/* SPDX-License-Identifier: BSD-3-Clause */
/* wide_avx512.h: the vocabulary of batch_template.h for AVX-512 (F, DQ): 8 lanes. */
#ifndef HS_WIDE_AVX512_H
#define HS_WIDE_AVX512_H

#include "../core/base/base.h"

/* One operation a line. */
/* clang-format off */

enum { LANES = 8 };
typedef __m512d  reals;
typedef __mmask8 truth;

HS_ALWAYS_INLINE reals broadcast(double x) { return _mm512_set1_pd(x); }
HS_ALWAYS_INLINE reals load(const double *p) { return _mm512_loadu_pd(p); }
HS_ALWAYS_INLINE void store(double *p, reals a) { _mm512_storeu_pd(p, a); }
HS_ALWAYS_INLINE reals add(reals a, reals b) { return _mm512_add_pd(a, b); }
HS_ALWAYS_INLINE reals subtract(reals a, reals b) { return _mm512_sub_pd(a, b); }
HS_ALWAYS_INLINE reals multiply(reals a, reals b) { return _mm512_mul_pd(a, b); }
HS_ALWAYS_INLINE reals divide(reals a, reals b) { return _mm512_div_pd(a, b); }
HS_ALWAYS_INLINE reals square_root(reals a) { return _mm512_sqrt_pd(a); }
HS_ALWAYS_INLINE reals negative(reals a) { return _mm512_xor_pd(a, _mm512_set1_pd(-0.0)); }
HS_ALWAYS_INLINE reals magnitude(reals a) { return _mm512_andnot_pd(_mm512_set1_pd(-0.0), a); }
/* a > b ? a : b, and a < b ? a : b. */
HS_ALWAYS_INLINE reals larger(reals a, reals b) { return _mm512_max_pd(a, b); }
HS_ALWAYS_INLINE reals smaller(reals a, reals b) { return _mm512_min_pd(a, b); }
/* a * b - product, where product is a * b rounded: exact. */
HS_ALWAYS_INLINE reals
product_error(reals a, reals b, reals product)
{
    return _mm512_fmsub_pd(a, b, product);
}
/* Comparisons are false for NaN. */
HS_ALWAYS_INLINE truth
is_below(reals a, reals b)
{
    return _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ);
}
HS_ALWAYS_INLINE truth
is_at_least(reals a, reals b)
{
    return _mm512_cmp_pd_mask(a, b, _CMP_GE_OQ);
}
HS_ALWAYS_INLINE truth
is_equal(reals a, reals b)
{
    return _mm512_cmp_pd_mask(a, b, _CMP_EQ_OQ);
}
HS_ALWAYS_INLINE truth both(truth x, truth y) { return x & y; }
HS_ALWAYS_INLINE truth either(truth x, truth y) { return x | y; }
/* a where t, else b. */
HS_ALWAYS_INLINE reals choose(truth t, reals a, reals b) { return _mm512_mask_blend_pd(t, b, a); }
/* One bit a lane. */
HS_ALWAYS_INLINE unsigned bits(truth t) { return t; }
HS_ALWAYS_INLINE int count(unsigned mask) { return (int)_mm_popcnt_u32(mask); }

#endif
