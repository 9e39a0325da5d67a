/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * wide_doubleword.h: core/exact/arithmetic.h in lanes: its operations in its order, so that every
 * lane has its bits. Include it after a vocabulary (wide_<isa>.h), inside that instruction set's
 * target region.
 */
#ifndef HS_WIDE_DOUBLEWORD_H
#define HS_WIDE_DOUBLEWORD_H

typedef struct dwords {
    reals hi, lo;
} dwords;

HS_ALWAYS_INLINE dwords
two_sum(reals a, reals b)
{
    const reals sum = add(a, b);
    const reals b_part = subtract(sum, a);
    const reals a_part = subtract(sum, b_part);
    return (dwords){sum, add(subtract(a, a_part), subtract(b, b_part))};
}

HS_ALWAYS_INLINE dwords
fast_two_sum(reals a, reals b)
{
    const reals sum = add(a, b);
    return (dwords){sum, subtract(b, subtract(sum, a))};
}

HS_ALWAYS_INLINE dwords
two_product(reals a, reals b)
{
    const reals product = multiply(a, b);
    return (dwords){product, product_error(a, b, product)};
}

HS_ALWAYS_INLINE dwords
dw_add(dwords x, dwords y)
{
    const dwords s = two_sum(x.hi, y.hi);
    const dwords t = two_sum(x.lo, y.lo);
    const dwords r = fast_two_sum(s.hi, add(s.lo, t.hi));
    return fast_two_sum(r.hi, add(t.lo, r.lo));
}

/* dw_add; lost remains zero in a lane only if the sum is exact there. hs_dw_add_watched. */
HS_ALWAYS_INLINE dwords
dw_add_watched(dwords x, dwords y, reals *lost)
{
    const dwords s = two_sum(x.hi, y.hi);
    const dwords t = two_sum(x.lo, y.lo);
    const dwords inner = two_sum(s.lo, t.hi);
    const dwords r = two_sum(s.hi, inner.hi);
    const dwords outer = two_sum(t.lo, r.lo);
    *lost = add(*lost, add(magnitude(inner.lo), magnitude(outer.lo)));
    return two_sum(r.hi, outer.hi);
}

HS_ALWAYS_INLINE dwords
dw_square(dwords x)
{
    const dwords s = two_product(x.hi, x.hi);
    return fast_two_sum(s.hi, add(s.lo, multiply(add(x.hi, x.hi), x.lo)));
}

HS_ALWAYS_INLINE reals
dw_sqrt(dwords x)
{
    const reals  root = square_root(x.hi);
    const dwords square = two_product(root, root);
    const reals  rest = add(subtract(subtract(x.hi, square.hi), square.lo), x.lo);
    return add(root, divide(rest, add(root, root)));
}

#endif
