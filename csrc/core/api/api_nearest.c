/* SPDX-License-Identifier: BSD-3-Clause */
/* api_nearest.c: the public search for the k nearest points: prepares trees, then searches group by
 * group. */
#include "request.h"
#include "../nearest/nearest.h"

/* Room for k entries for each asking point. */
static hs_status
make_room(hs_nearest *near, int64_t n_asking, hs_failure *failure)
{
    const double n = (double)n_asking * (double)near->k;
    if (n < 0x1p62 && hs_output_reserve(near->rows, n_asking * near->k, 0.0) == HS_OK) {
        near->rows->n_pairs = n_asking * near->k;
        return HS_OK;
    }
    failure->expected_pairs = n;
    failure->expected_bytes = n * (double)hs_output_bytes_per_pair(near->rows);
    failure->limit_bytes = near->search->call->account.limit;
    return HS_ERR_MEMORY;
}

static hs_status
find_nearest(hs_nearest *near, const hs_sets *sets, const hs_box *box, hs_failure *failure)
{
    hs_search    *search = near->search;
    const int64_t n_asking = sets->queries != NULL ? sets->queries->n : sets->points->n;
    const double  limit = search->call->options.cutoff;
    hs_status     status = make_room(near, n_asking, failure);
    if (status == HS_OK) {
        status = hs_nearest_prepare(near, sets, box, limit, failure);
    }
    if (status == HS_OK) { /* rows are written in the order of the tree */
        status = hs_touch_output(search->call->team, &search->call->options, near->rows);
    }
    if (status == HS_OK) {
        status = hs_nearest_search(near, failure);
    }
    hs_call_tell_limit(search->call, status, failure);
    hs_nearest_release(near);
    hs_search_close(search);
    return status;
}

static hs_status
check_nearest(const hs_sets *sets, const hs_box *box, int64_t k, const hs_options *options,
              hs_failure *failure)
{
    const hs_status status = hs_check_arguments(sets->points, sets->queries, box, options, failure);
    if (status != HS_OK || k < 1) {
        return status != HS_OK ? status : HS_ERR_ARGUMENT;
    }
    if (!(options->cutoff >= 0.0)) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    return HS_OK;
}

hs_status
hs_nearest_find(const hs_among *among, int64_t k, const hs_options *options, hs_pairs **result,
                hs_failure *failure)
{
    hs_search  search;
    hs_request request = hs_request_among(among, HS_FULL_LIST, options);
    hs_sets   *sets = &request.sets;
    if (!hs_can_return(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    sets->is_plain = sets->is_wide = true;
    const hs_options of_rows = hs_options_of_nearest(options);
    hs_pairs        *rows = hs_pairs_begin(&of_rows, &failure);
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_search_begin(&rows->call, &search);
    hs_nearest near = {.search = &search,
                       .k = k,
                       .of_spot = k < INT32_MAX - 1 ? (int32_t)k + 1 : INT32_MAX,
                       .omits_self = sets->queries == NULL,
                       .rows = &rows->output};
    hs_status  status = request.reach == NULL && request.selection == NULL
                            ? check_nearest(sets, request.box, k, &of_rows, failure)
                            : HS_ERR_ARGUMENT; /* which this search knows neither of */
    if (status == HS_OK) {
        hs_pairs_open(rows, sets->points->ndim);
        status = find_nearest(&near, sets, request.box, failure);
    }
    return hs_pairs_finish(rows, status, rows->output.n_pairs, result);
}
