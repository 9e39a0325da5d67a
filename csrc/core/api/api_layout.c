/* SPDX-License-Identifier: BSD-3-Clause */
/* api_layout.c: the public functions that tell which cells there are, and which of them a point is
 * in. */
#include "arguments.h"
#include "api_cells.h"
#include "../cells/sparse_grid.h"

#include <math.h>
#include <string.h>

void
hs_cells_layout(const hs_cells *cells, hs_layout *layout)
{
    if (layout == NULL) {
        return;
    }
    if (cells == NULL) {
        *layout = (hs_layout){.ndim = 0};
        return;
    }
    const hs_search *search = &cells->search;
    const hs_grid   *grid = &search->grid;
    *layout = (hs_layout){.ndim = grid->ndim,
                          .n_points = search->bins.n,
                          .n_cells = grid->n_cells,
                          .occupied_only = search->is_sparse,
                          .start = search->bins.start,
                          .order = search->bins.order};
    const hs_fpenv saved = hs_fpenv_enter();
    for (int k = 0; k < grid->ndim; k++) {
        layout->shape[k] = grid->shape[k];
        layout->cell_size[k] = search->scene.in_one_cell
                                   ? INFINITY
                                   : hs_scale_apply(search->scene.unscale, grid->cell_size[k]);
    }
    hs_fpenv_leave(saved);
}

/* Index along axis k of a point with coordinate t. */
static int64_t
index_along(const hs_search *search, int k, double t)
{
    return search->is_sparse ? hs_sparse_index(&search->grid, k, t)
                             : hs_grid_index(&search->grid, k, t);
}

/* The occupied cell with these indices, or -1. */
static int64_t
find_occupied(const hs_sparse *sparse, const int64_t *index, int64_t *hint)
{
    const int64_t    row = hs_sparse_find_row(sparse, index, hint);
    hs_sparse_cursor cursor = {0, 0};
    int32_t          first, end;
    if (row < 0) {
        return -1;
    }
    cursor.low = cursor.high = sparse->row_cell[row];
    hs_sparse_window(sparse, row, index[0], index[0], &cursor, &first, &end);
    return end > first ? cursor.low : -1;
}

static int64_t
cell_of_point(const hs_search *search, const hs_scene *scene, int64_t i, int64_t *hint)
{
    int64_t index[HS_MAX_DIM], cell = 0;
    for (int k = 0; k < scene->ndim; k++) {
        index[k] = index_along(search, k, hs_scene_coordinate(scene, i, k));
        cell += index[k] * search->grid.stride[k];
    }
    return search->is_sparse ? find_occupied(&search->sparse, index, hint) : cell;
}

hs_status
hs_cells_find(const hs_cells *cells, const hs_points *points, int64_t *cell, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    hs_call          call;
    hs_scene         scene;
    if (cells == NULL || points == NULL || !hs_has_entries(cell, points)) {
        return hs_end_early(HS_ERR_ARGUMENT, NULL, failure);
    }
    failure = hs_call_enter(&options, failure, &call);
    hs_status status = hs_check_arguments(&cells->points, points, NULL, &options, failure);
    if (status == HS_OK) {
        status = hs_scene_wrapped_like(&call.account, &cells->search.scene, points, &options,
                                       &scene, failure);
    }
    if (status == HS_OK) {
        int64_t hint = 0;
        for (int64_t i = 0; i < points->n; i++) {
            cell[i] = cell_of_point(&cells->search, &scene, i, &hint);
        }
        hs_scene_free(&call.account, &scene);
    }
    hs_call_leave(&call, 0);
    hs_account_close(&call.account);
    return status;
}

void
hs_cells_indices(const hs_cells *cells, int64_t *indices)
{
    if (cells == NULL || indices == NULL) {
        return;
    }
    const hs_search *search = &cells->search;
    const hs_sparse *sparse = &search->sparse;
    const int        d = search->grid.ndim;
    if (search->is_sparse) {
        for (int64_t row = 0; row < sparse->n_rows; row++) {
            for (int64_t c = sparse->row_cell[row]; c < sparse->row_cell[row + 1]; c++) {
                indices[c * d] = sparse->cell_x[c];
                memcpy(indices + c * d + 1, sparse->row_index + row * (d - 1),
                       (size_t)(d - 1) * sizeof *indices);
            }
        }
        return;
    }
    for (int64_t c = 0; c < search->grid.n_cells; c++) {
        for (int k = 0; k < d; k++) {
            indices[c * d + k] = c / search->grid.stride[k] % search->grid.shape[k];
        }
    }
}
