/* SPDX-License-Identifier: BSD-3-Clause */
#include "arithmetic.h"

/* arithmetic.c: sums, products and comparisons of binary fractions of any size. Places are
 * multiples of a limb, so that sums need no shifts. */

/* Leaves out zero limbs at both ends. */
static void
trim(hs_dyadic *x)
{
    int32_t low = 0;
    while (x->n > 0 && x->limb[x->n - 1] == 0) {
        x->n--;
    }
    while (low < x->n && x->limb[low] == 0) {
        low++;
    }
    if (low > 0) {
        x->n -= low;
        x->place += low;
        memmove(x->limb, x->limb + low, (size_t)x->n * sizeof *x->limb);
    }
}

/* significand 2^exponent. */
static void
set_scaled(uint64_t significand, int exponent, bool negative, hs_dyadic *to)
{
    const int bits = (exponent % 64 + 64) % 64;
    to->negative = negative;
    to->place = (exponent - bits) / 64;
    to->limb[0] = significand << bits;
    to->limb[1] = bits > 0 ? significand >> (64 - bits) : 0;
    to->n = 2;
    trim(to);
}

void
hs_dyadic_set(double x, int exponent, hs_dyadic *to)
{
    const uint64_t bits = hs_bits_of_double(x);
    const int      field = (int)(bits >> 52) & 0x7ff;
    const uint64_t fraction = bits & ((UINT64_C(1) << 52) - 1);
    const uint64_t significand = fraction | (uint64_t)(field != 0) << 52;
    set_scaled(significand, field + (field == 0) - 1075 + exponent, bits >> 63, to);
}

void
hs_dyadic_set_integer(int64_t x, hs_dyadic *to)
{
    set_scaled(x < 0 ? ~(uint64_t)x + 1 : (uint64_t)x, 0, x < 0, to);
}

static void
copy(const hs_dyadic *from, hs_dyadic *to)
{
    to->negative = from->negative;
    to->n = from->n;
    to->place = from->place;
    memcpy(to->limb, from->limb, (size_t)from->n * sizeof *to->limb);
}

/* The limb at this place, which may be outside. */
HS_ALWAYS_INLINE uint64_t
limb_at(const hs_dyadic *x, int32_t place)
{
    const int32_t i = place - x->place;
    return i >= 0 && i < x->n ? x->limb[i] : 0;
}

HS_ALWAYS_INLINE int32_t
lower_place(const hs_dyadic *a, const hs_dyadic *b)
{
    return a->place < b->place ? a->place : b->place;
}

HS_ALWAYS_INLINE int32_t
upper_place(const hs_dyadic *a, const hs_dyadic *b)
{
    const int32_t one = a->place + a->n, other = b->place + b->n;
    return one > other ? one : other;
}

int
hs_dyadic_compare_sizes(const hs_dyadic *a, const hs_dyadic *b)
{
    if (a->n == 0 || b->n == 0) {
        return (a->n > 0) - (b->n > 0);
    }
    const int32_t low = lower_place(a, b);
    for (int32_t place = upper_place(a, b) - 1; place >= low; place--) {
        const uint64_t one = limb_at(a, place), other = limb_at(b, place);
        if (one != other) {
            return one < other ? -1 : 1;
        }
    }
    return 0;
}

static void
add_sizes(const hs_dyadic *a, const hs_dyadic *b, hs_dyadic *to)
{
    const int32_t low = lower_place(a, b), n = upper_place(a, b) - low;
    uint64_t      carry = 0;
    HS_ASSERT(n < HS_DYADIC_LIMBS);
    for (int32_t i = 0; i < n; i++) {
        to->limb[i] = hs_add_carry(limb_at(a, low + i), limb_at(b, low + i), &carry);
    }
    to->limb[n] = carry;
    to->n = n + 1;
    to->place = low;
}

/* Of the larger one and the smaller one. */
static void
subtract_sizes(const hs_dyadic *larger, const hs_dyadic *smaller, hs_dyadic *to)
{
    const int32_t low = lower_place(larger, smaller), n = upper_place(larger, smaller) - low;
    uint64_t      carry = 1; /* -x is ~x + 1 */
    HS_ASSERT(n <= HS_DYADIC_LIMBS);
    for (int32_t i = 0; i < n; i++) {
        to->limb[i] = hs_add_carry(limb_at(larger, low + i), ~limb_at(smaller, low + i), &carry);
    }
    to->n = n;
    to->place = low;
}

void
hs_dyadic_add(const hs_dyadic *a, const hs_dyadic *b, bool subtract, hs_dyadic *to)
{
    HS_ASSERT(to != a && to != b);
    if (a->n == 0 || b->n == 0) {
        const hs_dyadic *one = b->n == 0 ? a : b;
        copy(one, to);
        to->negative = one->negative != (subtract && one == b);
        return;
    }
    if (a->negative == (b->negative != subtract)) {
        add_sizes(a, b, to);
        to->negative = a->negative;
    } else if (hs_dyadic_compare_sizes(a, b) >= 0) {
        subtract_sizes(a, b, to);
        to->negative = a->negative;
    } else {
        subtract_sizes(b, a, to);
        to->negative = b->negative != subtract;
    }
    trim(to);
}

void
hs_dyadic_add_to(hs_dyadic *sum, const hs_dyadic *a)
{
    hs_dyadic before;
    copy(sum, &before);
    hs_dyadic_add(&before, a, false, sum);
}

void
hs_dyadic_multiply(const hs_dyadic *a, const hs_dyadic *b, hs_dyadic *to)
{
    HS_ASSERT(to != a && to != b && a->n + b->n <= HS_DYADIC_LIMBS);
    to->n = a->n > 0 && b->n > 0 ? a->n + b->n : 0;
    to->place = a->place + b->place;
    to->negative = a->negative != b->negative;
    memset(to->limb, 0, (size_t)to->n * sizeof *to->limb);
    for (int32_t i = 0; i < a->n && to->n > 0; i++) {
        uint64_t carry = 0;
        for (int32_t j = 0; j < b->n; j++) {
            to->limb[i + j] = hs_multiply_add(a->limb[i], b->limb[j], to->limb[i + j], &carry);
        }
        to->limb[i + b->n] = carry;
    }
    trim(to);
}
