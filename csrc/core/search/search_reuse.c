/* SPDX-License-Identifier: BSD-3-Clause */
/* search_reuse.c: a copy of the other search that borrows its arrays, with a reach and queries of
 * its own. */
#include "search_open.h"

#include "../base/outcome.h"

#include "estimate.h"

/* Scaled cutoffs as small as this keep all their digits. */
#define SMALLEST_CUTOFF 0x1p-500

/* Takes what is shared as the new search's own, and marks as borrowed what it must not free. */
static void
borrow(const hs_search *built, bool is_untested, hs_search *search)
{
    search->scene = built->scene;
    search->scene.is_untested = is_untested;
    search->grid = built->grid;
    search->bins = built->bins;
    search->sparse = built->sparse;
    search->is_sparse = built->is_sparse;
    search->is_borrowed = true;
}

/* Whether the scale of the cells keeps all digits of a length up to theirs. */
static bool
keeps_digits(const hs_search *built, double length)
{
    return length == 0.0 || hs_scale_apply(built->scene.scale, length) >= SMALLEST_CUTOFF;
}

/* Whether cells for one cutoff serve another, and a least one where there are several. What is kept
 * of the points depends on the precision that they were meant for. */
static bool
serves(const hs_search *built, const hs_options *options, double least_cutoff)
{
    const double before = built->call->options.cutoff, cutoff = options->cutoff;
    if (options->precision != built->call->options.precision || built->scene.in_one_cell) {
        return false;
    }
    if (built->scene.extreme) { /* digits are lost, and kept beside */
        return cutoff == before;
    }
    return keeps_digits(built, least_cutoff) &&
           (cutoff == before || (cutoff >= 0.0 && cutoff < before && keeps_digits(built, cutoff)));
}

/* Makes cells serve the cutoff of the options, and sorts the queries into them. */
static hs_status
adapt(const hs_sets *sets, hs_search *search, hs_failure *failure)
{
    const hs_options *options = &search->call->options;
    const double      before = search->scene.cutoff;
    hs_status         status = HS_OK;
    if (options->cutoff != sets->built->call->options.cutoff) {
        hs_scene_set_cutoff(&search->scene, options);
        status = hs_grid_narrow(&search->scene, search->is_sparse, before, &search->grid);
    }
    hs_scene_init_metric(&search->scene, options);
    hs_search_set_asking(sets, search);
    hs_search_settle(search);
    if (status == HS_OK) {
        status = hs_estimate_by_density(search, failure);
    }
    if (status == HS_OK) {
        status = hs_stencil_build(&search->call->account, options, &search->scene, &search->grid,
                                  search->is_full, &search->stencil);
    }
    return status;
}

static hs_status
take_queries(const hs_points *queries, hs_search *search, hs_failure *failure)
{
    hs_scene  asking;
    hs_status status = hs_scene_like(&search->call->account, search->call->team, &search->scene,
                                     queries, &search->call->options, &asking, failure);
    if (status == HS_OK) {
        status = hs_search_bin_queries(search, &asking);
        hs_scene_free(&search->call->account, &asking);
    }
    return status;
}

hs_status
hs_search_reuse(const hs_sets *sets, hs_call *call, hs_search *search, hs_failure *failure)
{
    const hs_search *built = sets->built;
    const int64_t    n_queries = sets->queries != NULL ? sets->queries->n : 0;
    if (!serves(built, &call->options, sets->least_cutoff)) {
        return HS_UNSERVED;
    }
    hs_search_begin(call, search);
    borrow(built, sets->is_untested, search);
    hs_call_gather(call, sets->points->n + n_queries);
    hs_status status = call->kernel == NULL ? HS_ERR_KERNEL : adapt(sets, search, failure);
    if (status == HS_OK && sets->queries != NULL) {
        status = take_queries(sets->queries, search, failure);
    }
    if (status != HS_OK) {
        hs_search_close(search);
        if (status == HS_UNSERVED) {
            hs_call_restart(call);
            failure->in_queries = false;
        }
    }
    return status;
}
