/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_CELLS_GRID_H
#define HS_CELLS_GRID_H

#include "../scene/scene.h"

/*
 * grid.h: cells. How many along each grid axis, which one a point is in, and how many cells away a
 * neighbour can be. The number of cells follows the number of points, never the volume.
 */

typedef struct hs_grid {
    int     ndim;
    int64_t n_cells;             /* product of shape, at most 2 n + HS_GRID_SPARE_CELLS */
    int64_t shape[HS_MAX_DIM];   /* cells along each axis, at least 1 */
    int64_t stride[HS_MAX_DIM];  /* cell id = sum of index * stride; the first axis is fastest */
    double  lower[HS_MAX_DIM];   /* t of the first face; of place 0 in a sparse grid */
    int64_t skipped[HS_MAX_DIM]; /* sparse grids: cells before the first that holds points */
    double  cell_size[HS_MAX_DIM];
    double  cells_per_length[HS_MAX_DIM];
    double  range[HS_MAX_DIM]; /* largest |difference of computed t_k| of a pair */
    int64_t reach[HS_MAX_DIM]; /* `range` in cells, counted on through images */
    double  shift_error;       /* bound on the error of a shifted coordinate minus a centre */
    double  expected_pairs;    /* if the points were spread evenly over the space they occupy */
} hs_grid;

#define HS_GRID_SPARE_CELLS 64

/* Volume of a ball in ndim dimensions. */
double hs_ball_volume(int ndim, double radius);

/* One cell, several, or whichever is quicker. */
typedef enum hs_grid_kind { HS_GRID_ANY, HS_GRID_SINGLE, HS_GRID_CELLS } hs_grid_kind;

/* The grid of that kind which is quickest. HS_ERR_MEMORY when a cutoff spans more than 2^31 images,
 * HS_ERR_BOX_SKEWED when rounding does. */
hs_status hs_grid_init(const hs_scene *scene, hs_grid_kind kind, hs_grid *grid,
                       hs_failure *failure);

/*
 * Cells that are at least `width` wide, whatever that costs; wider ones, with *is_wider set, where
 * there would be too many of them, or too many around each. HS_TRY_OTHER where no grid will do.
 */
hs_status hs_grid_init_wide(const hs_scene *scene, double width, hs_grid *grid, bool *is_wider,
                            hs_failure *failure);

/* `count` cells of equal width along axis k: sets all but the stride, from the scene's range there
 * and grid->range. HS_ERR_MEMORY when the reach passes its integers. */
hs_status hs_grid_set_axis(const hs_scene *scene, int k, double count, hs_grid *grid);

/* The cells of `grid` for a scene whose cutoff was `cutoff_before` and is smaller now.
 * HS_ERR_MEMORY, HS_ERR_BOX_SKEWED for the reasons of hs_grid_init. */
hs_status hs_grid_narrow(const hs_scene *scene, bool is_sparse, double cutoff_before,
                         hs_grid *grid);

/* Relative room for the few roundings between a bound and its use. */
#define HS_GRID_SLACK 0x1p-40

/* Cell index along axis k of a point with coordinate t; points beyond a face count as on it. */
HS_ALWAYS_INLINE int64_t
hs_grid_index(const hs_grid *grid, int k, double t)
{
    const double  place = (t - grid->lower[k]) * grid->cells_per_length[k];
    const int64_t last = grid->shape[k] - 1;
    /* Compared first: it may be beyond any integer. */
    return !(place < (double)last) ? last : place > 0.0 ? (int64_t)place : 0;
}

/*
 * The forward half of the neighbouring rows of cells. A row is a line of cells along the
 * first grid axis. With the offset of j's cell from i's counted over images, each pair of cells
 * occurs once as a forward offset and once as its opposite, so following the forward ones only
 * visits each pair of points once, in boxes of any size, without comparing indices.
 */

/* Neighbouring row; offset[k] for axes k >= 1 (offset[0] unused). Cells from x + first to x + last
 * of that row can hold neighbours of points in cell x. */
typedef struct hs_stencil_row {
    int32_t offset[HS_MAX_DIM];
    int32_t first, last;
} hs_stencil_row;

typedef struct hs_stencil {
    hs_stencil_row *rows; /* owned; rows[0] is the own row, with first = 0 unless full */
    int64_t         n_rows;
} hs_stencil;

/* Polls now and then. HS_ERR_MEMORY or HS_ERR_BOX_SKEWED when the rows do not fit; the rows are to
 * be freed then as well. is_full: the backward half as well, for points that meet all their
 * neighbours. */
hs_status hs_stencil_build(hs_account *account, const hs_options *options, const hs_scene *scene,
                           const hs_grid *grid, bool is_full, hs_stencil *stencil);

/* Bytes that the rows take at least, in boxes along the coordinate axes; elsewhere about so
 * many. */
double hs_stencil_bytes(const hs_grid *grid, bool is_full);

#endif
