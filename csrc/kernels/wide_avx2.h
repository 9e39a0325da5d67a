/* SPDX-License-Identifier: BSD-3-Clause */
/* wide_avx2.h: the vocabulary of batch_template.h for AVX2 with FMA: 4 lanes. */
#ifndef HS_WIDE_AVX2_H
#define HS_WIDE_AVX2_H

#include "../core/base/base.h"

/* One operation a line. */
/* clang-format off */

enum { LANES = 4 };
typedef __m256d reals;
typedef __m256d truth; /* all bits of a lane */

HS_ALWAYS_INLINE reals broadcast(double x) { return _mm256_set1_pd(x); }
HS_ALWAYS_INLINE reals load(const double *p) { return _mm256_loadu_pd(p); }
HS_ALWAYS_INLINE void store(double *p, reals a) { _mm256_storeu_pd(p, a); }
HS_ALWAYS_INLINE reals add(reals a, reals b) { return _mm256_add_pd(a, b); }
HS_ALWAYS_INLINE reals subtract(reals a, reals b) { return _mm256_sub_pd(a, b); }
HS_ALWAYS_INLINE reals multiply(reals a, reals b) { return _mm256_mul_pd(a, b); }
HS_ALWAYS_INLINE reals divide(reals a, reals b) { return _mm256_div_pd(a, b); }
HS_ALWAYS_INLINE reals square_root(reals a) { return _mm256_sqrt_pd(a); }
HS_ALWAYS_INLINE reals negative(reals a) { return _mm256_xor_pd(a, _mm256_set1_pd(-0.0)); }
HS_ALWAYS_INLINE reals magnitude(reals a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a); }
/* a > b ? a : b, and a < b ? a : b. */
HS_ALWAYS_INLINE reals larger(reals a, reals b) { return _mm256_max_pd(a, b); }
HS_ALWAYS_INLINE reals smaller(reals a, reals b) { return _mm256_min_pd(a, b); }
/* a * b - product, where product is a * b rounded: exact. */
HS_ALWAYS_INLINE reals
product_error(reals a, reals b, reals product)
{
    return _mm256_fmsub_pd(a, b, product);
}
/* Comparisons are false for NaN. */
HS_ALWAYS_INLINE truth is_below(reals a, reals b) { return _mm256_cmp_pd(a, b, _CMP_LT_OQ); }
HS_ALWAYS_INLINE truth is_at_least(reals a, reals b) { return _mm256_cmp_pd(a, b, _CMP_GE_OQ); }
HS_ALWAYS_INLINE truth is_equal(reals a, reals b) { return _mm256_cmp_pd(a, b, _CMP_EQ_OQ); }
HS_ALWAYS_INLINE truth both(truth x, truth y) { return _mm256_and_pd(x, y); }
HS_ALWAYS_INLINE truth either(truth x, truth y) { return _mm256_or_pd(x, y); }
/* a where t, else b. */
HS_ALWAYS_INLINE reals choose(truth t, reals a, reals b) { return _mm256_blendv_pd(b, a, t); }
/* One bit a lane. */
HS_ALWAYS_INLINE unsigned bits(truth t) { return (unsigned)_mm256_movemask_pd(t); }
HS_ALWAYS_INLINE int count(unsigned mask) { return (int)_mm_popcnt_u32(mask); }

#endif
