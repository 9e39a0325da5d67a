/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * bins.h: the points in cell order. Point number si here is order[si] in the caller's array; cell c
 * holds si in [start[c], start[c + 1]), in ascending order of the caller's numbers.
 */
#ifndef HS_BINS_H
#define HS_BINS_H

#include "../threads/team.h"
#include "grid.h"

typedef struct hs_bins {
    int64_t  n;
    int      ndim;
    int      n_periodic;
    double  *x[HS_MAX_DIM]; /* X of each axis, n each; HS_PADDING more can be read */
    int32_t *order;         /* a permutation of 0 ... n - 1; HS_PADDING more can be read */
    int32_t *start;         /* owned; n_cells + 1, nondecreasing, last is n */
    bool     keeps_originals;
    double  *originals[HS_MAX_DIM]; /* the points as given, n each, if they are kept */
    hs_turns turns;
    void    *points; /* owned; the columns above lie in these two: the scene's blocks */
    void    *beside; /* owned or NULL */
} hs_bins;

/*
 * Sorts, polling now and then; takes the scene's arrays over or frees them. On failure holds
 * nothing. The result does not depend on the team.
 */
hs_status hs_bins_build(hs_account *account, hs_team *team, const hs_options *options,
                        hs_scene *scene, const hs_grid *grid, hs_bins *bins);

/* Steps of hs_bins_build, for other orders: the scene's arrays become those of the bins, in the
 * caller's order as yet, and without `start`; the scene's spare column stays usable. */
void hs_bins_take(hs_scene *scene, hs_bins *bins);

/* Then, with bins->order filled: moves all columns into that order. Overwrites the spare column.
 * HS_OK or HS_ERR_INTERRUPTED. */
hs_status hs_bins_arrange(hs_account *account, hs_team *team, const hs_options *options,
                          const hs_scene *scene, hs_bins *bins);

void hs_bins_free(hs_account *account, hs_bins *bins);

/*
 * The columns of the points, from the caller's order to cell order. Each is gathered
 * into the column that is free, and leaves its own place free for the next:
 *
 *     order | spare | x[0] | x[1] | ...   ->   order | x[0] | x[1] | ... | free
 *
 * so that this takes room for one column and no more.
 */

#endif
