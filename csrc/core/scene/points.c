/* SPDX-License-Identifier: BSD-3-Clause */
#include "points.h"
#include "../box/wrap.h"

/* points.c: slabs of points are copied to columns, and the range of each column is kept. */

/* Most bytes from one end of an array to the other: a little less than addresses allow, because the
 * sum that is compared with it is rounded. */
#define MOST_EXTENT    (0.99 * (double)PTRDIFF_MAX)
#define MAGNITUDE_BITS UINT64_C(0x7fffffffffffffff)
/* Points copied before their range is looked at: their columns are still in the nearest cache. */
#define TILE 512

hs_status
hs_check_points(const hs_points *points, hs_failure *failure)
{
    if (points == NULL || points->ndim < 1 || points->ndim > HS_MAX_DIM || points->n < 0 ||
        (points->real != HS_FLOAT32 && points->real != HS_FLOAT64)) {
        return HS_ERR_ARGUMENT;
    }
    if (points->n > INT32_MAX) {
        failure->value = (double)points->n;
        return HS_ERR_TOO_MANY;
    }
    /* Entries are there, if any, no further apart than addresses can be. */
    const double rows = (double)(points->n - 1) * (double)points->row_stride;
    const double columns = (double)(points->ndim - 1) * (double)points->column_stride;
    return points->n == 0 || (points->data != NULL && fabs(rows) + fabs(columns) <= MOST_EXTENT)
               ? HS_OK
               : HS_ERR_ARGUMENT;
}

typedef struct loading {
    const hs_points *points;
    hs_cloud        *cloud;
    hs_range         found[HS_SLABS][HS_MAX_DIM]; /* of slabs that have points */
} loading;

/* The number at any address; memcpy compiles to one load. */
HS_ALWAYS_INLINE double
read_entry(const char *entry, hs_real real)
{
    float  narrow;
    double x;
    if (real == HS_FLOAT32) {
        memcpy(&narrow, entry, sizeof narrow);
        return (double)narrow;
    }
    memcpy(&x, entry, sizeof x);
    return x;
}

/* Coordinate k of point i. */
static double
entry_at(const hs_points *points, int64_t i, int k)
{
    return read_entry((const char *)points->data + i * points->row_stride +
                          k * points->column_stride,
                      points->real);
}

/* Copies points [first, last). Inlined with constants for the type and ndim. */
HS_ALWAYS_INLINE void
copy_rows(const hs_points *points, const hs_real real, int ndim, int64_t first, int64_t last,
          double *const *x)
{
    double *to[HS_MAX_DIM];
    for (int k = 0; k < ndim; k++) {
        to[k] = x[k];
    }
    for (int64_t i = first; i < last; i++) { /* no address behind the last point: it may overflow */
        const char *row = (const char *)points->data + i * points->row_stride;
        for (int k = 0; k < ndim; k++) {
            to[k][i] = read_entry(row + k * points->column_stride, real);
        }
    }
}

static hs_status
load_slab(void *context, int slab, int64_t first, int64_t last)
{
    loading         *load = context;
    const hs_points *points = load->points;
    double *const   *x = load->cloud->x;
    const int        d = points->ndim;
    for (int64_t begin = first; begin < last; begin += TILE) {
        const int64_t end = last - begin < TILE ? last : begin + TILE;
        if (points->real == HS_FLOAT64 && d == 3) { /* most common: without an inner loop */
            copy_rows(points, HS_FLOAT64, 3, begin, end, x);
        } else if (points->real == HS_FLOAT64 && d == 2) {
            copy_rows(points, HS_FLOAT64, 2, begin, end, x);
        } else {
            copy_rows(points, points->real, d, begin, end, x);
        }
        for (int k = 0; k < d; k++) {
            hs_range_widen(x[k] + begin, end - begin, &load->found[slab][k]);
        }
    }
    return HS_OK;
}

hs_status
hs_points_check_finite(const hs_points *points, hs_failure *failure)
{
    for (int64_t i = 0; i < points->n; i++) {
        for (int k = 0; k < points->ndim; k++) {
            const double x = entry_at(points, i, k);
            if (!isfinite(x)) {
                failure->row = i;
                failure->column = k;
                failure->value = x;
                return HS_ERR_NOT_FINITE;
            }
        }
    }
    return HS_OK;
}

hs_status
hs_cloud_load(hs_account *account, hs_team *team, const hs_points *points,
              const hs_options *options, hs_cloud *cloud, hs_failure *failure)
{
    loading   load;
    const int n_slabs = points->n < HS_POLL_POINTS
                            ? (int)((points->n + HS_SLAB_POINTS - 1) / HS_SLAB_POINTS)
                            : HS_SLABS;
    HS_ASSERT(points->n <= INT32_MAX); /* hs_check_points */
    *cloud = (hs_cloud){.n = points->n, .ndim = points->ndim};
    const int64_t pitch = hs_column_pitch(cloud->n, sizeof(double));
    const int64_t for_order = hs_column_pitch(cloud->n, sizeof(int32_t)) / 2;
    const int64_t n_entries = for_order + (cloud->ndim + 1) * pitch + HS_PADDING;
    cloud->block = hs_alloc(account, HS_FOR_POINTS, n_entries, sizeof(double));
    if (cloud->block == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_account_reassign(account, HS_FOR_POINTS, HS_FOR_ORDER,
                        (for_order + pitch) * (int64_t)sizeof(double));
    cloud->order = cloud->block;
    cloud->spare = (double *)cloud->block + for_order;
    for (int k = 0; k < cloud->ndim; k++) {
        cloud->x[k] = cloud->spare + (k + 1) * pitch;
    }
    load.points = points;
    load.cloud = cloud;
    for (int slab = 0; slab < n_slabs; slab++) {
        for (int k = 0; k < cloud->ndim; k++) {
            load.found[slab][k] = HS_NO_RANGE;
        }
    }
    hs_status status = hs_walk_points(team, options, points->n, 0, load_slab, &load);
    double    poison = 0.0; /* of all slabs */
    for (int k = 0; status == HS_OK && k < cloud->ndim; k++) {
        cloud->lower[k] = INFINITY;
        cloud->upper[k] = -INFINITY;
        for (int slab = 0; slab < n_slabs; slab++) {
            const hs_range *found = &load.found[slab][k];
            cloud->lower[k] = hs_smaller(found->lower, cloud->lower[k]);
            cloud->upper[k] = hs_larger(found->upper, cloud->upper[k]);
            poison += found->poison;
        }
        cloud->largest = hs_larger(hs_larger(-cloud->lower[k], cloud->upper[k]), cloud->largest);
    }
    if (status == HS_OK && poison != 0.0) {
        const ptrdiff_t size = (ptrdiff_t)sizeof(double);
        const hs_points columns = {cloud->x[0], cloud->n, cloud->ndim,
                                   HS_FLOAT64,  size,     pitch * size};
        status = hs_points_check_finite(&columns, failure);
    }
    if (status != HS_OK) {
        hs_cloud_free(account, cloud);
    }
    return status;
}

void
hs_points_copy(const hs_points *points, double *rows)
{
    for (int64_t i = 0; i < points->n; i++) {
        for (int k = 0; k < points->ndim; k++) {
            *rows++ = entry_at(points, i, k);
        }
    }
}

hs_status
hs_points_copy_finite(const hs_points *points, double *rows, hs_failure *failure)
{
    const ptrdiff_t size = (ptrdiff_t)sizeof *rows;
    const hs_points copied = {rows, points->n, points->ndim, HS_FLOAT64, points->ndim * size, size};
    hs_points_copy(points, rows);
    return hs_points_check_finite(&copied, failure);
}

void
hs_points_range(const hs_points *points, double *lower, double *upper)
{
    for (int k = 0; k < points->ndim; k++) {
        lower[k] = INFINITY;
        upper[k] = -INFINITY;
        for (int64_t i = 0; i < points->n; i++) {
            const double x = entry_at(points, i, k);
            lower[k] = hs_smaller(x, lower[k]);
            upper[k] = hs_larger(x, upper[k]);
        }
    }
}

double
hs_cloud_smallest(const hs_cloud *cloud)
{
    /* Magnitudes as bit patterns, which order like numbers. Zero minus one wraps to the largest
     * integer, so zeros never win the minimum. */
    uint64_t smallest = UINT64_MAX;
    for (int k = 0; k < cloud->ndim; k++) {
        for (int64_t i = 0; i < cloud->n; i++) {
            const uint64_t below = (hs_bits_of_double(cloud->x[k][i]) & MAGNITUDE_BITS) - 1;
            smallest = below < smallest ? below : smallest;
        }
    }
    return smallest < UINT64_MAX ? hs_double_of_bits(smallest + 1) : INFINITY;
}

void
hs_cloud_free(hs_account *account, hs_cloud *cloud)
{
    hs_free(account, cloud->block);
    cloud->block = NULL;
}
