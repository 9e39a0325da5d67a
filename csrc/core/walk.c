/* SPDX-License-Identifier: BSD-3-Clause */
/* walk.c: see walk.h. */
#include "walk.h"

#include "decide.h"
#include "fpenv.h"
#include "poll.h"

#include <math.h>
#include <string.h>

/* Candidates between two calls of poll(): some milliseconds. */
#define POLL_WORK (INT64_C(1) << 21)

/*
 * Hits after which a scan stops, so that they can be written out. Measured: the stores of a short
 * burst drain to memory while the next one is scanned; with bursts of thousands the two take turns,
 * which costs up to 0.9 ns a pair.
 */
#define BURST 128

/* By one float32 comparison: nothing is decided again. */
static void
set_single(hs_walker *walker)
{
    const double cutoff = walker->search->scene.cutoff;
    const float  square = (float)(cutoff * cutoff);
    walker->direct.out = walker->options.inclusive ? square : nextafterf(square, -1.0f);
    walker->direct.in = INFINITY;
}

/* Thresholds for the present extent. A scaled cutoff may be known between bounds only. */
static void
set_thresholds(hs_walker *walker)
{
    const hs_scene *scene = &walker->search->scene;
    const double    extent = walker->extent, error = walker->search->filter_error;
    walker->direct = hs_thresholds_of(scene->ndim, scene->cutoff, extent, error);
    walker->expanded = hs_expanded_of(scene->ndim, scene->cutoff, extent, error);
    if (scene->extreme) {
        const double low = scene->cutoff_low;
        walker->direct.in =
            low > 0.0 ? hs_thresholds_of(scene->ndim, low, extent, error).in : -1.0f;
        walker->expanded.in =
            low > 0.0 ? hs_expanded_of(scene->ndim, low, extent, error).in : -INFINITY;
    }
}

/* Thresholds and form of the scan, by the size of the present group and block. */
static void
set_form(hs_walker *walker)
{
    const hs_kernel *kernel = walker->search->kernel;
    const bool       counts = walker->use == HS_BLOCK_COUNTS;
    const double     extent = hs_group_extent(&walker->group);
    if (extent == walker->extent) {
        return;
    }
    walker->extent = extent;
    walker->scan = counts ? kernel->count_direct : kernel->list_direct;
    if (walker->options.precision == HS_SINGLE) {
        set_single(walker);
        return;
    }
    set_thresholds(walker);
    if (hs_expanded_pays(walker->search->scene.cutoff, extent)) {
        walker->scan = counts ? kernel->count : kernel->list;
    }
}

/* The present block and group as a kernel sees them. */
static void
set_scan(const hs_walker *walker, hs_scan *scan)
{
    const hs_block *block = &walker->block;
    scan->ndim = walker->search->scene.ndim;
    for (int k = 0; k < scan->ndim; k++) {
        scan->y[k] = block->y[k];
        scan->q[k] = walker->group.q[k];
    }
    scan->label = walker->use == HS_BLOCK_LISTS_PLACES ? block->place : block->id;
    scan->n = block->n;
    scan->n_points = walker->group.last - walker->group.first;
    scan->triangular = walker->block_is_first;
    scan->norm = block->norm;
    scan->direct = walker->direct;
    scan->expanded = walker->expanded;
    scan->hits = block->hits;
    scan->unsure = block->unsure;
    scan->most_hits = block->most_hits;
    if (walker->use == HS_BLOCK_LISTS_IDS && block->n + BURST < scan->most_hits) {
        scan->most_hits = block->n + BURST;
    }
    scan->most_unsure = block->capacity;
}

/* The filter alone may flush; precision="single" is decided by it. */
static void
set_flushing(const hs_walker *walker, bool on)
{
    if (walker->flushes) {
        hs_fpenv_flush(on);
    }
}

static int32_t
run_scan(const hs_walker *walker, hs_scan *scan, int32_t first)
{
    set_flushing(walker, true);
    const int32_t next = walker->scan(scan, first);
    set_flushing(walker, false);
    return next;
}

/* Test every point of the group against the block, then empty the block. */
static hs_status
scan_block(hs_walker *walker)
{
    hs_block *block = &walker->block;
    int32_t   end[HS_GROUP_POINTS];
    hs_scan   scan;
    set_flushing(walker, true);
    hs_block_gather(&walker->search->bins, walker->search->kernel, walker->block_is_first, block,
                    &walker->group);
    set_flushing(walker, false);
    hs_trace_reset(&walker->trace);
    set_form(walker);
    set_scan(walker, &scan);
    const int64_t n_points = scan.n_points;
    const int64_t skipped = walker->block_is_first ? n_points * (n_points + 1) / 2 : 0;
    scan.end = end;
    for (int32_t first = 0, next; first < scan.n_points; first = next) {
        next = run_scan(walker, &scan, first);
        hs_status status = HS_OK;
        if (scan.n_unsure > 0 && walker->options.precision != HS_SINGLE) {
            status = hs_decide(walker, &scan, first, next);
        }
        walker->n_found += scan.n_hits;
        if (status == HS_OK && walker->visit != NULL && scan.n_hits > 0) {
            const int32_t si = walker->group.first + first;
            const hs_rows rows = {.n = next - first,
                                  .point = walker->search->bins.order + si,
                                  .end = end + first,
                                  .hits = scan.hits};
            status = walker->visit(walker->visit_context, walker, si, &rows);
        }
        if (status != HS_OK) {
            return status;
        }
    }
    walker->n_candidates += n_points * block->n - skipped;
    walker->work_since_poll += n_points * block->n;
    block->n = 0;
    block->n_runs = 0;
    walker->block_is_first = false;
    if (!walker->flushes && hs_fpenv_met_subnormal()) {
        walker->flushes = walker->options.precision != HS_SINGLE;
    }
    if (walker->n_candidates > walker->candidate_limit) {
        return HS_STATUS_END;
    }
    if (walker->work_since_poll > POLL_WORK) {
        walker->work_since_poll = 0;
        return hs_poll(&walker->options, hs_walk_fraction(walker));
    }
    return HS_OK;
}

static hs_status
gather_run(hs_walker *walker, int32_t si, int32_t end, const double *shift, const int32_t *image)
{
    while (si < end) {
        if (hs_block_is_full(&walker->block)) {
            const hs_status status = scan_block(walker);
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

/* Visit a group of the row that the links belong to. */
static hs_status
visit_group(hs_walker *walker, const hs_row_group *group)
{
    walker->n_groups++;
    walker->block.n = 0;
    walker->block.n_runs = 0;
    walker->block_is_first = true;
    hs_group_start(&walker->search->bins, group->first, group->last, &walker->group);
    for (int64_t l = 0; l < walker->n_links; l++) {
        hs_link *link = &walker->links[l];
        /* The own row comes first; in it each point meets only those that follow. */
        const hs_status status =
            gather_link(walker, link, group->x_first + link->first, group->x_last + link->last,
                        l == 0 ? group->first : 0);
        if (status != HS_OK) {
            return status;
        }
    }
    return scan_block(walker);
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
        walker->has_next = hs_row_next(walker->search, &walker->row, &walker->next);
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
        walker->has_next = hs_row_next(walker->search, &walker->row, &walker->next);
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

hs_status
hs_walker_init(hs_search *search, hs_block_use use, hs_visit_fn visit, void *context,
               hs_walker *walker)
{
    hs_account *account = &search->account;
    memset(walker, 0, sizeof *walker);
    walker->search = search;
    walker->options = search->options;
    walker->use = use;
    walker->visit = visit;
    walker->visit_context = context;
    walker->extent = -1.0;
    walker->row_number = -1;
    walker->candidate_limit = INT64_MAX;
    hs_status status = init_links(search, walker);
    if (status == HS_OK) {
        status = hs_block_init(account, search->scene.ndim, use, most_candidates(search),
                               &walker->block);
    }
    if (status == HS_OK) {
        status = hs_trace_init(search, &walker->block, use == HS_BLOCK_LISTS_PLACES,
                               &walker->trace);
    }
    if (status != HS_OK) {
        hs_walker_close(search, walker);
    }
    return status;
}

void
hs_walker_close(hs_search *search, hs_walker *walker)
{
    hs_counters *walked = &search->walked;
    walked->groups += walker->n_groups;
    walked->candidates += walker->n_candidates;
    walked->ambiguous += walker->n_ambiguous;
    walked->by_float64 += walker->stages.by_float64;
    walked->by_double_word += walker->stages.by_double_word;
    walked->by_integers += walker->stages.by_integers;
    walker->n_groups = walker->n_candidates = walker->n_ambiguous = 0;
    walker->stages = (hs_stages){0};
    hs_free(&search->account, walker->links);
    walker->links = NULL;
    hs_free(&search->account, walker->hints);
    walker->hints = NULL;
    hs_block_free(&search->account, &walker->block);
    hs_trace_free(&search->account, &walker->trace);
}
