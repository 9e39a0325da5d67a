/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * fold.h: wrapping many points at once, to the same bits as wrap.h does one by one. Points are
 * columns here. The quick ways are for points that lie within a few periods of the box, which is
 * all of them nearly always.
 */
#ifndef HS_FOLD_H
#define HS_FOLD_H

#include "lattice.h"

/* By how many box vectors each point was wrapped. */
typedef struct hs_turns {
    bool     known;
    int32_t *narrow[HS_MAX_DIM]; /* n each, over row r of B; NULL where they may pass int32: ... */
    int64_t *wide[HS_MAX_DIM];   /* ... then here */
} hs_turns;

HS_ALWAYS_INLINE int64_t
hs_turns_get(const hs_turns *turns, int row, int64_t i)
{
    return turns->narrow[row] != NULL ? turns->narrow[row][i] : turns->wide[row][i];
}

HS_ALWAYS_INLINE void
hs_turns_set(const hs_turns *turns, int row, int64_t i, int64_t value)
{
    if (turns->narrow[row] != NULL) {
        turns->narrow[row][i] = (int32_t)value;
    } else {
        turns->wide[row][i] = value;
    }
}

/* What wrapping found out about the points. */
typedef struct hs_folded {
    double  x_largest[HS_MAX_DIM]; /* at least the largest |X_k| */
    double  lower[HS_MAX_DIM];     /* range of t_k of X; not set in aligned lattices */
    double  upper[HS_MAX_DIM];
    double  magnitude;             /* as hs_wrap_point says */
    int64_t failed;                /* lowest point that could not be wrapped, or -1 */
} hs_folded;

/* Nothing yet. */
hs_folded hs_folded_none(void);

/* Joins `more` to *folded. */
void hs_folded_join(hs_folded *folded, const hs_folded *more);

/*
 * Along coordinate axis k of an aligned lattice: x[first, last) are wrapped in place. `largest`: at
 * least the largest |x| of the column. turns: NULL if they need not be known. Points beyond
 * HS_WRAP_LIMIT fail only where turns are wanted.
 */
void hs_fold_axis(const hs_lattice *lattice, int k, double *x, int64_t first, int64_t last,
                  double largest, const hs_turns *turns, hs_folded *folded);

/*
 * In any lattice: points [first, last) of the columns r go wrapped to the columns x, which may be
 * the same. few_turns: hs_fold_turns() says that no point is more than HS_FOLD_TURNS away; or else
 * it is looked at.
 */
void hs_fold_points(const hs_lattice *lattice, bool few_turns, double *const *r, int64_t first,
                    int64_t last, double *const *x, const hs_turns *turns, hs_folded *folded);

/* Largest |x|, or `largest` if that is larger. */
double hs_fold_largest(const double *x, int64_t n, double largest);

/* t_k of n points, summed in the order of hs_lattice_coordinate: to the same bits. */
void hs_fold_coordinates(const hs_lattice *lattice, int k, const double *const *x, int64_t n,
                         double *t);

/* At least the turns over any row of B that a point with all |x| <= largest needs, and the turns
 * over the rows as given that these make. */
double hs_fold_turns(const hs_lattice *lattice, double largest);

#define HS_FOLD_TURNS 0x1p20

#endif
