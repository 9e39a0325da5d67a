/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sparse_grid.h: cells as wide as the search wants them, however far the points reach. Such a grid
 * has no array over its cells: only the occupied ones are stored (sparse_rows.h).
 */
#ifndef HS_SPARSE_GRID_H
#define HS_SPARSE_GRID_H

#include <string.h>

#include "grid.h"

/* Cells per row's width along the first axis: short cells make tight windows and cost no rows. */
#define HS_SPARSE_SPLIT 4
/* Places nearer to 0 than this are numbered one by one; beyond it their 49 leading bits are. */
#define HS_SPARSE_LINEAR 0x1p49

/*
 * The grid of a scene with rows of cells `width` ranges wide (a power of two from 1 on) and cells
 * of width / HS_SPARSE_SPLIT along the first axis, however many these are; range, shift_error and
 * expected_pairs are those of `dense`. stride is 0, and n_cells is 0 until hs_sparse_build has
 * counted the occupied cells.
 */
void hs_sparse_grid(const hs_scene *scene, const hs_grid *dense, double width, hs_grid *grid);

/* Number of the cell that a place is in: of places (multiples of the cell's width) below
 * HS_SPARSE_LINEAR their floor; beyond it cells widen as the numbers themselves do. */
HS_ALWAYS_INLINE int64_t
hs_sparse_number(double place)
{
    if (place < HS_SPARSE_LINEAR && place > -HS_SPARSE_LINEAR) {
        const int64_t whole = (int64_t)place;
        return whole - (place < (double)whole);
    }
    const double  first = HS_SPARSE_LINEAR, size = place < 0.0 ? -place : place;
    const int64_t beyond = (int64_t)(hs_bits_of_double(size) - hs_bits_of_double(first));
    const int64_t number = (int64_t)first + (beyond >> 4); /* 48 of 52 fraction bits are left */
    return place < 0.0 ? -1 - number : number;
}

/* Cell index along axis k, in 0 ... shape - 1; points beyond the grid count as on its faces. */
HS_ALWAYS_INLINE int64_t
hs_sparse_index(const hs_grid *grid, int k, double t)
{
    const double  place = (t - grid->lower[k]) * grid->cells_per_length[k];
    const int64_t index = hs_sparse_number(place) - grid->skipped[k];
    const int64_t last = grid->shape[k] - 1;
    return index < 0 ? 0 : index < last ? index : last;
}

/*
 * Whether storing occupied cells only is quicker than the grid `dense`: 0 if not, else the `width`
 * for hs_sparse_grid. A judgement from the scene alone; costs nothing where the dense grid has the
 * cells it wants, some microseconds where it has not, and more only where points crowd.
 */
double hs_sparse_choose(const hs_scene *scene, const hs_grid *dense);

/* The `width` for hs_sparse_grid that is expected to be quickest, for a scene of any number of
 * points. dense: any grid of it. */
double hs_sparse_width(const hs_scene *scene, const hs_grid *dense);

#endif
