/* SPDX-License-Identifier: BSD-3-Clause */
/* search.c: see search.h. */
#include "search.h"

#include "decide.h"
#include "estimate.h"
#include "focus.h"
#include "poll.h"

#include <math.h>
#include <string.h>

/* Candidates between two calls of poll(): some milliseconds. */
#define POLL_WORK (INT64_C(1) << 21)

static int64_t
floor_divide(int64_t a, int64_t b)
{
    const int64_t quotient = a / b;
    return quotient - (a % b != 0 && (a < 0) != (b < 0));
}

/* An hs_poll_fn: the caller's, counted. */
static bool
counted_poll(void *context, double fraction)
{
    hs_search *search = context;
    search->n_polls++;
    return search->callers_poll(search->callers_context, fraction);
}

hs_status
hs_search_poll(hs_search *search)
{
    search->work_since_poll = 0;
    return hs_poll(&search->options, search->fraction);
}

/* Float32 thresholds of the present block, by the precision that was asked for. */
static hs_thresholds
block_thresholds(const hs_search *search)
{
    const hs_scene *scene = &search->scene;
    hs_thresholds   thresholds;
    if (search->options.precision == HS_SINGLE) {
        const float square = (float)(scene->cutoff * scene->cutoff);
        thresholds.out = search->options.inclusive ? square : nextafterf(square, -1.0f);
        thresholds.in = INFINITY; /* nothing is decided again */
        return thresholds;
    }
    const double extent = hs_block_extent(&search->group, &search->block, scene->ndim);
    thresholds = hs_thresholds_of(scene->ndim, scene->cutoff, extent, search->filter_error);
    if (scene->extreme) { /* the scaled cutoff is only an upper bound */
        thresholds.in = scene->cutoff_low > 0.0
                            ? hs_thresholds_of(scene->ndim, scene->cutoff_low, extent,
                                               search->filter_error).in
                            : -1.0f;
    }
    return thresholds;
}

/* Scan point t of the group, decide what is ambiguous, and leave the hits in block.hits. */
static hs_status
scan_point(hs_search *search, const hs_candidates *by_id, const hs_candidates *by_place,
           hs_thresholds thresholds, int32_t t, int32_t *n_hits)
{
    const float     *q = search->group.q[t];
    const int32_t    first = search->block_is_first ? t + 1 : 0;
    const int32_t    last = search->block.n;
    int32_t         *hits = search->block.hits;
    const hs_scan_fn scan = search->options.precision == HS_SINGLE ? search->kernel->unfused
                                                                   : search->kernel->scan;
    bool ambiguous = false;
    *n_hits = 0;
    if (first >= last) {
        return HS_OK;
    }
    search->n_candidates += last - first;
    search->work_since_poll += last - first;
    *n_hits = scan(search->lists_places ? by_place : by_id, first, last, q, thresholds,
                   search->scene.ndim, hits, &ambiguous);
    if (!ambiguous || search->options.precision == HS_SINGLE) {
        return HS_OK;
    }
    if (!search->lists_places) {
        *n_hits = scan(by_place, first, last, q, thresholds, search->scene.ndim, hits, &ambiguous);
    }
    const hs_status status = hs_decide_hits(search, t, thresholds, n_hits);
    if (!search->lists_places) {
        for (int32_t h = 0; h < *n_hits; h++) {
            hits[h] = search->block.id[hits[h]];
        }
    }
    return status;
}

/* Test every point of the group against the block, then empty the block. */
static hs_status
scan_block(hs_search *search)
{
    hs_block           *block = &search->block;
    hs_candidates       by_id = {.label = block->id}, by_place = {.label = block->place};
    const hs_thresholds thresholds = block_thresholds(search);
    block->runs[block->n_runs].at = block->n;
    for (int k = 0; k < search->scene.ndim; k++) {
        by_id.y[k] = by_place.y[k] = block->y[k];
    }
    for (int32_t t = 0; t < search->group.last - search->group.first; t++) {
        int32_t   n_hits;
        hs_status status = scan_point(search, &by_id, &by_place, thresholds, t, &n_hits);
        if (status == HS_OK && n_hits > 0) {
            status = search->visit(search->visit_context, search, search->group.first + t, n_hits);
        }
        if (status != HS_OK) {
            search->failed_point = search->bins.order[search->group.first + t];
            return status;
        }
    }
    block->n = 0;
    block->n_runs = 0;
    search->block_is_first = false;
    return search->work_since_poll > POLL_WORK ? hs_search_poll(search) : HS_OK;
}

static hs_status
gather_run(hs_search *search, int32_t si, int32_t end, const double *shift, const int32_t *image)
{
    while (si < end) {
        if (hs_block_is_full(&search->block)) {
            const hs_status status = scan_block(search);
            if (status != HS_OK) {
                return status;
            }
        }
        si += hs_block_append(&search->bins, &search->group, si, end, shift, image,
                              &search->block);
    }
    return HS_OK;
}

/*
 * Gather what the link's row has for a group in cell x, leaving out points before `from` of the
 * image 0 (the own row). Along a periodic first axis the range of cells may run over several
 * images.
 */
static hs_status
gather_link(hs_search *search, const hs_link *link, int64_t x, int32_t from)
{
    const hs_lattice *lattice = &search->scene.lattice;
    const int32_t    *start = search->bins.start + link->base;
    const int64_t     n_x = search->grid.shape[0];
    const int         row = lattice->row_of_axis[0];
    const int64_t     low = x + link->first, high = x + link->last;
    if (row < 0 && (high < 0 || low >= n_x)) {
        return HS_OK;
    }
    if (row < 0 || (low >= 0 && high < n_x)) {
        const int32_t first = start[low > 0 ? low : 0];
        const int32_t end = start[high < n_x ? high + 1 : n_x];
        return gather_run(search, first > from ? first : from, end, link->shift, link->image);
    }
    for (int64_t turn = floor_divide(low, n_x); turn * n_x <= high; turn++) {
        const int64_t begin = low - turn * n_x, end = high - turn * n_x;
        double        shift[HS_MAX_DIM];
        int32_t       image[HS_MAX_DIM];
        memcpy(image, link->image, sizeof image);
        image[row] = (int32_t)turn;
        for (int k = 0; k < search->scene.ndim; k++) {
            shift[k] = link->shift[k] + (double)turn * lattice->rows[row][k];
        }
        const int32_t first = start[begin > 0 ? begin : 0];
        const hs_status status =
            gather_run(search, turn == 0 && first < from ? from : first,
                       start[end < n_x ? end + 1 : n_x], shift, image);
        if (status != HS_OK) {
            return status;
        }
    }
    return HS_OK;
}

/* Visit points [first, last) of the cell at x in the row that the links belong to. */
static hs_status
visit_group(hs_search *search, int64_t x, int32_t first, int32_t last)
{
    search->n_groups++;
    search->block.n = 0;
    search->block.n_runs = 0;
    search->block_is_first = true;
    hs_group_set(&search->bins, first, last, &search->group);
    for (int64_t l = 0; l < search->n_links; l++) {
        /* The own row comes first; in it each point meets only those that follow. */
        const hs_status status =
            gather_link(search, &search->links[l], x, l == 0 ? first : 0);
        if (status != HS_OK) {
            return status;
        }
    }
    return scan_block(search);
}

/* Settle which rows neighbour the row with these cell indices (index[0] unused). */
static void
set_links(hs_search *search, const int64_t *index)
{
    const hs_lattice *lattice = &search->scene.lattice;
    const hs_grid    *grid = &search->grid;
    search->n_links = 0;
    search->work_since_poll += search->stencil.n_rows;
    for (int64_t s = 0; s < search->stencil.n_rows; s++) {
        const hs_stencil_row *row = &search->stencil.rows[s];
        hs_link              *link = &search->links[search->n_links];
        bool                  exists = true;
        *link = (hs_link){.first = row->first, .last = row->last};
        for (int k = 1; k < grid->ndim; k++) {
            int64_t   cell = index[k] + row->offset[k];
            const int b = lattice->row_of_axis[k];
            if (cell < 0 || cell >= grid->shape[k]) {
                if (b < 0) {
                    exists = false;
                    break;
                }
                const int64_t turn = floor_divide(cell, grid->shape[k]);
                cell -= turn * grid->shape[k];
                link->image[b] = (int32_t)turn;
                for (int c = 0; c < grid->ndim; c++) {
                    link->shift[c] += (double)turn * lattice->rows[b][c];
                }
            }
            link->base += cell * grid->stride[k];
        }
        const int32_t *start = search->bins.start + link->base;
        search->n_links += exists && (s == 0 || start[0] < start[grid->shape[0]]);
    }
}

static hs_status
visit_row(hs_search *search, const int64_t *index, const int32_t *start)
{
    set_links(search, index);
    for (int64_t x = 0; x < search->grid.shape[0]; x++) {
        const int32_t end = start[x + 1];
        for (int32_t first = start[x], last; first < end; first = last) {
            last = end - first > HS_GROUP_POINTS ? first + HS_GROUP_POINTS : end;
            const hs_status status = visit_group(search, x, first, last);
            if (status != HS_OK) {
                return status;
            }
            search->fraction = (double)last / (double)search->bins.n;
        }
    }
    return HS_OK;
}

hs_status
hs_search_walk(hs_search *search, hs_visit_fn visit, void *context)
{
    const hs_grid *grid = &search->grid;
    int64_t        index[HS_MAX_DIM] = {0};
    search->visit = visit;
    search->visit_context = context;
    if (!search->options.inclusive && search->options.cutoff == 0.0) {
        return HS_OK; /* no distance is below zero */
    }
    for (int64_t cell = 0; cell < grid->n_cells; cell += grid->shape[0]) {
        const int32_t *start = search->bins.start + cell;
        if (start[0] < start[grid->shape[0]]) {
            const hs_status status = visit_row(search, index, start);
            if (status != HS_OK) {
                return status;
            }
        }
        for (int k = 1; k < grid->ndim && ++index[k] == grid->shape[k]; k++) {
            index[k] = 0;
        }
    }
    return HS_OK;
}

hs_status
hs_search_point(hs_search *search, int32_t si, hs_visit_fn visit, void *context)
{
    int64_t index[HS_MAX_DIM];
    double  x[HS_MAX_DIM];
    for (int k = 0; k < search->scene.ndim; k++) {
        x[k] = search->bins.x[k][si];
    }
    for (int k = 0; k < search->scene.ndim; k++) {
        const double t = hs_lattice_coordinate(&search->scene.lattice, x, k);
        index[k] = hs_grid_index(&search->grid, k, t);
    }
    search->visit = visit;
    search->visit_context = context;
    set_links(search, index);
    return visit_group(search, index[0], si, si + 1);
}

hs_status
hs_search_open(const hs_points *points, const hs_box *box, const hs_options *options,
               hs_search *search, hs_failure *failure)
{
    memset(search, 0, sizeof *search);
    search->options = *options;
    if (options->poll != NULL) {
        search->callers_poll = options->poll;
        search->callers_context = options->poll_context;
        search->options.poll = counted_poll;
        search->options.poll_context = search;
    }
    options = &search->options;
    hs_account_init(&search->account, options);
    search->kernel = hs_kernel_select(options->kernel);
    if (search->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_account *account = &search->account;
    hs_status   status =
        hs_scene_init(account, points, box, options, &search->scene, failure);
    if (status == HS_OK) {
        hs_focus_ranges(&search->scene);
        status = hs_grid_init(&search->scene, &search->grid, failure);
    }
    if (status == HS_OK) {
        status = hs_estimate_by_density(search, failure);
    }
    if (status == HS_OK) {
        status = hs_stencil_build(account, options, &search->scene, &search->grid,
                                  &search->stencil);
    }
    if (status == HS_OK) {
        search->links = hs_alloc(account, HS_FOR_STENCIL, search->stencil.n_rows, sizeof(hs_link));
        status = search->links == NULL ? HS_ERR_MEMORY : HS_OK;
    }
    if (status == HS_OK) {
        status = hs_bins_build(account, options, &search->scene, &search->grid, &search->bins);
    }
    if (status == HS_OK) {
        status = hs_block_init(account, points->ndim, &search->block);
    }
    if (status != HS_OK) {
        hs_search_report(search, 0);
        hs_search_close(search);
        return status;
    }
    search->filter_error = search->scene.x_error + search->grid.shift_error +
                           search->scene.formula_error;
    return HS_OK;
}

void
hs_search_report(const hs_search *search, int64_t n_pairs)
{
    hs_counters *counters = search->options.counters;
    if (counters == NULL) {
        return;
    }
    *counters = search->account.total;
    counters->groups = search->n_groups;
    counters->candidates = search->n_candidates;
    counters->pairs = n_pairs;
    counters->ambiguous = search->n_ambiguous;
    counters->by_float64 = search->stages.by_float64;
    counters->by_double_word = search->stages.by_double_word;
    counters->by_integers = search->stages.by_integers;
    counters->polls = search->n_polls;
}

void
hs_search_close(hs_search *search)
{
    hs_account *account = &search->account;
    hs_scene_free(account, &search->scene);
    hs_stencil_free(account, &search->stencil);
    hs_free(account, search->links);
    search->links = NULL;
    hs_bins_free(account, &search->bins);
    hs_block_free(account, search->scene.ndim, &search->block);
}
