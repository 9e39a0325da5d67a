/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_BOX_LATTICE_H
#define HS_BOX_LATTICE_H

#include "../../halfshell.h"
#include "../base/base.h"

/*
 * lattice.h: the box as the search uses it. The periodic box vectors are replaced by a short
 * basis B of the same lattice, and each grid axis gets a unit normal along which points are
 * binned. Axis-aligned boxes keep their own coordinate axes and cost no arithmetic. The search
 * enumerates images over B, where their number is small however skewed the box is; shifts are
 * mapped back to the box as given, exactly, through integers.
 */

/* Multiplying by 2^-exponent, in two steps because 2^1074 is not a double. */
typedef struct hs_scale {
    int    exponent;
    double first, second; /* powers of two; first * second == 2^-exponent */
} hs_scale;

hs_scale hs_scale_of(int exponent);

HS_ALWAYS_INLINE double
hs_scale_apply(hs_scale scale, double value)
{
    return value * scale.first * scale.second;
}

/*
 * r counts periodic box vectors (0 ... n_periodic - 1), k counts grid axes (0 ... ndim - 1).
 * Lengths are scaled. A point X has the grid coordinate t_k = normal[k] . X. Matrices are set as
 * far as ndim and n_periodic go: what lies beyond is neither cleared nor read.
 */
typedef struct hs_lattice {
    int     ndim;
    int     n_periodic;
    bool    aligned;                        /* B is diagonal: t_k is coordinate k itself */
    bool    reduced;                        /* B is not the given box vectors (up to sign) */
    int     vector_of_row[HS_MAX_DIM];      /* box vector that periodic row r is */
    int     row_of_axis[HS_MAX_DIM];        /* row of B along grid axis k, or -1: open */
    double  given[HS_MAX_DIM][HS_MAX_DIM];  /* periodic box vectors as given, not scaled */
    double  scaled[HS_MAX_DIM][HS_MAX_DIM]; /* `given`, scaled */
    int64_t U[HS_MAX_DIM][HS_MAX_DIM];      /* B = U * scaled; |U[r][l]| <= 2^61 */
    double  rows[HS_MAX_DIM][HS_MAX_DIM];   /* B, scaled, rounded to float64 ... */
    double  row_error[HS_MAX_DIM];          /* ... each entry within this; 0 when aligned */
    double  normal[HS_MAX_DIM][HS_MAX_DIM]; /* unit vectors */
    double  period[HS_MAX_DIM];             /* normal[k] . B along k: the height; 0 when open */
    double  volume_mantissa;                /* the volume of the periodic box vectors, scaled,
                                             * ... */
    int     volume_exponent; /* ... is mantissa * 2^exponent: products of lengths overflow */
    double  direction[HS_MAX_DIM][HS_MAX_DIM]; /* D = sum_k (normal[k] . D) direction[k] */
} hs_lattice;

/* t_k of X, rounded; coordinate k itself in an aligned lattice. */
HS_ALWAYS_INLINE double
hs_lattice_coordinate(const hs_lattice *lattice, const double *x, int k)
{
    if (lattice->aligned) {
        return x[k];
    }
    double t = 0.0;
    for (int c = 0; c < lattice->ndim; c++) {
        t += lattice->normal[k][c] * x[c];
    }
    return t;
}

/* Periodic entries finite and periodic box vectors independent, decided exactly. NULL box:
 * HS_OK. */
hs_status hs_box_check(const hs_box *box, hs_failure *failure);

/* The lattice in a short basis, for searching. box: checked, or NULL for open space in ndim
 * dimensions. */
void hs_lattice_init(const hs_box *box, int ndim, hs_scale scale, hs_lattice *lattice);

/* The lattice in the box vectors as given, for measuring and wrapping: B is `scaled`, axis k is box
 * vector k. Only rows, normals, periods and the volume are set. */
void hs_lattice_init_given(const hs_box *box, hs_scale scale, hs_lattice *lattice);

/* Volume of the periodic box vectors, each length times 2^exponent; 1 without any. */
double hs_lattice_volume(const hs_lattice *lattice, int exponent);

/* S over the periodic box vectors as given, from a shift over B; false when it passes 2^62. */
bool hs_lattice_shift(const hs_lattice *lattice, const int64_t *reduced, int64_t *given);

/* The same of numbers that are known to be few: no sum passes int32. given may be reduced. */
HS_ALWAYS_INLINE void
hs_lattice_few(const hs_lattice *lattice, const int32_t *reduced, int32_t *given)
{
    int32_t sums[HS_MAX_DIM] = {0};
    for (int r = 0; r < lattice->n_periodic; r++) {
        for (int l = 0; l < lattice->n_periodic; l++) {
            sums[l] += reduced[r] * (int32_t)lattice->U[r][l];
        }
    }
    for (int l = 0; l < lattice->n_periodic; l++) {
        given[l] = sums[l];
    }
}

/* Gram and Schmidt, twice, so that the n unit vectors are at right angles to rounding: row order[r]
 * is the sum of parts[r][k] unit[k] over k <= r. order: NULL for rows in order. */
void hs_orthogonal_rows(const double rows[][HS_MAX_DIM], const int *order, int n, int ndim,
                        double unit[][HS_MAX_DIM], double parts[][HS_MAX_DIM]);

/* Whether reduction has failed: rows of B nearly depend on each other, or have coefficients over
 * the given box vectors that no shift may have. */
bool hs_skew_is_left(const hs_lattice *lattice);

/* Why a search would meet more images or rows of cells than any memory holds: HS_ERR_BOX_SKEWED or
 * HS_ERR_MEMORY, because the cutoff spans them. */
hs_status hs_skew_or_memory(const hs_lattice *lattice);

/*
 * What a change of the box does to distances, with certified bounds. docs/verlet.md
 * derives them.
 */

/* F, any matrix near the one that takes the old box vectors h0 to the new ones h. `residual` pays
 * for the difference between the two; no bound depends on how well F was found. */
typedef struct hs_strain {
    double F[HS_MAX_DIM][HS_MAX_DIM]; /* a row vector x goes to x F */
    double column_sum;                /* at least the largest sum over |F| of a column */
    double shrink;   /* |x F| >= shrink |x|, at most 1, rounded down; 0 or less: nothing known */
    double residual; /* |S (h0 F - h)| <= residual |S h0| for every S; taken off `shrink` too */
} hs_strain;

/* False where a bound cannot be had: too large a change, or numbers near the ends of the range. */
bool hs_strain_find(const hs_box *before, const hs_box *now, hs_strain *strain);

#endif
