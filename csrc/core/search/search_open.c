/* SPDX-License-Identifier: BSD-3-Clause */
/* search_open.c: cells that were kept, where they serve, or new ones. See search_open.h. */
#include "search_open.h"

#include "search_build.h"
#include "search_reuse.h"

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
