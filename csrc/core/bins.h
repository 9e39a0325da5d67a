/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * bins.h: the points in cell order. Point number si here is order[si] in the caller's array; cell c
 * holds si in [start[c], start[c + 1]), in ascending order of the caller's numbers.
 */
#ifndef HS_BINS_H
#define HS_BINS_H

#include "grid.h"

typedef struct hs_bins {
    int64_t  n;
    int      ndim;
    int      n_periodic;
    double  *x[HS_MAX_DIM]; /* owned; X of each axis, n each */
    int32_t *order;         /* owned; a permutation of 0 ... n - 1 */
    int32_t *start;         /* owned; n_cells + 1, nondecreasing, last is n */
    double  *originals;     /* owned or NULL; n * ndim */
    int64_t *turns;         /* owned or NULL; n * n_periodic */
} hs_bins;

/* Sorts, polling now and then; takes the scene's arrays over or frees them. On failure holds
 * nothing. */
hs_status hs_bins_build(hs_account *account, const hs_options *options, hs_scene *scene,
                        const hs_grid *grid, hs_bins *bins);

void hs_bins_free(hs_account *account, hs_bins *bins);

#endif
