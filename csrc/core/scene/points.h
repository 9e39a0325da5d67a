/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SCENE_POINTS_H
#define HS_SCENE_POINTS_H

#include "../threads/call.h"

/*
 * points.h: the only reader of the caller's coordinates. Each number is read once, so that a
 * concurrent write can change the answer but not corrupt memory: all later steps see this copy.
 */

/*
 * Coordinates as given, float32 widened exactly to float64, in one memory block together with the
 * room that sorting them takes. In it, with nothing of use between or behind them:
 *
 *     order | spare | x[0] | x[1] | ...
 */
typedef struct hs_cloud {
    void    *block;         /* owned */
    int32_t *order;         /* room for n */
    double  *spare;         /* room for n */
    double  *x[HS_MAX_DIM]; /* n each: coordinate k of every point */
    int64_t  n;
    int      ndim;
    double   lower[HS_MAX_DIM]; /* range of coordinate k; +infinity, -infinity without points */
    double   upper[HS_MAX_DIM];
    double   largest; /* largest |x|, 0 without points */
} hs_cloud;

/* Bytes behind the last column of a memory block that may be read: kernels work in whole
 * vectors. */
#define HS_COLUMN_PADDING ((int64_t)(HS_PADDING * sizeof(double)))

/* Entries from one column to the next: all begin on a cache line. */
HS_ALWAYS_INLINE int64_t
hs_column_pitch(int64_t n, size_t size)
{
    const int64_t per_line = (int64_t)(HS_ALIGNMENT / size);
    return (n + per_line - 1) / per_line * per_line;
}

/* HS_OK, HS_ERR_ARGUMENT, or HS_ERR_TOO_MANY for 2^31 points or more. points: or NULL. */
hs_status hs_check_points(const hs_points *points, hs_failure *failure);

/* Copies and checks, polling now and then. HS_ERR_NOT_FINITE names the first bad row and column;
 * HS_ERR_TOO_MANY from 2^31 points on. On failure the cloud holds nothing. */
hs_status hs_cloud_load(hs_account *account, hs_team *team, const hs_points *points,
                        const hs_options *options, hs_cloud *cloud, hs_failure *failure);

/* HS_OK, or HS_ERR_NOT_FINITE, which names the first number that is not finite. */
hs_status hs_points_check_finite(const hs_points *points, hs_failure *failure);

/* All coordinates in float64, one point behind another; they need not be finite. */
void hs_points_copy(const hs_points *points, double *rows);

/* hs_points_copy, where all must be finite: HS_ERR_NOT_FINITE names the first that is not. */
hs_status hs_points_copy_finite(const hs_points *points, double *rows, hs_failure *failure);

/* Range of each coordinate, from the caller's numbers, which need not be finite. */
void hs_points_range(const hs_points *points, double *lower, double *upper);

/* Smallest nonzero |x|; infinity when there is none. */
double hs_cloud_smallest(const hs_cloud *cloud);

void hs_cloud_free(hs_account *account, hs_cloud *cloud);

#endif
