/* SPDX-License-Identifier: BSD-3-Clause */
#include "points.h"

#include <math.h>
#include <string.h>

/* points.c: slabs of points are copied to columns, and the range of each column is kept. */

#if defined(__SSE2__) || defined(_M_X64)
#include <emmintrin.h>
#define HAS_SSE2 1
#else
#define HAS_SSE2 0
#endif

#define MAGNITUDE_BITS UINT64_C(0x7fffffffffffffff)
/* Points copied before their range is looked at: their columns are still in the nearest cache. */
#define TILE 512
/* Ranges kept side by side, so that the loops over them can be vectors. */
#define LANES 8

#define REAL    float
#define NAME(x) x##_f32
#include "points_template.h"

#define REAL    double
#define NAME(x) x##_f64
#include "points_template.h"

/* Range of a column. */
typedef struct range {
    double lower, upper;
    double poison; /* 0, or NaN once an entry was infinite or NaN */
} range;

static const range no_range = {INFINITY, -INFINITY, 0.0};

typedef struct loading {
    const hs_points *points;
    hs_cloud        *cloud;
    range            found[HS_SLABS][HS_MAX_DIM]; /* of slabs that have points */
} loading;

HS_ALWAYS_INLINE void
join_range(double lower, double upper, double poison, range *found)
{
    found->lower = hs_smaller(lower, found->lower);
    found->upper = hs_larger(upper, found->upper);
    found->poison += poison;
}

#if HAS_SSE2
/* What `join_range` does of each of LANES entries or more, written out: compilers do not find it.
 * The last LANES are looked at together, even if some have been before. */
HS_ALWAYS_INLINE void
widen_lanes(const double *x, int64_t n, range *found)
{
    __m128d lower[LANES / 2], upper[LANES / 2], poison[LANES / 2];
    double  ends[3][2];
    for (int pair = 0; pair < LANES / 2; pair++) {
        lower[pair] = _mm_set1_pd(INFINITY);
        upper[pair] = _mm_set1_pd(-INFINITY);
        poison[pair] = _mm_setzero_pd();
    }
    for (int64_t i = 0; i < n; i += LANES) {
        const double *from = x + (i + LANES <= n ? i : n - LANES);
        for (int pair = 0; pair < LANES / 2; pair++) {
            const __m128d entries = _mm_loadu_pd(from + 2 * pair);
            lower[pair] = _mm_min_pd(entries, lower[pair]); /* the second of them if one is NaN */
            upper[pair] = _mm_max_pd(entries, upper[pair]);
            poison[pair] = _mm_add_pd(poison[pair], _mm_sub_pd(entries, entries));
        }
    }
    for (int pair = 1; pair < LANES / 2; pair++) {
        lower[0] = _mm_min_pd(lower[pair], lower[0]);
        upper[0] = _mm_max_pd(upper[pair], upper[0]);
        poison[0] = _mm_add_pd(poison[0], poison[pair]);
    }
    _mm_storeu_pd(ends[0], lower[0]);
    _mm_storeu_pd(ends[1], upper[0]);
    _mm_storeu_pd(ends[2], poison[0]);
    join_range(ends[0][0], ends[1][0], ends[2][0], found);
    join_range(ends[0][1], ends[1][1], ends[2][1], found);
}
#else
HS_ALWAYS_INLINE void
widen_lanes(const double *x, int64_t n, range *found)
{
    double lower[LANES], upper[LANES], poison[LANES] = {0.0};
    for (int lane = 0; lane < LANES; lane++) {
        lower[lane] = INFINITY;
        upper[lane] = -INFINITY;
    }
    for (int64_t i = 0; i < n; i += LANES) {
        const double *from = x + (i + LANES <= n ? i : n - LANES);
        for (int lane = 0; lane < LANES; lane++) {
            const double entry = from[lane];
            lower[lane] = entry < lower[lane] ? entry : lower[lane];
            upper[lane] = entry > upper[lane] ? entry : upper[lane];
            poison[lane] += entry - entry;
        }
    }
    for (int lane = 0; lane < LANES; lane++) {
        join_range(lower[lane], upper[lane], poison[lane], found);
    }
}
#endif

static void
find_range(const double *x, int64_t n, range *found)
{
    if (n >= LANES) {
        widen_lanes(x, n, found);
        return;
    }
    for (int64_t i = 0; i < n; i++) {
        join_range(x[i], x[i], x[i] - x[i], found);
    }
}

static hs_status
load_slab(void *context, int slab, int64_t first, int64_t last)
{
    loading         *load = context;
    const hs_points *points = load->points;
    double *const   *x = load->cloud->x;
    for (int64_t begin = first; begin < last; begin += TILE) {
        const int64_t end = last - begin < TILE ? last : begin + TILE;
        if (points->real == HS_FLOAT32) {
            load_rows_f32(points, begin, end, x);
        } else {
            load_rows_f64(points, begin, end, x);
        }
        for (int k = 0; k < points->ndim; k++) {
            find_range(x[k] + begin, end - begin, &load->found[slab][k]);
        }
    }
    return HS_OK;
}

/* Coordinate k of point i. */
static double
entry_at(const hs_points *points, int64_t i, int k)
{
    const char *entry =
        (const char *)points->data + i * points->row_stride + k * points->column_stride;
    float  narrow;
    double x;
    if (points->real == HS_FLOAT32) {
        memcpy(&narrow, entry, sizeof narrow);
        return (double)narrow;
    }
    memcpy(&x, entry, sizeof x);
    return x;
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

static bool
allocate(hs_account *account, hs_cloud *cloud)
{
    const int64_t pitch = hs_column_pitch(cloud->n, sizeof(double));
    const int64_t for_order = hs_column_pitch(cloud->n, sizeof(int32_t)) / 2;
    const int64_t n_entries = for_order + (cloud->ndim + 1) * pitch + HS_PADDING;
    cloud->block = hs_alloc(account, HS_FOR_POINTS, n_entries, sizeof(double));
    if (cloud->block == NULL) {
        return false;
    }
    hs_account_reassign(account, HS_FOR_POINTS, HS_FOR_ORDER,
                        (for_order + pitch) * (int64_t)sizeof(double));
    cloud->order = cloud->block;
    cloud->spare = (double *)cloud->block + for_order;
    for (int k = 0; k < cloud->ndim; k++) {
        cloud->x[k] = cloud->spare + (k + 1) * pitch;
    }
    return true;
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
    if (!allocate(account, cloud)) {
        return HS_ERR_MEMORY;
    }
    load.points = points;
    load.cloud = cloud;
    for (int slab = 0; slab < n_slabs; slab++) {
        for (int k = 0; k < cloud->ndim; k++) {
            load.found[slab][k] = no_range;
        }
    }
    hs_status status = hs_walk_slabs(team, options, points->n, load_slab, &load);
    double    poison = 0.0; /* of all slabs */
    for (int k = 0; status == HS_OK && k < cloud->ndim; k++) {
        range all = no_range;
        for (int slab = 0; slab < n_slabs; slab++) {
            const range *found = &load.found[slab][k];
            join_range(found->lower, found->upper, found->poison, &all);
        }
        cloud->lower[k] = all.lower;
        cloud->upper[k] = all.upper;
        cloud->largest = hs_larger(hs_larger(-all.lower, all.upper), cloud->largest);
        poison += all.poison;
    }
    if (status == HS_OK && poison != 0.0) {
        const hs_points columns = {
            cloud->x[0],    cloud->n,
            cloud->ndim,    HS_FLOAT64,
            sizeof(double), hs_column_pitch(cloud->n, sizeof(double)) * (ptrdiff_t)sizeof(double)};
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
