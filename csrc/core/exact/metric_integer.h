/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * metric_integer.h: the last stage. Every float is an integer times a power of two, so that, for a
 * common power, D and the cutoff are integers and compare exactly. No overflow, no rounding mode
 * and no flushing can touch this; it always decides.
 */
#ifndef HS_METRIC_INTEGER_H
#define HS_METRIC_INTEGER_H

#include "doubleword.h"
#include "metric.h"

/* Sign of |D|^2 - cutoff^2: -1, 0 or 1. shift may be NULL. */
int hs_integer_compare(const hs_metric *metric, const double *p, const double *q,
                       const int64_t *shift);

/* Sign of |D|^2 - limit^2, for the sum of both words, which must not be negative. */
int hs_integer_compare_sum(const hs_metric *metric, hs_dw limit, const double *p, const double *q,
                           const int64_t *shift);

/* Sign of |D1|^2 - |D2|^2. */
int hs_integer_compare_two(const hs_metric *metric, const hs_span *one, const hs_span *other);

/* D: component k is (value[k].hi + value[k].lo) * 2^*exponent within 2^-100 of the largest
 * component, the largest being at least 2^128 and below 2^192, or all of them 0. */
void hs_integer_difference(const hs_metric *metric, const double *p, const double *q,
                           const int64_t *shift, hs_dw *value, int *exponent);

#endif
