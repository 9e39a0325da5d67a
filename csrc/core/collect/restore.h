/* SPDX-License-Identifier: BSD-3-Clause */
/* restore.h: the measures of a batch (kernels/batch.h) as the caller of the library gets them. */
#ifndef HS_RESTORE_H
#define HS_RESTORE_H

#include "../base/base.h"
#include "../box/lattice.h"

/* Each distance in the caller's unit; `unscale` leads back to it. */
void hs_restore_distances(double *distance, int32_t n, hs_scale unscale);

/* hs_keep_within for n distances. */
void hs_keep_all_within(double *distance, int32_t n, double cutoff, bool inclusive);

/* n rows of ndim numbers: the vectors in the caller's unit, times sign[e], which is 1 or -1. */
void hs_restore_vectors(double *HS_RESTRICT to, double *const *vector, const double *sign,
                        int32_t n, int ndim, hs_scale unscale);

#endif
