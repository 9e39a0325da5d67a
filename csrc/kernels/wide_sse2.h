/* SPDX-License-Identifier: BSD-3-Clause */
/* wide_sse2.h: the vocabulary of batch_template.h for any x86-64 CPU: 2 lanes, no FMA. */
#ifndef HS_WIDE_SSE2_H
#define HS_WIDE_SSE2_H

#include "../core/base/base.h"

/* One operation a line. */
/* clang-format off */

enum { LANES = 2 };
typedef __m128d reals;
typedef __m128d truth; /* all bits of a lane */

HS_ALWAYS_INLINE reals broadcast(double x) { return _mm_set1_pd(x); }
HS_ALWAYS_INLINE reals load(const double *p) { return _mm_loadu_pd(p); }
HS_ALWAYS_INLINE void store(double *p, reals a) { _mm_storeu_pd(p, a); }
HS_ALWAYS_INLINE reals add(reals a, reals b) { return _mm_add_pd(a, b); }
HS_ALWAYS_INLINE reals subtract(reals a, reals b) { return _mm_sub_pd(a, b); }
HS_ALWAYS_INLINE reals multiply(reals a, reals b) { return _mm_mul_pd(a, b); }
HS_ALWAYS_INLINE reals divide(reals a, reals b) { return _mm_div_pd(a, b); }
HS_ALWAYS_INLINE reals square_root(reals a) { return _mm_sqrt_pd(a); }
HS_ALWAYS_INLINE reals negative(reals a) { return _mm_xor_pd(a, _mm_set1_pd(-0.0)); }
HS_ALWAYS_INLINE reals magnitude(reals a) { return _mm_andnot_pd(_mm_set1_pd(-0.0), a); }
/* a > b ? a : b, and a < b ? a : b. */
HS_ALWAYS_INLINE reals larger(reals a, reals b) { return _mm_max_pd(a, b); }
HS_ALWAYS_INLINE reals smaller(reals a, reals b) { return _mm_min_pd(a, b); }
/* a without its lower half: hs_split of core/exact/arithmetic.h. */
HS_ALWAYS_INLINE reals
upper_half(reals a)
{
    const reals scaled = multiply(broadcast(0x1.0000002p27), a); /* 2^27 + 1 */
    return subtract(scaled, subtract(scaled, a));
}
/* a * b - product, where product is a * b rounded: exact. As hs_two_product. */
HS_ALWAYS_INLINE reals
product_error(reals a, reals b, reals product)
{
    const reals x = upper_half(a), x_low = subtract(a, x);
    const reals y = upper_half(b), y_low = subtract(b, y);
    const reals crossed = add(subtract(multiply(x, y), product), multiply(x, y_low));
    return add(add(crossed, multiply(x_low, y)), multiply(x_low, y_low));
}
/* Comparisons are false for NaN. */
HS_ALWAYS_INLINE truth is_below(reals a, reals b) { return _mm_cmplt_pd(a, b); }
HS_ALWAYS_INLINE truth is_at_least(reals a, reals b) { return _mm_cmpge_pd(a, b); }
HS_ALWAYS_INLINE truth is_equal(reals a, reals b) { return _mm_cmpeq_pd(a, b); }
HS_ALWAYS_INLINE truth both(truth x, truth y) { return _mm_and_pd(x, y); }
HS_ALWAYS_INLINE truth either(truth x, truth y) { return _mm_or_pd(x, y); }
/* a where t, else b. */
HS_ALWAYS_INLINE reals
choose(truth t, reals a, reals b)
{
    return _mm_or_pd(_mm_and_pd(t, a), _mm_andnot_pd(t, b));
}
/* One bit a lane. */
HS_ALWAYS_INLINE unsigned bits(truth t) { return (unsigned)_mm_movemask_pd(t); }
HS_ALWAYS_INLINE int count(unsigned mask) { return (int)((mask & 1) + (mask >> 1)); }

#endif
