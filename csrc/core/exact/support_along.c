/* SPDX-License-Identifier: BSD-3-Clause */
/* support_along.c: a bound that holds for any solution, and is near for one that is about right. */
#include "support_along.h"

#include <math.h>

#include "doubleword.h"
#include "support.h"

/* Numbers of these sizes neither overflow nor underflow where they are multiplied here. */
static bool
is_moderate(double x)
{
    return x >= 0x1p-200 && x <= 0x1p200;
}

/* About the solution of H y = normal, by cofactors. */
static void
solve(int ndim, const double *h, const double *normal, double *y)
{
    if (ndim == 1) {
        y[0] = normal[0] / h[0];
        return;
    }
    if (ndim == 2) {
        const double determinant = h[0] * h[2] - h[1] * h[1];
        y[0] = (h[2] * normal[0] - h[1] * normal[1]) / determinant;
        y[1] = (h[0] * normal[1] - h[1] * normal[0]) / determinant;
        return;
    }
    double       c[HS_SUPPORT_ENTRIES];
    const double determinant = hs_support_cofactors(h, c);
    y[0] = (c[0] * normal[0] + c[1] * normal[1] + c[3] * normal[2]) / determinant;
    y[1] = (c[1] * normal[0] + c[2] * normal[1] + c[4] * normal[2]) / determinant;
    y[2] = (c[3] * normal[0] + c[4] * normal[1] + c[5] * normal[2]) / determinant;
}

/* Not below the length of normal - H y: in double-words, with all that they lose. */
static double
residual(int ndim, const double *h, const double *normal, const double *y)
{
    double sum = 0.0;
    for (int k = 0; k < ndim; k++) {
        hs_dw  left = {normal[k], 0.0};
        double lost = 0.0;
        for (int l = 0; l < ndim; l++) {
            const hs_dw term = hs_two_product(-h[hs_support_at(k, l)], y[l]);
            left = hs_dw_add_watched(left, term, &lost);
        }
        sum += fabs(left.hi) + fabs(left.lo) + lost;
    }
    return sum;
}

/*
 * normal . D = (H^-1 normal) . (H D), which is at most |H^-1 normal| times the extent. With any y,
 * H^-1 normal = y + H^-1 (normal - H y), and the extent times H^-1 makes no vector longer than by
 * the reach. Rounding changes neither product by more than 2^-48 of it; what underflows in the
 * residual is below 2^-1000.
 */
double
hs_support_width(int ndim, const double *entries, double size, double extent, double reach,
                 const double *normal)
{
    double y[HS_SUPPORT_DIM], length = 0.0, square = 0.0;
    for (int k = 0; k < ndim; k++) {
        square += normal[k] * normal[k];
    }
    const double ball = reach * sqrt(square) * (1.0 + 0x1p-48);
    solve(ndim, entries, normal, y);
    for (int k = 0; k < ndim; k++) {
        length += y[k] * y[k];
    }
    length = sqrt(length);
    if (!is_moderate(size) || !is_moderate(length) || !is_moderate(extent) || !is_moderate(reach)) {
        return ball;
    }
    const double rest = residual(ndim, entries, normal, y) + 0x1p-1000;
    return hs_smaller((extent * length + reach * rest) * (1.0 + 0x1p-48), ball);
}
