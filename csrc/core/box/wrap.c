/* SPDX-License-Identifier: BSD-3-Clause */
/* wrap.c: one point in any box, and columns of points along coordinate axes. Remainders are exact
 * or computed by compensated sums. */
#include "wrap.h"

#include <math.h>

#include "../exact/doubleword.h"

#define TURNS_TAIL  (INT64_C(1) << 26) /* splits 62 bits into 36 and 26, both exact as doubles */
#define WRAP_PASSES 4 /* each pass gains 50 bits; from 2^51 turns two are enough, two are spare */

/* Numbers beyond this are taken smaller, exactly, before they are split into halves: splitting
 * multiplies by 2^27 + 1 (doubleword.h), and sums of a few products must be finite too. */
#define LARGE 0x1p900
/* Coordinates by so much: those that are large stay above 2^800, so that no digit of the length,
 * which is at least 2^-52 of them, is lost. */
#define REDUCE 0x1p-100
/* Entries of a box by so much, and their products back again: what is below 2^1024 comes below
 * 2^960, and stays above 2^836, far from the smallest numbers. */
#define SHRINK 0x1p-64
#define GROW   0x1p64

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
    const bool   is_large = fabs(entry) > LARGE;
    const double shrink = is_large ? SHRINK : 1.0, grow = is_large ? GROW : 1.0;
    const hs_dw  scaled = hs_two_product(-factor, entry * shrink);
    const hs_dw  product = {scaled.hi * grow, scaled.lo * grow};
    const hs_dw  partial = hs_two_sum(*sum, product.hi);
    *sum = partial.hi;
    *low += partial.lo + product.lo;
    *absolute += fabs(product.hi);
}

/* X = r - sum_l given_turns[l] * scaled box vector l. Turns of more than 52 bits are split into two
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
        *magnitude = hs_larger(absolute, *magnitude);
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
        *magnitude = hs_larger(fabs(r[k]), *magnitude);
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

/*
 * Columns of points along coordinate axes, hs_fold_axis.
 *
 * Why the bits are those of hs_wrap_axis: for |x| <= 1.25 L the rounded quotient x / L rounds to 0
 * exactly where |x| <= L/2 (the next double beyond L/2 is more than half a unit in the last place
 * of 0.5 too large), and to +-1 beyond; x - n L is the expression there.
 */

#define TILE  256 /* points at a time: they stay in the nearest cache */
#define LANES 8   /* maxima kept side by side, so that the loops over them can be vectors */
/* Up to here, in periods, x is wrapped by one turn at most; below 1.5 with room for rounding. */
#define ONE_TURN 1.25

hs_folded
hs_folded_none(void)
{
    hs_folded none = {.failed = -1};
    for (int k = 0; k < HS_MAX_DIM; k++) {
        none.lower[k] = INFINITY;
        none.upper[k] = -INFINITY;
    }
    return none;
}

void
hs_folded_join(hs_folded *folded, const hs_folded *more)
{
    for (int k = 0; k < HS_MAX_DIM; k++) {
        folded->x_largest[k] = fmax(folded->x_largest[k], more->x_largest[k]);
        folded->lower[k] = fmin(folded->lower[k], more->lower[k]);
        folded->upper[k] = fmax(folded->upper[k], more->upper[k]);
    }
    folded->magnitude = fmax(folded->magnitude, more->magnitude);
    if (folded->failed < 0 || (more->failed >= 0 && more->failed < folded->failed)) {
        folded->failed = more->failed;
    }
}

double
hs_fold_largest(const double *x, int64_t n, double largest)
{
    double  lane[LANES] = {0.0};
    int64_t i = 0;
    for (; i + LANES <= n; i += LANES) {
        for (int l = 0; l < LANES; l++) {
            const double size = fabs(x[i + l]);
            lane[l] = size > lane[l] ? size : lane[l];
        }
    }
    for (; i < n; i++) {
        largest = fmax(largest, fabs(x[i]));
    }
    for (int l = 0; l < LANES; l++) {
        largest = fmax(largest, lane[l]);
    }
    return largest;
}

/* At most one turn each way. Written so that compilers vectorise it: 1 and 0 for true and false,
 * and n * length instead of a branch. */
static void
fold_once(double *HS_RESTRICT x, int64_t n, double length)
{
    const double half = 0.5 * length;
    for (int64_t i = 0; i < n; i++) {
        const double above = x[i] > half ? 1.0 : 0.0;
        const double below = x[i] < -half ? 1.0 : 0.0;
        x[i] -= (above - below) * length;
    }
}

static void
count_once(const double *HS_RESTRICT x, int64_t n, double length, int32_t *HS_RESTRICT turns)
{
    const double half = 0.5 * length;
    for (int64_t i = 0; i < n; i++) {
        const double above = x[i] > half ? 1.0 : 0.0;
        const double below = x[i] < -half ? 1.0 : 0.0;
        turns[i] = (int32_t)(above - below);
    }
}

void
hs_fold_axis(const hs_lattice *lattice, int k, double *x, int64_t first, int64_t last,
             double largest, const hs_turns *turns, hs_folded *folded)
{
    const double length = lattice->period[k];
    const int    row = lattice->row_of_axis[k];
    const bool   once = largest <= ONE_TURN * length;
    for (int64_t begin = first; begin < last; begin += TILE) {
        const int64_t n = last - begin < TILE ? last - begin : TILE;
        if (once && (turns == NULL || turns->narrow[row] != NULL)) {
            if (turns != NULL) {
                count_once(x + begin, n, length, turns->narrow[row] + begin);
            }
            fold_once(x + begin, n, length);
        } else {
            for (int64_t i = begin; i < begin + n; i++) {
                int64_t turned;
                x[i] = hs_wrap_axis(x[i], length, &turned);
                if (turns != NULL && turned == HS_WRAP_UNKNOWN) {
                    folded->failed = folded->failed < 0 || i < folded->failed ? i : folded->failed;
                } else if (turns != NULL) {
                    hs_turns_set(turns, row, i, turned);
                }
            }
        }
    }
    folded->x_largest[k] = 0.5 * length;
}

double
hs_fold_turns(const hs_lattice *lattice, double largest)
{
    double most = 0.0, given = 0.0;
    for (int k = 0; k < lattice->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            /* |t_k| <= |x|, and a turn or two for roundings and the lattice's other rows. */
            most = fmax(most, lattice->ndim * largest / lattice->period[k] + 4.0);
        }
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        double sum = 0.0;
        for (int r = 0; r < lattice->n_periodic; r++) {
            sum += most * fabs((double)lattice->U[r][l]);
        }
        given = fmax(given, sum);
    }
    return fmax(most, given);
}

/* The first three terms at once: most scenes have no more dimensions. */
void
hs_fold_coordinates(const hs_lattice *lattice, int k, const double *const *x, int64_t n,
                    double *HS_RESTRICT t)
{
    const double *normal = lattice->normal[k];
    if (lattice->ndim >= 3) {
        const double              a = normal[0], b = normal[1], c = normal[2];
        const double *HS_RESTRICT x0 = x[0], *HS_RESTRICT x1 = x[1], *HS_RESTRICT x2 = x[2];
        for (int64_t i = 0; i < n; i++) {
            t[i] = 0.0 + a * x0[i] + b * x1[i] + c * x2[i];
        }
    } else {
        const double              a = normal[0], b = lattice->ndim > 1 ? normal[1] : 0.0;
        const double *HS_RESTRICT x0 = x[0], *HS_RESTRICT x1 = x[lattice->ndim - 1];
        for (int64_t i = 0; i < n; i++) {
            t[i] = 0.0 + a * x0[i] + b * x1[i];
        }
    }
    for (int c = 3; c < lattice->ndim; c++) {
        const double *HS_RESTRICT from = x[c];
        const double              factor = normal[c];
        for (int64_t i = 0; i < n; i++) {
            t[i] += factor * from[i];
        }
    }
}
