/* SPDX-License-Identifier: BSD-3-Clause */
/* api_candidates.c: which points the cells around a query hold, without a distance test. */
#include "request.h"
#include "api_cells.h"
#include "../base/outcome.h"
#include "../base/poll.h"
#include "../search/cell_rows.h"
#include "../search/search_open.h"

#include <string.h>

/* Ranges of points in cell order, of one query after the other. */
typedef struct range_list {
    const hs_search *search;
    hs_link         *links;
    int64_t         *hints;
    const int64_t   *offsets; /* where the ranges of each query begin; NULL: they are counted */
    int64_t         *counts;
    int64_t         *first, *end;
    int64_t          si, unpolled; /* the query, in cell order; work since the last poll */
} range_list;

static void
add_range(range_list *list, int64_t query, int32_t first, int32_t end)
{
    if (first < end) {
        const int64_t at = list->counts[query]++;
        if (list->offsets != NULL) {
            list->first[list->offsets[query] + at] = first;
            list->end[list->offsets[query] + at] = end;
        }
    }
}

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
        add_range(list, query, first, end);
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
        hs_row       row;
        hs_row_group group;
        int64_t      n_links = 0;
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

/* Offsets from counts, which are zero again. */
static int64_t
sum_counts(int64_t n, int64_t *counts, int64_t *offsets)
{
    int64_t sum = 0;
    for (int64_t q = 0; q < n; q++) {
        offsets[q] = sum;
        sum += counts[q];
        counts[q] = 0;
    }
    offsets[n] = sum;
    return sum;
}

static hs_status
find_ranges(hs_pairs *rows, range_list *list, hs_failure *failure)
{
    const int64_t n = hs_search_asking(list->search)->n;
    int64_t      *offsets = NULL;
    hs_status     status = hs_output_reserve(&rows->offsets, n + 1, 0.0);
    if (status == HS_OK) {
        rows->offsets.n_pairs = n + 1;
        offsets = hs_output_column(&rows->offsets, HS_WANT_I);
        memset(list->counts, 0, (size_t)n * sizeof *list->counts);
        status = add_queries(list);
    }
    if (status == HS_OK) {
        const int64_t n_ranges = sum_counts(n, list->counts, offsets);
        failure->search_bytes = (double)n_ranges * 2.0 * sizeof(int64_t);
        status = hs_output_reserve(&rows->output, n_ranges, 0.0);
        rows->output.n_pairs = status == HS_OK ? n_ranges : 0;
    }
    if (status == HS_OK) {
        list->offsets = offsets;
        list->first = hs_output_column(&rows->output, HS_WANT_I);
        list->end = hs_output_column(&rows->output, HS_WANT_J);
        status = add_queries(list);
    }
    return status;
}

/* With an open search: allocates links and ranges, and fills the ranges. */
static hs_status
list_ranges(hs_search *search, hs_pairs *rows, hs_failure *failure)
{
    hs_account   *account = &search->call->account;
    const int64_t n = hs_search_asking(search)->n, n_links = search->stencil.n_rows;
    range_list    list = {.search = search};
    list.links = hs_alloc(account, HS_FOR_STENCIL, n_links, sizeof *list.links);
    list.hints = hs_alloc(account, HS_FOR_STENCIL, n_links, sizeof *list.hints);
    list.counts = hs_alloc(account, HS_FOR_INDICES, n, sizeof *list.counts);
    hs_status status = HS_ERR_MEMORY;
    if (list.links != NULL && list.hints != NULL && list.counts != NULL) {
        memset(list.hints, 0, (size_t)n_links * sizeof *list.hints);
        status = find_ranges(rows, &list, failure);
    }
    hs_free(account, list.counts);
    hs_free(account, list.hints);
    hs_free(account, list.links);
    return status;
}

/* Why the cells do not serve these queries at this cutoff. */
static hs_status
tell_unserved(const hs_cells *cells, const hs_points *queries, double cutoff, hs_failure *failure)
{
    *failure = HS_NO_FAILURE;
    if (cutoff != cells->call.options.cutoff) {
        failure->value = cutoff;
        return HS_ERR_CUTOFF;
    }
    if (queries != NULL) {
        hs_scene_name_refused(&cells->search.scene, queries, failure);
    }
    return HS_ERR_FAR;
}

static hs_status
find_candidates(const hs_cells *cells, const hs_points *queries, hs_pairs *rows,
                hs_failure *failure)
{
    hs_search search;
    hs_call  *call = &rows->call;
    hs_sets   sets = {
          .points = &cells->points, .queries = queries, .built = &cells->search, .is_full = true};
    sets.is_untested = true;
    sets.keeps_none = true; /* no pairs; the ranges are allocated when their number is known */
    hs_status status = hs_check_arguments(&cells->points, queries, NULL, &call->options, failure);
    if (status == HS_OK) {
        call->options.precision = cells->call.options.precision; /* no pair is decided on */
        status = hs_search_reuse(&sets, call, &search, failure);
    }
    if (status == HS_OK) {
        const int d = cells->points.ndim;
        hs_output_init(&call->account, d, HS_WANT_I | HS_WANT_J, 8, &rows->output);
        hs_output_init(&call->account, d, HS_WANT_I, 8, &rows->offsets);
        status = list_ranges(&search, rows, failure);
        hs_search_close(&search);
    } else if (status == HS_UNSERVED) {
        status = tell_unserved(cells, queries, call->options.cutoff, failure);
    }
    if (status != HS_OK) {
        failure->limit_bytes = status == HS_ERR_MEMORY ? call->account.limit : 0.0;
    }
    return status;
}

hs_status
hs_cells_candidates(const hs_cells *cells, const hs_points *queries, const hs_options *options,
                    hs_pairs **result, hs_failure *failure)
{
    if (!hs_can_return(result, options) || cells == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_pairs *rows = hs_pairs_begin(options, &failure);
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    const hs_status status = find_candidates(cells, queries, rows, failure);
    return hs_pairs_finish(rows, status, 0, result);
}
