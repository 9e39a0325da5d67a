/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * wrap_skewed.c: columns of points into a box of any shape, hs_fold_points. A tile of points at a
 * time, without branches.
 *
 * Why the bits are those of hs_wrap_point: the steps are those of its first pass. With so few turns
 * the products by the leading part of the turns vanish, and the splitting of the turns is trivial;
 * a vanishing product changes nothing but the sign of a zero, which adding `low`, never -0, takes
 * away again. A tile with a point that may need a second pass goes through hs_wrap_point.
 */
#include "../exact/doubleword.h"
#include "wrap.h"

#include <math.h>
#include <string.h>

#define TILE  256 /* points at a time: all work arrays together fit the nearest cache */
#define LANES 8   /* extremes kept side by side, so that the loops over them can be vectors */
/* Adding and subtracting this rounds any |x| < 2^51 to an integer, ties to even, as rint() does. */
#define ROUNDER 0x1.8p52

/* Work arrays of one tile. */
typedef struct tile {
    int    n;
    double inside[HS_MAX_DIM][TILE];
    double given[HS_MAX_DIM][TILE];  /* turns over the given box vectors, as doubles */
    double turned[HS_MAX_DIM][TILE]; /* turns over B */
    double moved[TILE];              /* 0 where no turn is needed */
    double t[TILE], sum[TILE], low[TILE], absolute[TILE];
} tile;

static void
count_turns(const hs_lattice *lattice, const double *const *x, tile *work)
{
    double *HS_RESTRICT moved = work->moved;
    for (int i = 0; i < work->n; i++) {
        moved[i] = 0.0;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        const int row = lattice->row_of_axis[k];
        if (row < 0) {
            continue;
        }
        double *HS_RESTRICT turned = work->turned[row];
        const double        period = lattice->period[k];
        hs_fold_coordinates(lattice, k, x, work->n, work->t);
        for (int i = 0; i < work->n; i++) {
            turned[i] = (work->t[i] / period + ROUNDER) - ROUNDER;
            moved[i] += fabs(turned[i]);
        }
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        double *HS_RESTRICT given = work->given[l];
        for (int i = 0; i < work->n; i++) {
            given[i] = 0.0;
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            const double factor = (double)lattice->U[r][l];
            for (int i = 0; factor != 0.0 && i < work->n; i++) {
                given[i] += factor * work->turned[r][i];
            }
        }
    }
}

/* A given box vector with a component along the present axis, and the turns over it. */
typedef struct term {
    const double *turns;
    double        entry;
    double        high_part, low_part; /* of the entry: Veltkamp's halves. Their products with less
                                        * than 2^26 turns are exact */
} term;

/* At most this many terms at a time; more need a second loop. */
#define TERMS 3

static int
list_terms(const hs_lattice *lattice, int k, const tile *work, term *terms)
{
    int n_terms = 0;
    for (int l = 0; l < lattice->n_periodic; l++) {
        const double entry = lattice->scaled[l][k];
        if (entry != 0.0) {
            const double scaled = 0x1.0000002p27 * entry;
            const double high_part = scaled - (scaled - entry);
            terms[n_terms++] = (term){work->given[l], entry, high_part, entry - high_part};
        }
    }
    return n_terms;
}

/* sum + low -= turns * entry for each of n_terms terms, by the steps of subtract_product (wrap.c).
 * Inlined with constant n_terms. */
HS_ALWAYS_INLINE void
subtract_terms(const term *terms, int n_terms, tile *work)
{
    const term a = terms[0], b = n_terms > 1 ? terms[1] : a, c = n_terms > 2 ? terms[2] : a;
    const term each[TERMS] = {a, b, c};
    for (int i = 0; i < work->n; i++) {
        double sum = work->sum[i], low = work->low[i], absolute = work->absolute[i];
        for (int e = 0; e < n_terms; e++) {
            const double factor = -each[e].turns[i];
            const double product = factor * each[e].entry;
            const double error = (factor * each[e].high_part - product) + factor * each[e].low_part;
            const hs_dw  partial = hs_two_sum(sum, product);
            sum = partial.hi;
            low += partial.lo + error;
            absolute += fabs(product);
        }
        work->sum[i] = sum;
        work->low[i] = low;
        work->absolute[i] = absolute;
    }
}

static void
move_inside(const hs_lattice *lattice, int k, const double *HS_RESTRICT x, tile *work,
            hs_folded *folded)
{
    double *HS_RESTRICT inside = work->inside[k];
    term                terms[HS_MAX_DIM];
    const int           n_terms = list_terms(lattice, k, work, terms);
    for (int i = 0; i < work->n; i++) {
        work->sum[i] = x[i];
        work->low[i] = 0.0;
        work->absolute[i] = fabs(x[i]);
    }
    for (int e = 0; e < n_terms; e += TERMS) {
        if (n_terms - e >= 3) {
            subtract_terms(terms + e, 3, work);
        } else if (n_terms - e == 2) {
            subtract_terms(terms + e, 2, work);
        } else {
            subtract_terms(terms + e, 1, work);
        }
    }
    for (int i = 0; i < work->n; i++) {
        inside[i] = work->sum[i] + work->low[i];
    }
    for (int i = 0; i < work->n; i++) { /* a point that stays keeps its -0; no branch this way */
        const double given = x[i], moved = inside[i];
        inside[i] = work->moved[i] != 0.0 ? moved : given;
    }
    folded->magnitude = hs_fold_largest(work->absolute, work->n, folded->magnitude);
}

/* Ranges of the coordinates t_k of the points inside, joined to *folded. Returns whether along any
 * periodic axis one of them is beyond its faces. */
static bool
find_ranges(const hs_lattice *lattice, tile *work, hs_folded *folded)
{
    const double *inside[HS_MAX_DIM];
    bool          beyond = false;
    for (int k = 0; k < lattice->ndim; k++) {
        inside[k] = work->inside[k];
    }
    for (int k = 0; k < lattice->ndim; k++) {
        double lower[LANES], upper[LANES], low = INFINITY, high = -INFINITY;
        int    i = 0;
        hs_fold_coordinates(lattice, k, inside, work->n, work->t);
        for (int l = 0; l < LANES; l++) {
            lower[l] = INFINITY;
            upper[l] = -INFINITY;
        }
        for (; i + LANES <= work->n; i += LANES) {
            for (int l = 0; l < LANES; l++) {
                const double t = work->t[i + l];
                lower[l] = t < lower[l] ? t : lower[l];
                upper[l] = t > upper[l] ? t : upper[l];
            }
        }
        for (; i < work->n; i++) {
            lower[0] = fmin(lower[0], work->t[i]);
            upper[0] = fmax(upper[0], work->t[i]);
        }
        for (int l = 0; l < LANES; l++) {
            low = fmin(low, lower[l]);
            high = fmax(high, upper[l]);
        }
        folded->lower[k] = fmin(folded->lower[k], low);
        folded->upper[k] = fmax(folded->upper[k], high);
        folded->x_largest[k] = hs_fold_largest(inside[k], work->n, folded->x_largest[k]);
        const double half = 0.5 * lattice->period[k];
        beyond = beyond || (lattice->row_of_axis[k] >= 0 && !(low >= -half && high <= half));
    }
    return beyond;
}

/* Wraps every point by hs_wrap_point. Returns the first point that fails, or -1. */
static int
fold_one_by_one(const hs_lattice *lattice, const double *const *x, const hs_turns *turns,
                int64_t begin, tile *work, hs_folded *folded)
{
    for (int i = 0; i < work->n; i++) {
        double  r[HS_MAX_DIM], inside[HS_MAX_DIM];
        int64_t turned[HS_MAX_DIM];
        for (int k = 0; k < lattice->ndim; k++) {
            r[k] = x[k][i];
        }
        if (!hs_wrap_point(lattice, r, inside, turned, &folded->magnitude)) {
            return i;
        }
        for (int k = 0; k < lattice->ndim; k++) {
            work->inside[k][i] = inside[k];
        }
        for (int row = 0; row < lattice->n_periodic; row++) {
            hs_turns_set(turns, row, begin + i, turned[row]);
        }
    }
    return -1;
}

static void
put_turns(const hs_turns *turns, int row, int64_t begin, const tile *work)
{
    const double *HS_RESTRICT turned = work->turned[row];
    const int                 n = work->n;
    if (turns->narrow[row] != NULL) {
        int32_t *HS_RESTRICT to = turns->narrow[row] + begin;
        for (int i = 0; i < n; i++) {
            to[i] = (int32_t)turned[i];
        }
    } else {
        for (int i = 0; i < n; i++) {
            turns->wide[row][begin + i] = (int64_t)turned[i];
        }
    }
}

/* Whether no point of the tile has more than so many turns, over all rows of B together. */
static bool
turns_are_few(const tile *work, double most)
{
    int many = 0;
    for (int i = 0; i < work->n; i++) {
        many |= !(work->moved[i] <= most); /* also where overflow has left no number */
    }
    return many == 0;
}

/* Turns over B that make at most HS_FOLD_TURNS over any given box vector. */
static double
most_turns(const hs_lattice *lattice)
{
    double largest = 1.0;
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int l = 0; l < lattice->n_periodic; l++) {
            largest = fmax(largest, fabs((double)lattice->U[r][l]));
        }
    }
    return HS_FOLD_TURNS / largest;
}

/* The quick way. Returns false where some points have too many turns or may need a second pass. */
static bool
fold_tile(const hs_lattice *lattice, double most, const double *const *x, const hs_turns *turns,
          int64_t begin, tile *work, hs_folded *folded)
{
    hs_folded found = *folded;
    count_turns(lattice, x, work);
    if (!turns_are_few(work, most)) {
        return false;
    }
    for (int k = 0; k < lattice->ndim; k++) {
        move_inside(lattice, k, x[k], work, &found);
    }
    if (find_ranges(lattice, work, &found)) {
        return false;
    }
    *folded = found;
    for (int row = 0; row < lattice->n_periodic; row++) {
        put_turns(turns, row, begin, work);
    }
    return true;
}

void
hs_fold_points(const hs_lattice *lattice, bool few_turns, double *const *r, int64_t first,
               int64_t last, double *const *x, const hs_turns *turns, hs_folded *folded)
{
    tile         work;
    const double most = few_turns ? INFINITY : most_turns(lattice);
    for (int64_t begin = first; begin < last; begin += TILE) {
        const double *from[HS_MAX_DIM];
        work.n = (int)(last - begin < TILE ? last - begin : TILE);
        for (int k = 0; k < lattice->ndim; k++) {
            from[k] = r[k] + begin;
        }
        if (!fold_tile(lattice, most, from, turns, begin, &work, folded)) {
            const int failed = fold_one_by_one(lattice, from, turns, begin, &work, folded);
            if (failed >= 0) {
                folded->failed = begin + failed;
                return;
            }
            (void)find_ranges(lattice, &work, folded);
        }
        for (int k = 0; k < lattice->ndim; k++) {
            memcpy(x[k] + begin, work.inside[k], (size_t)work.n * sizeof(double));
        }
    }
}
