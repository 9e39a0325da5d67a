/* SPDX-License-Identifier: BSD-3-Clause */
/* points.c: slabs of points are copied to columns, and the range of each column is kept. */
#include "points.h"

#include "../threads/passes.h"

#include <math.h>
#include <string.h>
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

/* Range of one column, one lane for every LANES-th entry. */
typedef struct range {
    double lower[LANES];
    double upper[LANES];
    double poison[LANES]; /* 0, or NaN once an entry was infinite or NaN */
} range;

/* Range of one column, of all lanes. */
typedef struct joined_range {
    double lower, upper, poison;
} joined_range;

typedef struct loading {
    const hs_points *points;
    hs_cloud        *cloud;
    joined_range     found[HS_SLABS][HS_MAX_DIM]; /* of slabs that have points */
} loading;

HS_ALWAYS_INLINE void
widen(range *found, int lane, double x)
{
    found->lower[lane] = x < found->lower[lane] ? x : found->lower[lane];
    found->upper[lane] = x > found->upper[lane] ? x : found->upper[lane];
    found->poison[lane] += x - x;
}

#if HAS_SSE2
/* What `widen` does, written out: compilers do not find it. Returns how many entries are done. */
static int64_t
widen_lanes(const double *x, int64_t n, range *found)
{
    __m128d lower[LANES / 2], upper[LANES / 2], poison[LANES / 2];
    int64_t i = 0;
    for (int pair = 0; pair < LANES / 2; pair++) {
        lower[pair] = _mm_loadu_pd(found->lower + 2 * pair);
        upper[pair] = _mm_loadu_pd(found->upper + 2 * pair);
        poison[pair] = _mm_loadu_pd(found->poison + 2 * pair);
    }
    for (; i + LANES <= n; i += LANES) {
        for (int pair = 0; pair < LANES / 2; pair++) {
            const __m128d entries = _mm_loadu_pd(x + i + 2 * pair);
            lower[pair] = _mm_min_pd(entries, lower[pair]); /* the second of them if one is NaN */
            upper[pair] = _mm_max_pd(entries, upper[pair]);
            poison[pair] = _mm_add_pd(poison[pair], _mm_sub_pd(entries, entries));
        }
    }
    for (int pair = 0; pair < LANES / 2; pair++) {
        _mm_storeu_pd(found->lower + 2 * pair, lower[pair]);
        _mm_storeu_pd(found->upper + 2 * pair, upper[pair]);
        _mm_storeu_pd(found->poison + 2 * pair, poison[pair]);
    }
    return i;
}
#else
static int64_t
widen_lanes(const double *x, int64_t n, range *found)
{
    int64_t i = 0;
    for (; i + LANES <= n; i += LANES) {
        for (int lane = 0; lane < LANES; lane++) {
            widen(found, lane, x[i + lane]);
        }
    }
    return i;
}
#endif

static void
find_range(const double *x, int64_t n, range *found)
{
    for (int64_t i = widen_lanes(x, n, found); i < n; i++) {
        widen(found, 0, x[i]);
    }
}

static void
join_lanes(const range *found, joined_range *joined)
{
    for (int lane = 0; lane < LANES; lane++) {
        joined->lower = hs_smaller(found->lower[lane], joined->lower);
        joined->upper = hs_larger(found->upper[lane], joined->upper);
        joined->poison += found->poison[lane];
    }
}

static hs_status
load_slab(void *context, int slab, int64_t first, int64_t last)
{
    loading         *load = context;
    const hs_points *points = load->points;
    double *const   *x = load->cloud->x;
    range            found[HS_MAX_DIM];
    for (int k = 0; k < points->ndim; k++) {
        for (int lane = 0; lane < LANES; lane++) {
            found[k].lower[lane] = INFINITY;
            found[k].upper[lane] = -INFINITY;
            found[k].poison[lane] = 0.0;
        }
    }
    for (int64_t begin = first; begin < last; begin += TILE) {
        const int64_t end = last - begin < TILE ? last : begin + TILE;
        if (points->real == HS_FLOAT32) {
            load_rows_f32(points, begin, end, x);
        } else {
            load_rows_f64(points, begin, end, x);
        }
        for (int k = 0; k < points->ndim; k++) {
            find_range(x[k] + begin, end - begin, &found[k]);
        }
    }
    for (int k = 0; k < points->ndim; k++) {
        join_lanes(&found[k], &load->found[slab][k]);
    }
    return HS_OK;
}

/* Joins the ranges of all slabs. Returns whether every entry is finite. */
static bool
join_ranges(const loading *load, int n_slabs)
{
    hs_cloud *cloud = load->cloud;
    double    poison = 0.0;
    for (int k = 0; k < cloud->ndim; k++) {
        cloud->lower[k] = INFINITY;
        cloud->upper[k] = -INFINITY;
        for (int slab = 0; slab < n_slabs; slab++) {
            const joined_range *found = &load->found[slab][k];
            cloud->lower[k] = hs_smaller(found->lower, cloud->lower[k]);
            cloud->upper[k] = hs_larger(found->upper, cloud->upper[k]);
            poison += found->poison;
        }
        if (cloud->n > 0) {
            cloud->largest = fmax(cloud->largest, fmax(-cloud->lower[k], cloud->upper[k]));
        }
    }
    return poison == 0.0;
}

static void
name_first_bad(const hs_cloud *cloud, hs_failure *failure)
{
    for (int64_t i = 0; i < cloud->n; i++) {
        for (int k = 0; k < cloud->ndim; k++) {
            if (!isfinite(cloud->x[k][i])) {
                failure->row = i;
                failure->column = k;
                failure->value = cloud->x[k][i];
                return;
            }
        }
    }
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
            load.found[slab][k] = (joined_range){INFINITY, -INFINITY, 0.0};
        }
    }
    hs_status status = hs_walk_slabs(team, options, points->n, load_slab, &load);
    if (status == HS_OK && !join_ranges(&load, n_slabs)) {
        name_first_bad(cloud, failure);
        status = HS_ERR_NOT_FINITE;
    }
    if (status != HS_OK) {
        hs_cloud_free(account, cloud);
    }
    return status;
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
    hs_points_copy(points, rows);
    for (int64_t e = 0; e < points->n * points->ndim; e++) {
        if (!isfinite(rows[e])) {
            failure->row = e / points->ndim;
            failure->column = e % points->ndim;
            failure->value = rows[e];
            return HS_ERR_NOT_FINITE;
        }
    }
    return HS_OK;
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
