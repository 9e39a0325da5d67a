/* SPDX-License-Identifier: BSD-3-Clause */
#include "walk.h"

/* walk.c: finds the links of each row once; then each group has a window of cells in each link.
 * Dense rows go by cell ids, sparse rows by a search for their indices. */

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

/* How many rows there are. */
static int64_t
row_count(const hs_search *search)
{
    return search->is_sparse ? hs_search_asking(search)->n_rows
                             : search->grid.n_cells / search->grid.shape[0];
}

/* The first point of a row; of the row after the last, the number of points. */
static int32_t
first_point(const hs_search *search, int64_t number)
{
    const hs_bins *asking = hs_search_asking(search);
    const int64_t  cell = search->is_sparse ? asking->row_cell[number]
                                            : number * search->grid.shape[0];
    int64_t        low = 0, high = asking->n;
    if (asking->cells == NULL) {
        return asking->start[cell];
    }
    while (low < high) { /* the first query in this cell of a dense grid or a later one */
        const int64_t middle = low + (high - low) / 2;
        if (asking->cells[middle] < cell) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return (int32_t)low;
}

/* The last row that begins at or before point si. */
static int64_t
row_of(const hs_search *search, int32_t si)
{
    const hs_bins *asking = hs_search_asking(search);
    int64_t        low = 0, high = row_count(search);
    if (asking->cells != NULL) {
        return asking->cells[si] / search->grid.shape[0];
    }
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

static void
row_open(const hs_search *search, int64_t number, hs_row *row)
{
    const hs_grid *grid = &search->grid;
    const hs_bins *asking = hs_search_asking(search);
    row->first = first_point(search, number);
    row->end = first_point(search, number + 1);
    row->taken = (hs_sparse_group){.last = row->first};
    if (search->is_sparse) {
        row->base = number;
        for (int k = 1; k < grid->ndim; k++) {
            row->index[k] = asking->row_index[number * (grid->ndim - 1) + k - 1];
        }
        row->taken.cell = asking->row_cell[number];
        return;
    }
    row->base = number * grid->shape[0];
    for (int k = 1; k < grid->ndim; k++) {
        row->index[k] = row->base / grid->stride[k] % grid->shape[k];
    }
}

void
hs_row_open_at(const hs_search *search, int32_t si, hs_row *row, hs_sparse_group *group)
{
    double x[HS_MAX_DIM];
    for (int k = 0; k < search->scene.ndim; k++) {
        x[k] = hs_search_asking(search)->x[k][si];
    }
    const double t = hs_lattice_coordinate(&search->scene.lattice, x, 0);
    row_open(search, row_of(search, si), row);
    group->first = si;
    group->last = si + 1;
    group->x_first = group->x_last = search->is_sparse ? hs_sparse_index(&search->grid, 0, t)
                                                       : hs_grid_index(&search->grid, 0, t);
}

/* Takes the next group, with this target; false after the last. Groups depend on the scene and the
 * target alone. */
static bool
row_next(const hs_search *search, int32_t target, hs_row *row)
{
    const hs_bins *asking = hs_search_asking(search);
    if (search->is_sparse) {
        return hs_sparse_next_group(asking, row->base, HS_GROUP_POINTS, &row->taken);
    }
    const int32_t first = row->taken.last;
    if (first >= row->end) {
        return false;
    }
    if (asking->cells != NULL) { /* queries, while they are few, and their windows meet */
        const uint32_t *cells = asking->cells;
        const int64_t   apart = 2 * search->grid.reach[0] + 1;
        int32_t         last = first;
        while (last + 1 < row->end && last + 1 - first < target &&
               cells[last + 1] - cells[last] <= apart) {
            last++;
        }
        row->taken = (hs_sparse_group){.first = first,
                                       .last = last + 1,
                                       .x_first = cells[first] - row->base,
                                       .x_last = cells[last] - row->base};
        return true;
    }
    const int32_t *start = asking->start + row->base;
    int64_t        x = row->taken.x_last;
    while (start[x + 1] <= first) {
        x++;
    }
    int64_t last = x;
    /* A cell more, while they are few; none beside the rest of a crowded one. */
    while (last + 1 < search->grid.shape[0] && start[last + 2] - first <= target) {
        last++;
    }
    const int32_t end = start[last + 1];
    row->taken = (hs_sparse_group){
        first, end - first > HS_GROUP_POINTS ? first + HS_GROUP_POINTS : end, x, last, 0};
    return true;
}

hs_status
hs_row_links(const hs_search *search, const hs_options *options, const hs_row *row, hs_link *links,
             int64_t *hints, int64_t *found)
{
    const hs_stencil *stencil = &search->stencil;
    const hs_lattice *lattice = &search->scene.lattice;
    const hs_grid    *grid = &search->grid;
    int64_t           n_links = 0;
    for (int64_t s = 0; s < stencil->n_rows; s++) {
        const hs_stencil_row *offset = &stencil->rows[s];
        hs_link              *link = &links[n_links];
        int64_t               target[HS_MAX_DIM];
        bool                  is_there = true; /* in the box, or wrapped into it */
        if (s % POLL_LINKS == POLL_LINKS - 1 && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
        *link = (hs_link){.first = offset->first, .last = offset->last};
        for (int k = 1; k < grid->ndim; k++) {
            int64_t   cell = row->index[k] + offset->offset[k];
            const int b = lattice->row_of_axis[k];
            if (cell < 0 || cell >= grid->shape[k]) {
                const int64_t turn = hs_floor_divide(cell, grid->shape[k]);
                if (b < 0) {
                    is_there = false;
                    break;
                }
                cell -= turn * grid->shape[k];
                link->image[b] = (int32_t)turn;
                for (int c = 0; c < grid->ndim; c++) {
                    link->shift[c] += (double)turn * lattice->rows[b][c];
                }
            }
            target[k] = cell;
            link->base += cell * grid->stride[k];
        }
        if (is_there && search->is_sparse) {
            link->base = hs_sparse_find_row(&search->bins, target, &hints[s]);
            if (link->base >= 0) {
                link->cursor.low = link->cursor.high = search->bins.row_cell[link->base];
                n_links++;
            }
        } else if (is_there) {
            const int32_t *start = search->bins.start + link->base;
            /* The own row of the half list leads them all. */
            n_links += (s == 0 && !search->is_full) || start[0] < start[grid->shape[0]];
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
        hs_sparse_window(&search->bins, link->base, low, high, &link->cursor, first, end);
        return;
    }
    const int32_t *start = search->bins.start + link->base;
    *first = start[low > 0 ? low < n_x ? low : n_x : 0];
    *end = start[high < n_x - 1 ? high >= 0 ? high + 1 : 0 : n_x];
}

/*
 * Gather cells low to high of the link's row, leaving out points before `from` of the image 0 (the
 * own row). Along a periodic first axis the cells may run over several images: as many as the reach
 * has, below 2^32. Each but the outermost gives a run, and appending runs polls.
 */
static hs_status
gather_link(hs_walker *walker, hs_link *link, int64_t low, int64_t high, int32_t from)
{
    const hs_search  *search = walker->search;
    const hs_lattice *lattice = &search->scene.lattice;
    const int64_t     n_x = search->grid.shape[0];
    const int         row = lattice->row_of_axis[0];
    int32_t           first, end;
    if (row < 0 || (low >= 0 && high < n_x)) {
        hs_link_window(search, link, low, high, &first, &end);
        return hs_scanner_append(&walker->scanner, first > from ? first : from, end, link->shift,
                                 link->image);
    }
    for (int64_t turn = hs_floor_divide(low, n_x); turn * n_x <= high; turn++) {
        double  shift[HS_MAX_DIM];
        int32_t image[HS_MAX_DIM];
        memcpy(image, link->image, sizeof image);
        image[row] = (int32_t)turn;
        for (int k = 0; k < search->scene.ndim; k++) {
            shift[k] = link->shift[k] + (double)turn * lattice->rows[row][k];
        }
        hs_link_window(search, link, low - turn * n_x, high - turn * n_x, &first, &end);
        const hs_status status = hs_scanner_append(
            &walker->scanner, turn == 0 && first < from ? from : first, end, shift, image);
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

/* Visit a group of the row that the links belong to. */
static hs_status
visit_group(hs_walker *walker, const hs_sparse_group *group)
{
    hs_cursor *cursor = &walker->cursor;
    walker->scanner.work_since_poll += cursor->n_links; /* windows may be empty */
    hs_scanner_start(&walker->scanner, group->first, group->last);
    for (int64_t l = 0; l < cursor->n_links; l++) {
        hs_link *link = &cursor->links[l];
        /* The own row comes first; in it each point meets only those that follow. */
        const hs_status status = gather_link(walker, link, group->x_first + link->first,
                                             group->x_last + link->last,
                                             l == 0 && !walker->search->is_full ? group->first : 0);
        if (status != HS_OK) {
            return status;
        }
    }
    const hs_status status = hs_scanner_scan(&walker->scanner);
    walker->scanner.blocks_to_skip = 0;
    return status;
}

/*
 * Groups of the row, as far as their first point is in [from, to). Goes on where the last range of
 * this row ended, so that many ranges in a long row do not step through it again and again.
 */
static hs_status
walk_row(hs_walker *walker, int64_t number, int32_t from, int32_t to)
{
    const hs_search *search = walker->search;
    hs_cursor       *cursor = &walker->cursor;
    hs_status        status = HS_OK;
    if (cursor->row_number != number || from <= cursor->last_first) { /* from its first group on */
        row_open(search, number, &cursor->row);
        cursor->row_number = -1; /* until it has its links */
        cursor->last_first = -1;
        cursor->has_next = cursor->row.first < cursor->row.end;
        if (cursor->has_next) {
            walker->scanner.work_since_poll += search->stencil.n_rows;
            status = hs_row_links(search, &walker->scanner.options, &cursor->row, cursor->links,
                                  cursor->hints, &cursor->n_links);
            cursor->has_next = status == HS_OK && row_next(search, cursor->target, &cursor->row);
        }
        cursor->row_number = status == HS_OK ? number : -1;
    }
    while (status == HS_OK && cursor->has_next && cursor->row.taken.first < to) {
        const hs_sparse_group group = cursor->row.taken;
        cursor->last_first = group.first;
        cursor->has_next = row_next(search, cursor->target, &cursor->row);
        if (group.first >= from) {
            status = visit_group(walker, &group);
        }
    }
    return status;
}

hs_status
hs_walk(hs_walker *walker, int32_t first, int32_t end, hs_failure *failure)
{
    const hs_search  *search = walker->search;
    const hs_options *options = &walker->scanner.options;
    const int64_t     n_rows = row_count(search);
    if (first >= end || (!options->inclusive && options->cutoff == 0.0)) {
        return HS_OK; /* no distance is below zero */
    }
    const int64_t last_row = row_of(search, end - 1);
    for (int64_t row = row_of(search, first); row < n_rows && row <= last_row;) {
        const hs_status status = walk_row(walker, row, first, end);
        const int32_t   next = walker->cursor.row.end;
        if (status == HS_ERR_SHIFT_RANGE) {
            failure->row = walker->scanner.failed_point;
            failure->in_queries = search->has_queries;
        }
        if (status != HS_OK) {
            return status;
        }
        /* Between few queries there are many rows without one. */
        row = hs_search_asking(search)->cells != NULL && next < end ? row_of(search, next)
                                                                    : row + 1;
    }
    return HS_OK;
}

hs_status
hs_walk_point(hs_walker *walker, int32_t si)
{
    hs_cursor      *cursor = &walker->cursor;
    hs_sparse_group group;
    hs_row_open_at(walker->search, si, &cursor->row, &group);
    cursor->row_number = -1; /* the next walk begins anew */
    const hs_status status = hs_row_links(walker->search, &walker->scanner.options, &cursor->row,
                                          cursor->links, cursor->hints, &cursor->n_links);
    return status == HS_OK ? visit_group(walker, &group) : status;
}

/* All points in every image that the stencil can reach, and a run for each row of the stencil and
 * each image along the first axis. */
bool
hs_walker_bound(const hs_search *search, hs_neighbourhood *most)
{
    const hs_grid *grid = &search->grid;
    double         candidates = (double)search->bins.n, runs = (double)search->stencil.n_rows;
    for (int k = 0; k < grid->ndim; k++) {
        if (search->scene.lattice.row_of_axis[k] >= 0) {
            const double images = 2.0 * (double)(grid->reach[k] / grid->shape[k]) + 3.0;
            candidates *= images;
            runs *= k == 0 ? images : 1.0;
        }
    }
    most->candidates = (int64_t)hs_smaller(candidates, HS_BLOCK_CANDIDATES);
    most->runs = (int64_t)hs_smaller(runs, (double)most->candidates);
    return candidates < HS_BLOCK_CANDIDATES;
}

/* Candidates and runs that a block has room for. A small scene gets a small block. No larger one
 * than others have: where a block ends decides the order of pairs, and a walker may have been
 * opened for another search. */
static void
find_capacities(const hs_search *search, int32_t *candidates, int32_t *runs)
{
    hs_neighbourhood most;
    (void)hs_walker_bound(search, &most);
    *candidates = (int32_t)(most.candidates < HS_BLOCK_CANDIDATES - HS_GROUP_POINTS
                                ? most.candidates + HS_GROUP_POINTS
                                : HS_BLOCK_CANDIDATES);
    *runs = most.runs < HS_BLOCK_RUNS ? (int32_t)most.runs + 1 : HS_BLOCK_RUNS;
}

/* Puts the cursor in front of the first row. Its target: points that consecutive cells of a dense
 * row are put together for, by walkers that put their candidates in order (scan.h) or others. */
static void
set_out(const hs_search *search, bool is_ordered, hs_cursor *cursor)
{
    cursor->target = TARGET_POINTS;
    cursor->row_number = -1;
    if (is_ordered && !search->is_sparse) {
        const double in_cell = (double)hs_search_asking(search)->n / (double)search->grid.n_cells;
        const double target =
            sqrt(SHARED_PER_POINT * in_cell * (double)search->grid.reach[0] + SHARED);
        cursor->target = target < HS_GROUP_POINTS ? (int32_t)target : HS_GROUP_POINTS;
    }
}

hs_status
hs_walker_init(hs_search *search, hs_block_use use, const hs_neighbourhood *most, hs_visit_fn visit,
               void *context, hs_walker *walker)
{
    hs_account   *account = &search->call->account;
    hs_cursor    *cursor = &walker->cursor;
    const int64_t n = search->stencil.n_rows;
    int32_t       capacity, most_runs;
    if (most != NULL && most->candidates > HS_ORDER_CANDIDATES) {
        memset(walker, 0, sizeof *walker);
        return HS_ERR_MEMORY;
    }
    find_capacities(search, &capacity, &most_runs);
    if (most != NULL) { /* one more of each, because a full block is scanned before the next run */
        capacity = (int32_t)most->candidates + 1;
        most_runs = (int32_t)most->runs + 1;
    }
    memset(cursor, 0, sizeof *cursor);
    walker->search = search;
    set_out(search, most != NULL || use == HS_BLOCK_SIZES, cursor);
    hs_status status =
        hs_scanner_init(search, use, capacity, most_runs, most != NULL, &walker->scanner);
    walker->scanner.visit = visit;
    walker->scanner.visit_context = context;
    if (status == HS_OK) {
        const size_t of_hint = search->is_sparse ? sizeof(int64_t) : 0;
        cursor->links = hs_alloc(account, HS_FOR_STENCIL, n, sizeof(hs_link) + of_hint);
        cursor->most_links = n;
        status = cursor->links != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    if (status != HS_OK) {
        hs_walker_close(search, walker);
    } else if (search->is_sparse) {
        cursor->hints = memset(cursor->links + n, 0, (size_t)n * sizeof(int64_t));
    }
    return status;
}

hs_status
hs_walker_renew(hs_search *search, hs_block_use use, hs_visit_fn visit, void *context,
                hs_walker *walker)
{
    int32_t capacity, most_runs;
    find_capacities(search, &capacity, &most_runs);
    if (search->stencil.n_rows <= walker->cursor.most_links && hs_search_keeps_walker(search) &&
        hs_scanner_renew(search, use, capacity, most_runs, &walker->scanner)) {
        set_out(search, use == HS_BLOCK_SIZES, &walker->cursor);
        walker->scanner.visit = visit;
        walker->scanner.visit_context = context;
        return HS_OK;
    }
    hs_walker_close(search, walker);
    const hs_status status = hs_walker_init(search, use, NULL, visit, context, walker);
    if (hs_search_keeps_walker(search)) {
        hs_account_keep(&search->call->account);
    }
    return status;
}

void
hs_walker_flush_counters(hs_search *search, hs_walker *walker)
{
    hs_scanner_flush_counters(search, &walker->scanner);
    if (!hs_search_keeps_walker(search)) {
        hs_walker_close(search, walker);
    }
}

void
hs_walker_close(hs_search *search, hs_walker *walker)
{
    hs_account *account = &search->call->account;
    hs_cursor  *cursor = &walker->cursor;
    hs_scanner *scanner = &walker->scanner;
    hs_scanner_flush_counters(search, scanner);
    hs_free(account, cursor->links); /* the last block first: the arena has it again */
    hs_free(account, scanner->pair_batch.memory);
    hs_free(account, scanner->block.order.memory);
    hs_free(account, scanner->block.memory);
    cursor->links = NULL;
    scanner->pair_batch.memory = scanner->block.order.memory = scanner->block.memory = NULL;
}
