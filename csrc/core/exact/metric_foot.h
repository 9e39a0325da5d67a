/* SPDX-License-Identifier: BSD-3-Clause */
/* metric_foot.h: does the perpendicular from a point meet a segment, for the real numbers that
 * these floats are? */
#ifndef HS_METRIC_FOOT_H
#define HS_METRIC_FOOT_H

#include "../base/base.h"

/* Whether 0 <= (x - p).(q - p) <= |q - p|^2: the foot of the perpendicular from x on the line
 * through p and q lies on the closed segment between them. True where p and q are one point. */
bool hs_foot_is_between(const double *x, const double *p, const double *q, int ndim);

#endif
