/* SPDX-License-Identifier: BSD-3-Clause */
/* cell_rows.c: dense rows go by cell ids, sparse rows by a search for their indices. */
#include "cell_rows.h"

#include "../base/poll.h"
#include "../cells/sparse_grid.h"

#include <math.h>

/*
 * More points pay better for finding and gathering a neighbourhood, fewer have a smaller one. The
 * best number depends little on density: the costs of a neighbourhood and of its candidates are in
 * the ratio of some hundreds.
 */
#define TARGET_POINTS 20

/*
 * Where neighbourhoods are sorted, more pay when rows are crowded. Along its row a group is w cells
 * long, with p points of each w, and has candidates from w + 2 of them: its points share the 2, but
 * each meets these as well. With 40 tests for the price of gathering and sorting a candidate, and
 * 250 tests more for one group of a row, w p is best at the root of 90 p + 250.
 */
#define SHARED_PER_POINT 90.0
#define SHARED           250.0

#define POLL_LINKS (1 << 16) /* rows of the stencil between two polls */

/* The rows and cells of the asking points, in a sparse grid. */
static const hs_sparse *
asking_sparse(const hs_search *search)
{
    return search->has_queries ? &search->query_sparse : &search->sparse;
}

int64_t
hs_row_count(const hs_search *search)
{
    return search->is_sparse ? asking_sparse(search)->n_rows
                             : search->grid.n_cells / search->grid.shape[0];
}

/* The first point of a row; of the row after the last, the number of points. */
static int32_t
first_point(const hs_search *search, int64_t number)
{
    const int64_t cell = search->is_sparse ? asking_sparse(search)->row_cell[number]
                                           : number * search->grid.shape[0];
    return hs_search_asking(search)->start[cell];
}

int64_t
hs_row_of(const hs_search *search, int32_t si)
{
    int64_t low = 0, high = hs_row_count(search);
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (first_point(search, middle) <= si) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

void
hs_row_open(const hs_search *search, int64_t number, hs_row *row)
{
    const hs_grid *grid = &search->grid;
    row->first = row->next = first_point(search, number);
    row->end = first_point(search, number + 1);
    row->x = 0;
    if (search->is_sparse) {
        row->base = number;
        for (int k = 1; k < grid->ndim; k++) {
            row->index[k] = asking_sparse(search)->row_index[number * (grid->ndim - 1) + k - 1];
        }
        hs_sparse_first_group(asking_sparse(search), number, &row->taken);
        return;
    }
    row->base = number * grid->shape[0];
    for (int k = 1; k < grid->ndim; k++) {
        row->index[k] = row->base / grid->stride[k] % grid->shape[k];
    }
}

void
hs_row_open_at(const hs_search *search, int32_t si, hs_row *row, hs_row_group *group)
{
    double x[HS_MAX_DIM];
    for (int k = 0; k < search->scene.ndim; k++) {
        x[k] = hs_search_asking(search)->x[k][si];
    }
    const double t = hs_lattice_coordinate(&search->scene.lattice, x, 0);
    hs_row_open(search, hs_row_of(search, si), row);
    group->first = si;
    group->last = si + 1;
    group->x_first = group->x_last = search->is_sparse ? hs_sparse_index(&search->grid, 0, t)
                                                       : hs_grid_index(&search->grid, 0, t);
}

int32_t
hs_row_target(const hs_search *search, bool is_ordered)
{
    const hs_grid *grid = &search->grid;
    if (!is_ordered || search->is_sparse) {
        return TARGET_POINTS;
    }
    const double in_cell = (double)hs_search_asking(search)->n / (double)grid->n_cells;
    const double target = sqrt(SHARED_PER_POINT * in_cell * (double)grid->reach[0] + SHARED);
    return target < HS_GROUP_POINTS ? (int32_t)target : HS_GROUP_POINTS;
}

bool
hs_row_next(const hs_search *search, int32_t target, hs_row *row, hs_row_group *group)
{
    if (search->is_sparse) {
        const bool found =
            hs_sparse_next_group(asking_sparse(search), row->base, HS_GROUP_POINTS, &row->taken);
        *group = (hs_row_group){row->taken.first, row->taken.last, row->taken.x_first,
                                row->taken.x_last};
        return found;
    }
    const int32_t *start = hs_search_asking(search)->start + row->base;
    const int64_t  n_x = search->grid.shape[0];
    if (row->next >= row->end) {
        return false;
    }
    while (start[row->x + 1] <= row->next) {
        row->x++;
    }
    int64_t last = row->x;
    /* A cell more, while they are few; none beside the rest of a crowded one. */
    while (last + 1 < n_x && start[last + 2] - row->next <= target) {
        last++;
    }
    const int32_t end = start[last + 1];
    group->first = row->next;
    group->last = end - row->next > HS_GROUP_POINTS ? row->next + HS_GROUP_POINTS : end;
    group->x_first = row->x;
    group->x_last = last;
    row->next = group->last;
    return true;
}

/* The row at this offset from a row, wrapped into the box; false when there is none. */
static bool
settle_link(const hs_search *search, const hs_row *row, const hs_stencil_row *offset, hs_link *link,
            int64_t *target)
{
    const hs_lattice *lattice = &search->scene.lattice;
    const hs_grid    *grid = &search->grid;
    *link = (hs_link){.first = offset->first, .last = offset->last};
    for (int k = 1; k < grid->ndim; k++) {
        int64_t   cell = row->index[k] + offset->offset[k];
        const int b = lattice->row_of_axis[k];
        if (cell < 0 || cell >= grid->shape[k]) {
            if (b < 0) {
                return false;
            }
            const int64_t turn = hs_floor_divide(cell, grid->shape[k]);
            cell -= turn * grid->shape[k];
            link->image[b] = (int32_t)turn;
            for (int c = 0; c < grid->ndim; c++) {
                link->shift[c] += (double)turn * lattice->rows[b][c];
            }
        }
        target[k] = cell;
        link->base += cell * grid->stride[k];
    }
    return true;
}

hs_status
hs_row_links(const hs_search *search, const hs_options *options, const hs_row *row, hs_link *links,
             int64_t *hints, int64_t *found)
{
    const hs_stencil *stencil = &search->stencil;
    int64_t           n_links = 0;
    for (int64_t s = 0; s < stencil->n_rows; s++) {
        hs_link *link = &links[n_links];
        int64_t  target[HS_MAX_DIM];
        if (s % POLL_LINKS == POLL_LINKS - 1 && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
        if (!settle_link(search, row, &stencil->rows[s], link, target)) {
            continue;
        }
        if (search->is_sparse) {
            link->base = hs_sparse_find_row(&search->sparse, target, &hints[s]);
            if (link->base >= 0) {
                link->cursor.low = link->cursor.high = search->sparse.row_cell[link->base];
                n_links++;
            }
        } else {
            const int32_t *start = search->bins.start + link->base;
            /* The own row of the half list leads them all. */
            n_links += (s == 0 && !search->is_full) || start[0] < start[search->grid.shape[0]];
        }
    }
    *found = n_links;
    return HS_OK;
}

void
hs_link_window(const hs_search *search, hs_link *link, int64_t low, int64_t high, int32_t *first,
               int32_t *end)
{
    const int64_t n_x = search->grid.shape[0];
    if (search->is_sparse) {
        hs_sparse_window(&search->sparse, link->base, low, high, &link->cursor, first, end);
        return;
    }
    const int32_t *start = search->bins.start + link->base;
    *first = start[low > 0 ? low < n_x ? low : n_x : 0];
    *end = start[high < n_x - 1 ? high >= 0 ? high + 1 : 0 : n_x];
}
