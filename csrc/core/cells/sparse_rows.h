/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sparse_rows.h: the occupied cells of a sparse grid, in rows. A row is a line of cells along the
 * first axis; rows are sorted by their indices (the last axis slowest), the cells of a row by
 * theirs, so that cost and memory follow the points and nothing follows the volume. Nothing is
 * hashed: targets of neighbouring rows come in nearly ascending order, so that a hint finds them in
 * O(1), and no input makes a search slower than O(log n).
 *
 * How to walk (hs_sparse_grid, hs_stencil_build and hs_sparse_build first):
 *
 *     for each row
 *         for each row of the stencil, with a hint of its own that starts at 0
 *             target = index of the row + offset; along periodic axes wrapped into 0 ... shape - 1,
 *             which gives image and shift as in a dense grid
 *             hs_sparse_find_row(target, &hint); if there is one: a link, with a cursor of its own
 *         for each group of the row (hs_sparse_next_group)
 *             for each link
 *                 window of cells: group.x_first + link.first ... group.x_last + link.last; along a
 *                 periodic first axis cut into turns of `shape` cells, a cursor for each turn
 *                 or a fresh one
 *                 hs_sparse_window: points [first, end); in the own row and image 0 from
 *                 group.first on, where each point meets only those that follow it
 *
 * Each pair is met once: a group may see cells that are too far from some of its points, but always
 * along the row offset by which they see each other, and only forward (stencil.h).
 */
#ifndef HS_SPARSE_ROWS_H
#define HS_SPARSE_ROWS_H

#include "bins.h"

typedef struct hs_sparse {
    int            ndim;
    int64_t        n_rows;
    int64_t        n_cells;    /* occupied ones */
    int64_t       *row_index;  /* owned; (ndim - 1) per row: its index along axes 1, 2 ... */
    int32_t       *row_cell;   /* owned; n_rows + 1: its first cell */
    int64_t       *cell_x;     /* owned; index of each cell along the first axis */
    const int32_t *cell_start; /* bins->start: n_cells + 1, each cell's first point */
} hs_sparse;

/* Cells where the last window of a link began and ended. Any will do at first, as {0, 0}. */
typedef struct hs_sparse_cursor {
    int32_t low, high;
} hs_sparse_cursor;

/* Consecutive points of a row, at most one range long. */
typedef struct hs_sparse_group {
    int32_t first, last;     /* points [first, last) */
    int64_t x_first, x_last; /* indices of the cells that the first and the last are in */
    int32_t cell;            /* where the last one is */
} hs_sparse_group;

/*
 * Sorts the points by row, cell and the caller's number, polling now and then; takes the scene's
 * arrays over or frees them, as hs_bins_build does. bins->start counts the occupied cells and
 * grid->n_cells is their number. On failure neither holds anything. grid: from hs_sparse_grid.
 */
hs_status hs_sparse_build(hs_account *account, hs_team *team, const hs_options *options,
                          hs_scene *scene, hs_grid *grid, hs_sparse *sparse, hs_bins *bins);

/* The row with these indices (index[0] is not read), or -1. *hint: a row to start from, any in
 * 0 ... n_rows; receives where the row is or would be. */
int64_t hs_sparse_find_row(const hs_sparse *sparse, const int64_t *index, int64_t *hint);

/* Points [*first, *end) of the row whose index along the first axis is in [x_first, x_last]. */
void hs_sparse_window(const hs_sparse *sparse, int64_t row, int64_t x_first, int64_t x_last,
                      hs_sparse_cursor *cursor, int32_t *first, int32_t *end);

/* Before the first group of a row. */
void hs_sparse_first_group(const hs_sparse *sparse, int64_t row, hs_sparse_group *group);

/* The next group, of at most `most` points; false after the row's last. */
bool hs_sparse_next_group(const hs_sparse *sparse, int64_t row, int32_t most,
                          hs_sparse_group *group);

void hs_sparse_free(hs_account *account, hs_sparse *sparse);

#endif
