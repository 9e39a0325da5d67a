/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * grid.c: how far apart the coordinates of a pair can be, then one cell or several, whichever makes
 * a search cheaper; grid_counts.c says how many.
 *
 * Why no pair is lost: rounding is monotone, so cell indices are a monotone function of t; `range`
 * bounds how far apart the computed coordinates of a pair can be, every rounding and the whole
 * effect of inexact normals included; and `reach` is that range in cells, rounded up.
 */
#include "grid.h"

#include <math.h>
#include <string.h>

#define UNIT                0x1p-53
#define SLACK               HS_GRID_SLACK
#define MOST_CELLS_PER_AXIS HS_GRID_CELLS_PER_AXIS
/* Cost of sorting a point into its cell, in candidates. */
#define SORTING_COST 40.0

/* Sets the largest number of images per row of B that a pair can be apart; drift: of
 * measure_drift. */
static void
bound_images(const hs_scene *scene, const double *drift, double *images)
{
    const hs_lattice *lattice = &scene->lattice;
    for (int k = 0; k < scene->ndim; k++) {
        const int r = lattice->row_of_axis[k];
        if (r >= 0) {
            const double along = hs_scene_radius_along(scene, k) * (1.0 + SLACK);
            images[r] =
                ceil((along + drift[k] + 2.0 * scene->t_error[k]) / lattice->period[k]) + 2.0;
        }
    }
}

/*
 * How far adding one row of B can move t_k beyond whole periods, because normals are rounded:
 * measured, not assumed.
 */
static void
measure_drift(const hs_scene *scene, double drift_of_row[][HS_MAX_DIM])
{
    const hs_lattice *lattice = &scene->lattice;
    for (int k = 0; k < scene->ndim; k++) {
        for (int r = 0; r < lattice->n_periodic; r++) {
            double along = 0.0, rounding = 0.0;
            for (int c = 0; c < scene->ndim; c++) {
                const double term = lattice->normal[k][c] * lattice->rows[r][c];
                along += term;
                rounding += (scene->ndim + 2) * UNIT * fabs(term) +
                            fabs(lattice->normal[k][c]) * lattice->row_error[r];
            }
            if (lattice->row_of_axis[k] == r) {
                along -= lattice->period[k];
                rounding += UNIT * lattice->period[k];
            }
            drift_of_row[k][r] = fabs(along) + rounding * (1.0 + SLACK);
        }
    }
}

/* Bounds the drift, which is 0 so far, over as many images as a pair can be apart, a number that
 * depends on the drift. */
static void
bound_drift(const hs_scene *scene, double *images, double *drift)
{
    double drift_of_row[HS_MAX_DIM][HS_MAX_DIM];
    bound_images(scene, drift, images);
    if (scene->lattice.aligned) {
        return;
    }
    measure_drift(scene, drift_of_row);
    for (int pass = 0;; pass++) {
        for (int k = 0; k < scene->ndim; k++) {
            drift[k] = 0.0;
            for (int r = 0; r < scene->lattice.n_periodic; r++) {
                drift[k] += images[r] * drift_of_row[k][r];
            }
        }
        if (pass == 2) {
            return;
        }
        bound_images(scene, drift, images);
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
            error = hs_larger((2 * lattice->n_periodic + 3) * UNIT *
                                      (moved + 2.0 * scene->x_largest[c]) +
                                  row_errors,
                              error);
        }
    }
    return error;
}

double
hs_ball_volume(int ndim, double radius)
{
    double volume = ndim % 2 == 0 ? 1.0 : 2.0 * radius;
    for (int k = 2 + ndim % 2; k <= ndim; k += 2) {
        volume *= 6.283185307179586 / k * radius * radius;
    }
    return volume;
}

hs_status
hs_grid_set_axis(const hs_scene *scene, int k, double count, hs_grid *grid)
{
    const double extent = scene->upper[k] - scene->lower[k];
    const bool   open = scene->lattice.row_of_axis[k] < 0;
    grid->shape[k] = (int64_t)count;
    grid->by_faces[k] = false;
    grid->lower[k] = scene->lower[k];
    grid->cell_size[k] = extent / count;
    /* One cell needs no scale; that of a subnormal extent would be infinite. */
    grid->cells_per_length[k] = count > 1.0 || !open ? count / extent : 0.0;
    const double cells =
        grid->range[k] * grid->cells_per_length[k] * (1.0 + SLACK) + 0x1p-50 * count;
    if (open && !(cells < count - 1.0)) {
        grid->reach[k] = grid->shape[k] - 1;
    } else if (cells < MOST_CELLS_PER_AXIS - 2.0) { /* windows of cells are int32 */
        grid->reach[k] = (int64_t)cells + 1;
    } else {
        return HS_ERR_MEMORY;
    }
    return HS_OK;
}

hs_status
hs_grid_set_shape(const hs_scene *scene, const double *counts, hs_grid *grid)
{
    grid->n_cells = 1;
    for (int k = 0; k < scene->ndim; k++) {
        if (hs_grid_set_axis(scene, k, counts[k], grid) != HS_OK) {
            return HS_ERR_MEMORY;
        }
        grid->stride[k] = grid->n_cells;
        grid->n_cells *= grid->shape[k];
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
            cells = hs_smaller(cells, (double)grid->shape[k]);
        }
        candidates *= cells / (double)grid->shape[k];
        rows *= k > 0 ? cells : 1.0;
    }
    const double group = hs_smaller(hs_larger((double)scene->n / (double)grid->n_cells, 1.0), 64.0);
    return candidates + 8.0 * (rows + 1.0) / group + (grid->n_cells > 1 ? SORTING_COST : 0.0);
}

/* Chooses one cell, or a grid of cells where that is cheaper, unless the kind says which. */
static hs_status
choose_shape(const hs_scene *scene, hs_grid_kind kind, double density, double neighbours,
             hs_grid *grid)
{
    double counts[HS_MAX_DIM], parts[HS_MAX_DIM];
    double single_cost = INFINITY;
    for (int k = 0; k < scene->ndim; k++) {
        counts[k] = 1.0;
    }
    if (hs_grid_set_shape(scene, counts, grid) == HS_OK) {
        single_cost = cost_per_point(scene, grid);
    }
    if (kind == HS_GRID_SINGLE) {
        return single_cost < INFINITY ? HS_OK : hs_skew_or_memory(&scene->lattice);
    }
    if (kind == HS_GRID_ANY && single_cost <= SORTING_COST) { /* no grid costs less */
        return HS_OK;
    }
    const hs_grid single = *grid;
    /* Narrower rows cost more rows to visit, and leave out candidates that else are gathered first
     * (form.h). */
    const int finer = neighbours < 600.0 ? 1 : neighbours < 3000.0 ? 2 : 3;
    hs_grid_choose_counts(scene, grid, finer, density, counts, parts);
    const bool capped = hs_grid_fit_counts(scene, grid, counts);
    hs_status  status = hs_grid_set_shape(scene, counts, grid);
    if (status == HS_OK && scene->lattice.aligned && !capped && !scene->is_asked) {
        hs_grid_cut_by_faces(scene, parts, hs_grid_most_cells(scene), grid);
    }
    /* Axes with several cells reach a few of them, the others as far as in the single one. */
    HS_ASSERT(status == HS_OK || single_cost == INFINITY);
    if (status == HS_OK && kind == HS_GRID_ANY && single_cost <= cost_per_point(scene, grid)) {
        *grid = single;
    }
    return status == HS_OK ? HS_OK : hs_skew_or_memory(&scene->lattice);
}

/*
 * Whether rounding moves points across half a period and more than the cutoff: a box vector is so
 * long that along the short ones every point would meet many images of every other. drift: how far
 * images can move t_k beyond whole periods.
 */
static bool
is_blurred(const hs_scene *scene, const double *drift)
{
    for (int k = 0; k < scene->ndim; k++) {
        const double blur = drift[k] + 2.0 * scene->t_error[k];
        if (scene->lattice.row_of_axis[k] >= 0 && blur > scene->radius &&
            !(blur <= 0.5 * scene->lattice.period[k])) {
            return true;
        }
    }
    return false;
}

/* Sets how far apart the computed coordinates of a pair can be. HS_ERR_MEMORY when they pass more
 * images than can be counted, HS_ERR_BOX_SKEWED when it is rounding that does. */
static hs_status
set_ranges(const hs_scene *scene, hs_grid *grid)
{
    double images[HS_MAX_DIM], drift[HS_MAX_DIM] = {0.0};
    if (scene->lattice.n_periodic > 0) {
        bound_drift(scene, images, drift);
    }
    if (is_blurred(scene, drift)) {
        return HS_ERR_BOX_SKEWED;
    }
    for (int k = 0; k < scene->ndim; k++) {
        const int    r = scene->lattice.row_of_axis[k];
        const double along = hs_scene_radius_along(scene, k);
        grid->range[k] = (along + drift[k] + 2.0 * scene->t_error[k]) * (1.0 + SLACK);
        if (r >= 0 && !(grid->range[k] / scene->lattice.period[k] + 1.0 <= images[r])) {
            return hs_skew_or_memory(&scene->lattice);
        }
    }
    grid->shift_error = bound_shift_error(scene, images);
    return HS_OK;
}

/* Fills the failure where there would be more pairs than any memory holds. */
static void
tell_endless(hs_failure *failure)
{
    failure->expected_pairs = failure->expected_bytes = INFINITY;
}

hs_status
hs_grid_begin(const hs_scene *scene, double *density, hs_grid *grid, hs_failure *failure)
{
    /* Volume of the periodic axes, times the open extents. */
    double volume = hs_lattice_volume(&scene->lattice, 0);
    *grid = (hs_grid){.ndim = scene->ndim};
    hs_status status = set_ranges(scene, grid);
    for (int k = 0; status == HS_OK && k < scene->ndim; k++) {
        volume *= scene->lattice.row_of_axis[k] >= 0
                      ? 1.0
                      : hs_larger(scene->upper[k] - scene->lower[k], grid->range[k]);
    }
    *density = (double)scene->n / volume;
    grid->expected_pairs = 0.5 * (double)scene->n * *density *
                           hs_scene_volume(scene, hs_ball_volume(scene->ndim, scene->cutoff));
    if (!(volume > 0.0)) { /* points on one spot, cutoff 0 */
        grid->expected_pairs = 0.5 * (double)scene->n * (double)(scene->n - 1);
    }
    if (status == HS_ERR_MEMORY) {
        tell_endless(failure);
    }
    return status;
}

hs_status
hs_grid_init(const hs_scene *scene, hs_grid *grid, hs_failure *failure)
{
    return hs_grid_init_kind(scene, HS_GRID_ANY, grid, failure);
}

hs_status
hs_grid_init_kind(const hs_scene *scene, hs_grid_kind kind, hs_grid *grid, hs_failure *failure)
{
    double    density;
    hs_status status = hs_grid_begin(scene, &density, grid, failure);
    if (status == HS_OK) {
        const double neighbours =
            density * hs_scene_volume(scene, hs_ball_volume(scene->ndim, scene->cutoff));
        status = choose_shape(scene, kind, density, neighbours, grid);
        if (status == HS_ERR_MEMORY) {
            tell_endless(failure);
        }
    }
    return status;
}

hs_status
hs_grid_narrow(const hs_scene *scene, bool is_sparse, double cutoff_before, hs_grid *grid)
{
    HS_ASSERT(cutoff_before > 0.0 && cutoff_before >= scene->cutoff);
    const double    ratio = scene->cutoff / cutoff_before;
    const hs_status status = set_ranges(scene, grid);
    for (int k = 0; status == HS_OK && k < scene->ndim; k++) {
        HS_ASSERT(!grid->by_faces[k]);
        const double cells = grid->range[k] * grid->cells_per_length[k] * (1.0 + SLACK) +
                             0x1p-50 * (double)grid->shape[k];
        if (!is_sparse && cells < (double)grid->reach[k]) {
            grid->reach[k] = (int64_t)cells + 1;
        }
        grid->expected_pairs *= ratio;
    }
    return status;
}
