/* SPDX-License-Identifier: BSD-3-Clause */
/* restore.c: see restore.h. Loops without branches, which compilers turn into vectors. */
#include "restore.h"

#include <math.h>

void
hs_restore_distances(double *distance, int32_t n, hs_scale unscale)
{
    for (int32_t e = 0; e < n; e++) {
        distance[e] = hs_scale_apply(unscale, distance[e]);
    }
}

void
hs_keep_all_within(double *distance, int32_t n, double cutoff, bool inclusive)
{
    const double largest = inclusive ? cutoff : nextafter(cutoff, 0.0);
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
