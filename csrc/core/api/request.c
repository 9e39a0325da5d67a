/* SPDX-License-Identifier: BSD-3-Clause */
/* request.c: checks, opens, uses and closes, in this order for every search. */
#include "request.h"

#include "api_cells.h"

#include "../search/estimate.h"
#include "../search/choice.h"
#include "../search/search_open.h"

/* Fills the failure when memory is short. Where no pairs are kept, their number is not the
 * reason. */
static void
tell_shortage(const hs_request *request, const hs_search *search, hs_failure *failure)
{
    if (request->sets.keeps_none) {
        failure->limit_bytes = search->call->account.limit;
    } else {
        hs_shortage_of_search(request->sets.points, request->box, search, failure);
    }
}

hs_request
hs_request_among(const hs_among *among, hs_list_kind kind, const hs_options *options)
{
    hs_request request = {.options = options};
    if (among == NULL || (kind == HS_HALF_LIST && among->queries != NULL)) {
        return request;
    }
    request.reach = among->reach;
    request.selection = among->selection;
    request.sets.queries = among->queries;
    request.sets.is_full = kind == HS_FULL_LIST || among->queries != NULL;
    if (among->cells == NULL) {
        request.sets.points = among->points;
        request.box = among->box;
    } else if (among->points == NULL && among->box == NULL) {
        const hs_cells *cells = among->cells;
        request.sets.points = &cells->points;
        request.sets.built = &cells->search;
        request.sets.trees = cells->trees;
        request.box = hs_cells_box(cells);
    }
    return request;
}

hs_status
hs_request_open(const hs_request *request, hs_call *call, hs_search *search, hs_failure *failure)
{
    const hs_options *options = request->options;
    hs_sets           sets = request->sets;
    hs_status         sound =
        sets.is_full ? hs_check_arguments(sets.points, sets.queries, request->box, options, failure)
                             : hs_check_half_list(sets.points, request->box, options, failure);
    if (request->reach != NULL) { /* which this search does not know */
        sound = HS_ERR_ARGUMENT;
    }
    if (sound == HS_OK && (options->want & HS_WANT_SHELL)) {
        sets.is_plain = true;
        sets.least_cutoff = hs_least_length(options->shells, options->n_shells);
    }
    if (sound == HS_OK) {
        sound = hs_choice_of_request(request, options->cutoff, call, failure);
    }
    if (sound != HS_OK) {
        hs_search_begin(call, search); /* an empty one */
        return sound;
    }
    sets.least_cutoff = hs_choice_least_length(call->choice, sets.least_cutoff);
    sound = hs_search_open(&sets, request->box, call, search, failure);
    if (sound != HS_OK) {
        hs_choice_close(call);
    }
    return sound;
}

hs_status
hs_choice_of_request(const hs_request *request, double cutoff, hs_call *call, hs_failure *failure)
{
    const hs_sets *sets = &request->sets;
    hs_status      status = hs_choice_open(request->selection, sets, call, failure);
    if (status == HS_OK) {
        status = hs_choice_set_scene(sets, request->box, cutoff, call, failure);
    }
    if (status != HS_OK) {
        hs_choice_close(call);
    }
    return status;
}

void
hs_request_close(hs_call *call, hs_search *search)
{
    hs_search_close(search);
    hs_choice_close(call);
}

hs_status
hs_request_use(const hs_request *request, hs_use_fn use, void *context, hs_failure *failure)
{
    hs_call   call;
    hs_search search;
    int64_t   n_pairs = 0;
    failure = hs_call_enter(request->options, failure, &call);
    hs_status status = hs_request_open(request, &call, &search, failure);
    if (status == HS_OK) {
        status = use(context, &search, &n_pairs, failure);
        hs_request_close(&call, &search);
    }
    if (status == HS_ERR_MEMORY) {
        tell_shortage(request, &search, failure);
    }
    hs_call_leave(&call, n_pairs);
    hs_account_close(&call.account);
    return status;
}

hs_pairs *
hs_pairs_begin(const hs_options *options, hs_failure **failure)
{
    hs_pairs *pairs = hs_pairs_new();
    if (pairs == NULL) {
        (void)hs_end_early(HS_ERR_MEMORY, options, *failure);
        return NULL;
    }
    *failure = hs_call_enter(options, *failure, &pairs->call);
    return pairs;
}

hs_options
hs_options_of_nearest(const hs_options *options)
{
    hs_options of_rows = *options;
    of_rows.sorted = false;
    of_rows.out = NULL;
    of_rows.precision = HS_EXACT;
    of_rows.want &= HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
    return of_rows;
}

hs_options
hs_options_of_count(const hs_options *options)
{
    hs_options counting = *options;
    counting.want = 0;
    counting.sorted = false;
    counting.out = NULL;
    return counting;
}

hs_status
hs_request_fill(const hs_request *request, hs_fill_fn fill, hs_pairs **result, hs_failure *failure)
{
    hs_search search;
    hs_pairs *pairs = hs_pairs_begin(request->options, &failure);
    if (pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_status status = hs_request_open(request, &pairs->call, &search, failure);
    if (status == HS_OK) {
        hs_pairs_open(pairs, search.scene.ndim);
        status = fill(&search, pairs, failure);
        hs_request_close(&pairs->call, &search);
    }
    if (status == HS_ERR_MEMORY) {
        tell_shortage(request, &search, failure);
    }
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}
