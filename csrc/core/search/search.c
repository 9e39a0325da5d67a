/* SPDX-License-Identifier: BSD-3-Clause */
/* search.c: see search.h. */
#include "search.h"

#include "../api/call.h"
#include "estimate.h"

#include <stddef.h>
#include <string.h>

/* An hs_poll_fn: the caller's, counted. */
static bool
counted_poll(void *context, double fraction)
{
    hs_search *search = context;
    search->walked.polls++;
    return search->callers_poll(search->callers_context, fraction);
}

int
hs_search_threads(int64_t n_points, const hs_options *options)
{
    const int n = options->threads;
    const int most = n < 0 ? (n_points >= HS_POINTS_FOR_THREADS ? -n : 1) : n;
    return most < HS_MOST_THREADS ? most : HS_MOST_THREADS;
}

/* The dense grid, with cells as wide as the caller wants them or as is best. Where points crowd in
 * few of its cells one that stores occupied cells only, unless the caller has what he wants. */
static hs_status
choose_grid(hs_search *search, hs_failure *failure)
{
    const double wanted = search->options.cell_size;
    hs_status    status = HS_STATUS_END;
    bool         may_be_sparse = true;
    if (wanted > 0.0) {
        status = hs_grid_init_wide(&search->scene, hs_scale_apply(search->scene.scale, wanted),
                                   &search->grid, &may_be_sparse, failure);
    }
    if (status == HS_STATUS_END) {
        status = hs_grid_init(&search->scene, &search->grid, failure);
    }
    if (status == HS_OK && may_be_sparse) {
        const double width = hs_sparse_choose(&search->scene, &search->grid);
        const hs_grid dense = search->grid;
        search->is_sparse =
            width > 0.0 &&
            hs_sparse_grid(&search->scene, &dense, width, &search->grid) == HS_OK;
        if (!search->is_sparse) {
            search->grid = dense;
        }
    }
    return status;
}

/* Points into the cells of the grid. */
static hs_status
build_bins(hs_search *search, hs_scene *scene, hs_grid *grid, hs_sparse *sparse, hs_bins *bins)
{
    hs_account *account = &search->account;
    return search->is_sparse
               ? hs_sparse_build(account, search->team, &search->options, scene, grid, sparse, bins)
               : hs_bins_build(account, search->team, &search->options, scene, grid, bins);
}

hs_status
hs_search_bin_queries(hs_search *search, hs_scene *asking)
{
    hs_grid grid = search->grid; /* of which occupied cells are counted anew */
    return build_bins(search, asking, &grid, &search->query_sparse, &search->query_bins);
}

/* Grid, stencil and bins. */
static hs_status
build_cells(hs_search *search, hs_scene *asking, hs_failure *failure)
{
    hs_scene *scene = &search->scene;
    hs_status status = choose_grid(search, failure);
    if (status == HS_OK) {
        status = hs_estimate_by_density(search, failure);
    }
    if (status == HS_OK) {
        status = hs_stencil_build(&search->account, &search->options, scene, &search->grid,
                                  search->is_full, &search->stencil);
        if (status == HS_ERR_MEMORY) {
            failure->search_bytes = hs_stencil_bytes(&search->grid, search->is_full);
        }
    }
    if (status == HS_OK) {
        status = build_bins(search, scene, &search->grid, &search->sparse, &search->bins);
    }
    if (status == HS_OK && asking != NULL) {
        status = hs_search_bin_queries(search, asking);
    }
    return status;
}

void
hs_search_set_asking(const hs_sets *sets, hs_search *search)
{
    const int64_t n = sets->points->n;
    search->has_queries = sets->queries != NULL;
    search->keeps_none = sets->keeps_none;
    HS_ASSERT(sets->is_full || !search->has_queries);
    search->is_full = sets->is_full;
    search->n_in_all = search->has_queries ? sets->queries->n : n;
    search->pairs_per_half = !search->is_full ? 1.0
                             : n == 0         ? 0.0
                                              : 2.0 * (double)search->n_in_all / (double)n;
}

void
hs_search_settle(hs_search *search)
{
    search->filter_error = search->scene.x_error + search->grid.shift_error +
                           search->scene.formula_error;
}

hs_status
hs_search_build(const hs_sets *sets, const hs_box *box, hs_search *search, hs_failure *failure)
{
    const hs_options *options = &search->options;
    hs_scene          queries, *asking = sets->queries != NULL ? &queries : NULL;
    search->kernel = hs_kernel_select(options->kernel);
    if (search->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_search_set_asking(sets, search);
    hs_status status = hs_scene_init_sets(&search->account, search->team, sets, box, options,
                                          &search->scene, asking, failure);
    if (status == HS_OK) {
        status = build_cells(search, asking, failure);
        if (asking != NULL) {
            hs_scene_free(&search->account, asking);
        }
    }
    if (status == HS_OK) {
        hs_search_settle(search);
    }
    return status;
}

void
hs_search_renumber(int64_t first_point, int64_t n_points_in_all, hs_search *search)
{
    search->first_point = (int32_t)first_point;
    search->n_in_all = n_points_in_all;
    for (int64_t si = 0; si < search->bins.n; si++) {
        search->bins.order[si] += (int32_t)first_point;
    }
}

void
hs_search_set_poll(hs_poll_fn poll, void *context, hs_search *search)
{
    search->callers_poll = poll;
    search->callers_context = context;
    search->options.poll = poll != NULL ? counted_poll : NULL;
    search->options.poll_context = search;
}

void
hs_search_begin(const hs_options *options, hs_search *search)
{
    memset((char *)search + offsetof(hs_search, account), 0,
           sizeof *search - offsetof(hs_search, account));
    search->scene.cloud.block = search->scene.beside = NULL; /* freed also when never set */
    search->options = *options;
    hs_search_set_poll(options->poll, options->poll_context, search);
    hs_account_init(&search->account, options);
}

/* For the words on a search that was refused memory. */
static hs_status
tell_limit(const hs_search *search, hs_status status, hs_failure *failure)
{
    if (status == HS_ERR_MEMORY) {
        failure->limit_bytes = search->account.limit;
    }
    return status;
}

hs_status
hs_search_open(const hs_sets *sets, const hs_box *box, const hs_options *options,
               hs_search *search, hs_failure *failure)
{
    const hs_status sound = hs_check_arguments(sets->points, sets->queries, box, options, failure);
    if (sound != HS_OK) {
        hs_search_begin(options, search);
        hs_search_report(search, 0);
        return sound;
    }
    if (sets->built != NULL) {
        const hs_status status = hs_search_reuse(sets, options, search, failure);
        if (status != HS_STATUS_END) {
            return tell_limit(search, status, failure);
        }
    }
    hs_search_begin(options, search);
    const int64_t n_queries = sets->queries != NULL ? sets->queries->n : 0;
    search->team = hs_team_create(hs_search_threads(sets->points->n + n_queries, options));
    const hs_status status = hs_search_build(sets, box, search, failure);
    if (status != HS_OK) {
        hs_search_report(search, 0);
        hs_search_close(search);
    }
    return tell_limit(search, status, failure);
}

void
hs_search_note(hs_search *search, const hs_counters *walked)
{
    hs_counters *sum = &search->walked;
    sum->groups += walked->groups;
    sum->candidates += walked->candidates;
    sum->ambiguous += walked->ambiguous;
    sum->by_float64 += walked->by_float64;
    sum->by_double_word += walked->by_double_word;
    sum->by_integers += walked->by_integers;
    sum->polls += walked->polls;
}

void
hs_search_report(const hs_search *search, int64_t n_pairs)
{
    hs_counters *counters = search->options.counters;
    if (counters == NULL) {
        return;
    }
    *counters = search->walked;
    memcpy(counters->bytes, search->account.total.bytes, sizeof counters->bytes);
    counters->bytes_peak = search->account.total.bytes_peak;
    counters->pairs = n_pairs;
}

void
hs_search_close(hs_search *search)
{
    hs_account *account = &search->account;
    hs_stencil_free(account, &search->stencil);
    if (!search->is_borrowed) {
        hs_scene_free(account, &search->scene);
        hs_bins_free(account, &search->bins);
        hs_sparse_free(account, &search->sparse);
    }
    if (search->has_queries) {
        hs_bins_free(account, &search->query_bins);
        hs_sparse_free(account, &search->query_sparse);
    }
    hs_team_free(search->team);
    search->team = NULL;
}
