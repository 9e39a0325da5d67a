/* SPDX-License-Identifier: BSD-3-Clause */
/* wide_neon.h: the vocabulary of batch_template.h for any AArch64 CPU: 2 lanes. */
#ifndef HS_WIDE_NEON_H
#define HS_WIDE_NEON_H

#include "../core/base/base.h"

/* One operation a line. */
/* clang-format off */

enum { LANES = 2 };
typedef float64x2_t reals;
typedef uint64x2_t  truth; /* all bits of a lane */

HS_ALWAYS_INLINE reals broadcast(double x) { return vdupq_n_f64(x); }
HS_ALWAYS_INLINE reals load(const double *p) { return vld1q_f64(p); }
HS_ALWAYS_INLINE void store(double *p, reals a) { vst1q_f64(p, a); }
HS_ALWAYS_INLINE reals add(reals a, reals b) { return vaddq_f64(a, b); }
HS_ALWAYS_INLINE reals subtract(reals a, reals b) { return vsubq_f64(a, b); }
HS_ALWAYS_INLINE reals multiply(reals a, reals b) { return vmulq_f64(a, b); }
HS_ALWAYS_INLINE reals divide(reals a, reals b) { return vdivq_f64(a, b); }
HS_ALWAYS_INLINE reals square_root(reals a) { return vsqrtq_f64(a); }
HS_ALWAYS_INLINE reals negative(reals a) { return vnegq_f64(a); }
HS_ALWAYS_INLINE reals magnitude(reals a) { return vabsq_f64(a); }
/* a > b ? a : b, and a < b ? a : b; the instructions for it treat NaN and zeros differently. */
HS_ALWAYS_INLINE reals larger(reals a, reals b) { return vbslq_f64(vcgtq_f64(a, b), a, b); }
HS_ALWAYS_INLINE reals smaller(reals a, reals b) { return vbslq_f64(vcltq_f64(a, b), a, b); }
/* a * b - product, where product is a * b rounded: exact. */
HS_ALWAYS_INLINE reals
product_error(reals a, reals b, reals product)
{
    return vfmaq_f64(vnegq_f64(product), a, b);
}
/* Comparisons are false for NaN. */
HS_ALWAYS_INLINE truth is_below(reals a, reals b) { return vcltq_f64(a, b); }
HS_ALWAYS_INLINE truth is_at_least(reals a, reals b) { return vcgeq_f64(a, b); }
HS_ALWAYS_INLINE truth is_equal(reals a, reals b) { return vceqq_f64(a, b); }
HS_ALWAYS_INLINE truth both(truth x, truth y) { return vandq_u64(x, y); }
HS_ALWAYS_INLINE truth either(truth x, truth y) { return vorrq_u64(x, y); }
/* a where t, else b. */
HS_ALWAYS_INLINE reals choose(truth t, reals a, reals b) { return vbslq_f64(t, a, b); }
/* One bit a lane. */
HS_ALWAYS_INLINE unsigned
bits(truth t)
{
    return (unsigned)(vgetq_lane_u64(t, 0) & 1) | (unsigned)(vgetq_lane_u64(t, 1) & 2);
}
HS_ALWAYS_INLINE int count(unsigned mask) { return (int)((mask & 1) + (mask >> 1)); }

#endif
