/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_CELLS_BINS_H
#define HS_CELLS_BINS_H

#include "../threads/call.h"
#include "grid.h"

/*
 * bins.h: the points in cell order. Point number si here is order[si] in the caller's array; cell c
 * holds si in [start[c], start[c + 1]), in ascending order of the caller's numbers.
 */

typedef struct hs_bins {
    int64_t   n;
    int       ndim;
    int       n_periodic;
    double   *x[HS_MAX_DIM]; /* X of each axis, n each; HS_PADDING more can be read */
    int32_t  *order;         /* a permutation of 0 ... n - 1; HS_PADDING more can be read */
    int32_t  *start;         /* owned; n_cells + 1, nondecreasing, last is n; NULL of queries */
    uint32_t *cells;         /* owned; of queries in a dense grid: the cell of each */
    double    squares;       /* sum of the squared numbers of points in each cell */
    bool      keeps_originals;
    double   *originals[HS_MAX_DIM]; /* the points as given, n each, if they are kept */
    hs_turns  turns;
    void     *points; /* owned; the columns above lie in these two: the scene's blocks */
    void     *beside; /* owned or NULL */
    /* Of a sparse grid, whose cells are those that `start` counts; else NULL: */
    int64_t  n_rows;
    int64_t *row_index; /* owned; (ndim - 1) per row: its index along axes 1, 2 ... */
    int32_t *row_cell;  /* owned; n_rows + 1: its first cell */
    int64_t *cell_x;    /* owned; index of each cell along the first axis */
} hs_bins;

/*
 * Sorts, polling now and then; takes the scene's arrays over. To be freed on failure as well. The
 * result does not depend on the team. of_queries: what is stored is the cell of each
 * point, not where the points of each cell begin; and few points take time for themselves alone,
 * however many cells there are. In a sparse grid points are sorted by row, cell and the caller's
 * number, also of queries, and grid->n_cells becomes the number of occupied cells.
 */
hs_status hs_bins_build(hs_account *account, hs_team *team, const hs_options *options,
                        hs_scene *scene, hs_grid *grid, bool of_queries, hs_bins *bins);

/* Steps of hs_bins_build, for other orders: the scene's arrays become those of the bins, in the
 * caller's order as yet, and without `start`; the scene's spare column stays usable. */
void hs_bins_take(hs_scene *scene, hs_bins *bins);

/*
 * Then, with bins->order filled: moves all columns into that order. Each is gathered into the
 * column that is free, and leaves its own place free for the next:
 *
 *     order | spare | x[0] | x[1] | ...   ->   order | x[0] | x[1] | ... | free
 *
 * so that this takes room for one column and no more. HS_OK or HS_ERR_INTERRUPTED.
 */
hs_status hs_bins_arrange(hs_account *account, hs_team *team, const hs_options *options,
                          const hs_scene *scene, hs_bins *bins);

void hs_bins_free(hs_account *account, hs_bins *bins);

/*
 * Cells as wide as the search wants them, however far the points reach. Such a grid has no array
 * over its cells: only the occupied ones are stored.
 */

/* Cells per row's width along the first axis: short cells make tight windows and cost no rows. */
#define HS_SPARSE_SPLIT 4
/* Places nearer to 0 than this are numbered one by one; beyond it their 49 leading bits are. */
#define HS_SPARSE_LINEAR 0x1p49

/*
 * The grid of a scene with rows of cells `width` ranges wide (a power of two from 1 on) and cells
 * of width / HS_SPARSE_SPLIT along the first axis, however many these are; range, shift_error and
 * expected_pairs are those of `dense`. stride is 0, and n_cells is 0 until hs_bins_build has
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
 * for hs_sparse_grid that is expected to be quickest. A judgement from the scene alone, not sorted
 * yet; costs nothing where the dense grid has the cells it wants, some microseconds where it has
 * not, and more only where points crowd. always: a width whatever the dense grid is.
 */
double hs_sparse_choose(const hs_scene *scene, const hs_grid *dense, bool always);

/*
 * The occupied cells of a sparse grid, in rows. A row is a line of cells along the
 * first axis; rows are sorted by their indices (the last axis slowest), the cells of a row by
 * theirs, so that cost and memory follow the points and nothing follows the volume. Nothing is
 * hashed: targets of neighbouring rows come in nearly ascending order, so that a hint finds them in
 * O(1), and no input makes a search slower than O(log n).
 *
 * hs_sparse_grid, hs_stencil_build and hs_bins_build come first; walk.h walks. Each pair is met
 * once: a group may see cells that are too far from some of its points, but always along the row
 * offset by which they see each other, and only forward (grid.h).
 */

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

/* The row with these indices (index[0] is not read), or -1. *hint: a row to start from, any in
 * 0 ... n_rows; receives where the row is or would be. */
int64_t hs_sparse_find_row(const hs_bins *bins, const int64_t *index, int64_t *hint);

/* Points [*first, *end) of the row whose index along the first axis is in [x_first, x_last]. */
void hs_sparse_window(const hs_bins *bins, int64_t row, int64_t x_first, int64_t x_last,
                      hs_sparse_cursor *cursor, int32_t *first, int32_t *end);

/* The next group, of at most `most` points; false after the row's last. Before the first one `cell`
 * is the first cell of the row, and `last` its first point. */
bool hs_sparse_next_group(const hs_bins *bins, int64_t row, int32_t most, hs_sparse_group *group);

#endif
