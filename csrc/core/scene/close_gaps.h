/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * close_gaps.h: closes the gaps between coordinates that are far from zero. Where two different
 * float64 numbers are more than a cutoff apart, all that matters is which are equal, so smaller
 * numbers can take their place. No scale holds both a cutoff of 1e-300 and an outlier at 1e300;
 * once gaps are closed, one does. No pair changes, nor a bit of d and D, and S by the turns alone.
 */
#ifndef HS_CLOSE_GAPS_H
#define HS_CLOSE_GAPS_H

#include "points.h"

/* Points, queries. */
#define HS_CONDENSED_SETS 2

typedef struct hs_condensed {
    const hs_box *box;       /* in place of the caller's: borrowed, or `rows` */
    const hs_box *given_box; /* the caller's */
    hs_box        rows;
    bool          is_scaled; /* points and box vectors are in units of 2^unit now */
    bool          has_turns; /* something was wrapped into the box, and S is wanted: */
    /* Both set where has_turns says so. Owned, of points and of queries; n each for a column where
     * some were, else NULL. */
    int64_t *turns[HS_CONDENSED_SETS][HS_MAX_DIM];
    /* Owned; where scaling may lose digits: the columns that have turns, of both sets, as they were
     * given. S with all its turns belongs to these numbers and to the box as given. */
    double *given[HS_CONDENSED_SETS][HS_MAX_DIM];
} hs_condensed;

/*
 * unit: the exponent of the cutoff, 2^unit <= cutoff < 2^(unit + 1); with cutoff 0 any other.
 * powers: what is far is so beyond 2^powers units, HS_FAR_EXPONENT at most (unit.h). Does nothing
 * but look at ranges where nothing is far. box: checked. asking: NULL, or queries, whose
 * range and that of the points have been joined. HS_ERR_SHIFT_RANGE only where S is wanted.
 * hs_condensed_free in any case.
 */
hs_status hs_condense(hs_account *account, const hs_options *options, const hs_box *box, int unit,
                      int powers, hs_cloud *cloud, hs_cloud *asking, hs_condensed *condensed,
                      hs_failure *failure);

void hs_condensed_free(hs_account *account, hs_condensed *condensed);

#endif
