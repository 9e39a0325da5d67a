/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * exact_order.h: which of two points is nearer. The sign of |D1|^2 - |D2|^2 for two vectors of one
 * metric, decided by the stages of exact.h; its cutoff plays no part, but for floats_usable.
 */
#ifndef HS_EXACT_ORDER_H
#define HS_EXACT_ORDER_H

#include "exact.h"

/* One vector D = q - p + shift * rows; all borrowed. shift: n_rows integers, or NULL for zeros. */
typedef struct hs_span {
    const double  *p, *q;
    const int64_t *shift;
} hs_span;

/* -1, 0 or 1. Callers must have set round to nearest without flushing. */
int hs_metric_compare(const hs_metric *metric, const hs_span *one, const hs_span *other,
                      hs_stages *stages);

#endif
