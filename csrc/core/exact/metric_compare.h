/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * metric_compare.h: which of two points is nearer. The sign of |D1|^2 - |D2|^2 for two vectors of
 * one metric, decided by the stages of metric.h; its cutoff plays no part, but for floats_usable.
 */
#ifndef HS_METRIC_COMPARE_H
#define HS_METRIC_COMPARE_H

#include "metric.h"

/* -1, 0 or 1. Callers must have set round to nearest without flushing. */
int hs_metric_compare(const hs_metric *metric, const hs_span *one, const hs_span *other,
                      hs_stages *stages);

#endif
