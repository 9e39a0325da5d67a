/* SPDX-License-Identifier: BSD-3-Clause */
/* wrap.c: see wrap.h. */
#include "wrap.h"

#include "../exact/doubleword.h"

#include <math.h>

#define TURNS_TAIL (INT64_C(1) << 26) /* splits 62 bits into 36 and 26, both exact as doubles */
#define WRAP_PASSES 4 /* each pass gains 50 bits; from 2^51 turns two are enough, two are spare */

#define LARGE 0x1p900
#define REDUCE 0x1p-100

/*
 * x - n * length, which must be a double, for an integer 1 <= |n| < 2^52 within 3/4 of x / length.
 * By a product of two words, because some C libraries round twice in fma(). The first difference is
 * exact by Sterbenz's lemma, the second because its result is a double. Nothing underflows: all are
 * multiples of the last digit of `length`. Nothing overflows: large numbers are scaled.
 */
static double
rest(double x, double n, double length)
{
    const double scale = fabs(x) > LARGE ? REDUCE : 1.0;
    const hs_dw  product = hs_two_product(-n, scale * length);
    return ((scale * x + product.hi) + product.lo) / scale;
}

double
hs_wrap_axis(double x, double length, int64_t *turns)
{
    const double half = 0.5 * length;
    *turns = 0;
    if (x >= -half && x <= half) {
        return x;
    }
    double n = rint(x / length);
    double inside;
    if (fabs(n) <= 1.0) {
        inside = x - n * length; /* n * length is exact, the difference by Sterbenz's lemma */
    } else if (fabs(n) < HS_WRAP_LIMIT) {
        /* The quotient was rounded, so n may be one off; either way x - n * length is a double. */
        inside = rest(x, n, length);
        if (fabs(inside) > half) {
            n += inside > half ? 1.0 : -1.0;
            inside = rest(x, n, length);
        }
    } else {
        *turns = HS_WRAP_UNKNOWN;
        return remainder(x, length); /* exact by IEEE 754 for any quotient */
    }
    *turns = (int64_t)n;
    return inside;
}

/* sum + low -= factor * entry, by a compensated step (Ogita, Rump and Oishi 2005, Dot2). A factor
 * that is split must be below 2^996: large entries are taken smaller, exactly. */
HS_ALWAYS_INLINE void
subtract_product(double factor, double entry, double *sum, double *low, double *absolute)
{
    const bool   is_large = fabs(entry) > 0x1p900;
    const double shrink = is_large ? 0x1p-64 : 1.0, grow = is_large ? 0x1p64 : 1.0;
    const hs_dw  scaled = hs_two_product(-factor, entry * shrink);
    const hs_dw  product = {scaled.hi * grow, scaled.lo * grow};
    const hs_dw  partial = hs_two_sum(*sum, product.hi);
    *sum = partial.hi;
    *low += partial.lo + product.lo;
    *absolute += fabs(product.hi);
}

/* X = r - sum_l given_turns[l] * scaled row l. Turns of more than 52 bits are split into two
 * doubles. */
static void
subtract_rows(const hs_lattice *lattice, const double *r, const int64_t *given_turns,
              double *inside, double *magnitude)
{
    for (int k = 0; k < lattice->ndim; k++) {
        double sum = r[k];
        double low = 0.0;
        double absolute = fabs(r[k]);
        for (int l = 0; l < lattice->n_periodic; l++) {
            const double  entry = lattice->scaled[l][k];
            const int64_t tail = given_turns[l] % TURNS_TAIL;
            subtract_product((double)(given_turns[l] - tail), entry, &sum, &low, &absolute);
            subtract_product((double)tail, entry, &sum, &low, &absolute);
        }
        inside[k] = sum + low;
        *magnitude = fmax(*magnitude, absolute);
    }
}

bool
hs_wrap_by(const hs_lattice *lattice, const double *r, const int64_t *turns, double *inside,
           double *magnitude)
{
    int64_t given_turns[HS_MAX_DIM];
    if (!hs_lattice_shift(lattice, turns, given_turns)) {
        return false;
    }
    subtract_rows(lattice, r, given_turns, inside, magnitude);
    return true;
}

bool
hs_wrap_point(const hs_lattice *lattice, const double *r, double *inside, int64_t *turns,
              double *magnitude)
{
    for (int k = 0; k < lattice->ndim; k++) {
        inside[k] = r[k];
        *magnitude = fmax(*magnitude, fabs(r[k]));
    }
    for (int row = 0; row < lattice->n_periodic; row++) {
        turns[row] = 0;
    }
    for (int pass = 0; pass < WRAP_PASSES; pass++) {
        bool moved = false;
        for (int k = 0; k < lattice->ndim; k++) {
            const int row = lattice->row_of_axis[k];
            if (row < 0) {
                continue;
            }
            const double t = hs_lattice_coordinate(lattice, inside, k);
            const double n = rint(t / lattice->period[k]);
            if (!(fabs(n) + fabs((double)turns[row]) < HS_WRAP_LIMIT)) {
                return false;
            }
            turns[row] += (int64_t)n;
            moved = moved || n != 0.0;
        }
        if (!moved) {
            return true;
        }
        if (!hs_wrap_by(lattice, r, turns, inside, magnitude)) {
            return false;
        }
    }
    return true;
}
