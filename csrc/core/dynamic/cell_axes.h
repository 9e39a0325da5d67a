/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * cell_axes.h: which cell a coordinate is in, along each grid axis, and which cells a ball meets.
 *
 * The index of a cell is a monotone function of the coordinate as it is stored. A ball from t - R
 * to t + R, rounded outwards, therefore meets no cells but those from the index of its lower end to
 * that of its upper end, however these were rounded: at any radius, also a multiple of the width.
 *
 * Along a periodic axis with n cells indices go on: u = cell + n * image. Image m of a cell is
 * where m periods have been added to its points.
 */
#ifndef HS_CELL_AXES_H
#define HS_CELL_AXES_H

#include "../box/lattice.h"

#include <math.h>

#define HS_FARTHEST_CELL 0x1p52 /* from here on float64 does not tell neighbouring cells apart */

typedef struct hs_axis {
    int     row;             /* of B, or -1: open */
    int64_t n;               /* cells in a period; 0: open */
    double  inverse;         /* cells a unit of length; 0: one cell */
    double  width;           /* 1 / inverse; infinity: one cell */
    double  half;            /* half a period; 0: open */
    double  lowest, highest; /* cells of a period, or as far as there are any */
    double  period;          /* 0: open */
    double  leak;     /* by how much images that a query can meet may move along this axis otherwise
                      * than by whole periods, and what wrapped points are rounded by however near
                      * they are; 0 in aligned boxes */
    double  farthest; /* sum of absolute terms of coordinates that are too far away; as above */
} hs_axis;

typedef struct hs_axes {
    int     ndim;
    bool    aligned; /* coordinates along the axes are those of points, and exact */
    hs_axis axis[HS_MAX_DIM];
} hs_axes;

/* Cells that a ball meets along one axis. */
typedef struct hs_span_of_cells {
    int64_t first, last; /* u of cells; last < first: none */
    int64_t least, most; /* images */
    int64_t centre;      /* u of the centre's cell */
} hs_span_of_cells;

/*
 * Coordinates of X along the axes of general boxes are rounded sums of products with X, which is
 * rounded itself: by less than this of the sum of absolute products.
 */
HS_ALWAYS_INLINE double
hs_axis_rounding(int ndim)
{
    return (ndim + 4) * 0x1p-53;
}

/* Sum of absolute products that t_k of X is made of. */
HS_ALWAYS_INLINE double
hs_axis_terms(const hs_lattice *lattice, const double *x, int k)
{
    double terms = 0.0;
    for (int c = 0; c < lattice->ndim; c++) {
        terms += fabs(lattice->normal[k][c] * x[c]);
    }
    return terms;
}

/* Whether the box moves points along coordinate axis c. */
bool hs_moves_column(const hs_lattice *lattice, int c);

/* cell_size: least width, where `one_cell` is false. max_radius: of queries. */
void hs_axes_init(hs_axes *axes, const hs_lattice *lattice, double cell_size, bool one_cell,
                  double max_radius);

/* The cell of a coordinate: any integer up to HS_FARTHEST_CELL, or from 0 to n - 1. Rounded down by
 * way of an integer, once it is bounded, also where infinity times 0 is no number: floor() is a
 * call where the CPU may lack an instruction for it. */
HS_ALWAYS_INLINE int64_t
hs_axis_cell(const hs_axis *axis, double t)
{
    const double  place = hs_smaller((t + axis->half) * axis->inverse, axis->highest);
    const double  bounded = hs_larger(place, axis->lowest);
    const int64_t whole = (int64_t)bounded;
    return axis->n > 0 ? whole : whole - ((double)whole > bounded);
}

/* A double at most x - y, and one at least x + y. Where they are subnormal, the sum was exact. */
HS_ALWAYS_INLINE double
hs_below(double x, double y)
{
    const double sum = x - y;
    return sum - fabs(sum) * 0x1p-52;
}

HS_ALWAYS_INLINE double
hs_above(double x, double y)
{
    const double sum = x + y;
    return sum + fabs(sum) * 0x1p-52;
}

/* The cells of a ball that meets other images: less than 2^30 of them. low, high: its ends, rounded
 * outwards; error: what coordinates may be wrong by. Sets all but the centre. */
void hs_axis_images(const hs_axis *axis, double low, double high, double error,
                    hs_span_of_cells *span);

/* The cells of a ball. t: its centre, in the middle period but for rounding, and in the cell
 * `centre`; radius: with the error. */
HS_ALWAYS_INLINE void
hs_axis_span(const hs_axis *axis, double t, int64_t centre, double radius, double error,
             hs_span_of_cells *span)
{
    const double low = hs_below(t, radius), high = hs_above(t, radius);
    span->centre = centre;
    if (axis->n == 0 || (low >= -axis->half + error && high <= axis->half - error)) {
        span->first = hs_axis_cell(axis, low);
        span->last = hs_axis_cell(axis, high);
        span->least = span->most = 0;
    } else {
        hs_axis_images(axis, low, high, error, span);
    }
}

/* Cell and image of u. */
HS_ALWAYS_INLINE int64_t
hs_axis_image(const hs_axis *axis, int64_t u)
{
    if (axis->n == 0 || (uint64_t)u < (uint64_t)axis->n) {
        return 0;
    }
    return u >= 0 ? u / axis->n : -((-u - 1) / axis->n) - 1;
}

/*
 * At most the square of the distance along the axis from t to the points of cell u; 0 where that is
 * not known to be more. An edge at u * width - half is computed with three roundings, and an index
 * with three more: 2^-44 of all that goes into them is a hundred times as much.
 */
HS_ALWAYS_INLINE double
hs_axis_gap(const hs_axis *axis, double t, int64_t u, int64_t centre)
{
    if (u == centre || axis->inverse == 0.0) {
        return 0.0;
    }
    const double edge = (double)(u + (u < centre)) * axis->width;
    const double distance = u > centre ? (edge - axis->half) - t : t - (edge - axis->half);
    const double gap = distance - 0x1p-44 * (fabs(edge) + fabs(t) + axis->half + axis->width);
    return gap > 0.0 ? gap * gap : 0.0;
}

#endif
