/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sparse_grid.c: see sparse_grid.h.
 *
 * Why the reach holds at any distance. A place is (t - lower) c with c cells per length: two
 * roundings, so it is within 2^-52 of itself (and 2^-106), and it is a monotone function of t. The
 * cells follow each other without a gap and none is narrower than 1 (in places); so if two indices
 * are s >= 1 apart, s - 1 whole cells lie between the places. For two points within a range of each
 * other the places are at most range c + 2^-51 p apart, p being the larger one.
 *     p < 2^49: choose_pitch makes range c + 2^-51 p at most the reach r, so s - 1 < r.
 *     2^e <= p < 2^(e + 1), e >= 49: cells are w = 2^(e - 48) >= 2 wide and rounding moves places
 *     by at most 2^(e - 50) = w / 4, so range c >= w (s - 1) - w / 4 > s - 1 for s >= 2. Again
 *     s <= r.
 * Where p is just beyond 2^49, some of the cells between may be those before it, 1 wide; rounding
 * is 1/4 there as well, and the first case holds.
 *
 * Places are counted from the number in the points' range that is nearest to 0, which is where
 * float64 is finest: a cell wider than wanted holds at most 32 numbers to a side.
 */
#include "sparse_grid.h"

#include <math.h>

/* More than the 1e-5 cells by which stencil.c widens windows, so that these end at the reach. */
#define LEAST_MARGIN 0x1p-16
/* Of a place: 2^-51 for the roundings of two, times 4/3 for e <= 1/4 in 1 / (1 - e), rounded up. */
#define PLACE_ERROR 0x1p-50
/* No place passes 2^1000, also where the range is 0. */
#define SMALLEST_PITCH 0x1p-1000
/* Indices along periodic axes: their places need no other numbering. */
#define MOST_PER_PERIOD 0x1p31

/* Least width of cells along axis k, `width` ranges to a row. */
static double
choose_pitch(const hs_grid *grid, int k, double extent, double width)
{
    const double split = k == 0 ? HS_SPARSE_SPLIT / width : 1.0 / width;
    double       places = HS_SPARSE_LINEAR;
    if (split * extent < HS_SPARSE_LINEAR * grid->range[k]) {
        places = split * extent / grid->range[k];
    }
    const double margin = LEAST_MARGIN + PLACE_ERROR * places;
    const double floor_of_pitch = SMALLEST_PITCH * fmax(extent, 1.0);
    return fmax(grid->range[k] * (1.0 + margin) / split, floor_of_pitch);
}

static void
set_open_axis(const hs_scene *scene, int k, double pitch, int64_t reach, hs_grid *grid)
{
    const double  lower = scene->lower[k], upper = scene->upper[k];
    grid->lower[k] = lower > 0.0 ? lower : upper < 0.0 ? upper : 0.0;
    grid->cell_size[k] = pitch;
    grid->cells_per_length[k] = 1.0 / pitch;
    grid->skipped[k] = hs_sparse_number((lower - grid->lower[k]) * grid->cells_per_length[k]);
    grid->shape[k] = INT64_MAX;
    grid->shape[k] = hs_sparse_index(grid, k, upper) + 1;
    grid->reach[k] = reach < grid->shape[k] ? reach : grid->shape[k] - 1;
}

hs_status
hs_sparse_grid(const hs_scene *scene, const hs_grid *dense, double width, hs_grid *grid)
{
    *grid = *dense;
    grid->n_cells = 0;
    for (int k = 0; k < scene->ndim; k++) {
        const double extent = scene->upper[k] - scene->lower[k];
        const double pitch = choose_pitch(grid, k, extent, width);
        grid->stride[k] = 0;
        grid->skipped[k] = 0;
        if (scene->lattice.row_of_axis[k] >= 0) {
            const double count = floor(fmin(extent / pitch, MOST_PER_PERIOD));
            if (hs_grid_set_axis(scene, k, fmax(count, 1.0), grid) != HS_OK) {
                return HS_ERR_MEMORY;
            }
            continue;
        }
        const double reach = k == 0 ? fmax(1.0, HS_SPARSE_SPLIT / width) : 1.0;
        set_open_axis(scene, k, pitch, (int64_t)reach, grid);
    }
    return HS_OK;
}

