/* SPDX-License-Identifier: BSD-3-Clause */
/* record_measures.h: d, D and S of hits, written beside their indices. */
#ifndef HS_RECORD_MEASURES_H
#define HS_RECORD_MEASURES_H

#include "../base/base.h"
#include "../box/lattice.h"
#include "recorder.h"

/* The hits of points from `first` on, which are places in the walker's block, as the next pairs of
 * the output; recorder->ids holds their numbers. HS_ERR_SHIFT_RANGE sets scanner->failed_point. */
hs_status hs_put_measures(hs_recorder *recorder, hs_scanner *scanner, int32_t first,
                          const hs_hits *hits);

/* The measures of a batch (kernels/batch.h) as the caller of the library gets them. */

/* Each distance in the caller's unit; `unscale` leads back to it. */
void hs_restore_distances(double *distance, int32_t n, hs_scale unscale);

/* hs_keep_within for n distances. */
void hs_keep_all_within(double *distance, int32_t n, double cutoff, bool inclusive);

/* n rows of ndim numbers: the vectors in the caller's unit, times sign[e], which is 1 or -1. */
void hs_restore_vectors(double *HS_RESTRICT to, double *const *vector, const double *sign,
                        int32_t n, int ndim, hs_scale unscale);

#endif
