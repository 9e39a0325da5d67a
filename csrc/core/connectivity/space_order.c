/* SPDX-License-Identifier: BSD-3-Clause */
/* space_order.c: a key for each point, and a radix sort of the keys. */
#include "space_order.h"

#include "../base/radix_sort.h"
#include "morton.h"

#include <math.h>

/* The bounding box of the points that are finite. */
static void
find_box(const double *points, int64_t n, int ndim, double *low, double *high)
{
    for (int k = 0; k < ndim; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
    }
    for (int64_t i = 0; i < n; i++) {
        for (int k = 0; k < ndim; k++) {
            const double x = points[i * ndim + k];
            low[k] = isfinite(x) && x < low[k] ? x : low[k];
            high[k] = isfinite(x) && x > high[k] ? x : high[k];
        }
    }
}

static void
find_keys(const double *points, int64_t n, int ndim, hs_keys *sort)
{
    double low[HS_MAX_DIM], high[HS_MAX_DIM];
    find_box(points, n, ndim, low, high);
    for (int64_t i = 0; i < n; i++) {
        uint64_t slices[HS_MAX_DIM] = {0};
        for (int k = 0; k < ndim; k++) {
            const double x = points[i * ndim + k];
            slices[k] = isfinite(x) ? hs_morton_slice(x, low[k], high[k], hs_morton_bits(ndim)) : 0;
        }
        sort->keys[i] = (int64_t)hs_morton_interleave(slices, ndim);
        sort->ids[i] = (int32_t)i;
    }
}

hs_status
hs_space_order_make(hs_call *call, const double *points, int64_t n, int ndim, hs_space_order *order)
{
    hs_account *account = &call->account;
    int64_t    *keys = hs_alloc(account, HS_FOR_SORTING, n, 2 * sizeof *keys);
    int32_t    *spare = hs_alloc(account, HS_FOR_SORTING, n, sizeof *spare);
    hs_status   status = HS_ERR_MEMORY;
    order->order = hs_alloc(account, HS_FOR_SORTING, n, 2 * sizeof *order->order);
    if (order->order != NULL && keys != NULL && spare != NULL) {
        hs_keys sort = {.keys = keys,
                        .ids = order->order,
                        .spare_keys = keys + n,
                        .spare_ids = spare,
                        .options = &call->options};
        find_keys(points, n, ndim, &sort);
        status = hs_keys_sort(&sort, 0, n);
    }
    hs_free(account, keys);
    hs_free(account, spare);
    if (status != HS_OK) {
        hs_space_order_free(account, order);
        return status;
    }
    order->place = order->order + n;
    for (int64_t p = 0; p < n; p++) {
        order->place[order->order[p]] = (int32_t)p;
    }
    return HS_OK;
}

void
hs_space_order_free(hs_account *account, hs_space_order *order)
{
    hs_free(account, order->order);
    *order = (hs_space_order){NULL, NULL};
}
