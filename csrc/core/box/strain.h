/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * strain.h: what a change of the box does to distances, with certified bounds. docs/verlet.md
 * derives them.
 */
#ifndef HS_STRAIN_H
#define HS_STRAIN_H

#include "../../halfshell.h"

/* F, any matrix near the one that takes the old box vectors h0 to the new ones h. `residual` pays
 * for the difference between the two; no bound depends on how well F was found. */
typedef struct hs_strain {
    double F[HS_MAX_DIM][HS_MAX_DIM]; /* a row vector x goes to x F */
    double column_sum;                /* at least the largest sum over |F| of a column */
    double shrink;   /* |x F| >= shrink |x|, at most 1, rounded down; 0 or less: nothing known */
    double residual; /* |S (h0 F - h)| <= residual |S h0| for every S; taken off `shrink` too */
} hs_strain;

/* False where a bound cannot be had: too large a change, or numbers near the ends of the range. */
bool hs_strain_find(const hs_box *before, const hs_box *now, hs_strain *strain);

/* At most the smallest singular value of F (d rows of d); 0 or less where it may vanish. */
double hs_smallest_stretch(int d, const double F[][HS_MAX_DIM]);

#endif
