/* SPDX-License-Identifier: BSD-3-Clause */
/* walk.c: see walk.h. */
#include "walk.h"

#include "scan.h"

#include <string.h>

static hs_status
gather_run(hs_walker *walker, int32_t si, int32_t end, const double *shift, const int32_t *image)
{
    while (si < end) {
        if (hs_block_is_full(&walker->block)) {
            const hs_status status = hs_scan_block(walker);
            if (status != HS_OK) {
                return status;
            }
        }
        si += hs_block_append(&walker->block, si, end, walker->search->scene.ndim, shift, image,
                              &walker->group);
    }
    return HS_OK;
}

/*
 * Gather cells low to high of the link's row, leaving out points before `from` of the image 0 (the
 * own row). Along a periodic first axis the cells may run over several images.
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
        return gather_run(walker, first > from ? first : from, end, link->shift, link->image);
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
        const hs_status status = gather_run(walker, turn == 0 && first < from ? from : first, end,
                                            shift, image);
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

static void
keep_largest(int64_t found, int64_t *largest)
{
    *largest = found > *largest ? found : *largest;
}

/* Visit a group of the row that the links belong to. */
static hs_status
visit_group(hs_walker *walker, const hs_row_group *group)
{
    const hs_search *search = walker->search;
    walker->n_groups += walker->use != HS_BLOCK_SIZES;
    walker->blocks = 0;
    walker->block.n = 0;
    walker->block.n_runs = 0;
    walker->block_is_first = !search->is_full;
    walker->of_group = (hs_neighbourhood){0, 0};
    hs_group_start(hs_search_asking(search), group->first, group->last, &walker->group);
    if ((search->is_full || walker->blocks_to_skip > 0) && walker->use != HS_BLOCK_SIZES) {
        hs_group_load(hs_search_asking(search), &walker->group);
    }
    for (int64_t l = 0; l < walker->n_links; l++) {
        hs_link *link = &walker->links[l];
        /* The own row comes first; in it each point meets only those that follow. */
        const hs_status status =
            gather_link(walker, link, group->x_first + link->first, group->x_last + link->last,
                        l == 0 && !search->is_full ? group->first : 0);
        if (status != HS_OK) {
            return status;
        }
    }
    const hs_status status = hs_scan_block(walker);
    walker->blocks_to_skip = 0;
    keep_largest(walker->of_group.candidates, &walker->most.candidates);
    keep_largest(walker->of_group.runs, &walker->most.runs);
    return status;
}

static void
set_links(hs_walker *walker, const hs_row *row)
{
    walker->work_since_poll += walker->search->stencil.n_rows;
    walker->n_links = hs_row_links(walker->search, row, walker->links, walker->hints);
}

/* Takes up a row at its first group. */
static void
open_row(hs_walker *walker, int64_t number)
{
    hs_row_open(walker->search, number, &walker->row);
    walker->row_number = number;
    walker->last_first = -1;
    walker->has_next = walker->row.first < walker->row.end;
    if (walker->has_next) {
        set_links(walker, &walker->row);
        walker->has_next = hs_row_next(walker->search, walker->target, &walker->row, &walker->next);
    }
}

/*
 * Groups of the row, as far as their first point is in [from, to). Goes on where the last range of
 * this row ended, so that many ranges in a long row do not step through it again and again.
 */
static hs_status
walk_row(hs_walker *walker, int64_t number, int32_t from, int32_t to)
{
    if (walker->row_number != number || from <= walker->last_first) {
        open_row(walker, number);
    }
    while (walker->has_next && walker->next.first < to) {
        const hs_row_group group = walker->next;
        walker->last_first = group.first;
        walker->has_next = hs_row_next(walker->search, walker->target, &walker->row, &walker->next);
        if (group.first >= from) {
            const hs_status status = visit_group(walker, &group);
            if (status != HS_OK) {
                return status;
            }
        }
    }
    return HS_OK;
}

hs_status
hs_walk(hs_walker *walker, int32_t first, int32_t end)
{
    const hs_search *search = walker->search;
    const int64_t    n_rows = hs_row_count(search);
    if (first >= end || (!walker->options.inclusive && walker->options.cutoff == 0.0)) {
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
        failure->row = walker->failed_point;
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
    walker->row_number = -1; /* its links are overwritten */
    set_links(walker, &row);
    return visit_group(walker, &group);
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
    const double most = most_candidates(search); /* a small scene gets a small block */
    return most < HS_BLOCK_CANDIDATES ? (int32_t)most + HS_GROUP_POINTS : HS_BLOCK_CANDIDATES;
}

bool
hs_walker_bound(const hs_search *search, hs_neighbourhood *most)
{
    const hs_grid *grid = &search->grid;
    const double   candidates = most_candidates(search);
    const bool     turns = search->scene.lattice.row_of_axis[0] >= 0;
    /* Of each row of the stencil, in each image along the first axis. */
    const double   runs = (double)search->stencil.n_rows *
                        (turns ? 2.0 * (double)(grid->reach[0] / grid->shape[0]) + 3.0 : 1.0);
    most->candidates = candidates < HS_BLOCK_CANDIDATES ? (int64_t)candidates : 0;
    most->runs = (int64_t)hs_smaller(runs, candidates);
    return candidates < HS_BLOCK_CANDIDATES;
}

bool
hs_walker_fits(hs_search *search, const hs_neighbourhood *most, double *bytes)
{
    const int ndim = search->scene.ndim, m = search->scene.lattice.n_periodic;
    /* What each takes at least, gathered, in order and traced. */
    const double each = (double)(sizeof(hs_unsure) + 2 * sizeof(uint64_t) + 3 * sizeof(int32_t)) +
                        (double)(ndim + 1) * sizeof(float) + (double)ndim * sizeof(double) +
                        (double)m * sizeof(int64_t);
    *bytes = (double)most->candidates * each;
    return most->candidates <= HS_ORDER_CANDIDATES &&
           hs_account_allows(&search->account, *bytes);
}

static hs_status
init_links(hs_search *search, hs_walker *walker)
{
    hs_account   *account = &search->account;
    const int64_t n = search->stencil.n_rows;
    walker->links = hs_alloc(account, HS_FOR_STENCIL, n, sizeof(hs_link));
    if (walker->links == NULL) {
        return HS_ERR_MEMORY;
    }
    if (search->is_sparse) {
        walker->hints = hs_alloc(account, HS_FOR_STENCIL, n, sizeof(int64_t));
        if (walker->hints == NULL) {
            return HS_ERR_MEMORY;
        }
        memset(walker->hints, 0, (size_t)n * sizeof(int64_t));
    }
    return HS_OK;
}

/* Everything but what the walker is asked to do. */
static hs_status
init_walker(hs_search *search, hs_block_use use, int32_t capacity, int32_t most_runs,
            hs_walker *walker)
{
    hs_account *account = &search->account;
    memset(walker, 0, sizeof *walker);
    walker->search = search;
    walker->options = search->options;
    walker->use = use;
    walker->target = hs_row_target(search, use == HS_BLOCK_SIZES);
    walker->extent = -1.0;
    walker->row_number = -1;
    walker->candidate_limit = INT64_MAX;
    hs_status status = init_links(search, walker);
    if (status == HS_OK) {
        status = hs_block_init(account, search->scene.ndim, use, capacity, most_runs,
                               &walker->block);
    }
    if (status == HS_OK) {
        status = hs_trace_init(search, &walker->block, use == HS_BLOCK_LISTS_PLACES,
                               &walker->trace);
        walker->trace.polls = &walker->options;
    }
    return status;
}

hs_status
hs_walker_init(hs_search *search, hs_block_use use, hs_visit_fn visit, void *context,
               hs_walker *walker)
{
    const int32_t   capacity = hs_walker_capacity(search);
    const hs_status status = init_walker(search, use, capacity,
                                         capacity < HS_BLOCK_RUNS ? capacity : HS_BLOCK_RUNS,
                                         walker);
    walker->visit = visit;
    walker->visit_context = context;
    if (status != HS_OK) {
        hs_walker_close(search, walker);
    }
    return status;
}

hs_status
hs_walker_init_ordered(hs_search *search, hs_block_use use, const hs_neighbourhood *most,
                       hs_visit_fn visit, void *context, hs_walker *walker)
{
    if (most->candidates > HS_ORDER_CANDIDATES) {
        memset(walker, 0, sizeof *walker);
        return HS_ERR_MEMORY;
    }
    /* One more of each: a block that is full is scanned before the next run. */
    hs_status status = init_walker(search, use, (int32_t)most->candidates + 1,
                                   (int32_t)most->runs + 1, walker);
    if (status == HS_OK) {
        status = hs_order_init(&search->account, &walker->block, &walker->order);
    }
    walker->is_ordered = true;
    walker->target = hs_row_target(search, true);
    walker->visit = visit;
    walker->visit_context = context;
    if (status != HS_OK) {
        hs_walker_close(search, walker);
    }
    return status;
}

void
hs_walker_close(hs_search *search, hs_walker *walker)
{
    const hs_counters walked = {.groups = walker->n_groups,
                                .candidates = walker->n_candidates,
                                .ambiguous = walker->n_ambiguous,
                                .by_float64 = walker->stages.by_float64,
                                .by_double_word = walker->stages.by_double_word,
                                .by_integers = walker->stages.by_integers};
    hs_search_note(search, &walked);
    walker->n_groups = walker->n_candidates = walker->n_ambiguous = 0;
    walker->stages = (hs_stages){0};
    hs_free(&search->account, walker->links);
    walker->links = NULL;
    hs_free(&search->account, walker->hints);
    walker->hints = NULL;
    hs_order_free(&search->account, &walker->block, &walker->order);
    hs_block_free(&search->account, &walker->block);
    hs_trace_free(&search->account, &walker->trace);
}
