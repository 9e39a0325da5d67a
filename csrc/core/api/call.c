/* SPDX-License-Identifier: BSD-3-Clause */
/* call.c: see call.h. */
#include "call.h"

#include "arguments.h"
#include "../search/estimate.h"
#include "../base/fpenv.h"
#include "../base/poll.h"

/* What the caller is told when memory is short. Where no pairs are kept their number is not why. */
static void
tell_shortage(const hs_request *request, const hs_search *search, hs_failure *failure)
{
    if (request->sets->keeps_none) {
        failure->limit_bytes = search->account.limit;
    } else {
        hs_shortage_of_search(request->sets->points, request->box, search, failure);
    }
}

hs_status
hs_request_use(const hs_request *request, hs_use_fn use, void *context, hs_failure *failure)
{
    hs_failure ignored;
    hs_search  search;
    int64_t    n_pairs = 0;
    failure = failure != NULL ? failure : &ignored;
    *failure = HS_NO_FAILURE;
    const hs_fpenv saved = hs_fpenv_enter();
    hs_status      status =
        hs_search_open(request->sets, request->box, request->options, &search, failure);
    if (status == HS_OK) {
        status = use(context, &search, &n_pairs, failure);
        hs_search_report(&search, n_pairs);
        hs_search_close(&search);
    }
    if (status == HS_ERR_MEMORY) {
        tell_shortage(request, &search, failure);
    }
    hs_account_close(&search.account);
    hs_fpenv_leave(saved);
    return status;
}

hs_status
hs_request_fill(const hs_request *request, hs_fill_fn fill, hs_pairs **result, hs_failure *failure)
{
    const hs_options *options = request->options;
    hs_failure        ignored;
    failure = failure != NULL ? failure : &ignored;
    *failure = HS_NO_FAILURE;
    hs_pairs *pairs = hs_pairs_new();
    if (pairs == NULL) {
        return hs_end_early(HS_ERR_MEMORY, options, failure);
    }
    hs_search     *search = &pairs->search;
    const hs_fpenv saved = hs_fpenv_enter();
    hs_status status = hs_search_open(request->sets, request->box, options, search, failure);
    if (status == HS_OK) {
        hs_output_init(&search->account, request->sets->points->ndim, options->want,
                       options->index_bytes, &pairs->output);
        if (options->out != NULL) {
            hs_output_fix(&pairs->output, options->out);
        }
        status = fill(pairs, failure);
        hs_search_report(search, pairs->output.n_pairs);
        hs_search_close(search);
    }
    if (status == HS_ERR_MEMORY) {
        tell_shortage(request, search, failure);
    }
    hs_fpenv_leave(saved);
    if (status != HS_OK) {
        hs_pairs_free(pairs);
        return status;
    }
    *result = pairs;
    return HS_OK;
}
