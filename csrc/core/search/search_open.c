/* SPDX-License-Identifier: BSD-3-Clause */
/* search_open.c: takes cells that were kept where they serve, and else makes new ones. */
#include "search_open.h"

#include "../base/outcome.h"

/* Shells, and threads for the walk where points alone were not worth them. */
static hs_status
finish(hs_search *search)
{
    hs_call *call = search->call;
    if (hs_shells_open(&call->account, &search->scene, &call->options, &search->shells) != HS_OK) {
        hs_search_close(search);
        return HS_ERR_MEMORY;
    }
    hs_call_gather_for(call, hs_search_asking(search)->n,
                       search->grid.expected_pairs * search->pairs_per_half);
    return HS_OK;
}

hs_status
hs_search_open(const hs_sets *sets, const hs_box *box, hs_call *call, hs_search *search,
               hs_failure *failure)
{
    hs_status status = HS_UNSERVED;
    if (sets->built != NULL) {
        status = hs_search_reuse(sets, call, search, failure);
    }
    if (status == HS_UNSERVED) {
        const int64_t n_queries = sets->queries != NULL ? sets->queries->n : 0;
        hs_search_begin(call, search);
        hs_call_gather(call, sets->points->n + n_queries);
        status = hs_search_build(sets, box, search, failure);
        if (status != HS_OK) {
            hs_search_close(search);
        }
    }
    if (status == HS_OK) {
        status = finish(search);
    }
    hs_call_tell_limit(call, status, failure);
    return status;
}
