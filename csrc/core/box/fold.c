/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * fold.c: see fold.h. Along coordinate axes.
 *
 * Why the bits are those of wrap.c: for |x| <= 1.25 L the rounded quotient x / L rounds to 0
 * exactly where |x| <= L/2 (the next double beyond L/2 is more than half a unit in the last place
 * of 0.5 too large), and to +-1 beyond; x - n L is the expression of wrap.c.
 */
#include "fold.h"

#include "wrap.h"

#include <math.h>

#define TILE 256 /* points at a time: they stay in the nearest cache */
#define LANES 8  /* maxima kept side by side, so that the loops over them can be vectors */
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

/* At most one turn each way. Written so that compilers make vectors of it: 1 and 0 for true and
 * false, and n * length instead of a choice. */
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

/* The first three terms at once: the rest are for more dimensions than most scenes have. */
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
