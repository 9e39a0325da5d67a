/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_SEARCH_WALK_H
#define HS_SEARCH_WALK_H

#include "scan.h"

/*
 * walk.h: the walk over groups of points. Rows of cells in order, cells along each row, at most
 * HS_GROUP_POINTS points at a time; each group's neighbourhood is gathered, scanned for every point
 * of the group, decided, and the hits are handed to a visitor. Groups depend on the scene and on
 * whether neighbourhoods are put in order, never on the thread that walks them.
 */

/*
 * Rows of cells, dense or sparse, as the walk sees them: which rows there are, which
 * groups of asking points each one has, which rows neighbour it, and which points of these lie in a
 * window of cells.
 */

/* One row, and how far its groups have been taken. */
typedef struct hs_row {
    int64_t         index[HS_MAX_DIM]; /* of its cells along axes 1, 2 ... */
    int64_t         base;              /* id of its first cell; in a sparse grid, of itself */
    int32_t         first, end;        /* its points */
    hs_sparse_group taken;             /* the last group */
} hs_row;

/* A neighbouring row of the row being walked, with its image settled. */
typedef struct hs_link {
    int64_t          base;              /* id of its first cell; in a sparse grid, of the row */
    hs_sparse_cursor cursor;            /* sparse only */
    int32_t          first, last;       /* neighbours of cell x: x + first to x + last */
    int32_t          image[HS_MAX_DIM]; /* shift over the rows of B */
    double           shift[HS_MAX_DIM]; /* image * B */
} hs_link;

/* The row and the cell along it of point si, taken as a group of its own. */
void hs_row_open_at(const hs_search *search, int32_t si, hs_row *row, hs_sparse_group *group);

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

/* Where a walk was left and can be taken up: the group that begins at this point, or the first one
 * behind it, when so many blocks of its candidates have been scanned. */
typedef struct hs_bookmark {
    int64_t point;
    int32_t blocks;
} hs_bookmark;

/* Where in the rows of cells a walk is. */
typedef struct hs_cursor {
    int32_t  target;              /* of groups, for row_next */
    hs_row   row;                 /* being walked: */
    int64_t  row_number;          /* its number, or -1 */
    int32_t  last_first;          /* first point of the last group that was taken, or -1 */
    bool     has_next;            /* row.taken is the next group */
    hs_link *links;               /* owned; of the row being walked */
    int64_t  n_links, most_links; /* there are, and there is room for */
    int64_t *hints; /* for hs_row_links, behind the links; NULL unless the grid is sparse */
} hs_cursor;

/* Belongs to one thread. */
typedef struct hs_walker {
    const hs_search *search; /* borrowed, read only */
    hs_cursor        cursor;
    hs_scanner       scanner;
} hs_walker;

/* A bound on the neighbourhood of any group. False where it is larger than one block has room for:
 * then a walk with HS_BLOCK_SIZES can tell. */
bool hs_walker_bound(const hs_search *search, hs_neighbourhood *most);

/*
 * most NULL: hits come block by block, as they are found. Else of a full search that lists: each
 * point's hits come in one visit, ascending by the candidate's number and then by S; it is the
 * largest neighbourhood, as hs_walker_bound says or a walk with HS_BLOCK_SIZES over all groups has
 * found it. `visit` NULL: hits are only counted, in n_found; with HS_BLOCK_SIZES not even that, but
 * the largest neighbourhood is found.
 */
hs_status hs_walker_init(hs_search *search, hs_block_use use, const hs_neighbourhood *most,
                         hs_visit_fn visit, void *context, hs_walker *walker);

/*
 * hs_walker_init without an order, for what the search of this walker has become, or for the first
 * one: then the walker is all zeros. It is the same object, of the same call, with as many axes,
 * and with the same kernel and options but for the cutoff. Memory that will do is kept, in the
 * account's arena too (hs_account_keep). Between two searches hs_walker_flush_counters tells the
 * call what was done; a walker that is not for others (hs_search_keeps_walker) ends there.
 */
hs_status hs_walker_renew(hs_search *search, hs_block_use use, hs_visit_fn visit, void *context,
                          hs_walker *walker);
void      hs_walker_flush_counters(hs_search *search, hs_walker *walker);

/* Visit the groups whose first point is in [first, end), in cell order. On HS_ERR_SHIFT_RANGE the
 * failure names the point. */
hs_status hs_walk(hs_walker *walker, int32_t first, int32_t end, hs_failure *failure);

/* Visit one point, as a group of its own. */
hs_status hs_walk_point(hs_walker *walker, int32_t si);

/* Adds what was done to that of the call and frees; idempotent. */
void hs_walker_close(hs_search *search, hs_walker *walker);

#endif
