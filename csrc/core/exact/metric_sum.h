/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * metric_sum.h: the decision of metric.h for a limit that is the sum of two numbers, such as two
 * radii, and often no float64. What is compared is the real sum.
 */
#ifndef HS_METRIC_SUM_H
#define HS_METRIC_SUM_H

#include "doubleword.h"
#include "metric.h"

/* Sets the cutoff of a metric, whose rows stay. */
void hs_metric_set_cutoff(double cutoff, hs_metric *metric);

/* hs_metric_within for limit.hi + limit.lo, not negative, hi being the sum rounded to nearest. The
 * cutoff of the metric plays no part. */
bool hs_metric_within_sum(const hs_metric *metric, hs_dw limit, const double *p, const double *q,
                          const int64_t *shift, hs_stages *stages);

#endif
