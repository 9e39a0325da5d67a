/* SPDX-License-Identifier: BSD-3-Clause */
/* wide_plain.h: the vocabulary of batch_template.h in plain C: one lane, any CPU. */
#ifndef HS_WIDE_PLAIN_H
#define HS_WIDE_PLAIN_H

#include <math.h>

#include "../core/exact/arithmetic.h"

/* One operation a line. */
/* clang-format off */

enum { LANES = 1 };
typedef double reals;
typedef bool   truth;

HS_ALWAYS_INLINE reals broadcast(double x) { return x; }
HS_ALWAYS_INLINE reals load(const double *p) { return *p; }
HS_ALWAYS_INLINE void store(double *p, reals a) { *p = a; }
HS_ALWAYS_INLINE reals add(reals a, reals b) { return a + b; }
HS_ALWAYS_INLINE reals subtract(reals a, reals b) { return a - b; }
HS_ALWAYS_INLINE reals multiply(reals a, reals b) { return a * b; }
HS_ALWAYS_INLINE reals divide(reals a, reals b) { return a / b; }
HS_ALWAYS_INLINE reals square_root(reals a) { return sqrt(a); }
HS_ALWAYS_INLINE reals negative(reals a) { return -a; }
HS_ALWAYS_INLINE reals magnitude(reals a) { return fabs(a); }
HS_ALWAYS_INLINE reals larger(reals a, reals b) { return a > b ? a : b; }
HS_ALWAYS_INLINE reals smaller(reals a, reals b) { return a < b ? a : b; }
/* a * b - product, where product is a * b rounded: exact. */
HS_ALWAYS_INLINE reals
product_error(reals a, reals b, reals product)
{
    (void)product;
    return hs_two_product(a, b).lo;
}
/* Comparisons are false for NaN. */
HS_ALWAYS_INLINE truth is_below(reals a, reals b) { return a < b; }
HS_ALWAYS_INLINE truth is_at_least(reals a, reals b) { return a >= b; }
HS_ALWAYS_INLINE truth is_equal(reals a, reals b) { return a == b; }
HS_ALWAYS_INLINE truth both(truth x, truth y) { return x & y; }
HS_ALWAYS_INLINE truth either(truth x, truth y) { return x | y; }
HS_ALWAYS_INLINE reals choose(truth t, reals a, reals b) { return t ? a : b; }
HS_ALWAYS_INLINE unsigned bits(truth t) { return t; }
HS_ALWAYS_INLINE int count(unsigned mask) { return (int)mask; }

#endif
