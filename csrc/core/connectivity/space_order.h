/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * space_order.h: points in the order of the Z curve through their bounding box. Work on points that
 * follow each other then finds in the caches what the last ones needed.
 */
#ifndef HS_SPACE_ORDER_H
#define HS_SPACE_ORDER_H

#include "../threads/call.h"

/* Both arrays are parts of one block, owned by `order`. */
typedef struct hs_space_order {
    int32_t *order; /* n: the points, in this order */
    int32_t *place; /* n: where each of them is in it */
} hs_space_order;

/* points: row after row; those that are not finite come anywhere. On failure holds nothing. */
hs_status hs_space_order_make(hs_call *call, const double *points, int64_t n, int ndim,
                              hs_space_order *order);

/* Harmless twice. */
void hs_space_order_free(hs_account *account, hs_space_order *order);

#endif
