/* SPDX-License-Identifier: BSD-3-Clause */
/* points.c: see points.h. Magnitudes are compared as bit patterns, which order like numbers. */
#include "points.h"

#include "poll.h"

#include <math.h>
#include <string.h>

#define MAGNITUDE_BITS UINT64_C(0x7fffffffffffffff)
#define INFINITY_BITS  UINT64_C(0x7ff0000000000000)

HS_ALWAYS_INLINE uint64_t
double_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

HS_ALWAYS_INLINE double
double_of_bits(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

#define REAL    float
#define NAME(x) x##_f32
#include "points_template.h"

#define REAL    double
#define NAME(x) x##_f64
#include "points_template.h"

static void
name_first_bad(const hs_cloud *cloud, hs_failure *failure)
{
    int64_t at = 0;
    while (isfinite(cloud->x[at])) {
        at++;
    }
    failure->row = at / cloud->ndim;
    failure->column = at % cloud->ndim;
    failure->value = cloud->x[at];
}

/* Loads in parts, with a question after each full one. */
static hs_status
load_parts(const hs_points *points, const hs_options *options, double *x, uint64_t *largest)
{
    hs_status status = HS_OK;
    *largest = 0;
    for (int64_t first = 0; first < points->n && status == HS_OK; first += HS_POLL_POINTS) {
        const int64_t  left = points->n - first;
        hs_points      part = *points;
        part.n = left < HS_POLL_POINTS ? left : HS_POLL_POINTS;
        part.data = (const char *)points->data + first * points->row_stride;
        double        *to = x + first * points->ndim;
        const uint64_t found =
            points->real == HS_FLOAT32 ? load_rows_f32(&part, to) : load_rows_f64(&part, to);
        *largest = found > *largest ? found : *largest;
        status = hs_poll_points(options, part.n);
    }
    return status;
}

hs_status
hs_cloud_load(hs_account *account, const hs_points *points, const hs_options *options,
              hs_cloud *cloud, hs_failure *failure)
{
    uint64_t largest;
    *cloud = (hs_cloud){.n = points->n, .ndim = points->ndim};
    if (points->n > INT32_MAX) {
        failure->value = (double)points->n;
        return HS_ERR_TOO_MANY;
    }
    cloud->x = hs_alloc(account, HS_FOR_POINTS, points->n * points->ndim, sizeof(double));
    if (cloud->x == NULL) {
        return HS_ERR_MEMORY;
    }
    const hs_status status = load_parts(points, options, cloud->x, &largest);
    if (status != HS_OK) {
        hs_cloud_free(account, cloud);
        return status;
    }
    if (largest >= INFINITY_BITS) {
        name_first_bad(cloud, failure);
        hs_cloud_free(account, cloud);
        return HS_ERR_NOT_FINITE;
    }
    cloud->largest = double_of_bits(largest);
    return HS_OK;
}

double
hs_cloud_smallest(const hs_cloud *cloud)
{
    /* Zero minus one wraps to the largest integer, so zeros never win the minimum. */
    uint64_t smallest = UINT64_MAX;
    for (int64_t e = 0; e < cloud->n * cloud->ndim; e++) {
        const uint64_t below = (double_bits(cloud->x[e]) & MAGNITUDE_BITS) - 1;
        smallest = below < smallest ? below : smallest;
    }
    return smallest == UINT64_MAX ? INFINITY : double_of_bits(smallest + 1);
}

void
hs_cloud_free(hs_account *account, hs_cloud *cloud)
{
    hs_free(account, cloud->x);
    cloud->x = NULL;
}
