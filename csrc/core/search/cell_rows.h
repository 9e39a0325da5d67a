/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * cell_rows.h: rows of cells, dense or sparse, as the walk sees them: which rows there are, which
 * groups of asking points each one has, which rows neighbour it, and which points of these lie in a
 * window of cells.
 */
#ifndef HS_CELL_ROWS_H
#define HS_CELL_ROWS_H

#include "search.h"

/* Consecutive points of a row, at most HS_GROUP_POINTS, and the cells along it that they are in. */
typedef struct hs_row_group {
    int32_t first, last; /* [first, last) in cell order */
    int64_t x_first, x_last;
} hs_row_group;

/* One row, and how far its groups have been taken. */
typedef struct hs_row {
    int64_t         index[HS_MAX_DIM]; /* of its cells along axes 1, 2 ... */
    int64_t         base;              /* id of its first cell; in a sparse grid, of itself */
    int32_t         first, end;        /* its points */
    int32_t         next;              /* first point of the next group */
    int64_t         x;                 /* cell of that point; dense only */
    hs_sparse_group taken;             /* the last group; sparse only */
} hs_row;

/* A neighbouring row of the row being walked, with its image settled. */
typedef struct hs_link {
    int64_t          base;              /* id of its first cell; in a sparse grid, of the row */
    hs_sparse_cursor cursor;            /* sparse only */
    int32_t          first, last;       /* neighbours of cell x: x + first to x + last */
    int32_t          image[HS_MAX_DIM]; /* shift over the rows of B */
    double           shift[HS_MAX_DIM]; /* image * B */
} hs_link;

int64_t hs_row_count(const hs_search *search);

/* The last row that begins at or before point si. */
int64_t hs_row_of(const hs_search *search, int32_t si);

void hs_row_open(const hs_search *search, int64_t number, hs_row *row);

/* The row and the cell along it of point si, taken as a group of its own. */
void hs_row_open_at(const hs_search *search, int32_t si, hs_row *row, hs_row_group *group);

/* Points that consecutive cells of a dense row are put together for, by walkers that put their
 * candidates in order (neighbourhood_sort.h) or others. */
int32_t hs_row_target(const hs_search *search, bool is_ordered);

/* The next group, with this target; false after the last. Groups depend on the scene and the target
 * alone. */
bool hs_row_next(const hs_search *search, int32_t target, hs_row *row, hs_row_group *group);

/*
 * Settles which rows neighbour this one, for half lists its own first, and how many. links: room
 * for search->stencil.n_rows, which memory alone bounds; hints: as many, zero at first, for sparse
 * grids only. Polls by these options.
 */
hs_status hs_row_links(const hs_search *search, const hs_options *options, const hs_row *row,
                       hs_link *links, int64_t *hints, int64_t *n_links);

/* Points [*first, *end) in cells low to high of the link's row; cells beyond it have none. */
void hs_link_window(const hs_search *search, hs_link *link, int64_t low, int64_t high,
                    int32_t *first, int32_t *end);

/* Rounded down. */
HS_ALWAYS_INLINE int64_t
hs_floor_divide(int64_t a, int64_t b)
{
    const int64_t quotient = a / b;
    return quotient - (a % b != 0 && (a < 0) != (b < 0));
}

#endif
