/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * strain.c: a first guess of F, then bounds on how wrong it is. Sums of non-negative numbers are
 * rounded up by a factor GROW at the end: no sum here has more than 200 operations, each of a
 * relative error of at most 2^-53.
 */
#include "strain.h"

#include "lattice.h"

#include <math.h>
#include <string.h>

#define UNIT 0x1p-53
#define GROW (1.0 + 0x1p-40)
/* More than all underflows of a sum of products lose. */
#define LOST 0x1p-1060
/* Sweeps of rotations: they converge quadratically, and whatever is left is measured. */
#define SWEEPS 12

/* c = a b; returns how far, at most, an entry may be from that of the exact product. */
static double
multiply(int rows, int inner, int columns, const double a[][HS_MAX_DIM],
         const double b[][HS_MAX_DIM], double c[][HS_MAX_DIM])
{
    double worst = 0.0;
    for (int r = 0; r < rows; r++) {
        for (int k = 0; k < columns; k++) {
            double sum = 0.0, size = 0.0;
            for (int l = 0; l < inner; l++) {
                sum += a[r][l] * b[l][k];
                size += fabs(a[r][l]) * fabs(b[l][k]);
            }
            c[r][k] = sum;
            worst = hs_larger((inner + 1) * UNIT * size, worst);
        }
    }
    return worst * GROW + LOST;
}

/* At most the smallest (sign = -1), or at least the largest (sign = 1), eigenvalue of M M^T, by
 * Gershgorin's circles. */
static double
bound_eigenvalue(int d, const double M[][HS_MAX_DIM], double sign)
{
    double bound = sign * -INFINITY;
    for (int a = 0; a < d; a++) {
        double radius = 0.0, centre = 0.0;
        for (int b = 0; b < d; b++) {
            double dot = 0.0, size = 0.0;
            for (int k = 0; k < d; k++) {
                dot += M[a][k] * M[b][k];
                size += fabs(M[a][k]) * fabs(M[b][k]);
            }
            radius += (b == a ? 0.0 : fabs(dot)) + (d + 1) * UNIT * size + LOST;
            centre = b == a ? dot : centre;
        }
        /* The sum and its rounding, to the safe side. */
        const double reach = radius * GROW + fabs(centre) * 0x1p-50;
        const double end = centre + sign * reach;
        bound = sign > 0.0 ? hs_larger(end, bound) : hs_smaller(end, bound);
        if (!(end == end)) {
            return NAN;
        }
    }
    return bound;
}

/* Rotates rows a and b of M, and of V, so that those of M become orthogonal. */
static void
rotate_rows(int d, double M[][HS_MAX_DIM], double V[][HS_MAX_DIM], int a, int b)
{
    double aa = 0.0, bb = 0.0, ab = 0.0;
    for (int k = 0; k < d; k++) {
        aa += M[a][k] * M[a][k];
        bb += M[b][k] * M[b][k];
        ab += M[a][k] * M[b][k];
    }
    if (ab == 0.0) {
        return;
    }
    const double zeta = (bb - aa) / (2.0 * ab);
    const double t = (zeta >= 0.0 ? 1.0 : -1.0) / (fabs(zeta) + sqrt(1.0 + zeta * zeta));
    const double c = 1.0 / sqrt(1.0 + t * t), s = c * t;
    for (int k = 0; k < d; k++) {
        const double m = M[a][k], v = V[a][k];
        M[a][k] = c * m - s * M[b][k];
        M[b][k] = s * m + c * M[b][k];
        V[a][k] = c * v - s * V[b][k];
        V[b][k] = s * v + c * V[b][k];
    }
}

double
hs_smallest_stretch(int d, const double F[][HS_MAX_DIM])
{
    double M[HS_MAX_DIM][HS_MAX_DIM], V[HS_MAX_DIM][HS_MAX_DIM];
    for (int a = 0; a < d; a++) {
        for (int k = 0; k < d; k++) {
            M[a][k] = F[a][k];
            V[a][k] = a == k;
        }
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        for (int a = 0; a < d; a++) {
            for (int b = a + 1; b < d; b++) {
                rotate_rows(d, M, V, a, b);
            }
        }
    }
    /* V is nearly orthogonal and V F has nearly orthogonal rows. Neither is trusted: both are
     * measured. With x = y V: |x F|^2 = |y (V F)|^2 and |x|^2 = |y V|^2. */
    const double off = multiply(d, d, d, (const double(*)[HS_MAX_DIM])V, F, M);
    const double least = bound_eigenvalue(d, (const double(*)[HS_MAX_DIM])M, -1.0);
    const double most = bound_eigenvalue(d, (const double(*)[HS_MAX_DIM])V, 1.0);
    if (!(least > 0x1p-900) || !(least < 0x1p900) || !(most < 2.0) || !(most > 0.5)) {
        return 0.0;
    }
    /* 2^-48 is more than the six roundings; `off` moves a singular value by its norm at most. */
    return (sqrt(least) - d * off * GROW) / sqrt(most) * (1.0 - 0x1p-48);
}

/* F = 1 + sum_r g_r^T (h_r - h0_r), g_r being the vectors dual to h0: a first guess. */
static bool
guess_strain(const hs_lattice *lattice, const double now[][HS_MAX_DIM], hs_strain *strain)
{
    const int d = lattice->ndim;
    for (int c = 0; c < d; c++) {
        for (int k = 0; k < d; k++) {
            strain->F[c][k] = c == k;
        }
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        const int axis = lattice->vector_of_row[r];
        if (!(lattice->period[axis] > 0.0)) {
            return false;
        }
        for (int c = 0; c < d; c++) {
            const double dual = lattice->normal[axis][c] / lattice->period[axis];
            for (int k = 0; k < d; k++) {
                strain->F[c][k] += dual * (now[r][k] - lattice->given[r][k]);
            }
        }
    }
    return true;
}

/* |g| (Frobenius) of a right inverse of h0, from a rounded one that is within `error` of one. */
static double
bound_inverse(const hs_lattice *lattice)
{
    const int d = lattice->ndim, m = lattice->n_periodic;
    double    g[HS_MAX_DIM][HS_MAX_DIM], product[HS_MAX_DIM][HS_MAX_DIM];
    double    norm = 0.0, error = 0.0;
    for (int r = 0; r < m; r++) {
        const int axis = lattice->vector_of_row[r];
        for (int c = 0; c < d; c++) {
            g[c][r] = lattice->normal[axis][c] / lattice->period[axis];
            norm += fabs(g[c][r]);
        }
    }
    const double off = multiply(m, d, m, lattice->given, (const double(*)[HS_MAX_DIM])g, product);
    for (int r = 0; r < m; r++) {
        for (int s = 0; s < m; s++) {
            error += fabs(product[r][s] - (r == s)) * (1.0 + 0x1p-52) + off;
        }
    }
    error *= GROW;
    return error < 0.5 ? norm / (1.0 - error) * GROW : INFINITY;
}

/* |h0 F - h|, the sum over all entries. */
static double
bound_residual(const hs_lattice *lattice, const double now[][HS_MAX_DIM], const hs_strain *strain)
{
    const int    d = lattice->ndim, m = lattice->n_periodic;
    double       product[HS_MAX_DIM][HS_MAX_DIM], sum = 0.0;
    const double off = multiply(m, d, d, lattice->given, strain->F, product);
    for (int r = 0; r < m; r++) {
        for (int k = 0; k < d; k++) {
            sum += fabs(product[r][k] - now[r][k]) * (1.0 + 0x1p-52) + off;
        }
    }
    return sum * GROW;
}

bool
hs_strain_find(const hs_box *before, const hs_box *now, hs_strain *strain)
{
    hs_lattice lattice;
    double     rows[HS_MAX_DIM][HS_MAX_DIM];
    hs_lattice_init_given(before, hs_scale_of(0), &lattice);
    for (int r = 0; r < lattice.n_periodic; r++) {
        memcpy(rows[r], now->rows[lattice.vector_of_row[r]], sizeof rows[r]);
    }
    if (!guess_strain(&lattice, (const double(*)[HS_MAX_DIM])rows, strain)) {
        return false;
    }
    strain->column_sum = 0.0;
    for (int k = 0; k < before->ndim; k++) {
        double sum = 0.0;
        for (int c = 0; c < before->ndim; c++) {
            sum += fabs(strain->F[c][k]);
        }
        strain->column_sum = hs_larger(sum * GROW, strain->column_sum);
    }
    strain->residual = bound_inverse(&lattice) *
                       bound_residual(&lattice, (const double(*)[HS_MAX_DIM])rows, strain) * GROW;
    strain->shrink = hs_smallest_stretch(before->ndim, (const double(*)[HS_MAX_DIM])strain->F) -
                     strain->residual;
    /* The difference is rounded by at most 2^-53 of the larger. */
    strain->shrink -= 0x1p-52 * fabs(strain->shrink) + 0x1p-53 * strain->residual + 0x1p-1060;
    strain->shrink = hs_smaller(strain->shrink, 1.0);
    return strain->shrink > 0.0 && strain->residual < INFINITY;
}
