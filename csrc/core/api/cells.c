/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"
#include "../base/sort.h"

#include <math.h>
#include <string.h>

/* cells.c: the public functions of cells: points that are copied, sorted once and searched many
 * times. */

hs_status
hs_cells_build(const hs_points *points, const hs_box *box, const hs_options *options,
               hs_cells **result, hs_failure *failure)
{
    if (result != NULL) {
        *result = NULL;
    }
    if (result == NULL || options == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_cells *cells = hs_alloc(NULL, HS_FOR_CELLS, 1, sizeof *cells);
    if (cells == NULL) {
        return hs_end_early(HS_ERR_MEMORY, options, failure);
    }
    hs_options of_cells = *options;
    hs_call   *call = &cells->call;
    cells->copy = NULL;
    cells->trees = hs_nearest_kept_new();
    cells->has_box = box != NULL;
    if (box != NULL) {
        cells->box = *box;
    }
    of_cells.want = HS_WANT_SHIFT; /* they keep all that a later search may want */
    of_cells.out = NULL;
    of_cells.domain = NULL; /* borrowed for this call */
    failure = hs_call_enter(&of_cells, failure, call);
    call->account.is_kept = true;
    hs_search_begin(call, &cells->search);
    hs_status status = hs_check_sets(points, NULL, hs_cells_box(cells), failure);
    if (status == HS_OK) {
        status = hs_check_options(&of_cells, HS_WANT_ALL);
    }
    for (int k = 0; status == HS_OK && options->domain != NULL && k < points->ndim; k++) {
        const double low = options->domain[k], high = options->domain[points->ndim + k];
        if (!(low > high) && !(low <= high && isfinite(low) && isfinite(high))) {
            status = HS_ERR_ARGUMENT; /* low > high: an axis that does not matter */
        }
    }
    if (status == HS_OK) {
        /* The points in memory of the cells: the caller cannot change them between searches. */
        const int64_t width = points->ndim * (int64_t)sizeof(double);
        cells->copy = hs_alloc(&call->account, HS_FOR_ORIGINALS, points->n, (size_t)width);
        status = cells->copy != NULL ? HS_OK : HS_ERR_MEMORY;
        cells->points = (hs_points){.data = cells->copy,
                                    .n = points->n,
                                    .ndim = points->ndim,
                                    .real = HS_FLOAT64,
                                    .row_stride = (ptrdiff_t)width,
                                    .column_stride = sizeof(double)};
    }
    if (status == HS_OK) {
        hs_points_copy(points, cells->copy);
        /* keeps_none: no pairs are kept by this call */
        const hs_sets sets = {.points = &cells->points,
                              .is_kept = true,
                              .keeps_none = true,
                              .domain = options->domain};
        hs_call_gather(call, points->n / HS_POINTS_MADE_READY);
        status = hs_search_build(&sets, hs_cells_box(cells), &cells->search, failure);
    }
    if (status == HS_OK && cells->trees == NULL) {
        status = HS_ERR_MEMORY;
    }
    hs_call_tell_limit(call, status, failure);
    hs_call_leave(call, 0);
    hs_call_detach(call);
    if (status == HS_OK) {
        *result = cells;
    } else {
        hs_cells_free(cells);
    }
    return status;
}

void
hs_cells_free(hs_cells *cells)
{
    if (cells == NULL) {
        return;
    }
    hs_search_close(&cells->search);
    hs_free(&cells->call.account, cells->copy);
    hs_account_close(&cells->call.account);
    hs_nearest_kept_free(cells->trees);
    hs_free(NULL, cells);
}

void
hs_cells_points(const hs_cells *cells, hs_points *points)
{
    if (points != NULL) {
        *points = cells != NULL ? cells->points : (hs_points){.data = NULL};
    }
}

const hs_box *
hs_cells_box(const hs_cells *cells)
{
    return cells != NULL && cells->has_box ? &cells->box : NULL;
}

/* The public functions that tell which cells there are, and which of them a point is in. */

void
hs_cells_layout(const hs_cells *cells, hs_layout *layout)
{
    if (layout == NULL) {
        return;
    }
    if (cells == NULL) {
        *layout = (hs_layout){.ndim = 0};
        return;
    }
    const hs_search *search = &cells->search;
    const hs_grid   *grid = &search->grid;
    *layout = (hs_layout){.ndim = grid->ndim,
                          .n_points = search->bins.n,
                          .n_cells = grid->n_cells,
                          .occupied_only = search->is_sparse,
                          .start = search->bins.start,
                          .order = search->bins.order};
    const hs_fpenv saved = hs_fpenv_enter();
    for (int k = 0; k < grid->ndim; k++) {
        layout->shape[k] = grid->shape[k];
        layout->cell_size[k] = search->scene.in_one_cell
                                   ? INFINITY
                                   : hs_scale_apply(search->scene.unscale, grid->cell_size[k]);
    }
    hs_fpenv_leave(saved);
}

hs_status
hs_cells_find(const hs_cells *cells, const hs_points *points, int64_t *cell, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    hs_call          call;
    hs_scene         scene;
    if (cells == NULL || points == NULL || !hs_has_entries(cell, points)) {
        return hs_end_early(HS_ERR_ARGUMENT, NULL, failure);
    }
    const hs_search *search = &cells->search;
    failure = hs_call_enter(&options, failure, &call);
    hs_status status = hs_check_sets(&cells->points, points, NULL, failure);
    if (status == HS_OK) {
        status = hs_scene_from_kept(&call.account, NULL, &search->scene, points, &options, true,
                                    &scene, failure);
    }
    if (status == HS_OK) {
        int64_t hint = 0;
        for (int64_t i = 0; i < points->n; i++) {
            int64_t index[HS_MAX_DIM];
            cell[i] = 0;
            for (int k = 0; k < scene.ndim; k++) {
                const double t = hs_scene_coordinate(&scene, i, k);
                index[k] = search->is_sparse ? hs_sparse_index(&search->grid, k, t)
                                             : hs_grid_index(&search->grid, k, t);
                cell[i] += index[k] * search->grid.stride[k];
            }
            if (search->is_sparse) {
                hs_sparse_cursor cursor = {0, 0};
                int32_t          first = 0, end = 0;
                const int64_t    row = hs_sparse_find_row(&search->bins, index, &hint);
                if (row >= 0) {
                    hs_sparse_window(&search->bins, row, index[0], index[0], &cursor, &first, &end);
                }
                cell[i] = end > first ? cursor.low : -1; /* -1: empty cells are not stored */
            }
        }
        hs_scene_free(&call.account, &scene);
    }
    hs_call_leave(&call, 0);
    hs_account_close(&call.account);
    return status;
}

void
hs_cells_indices(const hs_cells *cells, int64_t *indices)
{
    if (cells == NULL || indices == NULL) {
        return;
    }
    const hs_search *search = &cells->search;
    const hs_bins   *bins = &search->bins;
    const int        d = search->grid.ndim;
    if (search->is_sparse) {
        for (int64_t row = 0; row < bins->n_rows; row++) {
            for (int64_t c = bins->row_cell[row]; c < bins->row_cell[row + 1]; c++) {
                indices[c * d] = bins->cell_x[c];
                memcpy(indices + c * d + 1, bins->row_index + row * (d - 1),
                       (size_t)(d - 1) * sizeof *indices);
            }
        }
        return;
    }
    for (int64_t c = 0; c < search->grid.n_cells; c++) {
        for (int k = 0; k < d; k++) {
            indices[c * d + k] = c / search->grid.stride[k] % search->grid.shape[k];
        }
    }
}

/* Which points the cells around a query hold, without a distance test. */

/* Ranges of points in cell order, of one query after the other. */
typedef struct range_list {
    const hs_search *search;
    hs_link         *links;
    int64_t         *hints;
    int64_t         *next; /* of each query: where its next range goes, or their number so far */
    int64_t         *first, *end;  /* NULL: ranges are counted */
    int64_t          si, unpolled; /* the query, in cell order; work since the last poll */
} range_list;

/* Polls after so much more work: rows of cells, of which there may be thousands for one query, and
 * images of them, of which there may be millions. */
static hs_status
poll_sometimes(range_list *list, int64_t work)
{
    const hs_search *search = list->search;
    list->unpolled += work;
    if (list->unpolled < HS_POLL_POINTS) {
        return HS_OK;
    }
    list->unpolled = 0;
    return hs_poll(&search->call->options, (double)list->si / (double)hs_search_asking(search)->n);
}

/* Cells low to high of the link's row; along a periodic first axis they may run over images: as
 * many as the reach has, below 2^32. */
static hs_status
add_window(range_list *list, int64_t query, hs_link *link, int64_t low, int64_t high)
{
    const hs_search *search = list->search;
    const int64_t    n_x = search->grid.shape[0];
    const bool       repeats = search->scene.lattice.row_of_axis[0] >= 0;
    int64_t          turn = repeats ? hs_floor_divide(low, n_x) : 0;
    hs_status        status;
    do {
        int32_t first, end;
        hs_link_window(search, link, low - turn * n_x, high - turn * n_x, &first, &end);
        if (first < end) {
            const int64_t at = list->next[query]++;
            if (list->first != NULL) {
                list->first[at] = first;
                list->end[at] = end;
            }
        }
        status = poll_sometimes(list, 1);
        turn++;
    } while (status == HS_OK && repeats && turn * n_x <= high);
    return status;
}

/* Whether a query lies further beyond an open face than any point can be within the cutoff. */
static bool
is_far_outside(const hs_search *search, int64_t si)
{
    const hs_scene *scene = &search->scene;
    double          x[HS_MAX_DIM];
    for (int c = 0; c < scene->ndim; c++) {
        x[c] = hs_search_asking(search)->x[c][si];
    }
    for (int k = 0; k < scene->ndim; k++) {
        const double t = hs_lattice_coordinate(&scene->lattice, x, k);
        const double reach = scene->radius * (1.0 + HS_GRID_SLACK) + 2.0 * scene->t_error[k];
        if (scene->lattice.row_of_axis[k] < 0 &&
            (t - scene->upper[k] > reach || scene->lower[k] - t > reach)) {
            return true;
        }
    }
    return false;
}

static hs_status
add_queries(range_list *list)
{
    const hs_search *search = list->search;
    const hs_bins   *asking = hs_search_asking(search);
    hs_status        status = HS_OK;
    list->unpolled = HS_POLL_POINTS;
    for (int64_t si = 0; status == HS_OK && si < asking->n; si++) {
        hs_row          row;
        hs_sparse_group group;
        int64_t         n_links = 0;
        list->si = si;
        status = poll_sometimes(list, 1);
        if (status != HS_OK || is_far_outside(search, si)) {
            continue;
        }
        hs_row_open_at(search, (int32_t)si, &row, &group);
        status =
            hs_row_links(search, &search->call->options, &row, list->links, list->hints, &n_links);
        list->unpolled += search->stencil.n_rows;
        for (int64_t l = 0; status == HS_OK && l < n_links; l++) {
            hs_link *link = &list->links[l];
            status = add_window(list, asking->order[si], link, group.x_first + link->first,
                                group.x_last + link->last);
        }
    }
    return status;
}

hs_status
hs_cells_candidates(const hs_cells *cells, const hs_points *queries, const hs_options *options,
                    hs_pairs **result, hs_failure *failure)
{
    hs_status status;
    hs_pairs *rows = hs_result_begin(cells != NULL, options, result, &failure, &status);
    if (rows == NULL) {
        return status;
    }
    hs_search     search;
    hs_call      *call = &rows->call;
    hs_account   *account = &call->account;
    const hs_sets sets = {.points = &cells->points,
                          .queries = queries,
                          .built = &cells->search,
                          .is_full = true,
                          .is_untested = true,
                          /* no pairs; the ranges are allocated when their number is known */
                          .keeps_none = true};
    status = hs_check_sets(&cells->points, queries, NULL, failure);
    if (status == HS_OK) {
        status = hs_check_options(&call->options, HS_WANT_ALL);
    }
    if (status == HS_OK) {
        call->options.precision = cells->call.options.precision; /* no pair is decided on */
        status = hs_search_reuse(&sets, call, &search, failure);
    }
    if (status == HS_OK) {
        const int64_t n = hs_search_asking(&search)->n, n_links = search.stencil.n_rows;
        range_list    list = {.search = &search};
        int64_t      *offsets;
        hs_output_init(account, cells->points.ndim, HS_WANT_I | HS_WANT_J, 8, &rows->output);
        list.links = hs_alloc(account, HS_FOR_STENCIL, n_links, sizeof *list.links);
        list.hints = hs_alloc(account, HS_FOR_STENCIL, n_links, sizeof *list.hints);
        status = HS_ERR_MEMORY;
        if (list.links != NULL && list.hints != NULL) {
            memset(list.hints, 0, (size_t)n_links * sizeof *list.hints);
            status = hs_output_open_offsets(account, n + 1, &rows->offsets, &offsets);
        }
        if (status == HS_OK) { /* counts the ranges of each query, and then fills them */
            memset(offsets, 0, (size_t)(n + 1) * sizeof *offsets);
            list.next = offsets + 1;
            status = add_queries(&list);
        }
        if (status == HS_OK) {
            hs_starts_of_lengths(offsets, n + 1);
            failure->search_bytes = (double)offsets[n] * 2.0 * sizeof(int64_t);
            status = hs_output_reserve(&rows->output, offsets[n], 0.0);
        }
        if (status == HS_OK) {
            rows->output.n_pairs = offsets[n];
            list.next = offsets;
            list.first = hs_output_column(&rows->output, HS_WANT_I);
            list.end = hs_output_column(&rows->output, HS_WANT_J);
            status = add_queries(&list);
            hs_starts_of_ends(offsets, n + 1);
        }
        hs_free(account, list.hints);
        hs_free(account, list.links);
        hs_search_close(&search);
    } else if (status == HS_REBUILD) {
        /* The cutoff is not that of the cells, or a query is too far from their points. */
        *failure = HS_NO_FAILURE;
        status = call->options.cutoff != cells->call.options.cutoff ? HS_ERR_CUTOFF : HS_ERR_FAR;
        if (status == HS_ERR_CUTOFF) {
            failure->value = call->options.cutoff;
        } else if (queries != NULL) {
            hs_scene_name_refused(&cells->search.scene, queries, failure);
        }
    }
    hs_call_tell_limit(call, status, failure);
    return hs_pairs_finish(rows, status, 0, result);
}
