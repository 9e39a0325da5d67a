/* SPDX-License-Identifier: BSD-3-Clause */
/* grid_counts.c: how many cells there are along each axis, unless the caller sets their width
 * (grid_width.c). Any cells find all pairs: what is chosen here is speed alone. */
#include "grid.h"

#include <math.h>

/* Cells of a grid: their ids are uint32. */
#define MOST_CELLS 4294967295.0
/* Points that a cell along the first axis should hold, if that makes it a quarter of the range or
 * more; walks put cells together where these are fewer. */
#define POINTS_PER_CELL 12.0
/* Where cells are wider than need be, rows of few cells hold so many points at least: there is
 * nothing to put together along them. */
#define FEW_CELLS      4.0
#define POINTS_PER_ROW 8.0
/* Where many cells are wider than need be: how many times shorter they are made along the first
 * axis at most, and along how many rows they then lie at least, on each other axis. Clusters of
 * 300 points gain a quarter with 4 to 30; uniform scenes lose with more than 16. */
#define SHORTER     16.0
#define ROWS_ACROSS 10.0

/* The least width of cells along axis k of which `parts` shall reach as far as the range. */
static double
pitch_of(const hs_grid *grid, int k, double parts)
{
    return grid->range[k] * (1.0 + 0x1p-20) / parts;
}

void
hs_grid_choose_counts(const hs_scene *scene, const hs_grid *grid, int finer, double density,
                      double *counts, double *parts)
{
    double area = 1.0; /* of one row's cross-section */
    for (int k = scene->ndim - 1; k >= 0; k--) {
        const double extent = scene->upper[k] - scene->lower[k];
        parts[k] = finer;
        if (k == 0 && scene->ndim > 1) {
            /* A whole fraction of the range: otherwise windows are longer than need be. */
            const double points = density * area * grid->range[0];
            parts[k] = fmin(fmax(nearbyint(points / POINTS_PER_CELL), 1.0), 4.0);
        }
        const double pitch = pitch_of(grid, k, parts[k]);
        counts[k] = 1.0;
        if (extent > pitch) { /* never for a zero extent, also with cutoff 0 */
            counts[k] = floor(fmin(extent / pitch, HS_GRID_CELLS_PER_AXIS));
        }
        area *= fmax(extent, grid->range[k]) / counts[k]; /* flat scenes count as this thick */
    }
}

double
hs_grid_most_cells(const hs_scene *scene)
{
    return fmin(2.0 * (double)scene->n + HS_GRID_SPARE_CELLS, MOST_CELLS);
}

/* Fewer cells, evenly over the axes, until there are no more than `cap`. Returns whether it had
 * to. */
static bool
cap_counts(int ndim, double cap, double *counts)
{
    for (bool capped = false;;) {
        double product = 1.0;
        int    divided = 0;
        for (int k = 0; k < ndim; k++) {
            product *= counts[k];
            divided += counts[k] > 1.0;
        }
        if (product <= cap) {
            return capped;
        }
        capped = true;
        const double factor = pow(cap / product, 1.0 / divided);
        for (int k = 0; k < ndim; k++) {
            /* Always at least one less, so that this ends. */
            counts[k] = fmax(1.0, floor(fmin(counts[k] * factor, counts[k] - 1.0)));
        }
    }
}

bool
hs_grid_cap_counts(const hs_scene *scene, double *counts)
{
    return cap_counts(scene->ndim, hs_grid_most_cells(scene), counts);
}

/*
 * For counts that were capped, so that cells are wider than the range: cells become shorter along
 * the first axis, where a walk passes over them one after the other, and wider along the others, in
 * about the same number. Points of a group are then closer together, and meet fewer candidates,
 * where points are in clusters. Not where an axis has hardly more than ROWS_ACROSS.
 */
static void
shorten_cells(const hs_scene *scene, const hs_grid *grid, double *counts)
{
    const double extent = scene->upper[0] - scene->lower[0]; /* not 0: there are several cells */
    const double most = fmin(SHORTER * counts[0], floor(extent / pitch_of(grid, 0, 1.0)));
    double       across = INFINITY, product = counts[0];
    int          n_others = 0;
    for (int k = 1; k < scene->ndim; k++) {
        across = counts[k] > 1.0 ? fmin(across, counts[k]) : across;
        product *= counts[k];
        n_others += counts[k] > 1.0;
    }
    /* Infinite with one axis, or with cutoff 0: then the other bound counts, or there is no
     * other. */
    const double times = fmin(most / counts[0], pow(across / ROWS_ACROSS, (double)n_others));
    if (n_others == 0 || !(times > 1.0)) {
        return;
    }
    for (int k = 1; k < scene->ndim; k++) {
        if (counts[k] > 1.0) {
            counts[k] = fmax(ROWS_ACROSS, floor(counts[k] * pow(times, -1.0 / n_others)));
            product /= counts[k];
        }
    }
    counts[0] = fmin(floor(product), most);
}

bool
hs_grid_fit_counts(const hs_scene *scene, const hs_grid *grid, double *counts)
{
    const bool capped = hs_grid_cap_counts(scene, counts);
    if (capped && counts[0] < FEW_CELLS) {
        const double rows = fmax((double)scene->n / POINTS_PER_ROW, 1.0);
        (void)cap_counts(scene->ndim, counts[0] * rows, counts);
    } else if (capped) {
        shorten_cells(scene, grid, counts);
    }
    return capped;
}
