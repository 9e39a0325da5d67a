/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * metric_foot.c: the signs of (x - p).(q - p) and (x - q).(p - q), neither of which is negative if
 * the foot lies between p and q: by float64 with an error bound, and else by integers.
 */
#include "metric_foot.h"

#include "metric_integer.h"

#include <math.h>

/*
 * d terms, each a product of two differences, are rounded three times each, and their sum d - 1
 * times: with v = 2^-53 and m the sum of their sizes as it is computed, the error is less than
 * (d + 2) v m (1 + 2 (d + 2) v), for d <= 8 below 11 v m. Numbers that underflow change it by less
 * than 2^-1071, which is below v m where m is at least 2^-1000.
 */
#define FOOT_ERROR   (12.0 * 0x1p-53)
#define LEAST_SIZE   0x1p-1000
#define LARGEST_SIZE 0x1p1020

/* Sign of (x - p).(q - p) by integers: four times that product is |x + q - 2 p|^2 - |x - q|^2. The
 * first vector is x - p + q - p: q and p are taken for box vectors, with the shift (1, -1). */
static HS_NO_INLINE int
sign_by_integers(const double *x, const double *p, const double *q, int ndim)
{
    const int64_t shift[2] = {1, -1};
    hs_metric     metric = {.ndim = ndim, .n_rows = 2};
    for (int k = 0; k < ndim; k++) {
        metric.rows[0][k] = q[k];
        metric.rows[1][k] = p[k];
    }
    return hs_integer_compare_two(&metric, &(hs_span){p, x, shift}, &(hs_span){q, x, NULL});
}

HS_ALWAYS_INLINE bool
is_forward(const double *x, const double *p, const double *q, int ndim)
{
    double product = 0.0, size = 0.0;
    for (int k = 0; k < ndim; k++) {
        const double term = (x[k] - p[k]) * (q[k] - p[k]);
        product += term;
        size += fabs(term);
    }
    if (size >= LEAST_SIZE && size <= LARGEST_SIZE && fabs(product) > FOOT_ERROR * size) {
        return product > 0.0;
    }
    return sign_by_integers(x, p, q, ndim) >= 0;
}

bool
hs_foot_is_between(const double *x, const double *p, const double *q, int ndim)
{
    return is_forward(x, p, q, ndim) && is_forward(x, q, p, ndim);
}
