/* SPDX-License-Identifier: BSD-3-Clause */
/* measures.c: kernels first, one pair at a time where they decline; then to the caller's unit, in
 * loops without branches, which compilers turn into vectors. */
#include "measures.h"

#include <math.h>

/* Pair e of the batch, by itself. */
static void
measure_one(const hs_metric *metric, const hs_batch *batch, int64_t *const *shift, int32_t e,
            double *distance, double *const *vector)
{
    double  p[HS_MAX_DIM], q[HS_MAX_DIM], along[HS_MAX_DIM];
    int64_t of_pair[HS_MAX_DIM];
    for (int k = 0; k < metric->ndim; k++) {
        p[k] = batch->p[k][e];
        q[k] = batch->q[k][e];
    }
    for (int r = 0; shift != NULL && r < metric->n_rows; r++) {
        of_pair[r] = shift[r][e];
    }
    distance[e] = hs_metric_measure(metric, p, q, shift != NULL ? of_pair : NULL, along);
    for (int k = 0; vector != NULL && k < metric->ndim; k++) {
        vector[k][e] = along[k];
    }
}

void
hs_measure_pairs(const hs_kernel *kernel, const hs_metric *metric, const hs_batch *batch,
                 int64_t *const *shift, bool is_wide, double *distance, double *const *vector)
{
    uint8_t done[HS_IN_BATCH] = {0};
    if (!is_wide) {
        kernel->measure(metric, batch, distance, vector, done);
    }
    for (int32_t e = 0; e < batch->n; e++) {
        if (HS_UNLIKELY(!done[e])) {
            measure_one(metric, batch, shift, e, distance, vector);
        }
    }
}

void
hs_measured_find(const hs_kernel *kernel, const hs_metric *metric, bool vectors, hs_measured *pairs)
{
    hs_batch batch = {.n = pairs->n};
    double  *vector[HS_MAX_DIM];
    int64_t *shift[HS_MAX_DIM];
    for (int k = 0; k < metric->ndim; k++) {
        batch.p[k] = pairs->p[k];
        batch.q[k] = pairs->q[k];
        vector[k] = pairs->vector[k];
    }
    for (int r = 0; pairs->is_shifted && r < metric->n_rows; r++) {
        batch.shift[r] = pairs->times[r];
        shift[r] = pairs->shift[r];
    }
    hs_measure_pairs(kernel, metric, &batch, pairs->is_shifted ? shift : NULL, pairs->is_wide,
                     pairs->distance, vectors ? vector : NULL);
}

hs_scale
hs_measures_unscale(const hs_scene *scene)
{
    const hs_scale same = {.exponent = 0, .first = 1.0, .second = 1.0};
    return scene->extreme ? same : scene->unscale; /* then the metric has the caller's unit */
}

/* The largest distance that is within the cutoff. */
static double
largest_within(double cutoff, bool inclusive)
{
    return inclusive ? cutoff : nextafter(cutoff, 0.0);
}

void
hs_measures_tell(const hs_scene *scene, const hs_options *options, hs_write *write)
{
    const hs_scale unscale = hs_measures_unscale(scene);
    const bool     is_exact = options->precision == HS_EXACT;
    write->first = unscale.first;
    write->second = unscale.second;
    write->cutoff = is_exact ? options->cutoff : INFINITY;
    write->largest = is_exact ? largest_within(options->cutoff, options->inclusive) : INFINITY;
}

void
hs_restore_distances(double *distance, int32_t n, hs_scale unscale)
{
    for (int32_t e = 0; unscale.exponent != 0 && e < n; e++) {
        distance[e] = hs_scale_apply(unscale, distance[e]);
    }
}

void
hs_keep_all_within(double *distance, int32_t n, double cutoff, bool inclusive)
{
    const double largest = largest_within(cutoff, inclusive);
    for (int32_t e = 0; e < n; e++) {
        distance[e] = distance[e] < cutoff ? distance[e] : largest;
    }
}

HS_ALWAYS_INLINE void
restore_vectors(double *HS_RESTRICT to, double *const *vector, const double *sign, int32_t n,
                const int ndim, hs_scale unscale)
{
    for (int32_t e = 0; e < n; e++) {
        for (int k = 0; k < ndim; k++) {
            /* Plus zero: a zero has no sign, which would tell where the search met the pair. */
            to[(int64_t)e * ndim + k] = hs_scale_apply(unscale, vector[k][e]) * sign[e] + 0.0;
        }
    }
}

void
hs_restore_vectors(double *HS_RESTRICT to, double *const *vector, const double *sign, int32_t n,
                   int ndim, hs_scale unscale)
{
    switch (ndim) {
    case 1: restore_vectors(to, vector, sign, n, 1, unscale); break;
    case 2: restore_vectors(to, vector, sign, n, 2, unscale); break;
    case 3: restore_vectors(to, vector, sign, n, 3, unscale); break;
    default: restore_vectors(to, vector, sign, n, ndim, unscale);
    }
}
