/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * points.h: the only reader of the caller's coordinates. Each number is read once, so that a
 * concurrent write can change the answer but not corrupt memory: all later steps see this copy.
 */
#ifndef HS_POINTS_H
#define HS_POINTS_H

#include "memory.h"

/* Coordinates as given, float32 widened exactly to float64. */
typedef struct hs_cloud {
    double *x;       /* owned; n * ndim, row-major */
    int64_t n;
    int     ndim;
    double  largest; /* largest |x|, 0 without points */
} hs_cloud;

/* Copies and checks, polling now and then. HS_ERR_NOT_FINITE names the first bad row and column;
 * HS_ERR_TOO_MANY from 2^31 points on. On failure the cloud holds nothing. */
hs_status hs_cloud_load(hs_account *account, const hs_points *points, const hs_options *options,
                        hs_cloud *cloud, hs_failure *failure);

/* Smallest nonzero |x|; infinity when there is none. */
double hs_cloud_smallest(const hs_cloud *cloud);

void hs_cloud_free(hs_account *account, hs_cloud *cloud);

#endif
