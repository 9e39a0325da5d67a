/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * grid.c: see grid.h.
 *
 * Why no pair is lost: rounding is monotone, so cell indices are a monotone function of t; `range`
 * bounds how far apart the computed coordinates of a pair can be, every rounding and the whole
 * effect of inexact normals included; and `reach` is that range in cells, rounded up.
 */
#include "grid.h"

#include <math.h>

#define UNIT 0x1p-53
/* Relative room for the few roundings between a bound and its use. */
#define SLACK 0x1p-40
/* Cells per axis that int32 windows and doubles tell apart, and in all: cell ids are uint32. */
#define MOST_CELLS_PER_AXIS 0x1p31
#define MOST_CELLS 4294967295.0
/* Points that a cell along the first axis should hold: enough to pay for gathering its
 * neighbourhood, few enough that the neighbourhood is not much larger than the cutoff. */
#define POINTS_PER_CELL 12.0

static double
largest_entry(const double *row, int ndim)
{
    double largest = 0.0;
    for (int k = 0; k < ndim; k++) {
        largest = fmax(largest, fabs(row[k]));
    }
    return largest;
}

/* Largest number of images per row of B that a pair can be apart; `drift` as below. */
static void
bound_images(const hs_scene *scene, const double *drift, double *images)
{
    const hs_lattice *lattice = &scene->lattice;
    for (int k = 0; k < scene->ndim; k++) {
        const int r = lattice->row_of_axis[k];
        if (r >= 0) {
            images[r] = ceil((scene->radius * (1.0 + SLACK) + drift[k] + 2.0 * scene->t_error[k]) /
                             lattice->period[k]) + 2.0;
        }
    }
}

/*
 * How far adding lattice vectors can move t_k beyond whole periods, because normals are rounded:
 * measured, not assumed. Zero in aligned boxes.
 */
static void
bound_drift(const hs_scene *scene, const double *images, double *drift)
{
    const hs_lattice *lattice = &scene->lattice;
    for (int k = 0; k < scene->ndim; k++) {
        drift[k] = 0.0;
        for (int r = 0; r < lattice->n_periodic && !lattice->aligned; r++) {
            double along = 0.0;
            for (int c = 0; c < scene->ndim; c++) {
                along += lattice->normal[k][c] * lattice->rows[r][c];
            }
            if (lattice->row_of_axis[k] == r) {
                along -= lattice->period[k];
            }
            const double rounding = (scene->ndim + 2) * scene->ndim * UNIT *
                                        largest_entry(lattice->rows[r], scene->ndim) +
                                    scene->ndim * lattice->row_error[r];
            drift[k] += images[r] * (fabs(along) + rounding);
        }
    }
}

/* T = shift * B - centre is rounded; open coordinates subtract exactly enough without it. */
static double
bound_shift_error(const hs_scene *scene, const double *images)
{
    const hs_lattice *lattice = &scene->lattice;
    double            error = 0.0;
    for (int c = 0; c < scene->ndim; c++) {
        double moved = 0.0, row_errors = 0.0;
        for (int r = 0; r < lattice->n_periodic; r++) {
            moved += images[r] * fabs(lattice->rows[r][c]);
            row_errors += images[r] * lattice->row_error[r];
        }
        if (moved > 0.0) {
            error = fmax(error, (2 * lattice->n_periodic + 3) * UNIT *
                                        (moved + 2.0 * scene->x_largest[c]) + row_errors);
        }
    }
    return error;
}

/* Volume of the unit ball in ndim dimensions. */
static double
unit_ball(int ndim)
{
    double volume = ndim % 2 == 0 ? 1.0 : 2.0;
    for (int k = 2 + ndim % 2; k <= ndim; k += 2) {
        volume *= 6.283185307179586 / k;
    }
    return volume;
}

/* Cells along each axis for a pitch of radius / finer, and for about POINTS_PER_CELL along the
 * first. */
static void
choose_counts(const hs_scene *scene, const hs_grid *grid, int finer, double density,
              double *counts)
{
    double area = 1.0; /* of one row's cross-section */
    for (int k = scene->ndim - 1; k >= 0; k--) {
        const double extent = scene->upper[k] - scene->lower[k];
        double       pitch = grid->range[k] * (1.0 + 0x1p-20) / finer;
        if (k == 0 && scene->ndim > 1) {
            const double wanted = POINTS_PER_CELL / (density * area);
            pitch = fmin(fmax(wanted, 0.25 * grid->range[0]), 4.0 * grid->range[0]);
        }
        counts[k] = 1.0;
        if (extent > pitch) { /* never for a zero extent, also with cutoff 0 */
            counts[k] = floor(fmin(extent / pitch, MOST_CELLS_PER_AXIS));
        }
        area *= fmax(extent, grid->range[k]) / counts[k]; /* flat scenes count as this thick */
    }
}

/* Fewer cells, evenly over the axes, until their number is in proportion to the points. */
static void
cap_counts(int ndim, double cap, double *counts)
{
    for (;;) {
        double product = 1.0;
        int    divided = 0;
        for (int k = 0; k < ndim; k++) {
            product *= counts[k];
            divided += counts[k] > 1.0;
        }
        if (product <= cap) {
            return;
        }
        const double factor = pow(cap / product, 1.0 / divided);
        for (int k = 0; k < ndim; k++) {
            /* Always at least one less, so that this ends. */
            counts[k] = fmax(1.0, floor(fmin(counts[k] * factor, counts[k] - 1.0)));
        }
    }
}

static hs_status
set_shape(const hs_scene *scene, const double *counts, hs_grid *grid)
{
    grid->n_cells = 1;
    for (int k = 0; k < scene->ndim; k++) {
        const double extent = scene->upper[k] - scene->lower[k];
        const bool   open = scene->lattice.row_of_axis[k] < 0;
        grid->shape[k] = (int64_t)counts[k];
        grid->stride[k] = grid->n_cells;
        grid->n_cells *= grid->shape[k];
        grid->lower[k] = scene->lower[k];
        grid->cell_size[k] = extent / counts[k];
        /* One cell needs no place in it, and a subnormal extent no infinite scale. */
        grid->cells_per_length[k] = counts[k] > 1.0 || !open ? counts[k] / extent : 0.0;
        const double cells = grid->range[k] * grid->cells_per_length[k] * (1.0 + SLACK) +
                             0x1p-50 * counts[k];
        if (open && !(cells < counts[k] - 1.0)) {
            grid->reach[k] = grid->shape[k] - 1;
        } else if (cells < MOST_CELLS_PER_AXIS - 2.0) { /* windows of cells are int32 */
            grid->reach[k] = (int64_t)cells + 1;
        } else {
            return HS_ERR_MEMORY;
        }
    }
    return HS_OK;
}

/*
 * Estimated cost of a search, in candidates per point: tested pairs, plus what a neighbourhood
 * costs to visit, plus sorting unless there is one cell.
 */
static double
cost_per_point(const hs_scene *scene, const hs_grid *grid)
{
    double candidates = 0.5 * (double)scene->n;
    double rows = 0.5;
    for (int k = 0; k < scene->ndim; k++) {
        double cells = 2.0 * (double)grid->reach[k] + 1.0;
        if (scene->lattice.row_of_axis[k] < 0) {
            cells = fmin(cells, (double)grid->shape[k]);
        }
        candidates *= cells / (double)grid->shape[k];
        rows *= k > 0 ? cells : 1.0;
    }
    const double group = fmin(fmax((double)scene->n / (double)grid->n_cells, 1.0), 64.0);
    return candidates + 8.0 * (rows + 1.0) / group + (grid->n_cells > 1 ? 40.0 : 0.0);
}

hs_status
hs_grid_init(const hs_scene *scene, hs_grid *grid, hs_failure *failure)
{
    double images[HS_MAX_DIM] = {0}, drift[HS_MAX_DIM] = {0}, counts[HS_MAX_DIM];
    /* Of the periodic part, times the open extents. */
    double volume = hs_lattice_volume(&scene->lattice, 0);
    *grid = (hs_grid){.ndim = scene->ndim};
    for (int pass = 0; pass < 3; pass++) {
        bound_images(scene, drift, images);
        bound_drift(scene, images, drift);
    }
    for (int k = 0; k < scene->ndim; k++) {
        const int r = scene->lattice.row_of_axis[k];
        grid->range[k] = (scene->radius + drift[k] + 2.0 * scene->t_error[k]) * (1.0 + SLACK);
        if (r >= 0 && !(grid->range[k] / scene->lattice.period[k] + 1.0 <= images[r])) {
            failure->expected_pairs = failure->expected_bytes = INFINITY;
            return HS_ERR_MEMORY;
        }
        volume *= r >= 0 ? 1.0 : fmax(scene->upper[k] - scene->lower[k], grid->range[k]);
    }
    grid->shift_error = bound_shift_error(scene, images);

    const double density = (double)scene->n / volume;
    const double ball = unit_ball(scene->ndim) * pow(scene->cutoff, scene->ndim);
    grid->expected_pairs = 0.5 * (double)scene->n * density * ball;
    if (!(volume > 0.0)) { /* points on one spot, cutoff 0 */
        grid->expected_pairs = 0.5 * (double)scene->n * (double)(scene->n - 1);
    }
    const double neighbours = density * ball;
    /* Narrower rows test fewer pairs that are too far apart, and cost more rows to visit. */
    const int finer = neighbours < 150.0 ? 1 : neighbours < 700.0 ? 2 : 3;
    choose_counts(scene, grid, finer, density, counts);
    cap_counts(scene->ndim, fmin(2.0 * (double)scene->n + HS_GRID_SPARE_CELLS, MOST_CELLS), counts);
    hs_status    status = set_shape(scene, counts, grid);
    const double cost = status == HS_OK ? cost_per_point(scene, grid) : INFINITY;

    hs_grid single = *grid;
    for (int k = 0; k < scene->ndim; k++) {
        counts[k] = 1.0;
    }
    if (set_shape(scene, counts, &single) == HS_OK &&
        (status != HS_OK || cost_per_point(scene, &single) <= cost)) {
        *grid = single;
        status = HS_OK;
    }
    if (status != HS_OK) {
        failure->expected_pairs = failure->expected_bytes = INFINITY;
    }
    return status;
}
