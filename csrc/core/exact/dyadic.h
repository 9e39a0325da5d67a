/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * dyadic.h: numbers m 2^e with integers m and e, added and multiplied exactly: every float64 is
 * one, and so is every determinant of them. For the few decisions that float stages leave over;
 * there is no allocation and no rounding.
 */
#ifndef HS_DYADIC_H
#define HS_DYADIC_H

#include "../base/base.h"

/*
 * Room for the largest of them, the determinant of three rows less an eigenvalue: entries are
 * multiples of 2^-2148 (an eigenvalue of a scaled matrix, scaled back) below 2^1025, that is 51
 * limbs, and three of them multiplied 153. The square of |H D| has 2 (17 + 18 + 35) and one more.
 */
#define HS_DYADIC_LIMBS 160

/* The sum of limb[i] 2^(64 (place + i)); no limbs for zero, otherwise the first and the last one
 * are not zero. */
typedef struct hs_dyadic {
    bool     negative;
    int32_t  n, place;
    uint64_t limb[HS_DYADIC_LIMBS];
} hs_dyadic;

/* x 2^exponent of a finite x. */
void hs_dyadic_set(double x, int exponent, hs_dyadic *to);
void hs_dyadic_set_integer(int64_t x, hs_dyadic *to);

void hs_dyadic_copy(const hs_dyadic *from, hs_dyadic *to);

/* a + b, or a - b. `to` must be neither. */
void hs_dyadic_add(const hs_dyadic *a, const hs_dyadic *b, bool subtract, hs_dyadic *to);

/* a b. `to` must be neither. */
void hs_dyadic_multiply(const hs_dyadic *a, const hs_dyadic *b, hs_dyadic *to);

/* Sign of |a| - |b|: -1, 0 or 1. */
int hs_dyadic_compare_sizes(const hs_dyadic *a, const hs_dyadic *b);

/* -1, 0 or 1. */
HS_ALWAYS_INLINE int
hs_dyadic_sign(const hs_dyadic *x)
{
    return x->n == 0 ? 0 : x->negative ? -1 : 1;
}

#endif
