/* SPDX-License-Identifier: BSD-3-Clause */
/* cell_axes.c: cells of at least the width that was given; periods hold a whole number of them. */
#include "cell_axes.h"

#include "../box/wrap.h"

#define MOST_CELLS 0x1p30 /* in a period: their numbers and images are int32 and int64 */

/* Wrapped points are so many rows away at most, where they are far along open axes. */
#define ROWS_AWAY 16

bool
hs_moves_column(const hs_lattice *lattice, int c)
{
    bool moves = false;
    for (int l = 0; l < lattice->n_periodic; l++) {
        moves = moves || lattice->given[l][c] != 0.0;
    }
    return moves;
}

/*
 * By how much the images of a ball may miss whole periods along axis k: a row of B that should not
 * move along it does so by normal . row, as rounded, and by the roundings of these; the row that
 * should moves by its height as rounded. So often as a query can meet the row: R and what
 * coordinates are wrong by, in heights. Points that are ROWS_AWAY are rounded besides.
 */
static double
leak_of(const hs_lattice *lattice, int k, double max_radius, const hs_axes *so_far)
{
    double leak = 0.0;
    for (int j = 0; j < lattice->ndim; j++) {
        const int r = lattice->row_of_axis[j];
        double    along = 0.0, size = 0.0;
        if (r < 0) {
            continue;
        }
        for (int c = 0; c < lattice->ndim; c++) {
            along += lattice->normal[k][c] * lattice->rows[r][c];
            size += fabs(lattice->rows[r][c]);
        }
        const double miss =
            (j == k ? 0.0 : fabs(along)) + 0x1p-44 * size + lattice->ndim * lattice->row_error[r];
        leak += ((max_radius + so_far->axis[j].leak) / lattice->period[j] + ROWS_AWAY) * miss;
        leak += hs_axis_rounding(lattice->ndim) * ROWS_AWAY *
                hs_axis_terms(lattice, lattice->rows[r], k);
    }
    return leak;
}

/* Leaks twice: those along one axis lead to more images along others. */
static void
set_leaks(hs_axes *axes, const hs_lattice *lattice, double max_radius)
{
    for (int pass = 0; pass < 2 && !lattice->aligned; pass++) {
        const hs_axes so_far = *axes;
        for (int k = 0; k < lattice->ndim; k++) {
            axes->axis[k].leak = leak_of(lattice, k, max_radius, &so_far);
        }
    }
    for (int k = 0; k < lattice->ndim; k++) {
        hs_axis *axis = &axes->axis[k];
        axis->farthest = axis->row >= 0 ? HS_WRAP_LIMIT * axis->period : INFINITY;
        for (int r = 0; r < lattice->n_periodic; r++) {
            axis->farthest += hs_axis_terms(lattice, lattice->rows[r], k);
        }
    }
}

void
hs_axes_init(hs_axes *axes, const hs_lattice *lattice, double cell_size, bool one_cell,
             double max_radius)
{
    axes->ndim = lattice->ndim;
    axes->aligned = lattice->aligned;
    for (int k = 0; k < lattice->ndim; k++) {
        hs_axis *axis = &axes->axis[k];
        *axis = (hs_axis){.row = lattice->row_of_axis[k]};
        if (axis->row >= 0) {
            const double fitting = one_cell ? 1.0 : floor(lattice->period[k] / cell_size);
            axis->period = lattice->period[k];
            axis->half = 0.5 * axis->period;
            axis->n = (int64_t)hs_larger(hs_smaller(fitting, MOST_CELLS), 1.0);
        }
        if (axis->n == 1 || (axis->n == 0 && one_cell)) {
            axis->width = axis->n == 1 ? axis->period : INFINITY;
            axis->inverse = 0.0;
        } else {
            axis->width = axis->n > 0 ? axis->period / (double)axis->n : cell_size;
            axis->inverse = 1.0 / axis->width;
        }
        const double farthest = one_cell ? 0.0 : HS_FARTHEST_CELL;
        axis->lowest = axis->n > 0 ? 0.0 : -farthest;
        axis->highest = axis->n > 0 ? (double)(axis->n - 1) : farthest;
    }
    set_leaks(axes, lattice, max_radius);
}

/* The number of periods times their length; beyond one it may be rounded, by less than `*slack`. */
static double
shift_of(const hs_axis *axis, int64_t image, double *slack)
{
    const double shift = (double)image * axis->period;
    *slack = image < -1 || image > 1 ? 0x1p-50 * fabs(shift) : 0.0;
    return shift;
}

void
hs_axis_images(const hs_axis *axis, double low, double high, double error, hs_span_of_cells *span)
{
    /* Image m has points from m L - L/2 to m L + L/2, wider by the error; the quotients are rounded
     * by less than the 2^-40 that is added: one image too many is no fault. */
    const double least = floor((low - error) / axis->period + 0.5 - 0x1p-40);
    const double most = floor((high + error) / axis->period + 0.5 + 0x1p-40);
    double       slack;
    HS_ASSERT(least > -0x1p30 && most < 0x1p30); /* new_list.c, place_point.h */
    span->least = (int64_t)least - (fabs(least) > 0x1p8);
    span->most = (int64_t)most + (fabs(most) > 0x1p8);
    const double first = hs_below(low, shift_of(axis, span->least, &slack));
    span->first = span->least * axis->n + hs_axis_cell(axis, first - slack);
    const double last = hs_above(high, -shift_of(axis, span->most, &slack));
    span->last = span->most * axis->n + hs_axis_cell(axis, last + slack);
}
