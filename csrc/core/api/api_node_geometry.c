/* SPDX-License-Identifier: BSD-3-Clause */
/* api_node_geometry.c: the public functions about single nodes: feet on a segment, and places on
 * the Z curve. Points are looked at one by one; nothing is allocated. */
#include "../../halfshell_nodes.h"

#include "../connectivity/morton.h"
#include "../exact/metric_foot.h"
#include "../scene/points.h"
#include "../threads/call.h"

#include "arguments.h"

#include <math.h>

/* Reads point i; HS_ERR_NOT_FINITE where it is no point. */
static hs_status
read_point(const hs_points *points, int64_t i, double *x, hs_failure *failure)
{
    hs_points one = *points;
    one.data = (const char *)points->data + i * points->row_stride;
    one.n = 1;
    const hs_status status = hs_points_copy_finite(&one, x, failure);
    failure->row = status != HS_OK ? i : failure->row;
    return status;
}

static bool
are_finite(const double *x, int ndim)
{
    for (int k = 0; k < ndim; k++) {
        if (!isfinite(x[k])) {
            return false;
        }
    }
    return true;
}

hs_status
hs_feet_between(const hs_points *points, const double *p, const double *q, bool *between,
                hs_failure *failure)
{
    hs_entry entry;
    double   ends[2][HS_MAX_DIM] = {{0.0}}, x[HS_MAX_DIM];
    failure = hs_enter(failure, &entry);
    hs_status status = points != NULL ? hs_check_points(points, failure) : HS_ERR_ARGUMENT;
    if (status == HS_OK && (p == NULL || q == NULL || !hs_has_entries(between, points))) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        memcpy(ends[0], p, (size_t)points->ndim * sizeof *p);
        memcpy(ends[1], q, (size_t)points->ndim * sizeof *q);
        if (!are_finite(ends[0], points->ndim) || !are_finite(ends[1], points->ndim)) {
            status = HS_ERR_ARGUMENT;
        }
    }
    for (int64_t i = 0; status == HS_OK && i < points->n; i++) {
        status = read_point(points, i, x, failure);
        if (status == HS_OK) {
            between[i] = hs_foot_is_between(x, ends[0], ends[1], points->ndim);
        }
    }
    hs_leave(&entry);
    return status;
}

/* The box of the keys. */
typedef struct key_box {
    double low[HS_MAX_DIM], high[HS_MAX_DIM];
} key_box;

static hs_status
read_box(const double *low, const double *high, int ndim, key_box *box, hs_failure *failure)
{
    for (int k = 0; k < ndim; k++) {
        box->low[k] = low[k];
        box->high[k] = high[k];
        if (!isfinite(box->low[k]) || !isfinite(box->high[k]) || box->low[k] > box->high[k]) {
            failure->column = k;
            return HS_ERR_BOX_FINITE;
        }
    }
    return HS_OK;
}

/* The key of a point, or HS_ERR_FAR where it is outside. */
static hs_status
find_key(const key_box *box, const double *x, int ndim, uint64_t *key)
{
    uint64_t slices[HS_MAX_DIM];
    for (int k = 0; k < ndim; k++) {
        if (x[k] < box->low[k] || x[k] > box->high[k]) {
            return HS_ERR_FAR;
        }
        slices[k] = hs_morton_slice(x[k], box->low[k], box->high[k], hs_morton_bits(ndim));
    }
    *key = hs_morton_interleave(slices, ndim);
    return HS_OK;
}

hs_status
hs_morton_keys(const hs_points *points, const double *low, const double *high, uint64_t *keys,
               hs_failure *failure)
{
    hs_entry entry;
    key_box  box;
    double   x[HS_MAX_DIM];
    failure = hs_enter(failure, &entry);
    hs_status status = points != NULL ? hs_check_points(points, failure) : HS_ERR_ARGUMENT;
    if (status == HS_OK && (low == NULL || high == NULL || !hs_has_entries(keys, points))) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = read_box(low, high, points->ndim, &box, failure);
    }
    for (int64_t i = 0; status == HS_OK && i < points->n; i++) {
        status = read_point(points, i, x, failure);
        if (status == HS_OK) {
            status = find_key(&box, x, points->ndim, &keys[i]);
            failure->row = status != HS_OK ? i : failure->row;
        }
    }
    hs_leave(&entry);
    return status;
}
