/* SPDX-License-Identifier: BSD-3-Clause */
/* grid_width.c: cells of a width that the caller chooses. Any cells find all pairs, for their reach
 * follows from their width (grid.c): only layout and speed are the caller's. */
#include "stencil.h"

#include "../base/outcome.h"

#include <math.h>

/* Rows around a cell, the forward half of them, at most: each takes room, and a look for each group
 * of points. In eight dimensions the nearest ones alone are half of 3^7 = 2187. */
#define MOST_ROWS 2048.0

/* Where the range is a whole number of cells it would reach one cell further, for it is a little
 * more than the cutoff: such cells are as much wider. */
static double
wide_enough(double range, double width)
{
    const double parts = fmax(nearbyint(range / width), 1.0);
    const double part = range * (1.0 + 0x1p-20) / parts;
    return part > width && part <= width * (1.0 + 0x1p-18) ? part : width;
}

/* Returns whether any axis had more than one. */
static bool
halve_counts(int ndim, double *counts)
{
    bool any = false;
    for (int k = 0; k < ndim; k++) {
        any = any || counts[k] > 1.0;
        counts[k] = fmax(floor(0.5 * counts[k]), 1.0);
    }
    return any;
}

hs_status
hs_grid_init_wide(const hs_scene *scene, double width, hs_grid *grid, bool *is_wider,
                  hs_failure *failure)
{
    double          counts[HS_MAX_DIM], density;
    const hs_status status = hs_grid_begin(scene, &density, grid, failure);
    if (status != HS_OK) {
        return status;
    }
    for (int k = 0; k < scene->ndim; k++) {
        const double extent = scene->upper[k] - scene->lower[k];
        const double pitch = wide_enough(grid->range[k], width);
        /* Not for a zero extent, also with a width that scaling brought to zero. */
        counts[k] = extent > pitch ? floor(fmin(extent / pitch, HS_GRID_CELLS_PER_AXIS)) : 1.0;
    }
    *is_wider = hs_grid_cap_counts(scene, counts);
    while (hs_grid_set_shape(scene, counts, grid) != HS_OK || hs_stencil_bound(grid) > MOST_ROWS) {
        *is_wider = true;
        if (!halve_counts(scene->ndim, counts)) {
            return HS_TOO_MUCH;
        }
    }
    return HS_OK;
}
