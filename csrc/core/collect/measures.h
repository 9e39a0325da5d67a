/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * measures.h: d and D of a batch of pairs, with the same bits wherever pairs come from: a walk, the
 * nearest points, a list that is decided anew. The batch kernels measure nearly all pairs, the
 * functions of metric.h what these leave.
 */
#ifndef HS_MEASURES_H
#define HS_MEASURES_H

#include "../exact/metric.h"
#include "../scene/scene.h"

#include "../../kernels/kernel.h"

enum { HS_IN_BATCH = HS_BATCH + HS_BATCH_PADDING };

/* A batch of pairs with room of its own, for those that have no pair_batch.h. */
typedef struct hs_measured {
    int32_t n;
    bool    is_shifted; /* some shift is not zero; or `times` and `shift` are not looked at */
    bool    is_wide;    /* some shift is too large for the batch kernels */
    double  p[HS_MAX_DIM][HS_IN_BATCH], q[HS_MAX_DIM][HS_IN_BATCH]; /* measured between these */
    double  times[HS_MAX_DIM][HS_IN_BATCH];                         /* the metric's shifts */
    int64_t shift[HS_MAX_DIM][HS_IN_BATCH];                         /* these numbers as integers */
    double  distance[HS_IN_BATCH], vector[HS_MAX_DIM][HS_IN_BATCH];
} hs_measured;

/* Sets the shift of pair e along row r. */
HS_ALWAYS_INLINE void
hs_measured_shift(hs_measured *pairs, int32_t e, int r, int64_t shift)
{
    const int64_t widest = INT64_C(1) << 53; /* what the batch kernels take */
    pairs->times[r][e] = (double)shift;
    pairs->shift[r][e] = shift;
    pairs->is_shifted = pairs->is_shifted || shift != 0;
    pairs->is_wide = pairs->is_wide || shift > widest || shift < -widest;
}

/* Sets distance and, if `vectors`, vector, in the unit of the metric. */
void hs_measured_find(const hs_kernel *kernel, const hs_metric *metric, bool vectors,
                      hs_measured *pairs);

/* Measures pairs in the arrays of `batch`. shift: one array for each row of the metric, or NULL if
 * no pair is shifted. is_wide: batch->shift does not hold these numbers. vector: NULL, or one array
 * for each axis. */
void hs_measure_pairs(const hs_kernel *kernel, const hs_metric *metric, const hs_batch *batch,
                      int64_t *const *shift, bool is_wide, double *distance, double *const *vector);

/* From the unit of the scene's metric to the caller's. */
hs_scale hs_measures_unscale(const hs_scene *scene);

/* What a writer is told of the caller's unit, and of the limit that distances of an exact search do
 * not pass. */
void hs_measures_tell(const hs_scene *scene, const hs_options *options, hs_write *write);

/* Each of n distances in the caller's unit, none beyond the cutoff: hs_keep_within. */
void hs_restore_distances(double *distance, int32_t n, hs_scale unscale);
void hs_keep_all_within(double *distance, int32_t n, double cutoff, bool inclusive);

/* Writes n vectors, one behind another: in the caller's unit, times sign[e], which is 1 or -1. */
void hs_restore_vectors(double *HS_RESTRICT to, double *const *vector, const double *sign,
                        int32_t n, int ndim, hs_scale unscale);

#endif
