/* SPDX-License-Identifier: BSD-3-Clause */
/* api_pairs.c: the public searches: find and count. */
#include "../../halfshell.h"

#include "by_reach.h"
#include "reach_pairs.h"
#include "request.h"
#include "../search/estimate.h"
#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"

#include <math.h>

hs_options
hs_options_default(void)
{
    return (hs_options){.inclusive = true,
                        .want = HS_WANT_I | HS_WANT_J,
                        .index_bytes = 8,
                        .threads = 1,
                        .memory_limit = INFINITY};
}

/* Writes all pairs sorted. They are found in an output of their own, with the columns that sorting
 * needs besides. */
static hs_status
sort_pairs(hs_search *search, hs_output *output, hs_failure *failure)
{
    hs_output found;
    hs_output_init(&search->call->account, search->scene.ndim, hs_sort_columns(search), 4, &found);
    hs_status status = hs_record_all(search, &found, failure);
    if (status == HS_OK) {
        status = hs_sort_pairs(search->call, search->first_point, search->scene.n, &found, output);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)found.n_pairs;
    }
    hs_output_free(&found);
    return status;
}

/* A hs_fill_fn. */
static hs_status
fill_pairs(hs_search *search, hs_pairs *pairs, hs_failure *failure)
{
    hs_output *output = &pairs->output;
    hs_status  status = hs_estimate_by_sample(search, failure);
    if (status != HS_OK) {
        return status;
    }
    if (search->call->options.sorted) {
        status = sort_pairs(search, output, failure);
    } else {
        status = hs_record_all(search, output, failure);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)output->n_pairs);
    }
    return hs_pairs_conclude(output, status, failure);
}

hs_status
hs_pairs_find(const hs_among *among, const hs_options *options, hs_pairs **result,
              hs_failure *failure)
{
    const hs_request request = hs_request_among(among, HS_HALF_LIST, options);
    if (!hs_can_return(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    return request.reach != NULL ? hs_by_reach_pairs(&request, result, failure)
                                 : hs_request_fill(&request, fill_pairs, result, failure);
}

/* A hs_use_fn: adds the number of pairs, each once; with queries, of all neighbours of each. */
static hs_status
count_pairs(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    const hs_status status = hs_parallel_count(search, n_pairs, failure);
    if (status == HS_OK) {
        *(int64_t *)context += *n_pairs;
    }
    return status;
}

hs_status
hs_pairs_count(const hs_among *among, const hs_options *options, int64_t *count,
               hs_failure *failure)
{
    if (count == NULL || options == NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options counting = hs_options_of_count(options);
    const hs_request request = hs_request_among(among, HS_HALF_OR_QUERIES, &counting);
    int64_t          n_pairs = 0;
    const hs_status  status = hs_by_reach_use(&request, count_pairs, &n_pairs, failure);
    *count = status == HS_OK ? n_pairs : *count;
    return status;
}
