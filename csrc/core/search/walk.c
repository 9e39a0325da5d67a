/* SPDX-License-Identifier: BSD-3-Clause */
/* walk.c: finds the links of each row once; then each group has a window of cells in each link. */
#include "walk.h"

#include "open_scanner.h"
#include "scan.h"

#include <string.h>

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
visit_group(hs_walker *walker, const hs_row_group *group)
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
    return hs_scanner_finish(&walker->scanner);
}

static hs_status
set_links(hs_walker *walker, const hs_row *row)
{
    hs_cursor *cursor = &walker->cursor;
    walker->scanner.work_since_poll += walker->search->stencil.n_rows;
    return hs_row_links(walker->search, &walker->scanner.options, row, cursor->links, cursor->hints,
                        &cursor->n_links);
}

static void
find_next(const hs_search *search, hs_cursor *cursor)
{
    cursor->has_next = hs_row_next(search, cursor->target, &cursor->row, &cursor->next);
}

/* Takes up a row at its first group. */
static hs_status
open_row(hs_walker *walker, int64_t number)
{
    hs_cursor *cursor = &walker->cursor;
    hs_row_open(walker->search, number, &cursor->row);
    cursor->row_number = -1; /* until it has its links */
    cursor->last_first = -1;
    cursor->has_next = cursor->row.first < cursor->row.end;
    if (cursor->has_next) {
        const hs_status status = set_links(walker, &cursor->row);
        if (status != HS_OK) {
            return status;
        }
        find_next(walker->search, cursor);
    }
    cursor->row_number = number;
    return HS_OK;
}

/*
 * Groups of the row, as far as their first point is in [from, to). Goes on where the last range of
 * this row ended, so that many ranges in a long row do not step through it again and again.
 */
static hs_status
walk_row(hs_walker *walker, int64_t number, int32_t from, int32_t to)
{
    hs_cursor *cursor = &walker->cursor;
    hs_status  status = HS_OK;
    if (cursor->row_number != number || from <= cursor->last_first) {
        status = open_row(walker, number);
    }
    while (status == HS_OK && cursor->has_next && cursor->next.first < to) {
        const hs_row_group group = cursor->next;
        cursor->last_first = group.first;
        find_next(walker->search, cursor);
        if (group.first >= from) {
            status = visit_group(walker, &group);
        }
    }
    return status;
}

hs_status
hs_walk(hs_walker *walker, int32_t first, int32_t end)
{
    const hs_search  *search = walker->search;
    const hs_options *options = &walker->scanner.options;
    const int64_t     n_rows = hs_row_count(search);
    if (first >= end || (!options->inclusive && options->cutoff == 0.0)) {
        return HS_OK; /* no distance is below zero */
    }
    const int64_t last_row = hs_row_of(search, end - 1);
    for (int64_t row = hs_row_of(search, first); row < n_rows && row <= last_row; row++) {
        const hs_status status = walk_row(walker, row, first, end);
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

hs_status
hs_walk_or_tell(hs_walker *walker, int32_t first, int32_t end, hs_failure *failure)
{
    const hs_status status = hs_walk(walker, first, end);
    if (status == HS_ERR_SHIFT_RANGE) {
        failure->row = walker->scanner.failed_point;
        failure->in_queries = walker->search->has_queries;
    }
    return status;
}

hs_status
hs_walk_point(hs_walker *walker, int32_t si)
{
    hs_row       row;
    hs_row_group group;
    hs_row_open_at(walker->search, si, &row, &group);
    walker->cursor.row_number = -1; /* its links are overwritten */
    const hs_status status = set_links(walker, &row);
    return status == HS_OK ? visit_group(walker, &group) : status;
}

/* A bound on the candidates of a group: all points in every image that the stencil can reach. */
static double
most_candidates(const hs_search *search)
{
    const hs_grid *grid = &search->grid;
    double         most = (double)search->bins.n;
    for (int k = 0; k < grid->ndim && most < HS_BLOCK_CANDIDATES; k++) {
        if (search->scene.lattice.row_of_axis[k] >= 0) {
            most *= 2.0 * (double)(grid->reach[k] / grid->shape[k]) + 3.0;
        }
    }
    return most;
}

int32_t
hs_walker_capacity(const hs_search *search)
{
    /* A small scene gets a small block. No larger one than others have: where a block ends decides
     * the order of pairs, and a walker may have been opened for another search. */
    return (int32_t)hs_smaller(most_candidates(search) + HS_GROUP_POINTS, HS_BLOCK_CANDIDATES);
}

bool
hs_walker_bound(const hs_search *search, hs_neighbourhood *most)
{
    const hs_grid *grid = &search->grid;
    const double   candidates = most_candidates(search);
    const bool     turns = search->scene.lattice.row_of_axis[0] >= 0;
    /* A run for each row of the stencil and each image along the first axis. */
    const double runs = (double)search->stencil.n_rows *
                        (turns ? 2.0 * (double)(grid->reach[0] / grid->shape[0]) + 3.0 : 1.0);
    most->candidates = candidates < HS_BLOCK_CANDIDATES ? (int64_t)candidates : 0;
    most->runs = (int64_t)hs_smaller(runs, candidates);
    return candidates < HS_BLOCK_CANDIDATES;
}

bool
hs_walker_fits(hs_search *search, const hs_neighbourhood *most, double *bytes)
{
    const int ndim = search->scene.ndim, m = search->scene.lattice.n_periodic;
    /* Bytes that each candidate takes at least, gathered, sorted and looked up. */
    const double each = (double)(sizeof(hs_unsure) + 2 * sizeof(uint64_t) + 4 * sizeof(int32_t)) +
                        (double)(ndim + 1) * sizeof(float) + (double)ndim * sizeof(double) +
                        (double)m * sizeof(int64_t);
    const double all = (double)most->candidates * each;
    if (most->candidates <= HS_ORDER_CANDIDATES && hs_account_allows(&search->call->account, all)) {
        return true;
    }
    *bytes = all;
    return false;
}

static hs_status
init_links(hs_search *search, hs_cursor *cursor)
{
    hs_account   *account = &search->call->account;
    const int64_t n = search->stencil.n_rows;
    cursor->links = hs_alloc(account, HS_FOR_STENCIL, n, sizeof(hs_link));
    if (cursor->links == NULL) {
        return HS_ERR_MEMORY;
    }
    cursor->most_links = n;
    if (search->is_sparse) {
        cursor->hints = hs_alloc(account, HS_FOR_STENCIL, n, sizeof(int64_t));
        if (cursor->hints == NULL) {
            return HS_ERR_MEMORY;
        }
        memset(cursor->hints, 0, (size_t)n * sizeof(int64_t));
    }
    return HS_OK;
}

/* In front of the first row. */
static void
set_out(const hs_search *search, bool is_ordered, hs_cursor *cursor)
{
    cursor->target = hs_row_target(search, is_ordered);
    cursor->row_number = -1;
}

static hs_status
init_walker(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
            bool is_ordered, hs_walker *walker)
{
    memset(&walker->cursor, 0, sizeof walker->cursor);
    walker->search = search;
    set_out(search, is_ordered || use == HS_BLOCK_SIZES, &walker->cursor);
    const hs_status status =
        hs_scanner_init(search, use, capacity, most_runs, is_ordered, &walker->scanner);
    return status == HS_OK ? init_links(search, &walker->cursor) : status;
}

/* Sets the visitor, or closes what could not be opened. */
static hs_status
settle_walker(hs_search *search, hs_status status, hs_visit_fn visit, void *context,
              hs_walker *walker)
{
    walker->scanner.visit = visit;
    walker->scanner.visit_context = context;
    if (status != HS_OK) {
        hs_walker_close(search, walker);
    }
    return status;
}

/* Runs that a block has room for. */
static int32_t
run_capacity(const hs_search *search)
{
    hs_neighbourhood most;
    (void)hs_walker_bound(search, &most);
    return most.runs < HS_BLOCK_RUNS ? (int32_t)most.runs + 1 : HS_BLOCK_RUNS;
}

hs_status
hs_walker_init(hs_search *search, hs_block_use use, hs_visit_fn visit, void *context,
               hs_walker *walker)
{
    const hs_status status =
        init_walker(search, use, hs_walker_capacity(search), run_capacity(search), false, walker);
    return settle_walker(search, status, visit, context, walker);
}

hs_status
hs_walker_renew(hs_search *search, hs_block_use use, hs_visit_fn visit, void *context,
                hs_walker *walker)
{
    if (search->stencil.n_rows <= walker->cursor.most_links && hs_search_keeps_walker(search) &&
        hs_scanner_renew(search, use, hs_walker_capacity(search), run_capacity(search),
                         &walker->scanner)) {
        set_out(search, use == HS_BLOCK_SIZES, &walker->cursor);
        return settle_walker(search, HS_OK, visit, context, walker);
    }
    hs_walker_close(search, walker);
    const hs_status status = hs_walker_init(search, use, visit, context, walker);
    if (hs_search_keeps_walker(search)) {
        hs_account_keep(&search->call->account);
    }
    return status;
}

void
hs_walker_rest(hs_search *search, hs_walker *walker)
{
    hs_scanner_note(search, &walker->scanner);
    if (!hs_search_keeps_walker(search)) {
        hs_walker_close(search, walker);
    }
}

hs_status
hs_walker_init_ordered(hs_search *search, hs_block_use use, const hs_neighbourhood *most,
                       hs_visit_fn visit, void *context, hs_walker *walker)
{
    if (most->candidates > HS_ORDER_CANDIDATES) {
        memset(walker, 0, sizeof *walker);
        return HS_ERR_MEMORY;
    }
    /* One more of each, because a full block is scanned before the next run. */
    const hs_status status = init_walker(search, use, (int32_t)most->candidates + 1,
                                         (int32_t)most->runs + 1, true, walker);
    return settle_walker(search, status, visit, context, walker);
}

void
hs_walker_close(hs_search *search, hs_walker *walker)
{
    hs_account *account = &search->call->account;
    hs_free(account, walker->cursor.hints); /* the last block first: the arena has it again */
    walker->cursor.hints = NULL;
    hs_free(account, walker->cursor.links);
    walker->cursor.links = NULL;
    hs_scanner_close(search, &walker->scanner);
}
