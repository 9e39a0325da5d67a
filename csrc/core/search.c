/* SPDX-License-Identifier: BSD-3-Clause */
/* search.c: see search.h. */
#include "search.h"

#include "estimate.h"

#include <stddef.h>
#include <string.h>

#define POINTS_FOR_TEAM 20000

/* An hs_poll_fn: the caller's, counted. */
static bool
counted_poll(void *context, double fraction)
{
    hs_search *search = context;
    search->walked.polls++;
    return search->callers_poll(search->callers_context, fraction);
}

/*
 * Threads cost some ten microseconds each to start and to end. An explicit number is taken as it
 * is; -n means up to n where there are points enough that the work takes a millisecond.
 */
int
hs_search_threads(int64_t n_points, const hs_options *options)
{
    const int n = options->threads;
    return n < 0 ? (n_points >= POINTS_FOR_TEAM ? -n : 1) : n;
}

/* The dense grid, or where points crowd in few of its cells one that stores occupied cells only. */
static hs_status
choose_grid(hs_search *search, hs_failure *failure)
{
    hs_status status = hs_grid_init(&search->scene, &search->grid, failure);
    if (status == HS_OK) {
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

hs_status
hs_search_build(const hs_points *points, const hs_box *box, hs_search *search,
                hs_failure *failure)
{
    const hs_options *options = &search->options;
    hs_account       *account = &search->account;
    search->kernel = hs_kernel_select(options->kernel);
    if (search->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_status status =
        hs_scene_init(account, search->team, points, box, options, &search->scene, failure);
    if (status == HS_OK) {
        status = choose_grid(search, failure);
    }
    if (status == HS_OK) {
        status = hs_estimate_by_density(search, failure);
    }
    if (status == HS_OK) {
        status = hs_stencil_build(account, options, &search->scene, &search->grid,
                                  &search->stencil);
    }
    if (status == HS_OK) {
        status = search->is_sparse
                     ? hs_sparse_build(account, search->team, options, &search->scene,
                                       &search->grid, &search->sparse, &search->bins)
                     : hs_bins_build(account, search->team, options, &search->scene, &search->grid,
                                     &search->bins);
    }
    if (status == HS_OK) {
        search->n_in_all = points->n;
        search->filter_error = search->scene.x_error + search->grid.shift_error +
                               search->scene.formula_error;
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
hs_search_begin(const hs_options *options, hs_search *search)
{
    memset((char *)search + offsetof(hs_search, account), 0,
           sizeof *search - offsetof(hs_search, account));
    search->scene.cloud.block = search->scene.beside = NULL; /* freed also when never set */
    search->options = *options;
    if (options->poll != NULL) {
        search->callers_poll = options->poll;
        search->callers_context = options->poll_context;
        search->options.poll = counted_poll;
        search->options.poll_context = search;
    }
    hs_account_init(&search->account, options);
}

hs_status
hs_search_open(const hs_points *points, const hs_box *box, const hs_options *options,
               hs_search *search, hs_failure *failure)
{
    hs_search_begin(options, search);
    search->team = hs_team_create(hs_search_threads(points->n, options));
    const hs_status status = hs_search_build(points, box, search, failure);
    if (status == HS_ERR_MEMORY) {
        failure->limit_bytes = search->account.limit;
    }
    if (status != HS_OK) {
        hs_search_report(search, 0);
        hs_search_close(search);
    }
    return status;
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
    hs_scene_free(account, &search->scene);
    hs_stencil_free(account, &search->stencil);
    hs_bins_free(account, &search->bins);
    hs_sparse_free(account, &search->sparse);
    hs_team_free(search->team);
    search->team = NULL;
}
