/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * request.h: what the public searches of one scene share: from their arguments to an open search,
 * and from its end to what the caller gets. What each does with the search is its own.
 */
#ifndef HS_REQUEST_H
#define HS_REQUEST_H

#include "arguments.h"
#include "../collect/result.h"
#include "../search/search.h"

/* What to search for, all borrowed. */
typedef struct hs_request {
    hs_sets             sets;
    const hs_box       *box;
    const hs_options   *options;
    const hs_reach     *reach;     /* NULL: the cutoff holds for all pairs */
    const hs_selection *selection; /* NULL: all pairs within reach count */
} hs_request;

/* Which pairs a search is for: each once, among the points alone; every neighbour of each point or
 * query; or the first without queries and the second with them. */
typedef enum hs_list_kind { HS_HALF_LIST, HS_FULL_LIST, HS_HALF_OR_QUERIES } hs_list_kind;

/* `among` may be NULL or contradict itself: then no points are set, which opening refuses. */
hs_request hs_request_among(const hs_among *among, hs_list_kind kind, const hs_options *options);

/* Checks the arguments, and opens a search of them for a call that has begun. On failure it is
 * closed. */
hs_status hs_request_open(const hs_request *request, hs_call *call, hs_search *search,
                          hs_failure *failure);

/* Closes it, and what was opened with it. */
void hs_request_close(hs_call *call, hs_search *search);

/* Which pairs count: the request's selection, made ready for the call, of which no pair is further
 * apart than the cutoff. To be freed by hs_choice_close; on failure there is none. */
hs_status hs_choice_of_request(const hs_request *request, double cutoff, hs_call *call,
                               hs_failure *failure);

/* Uses an open search; *n_pairs, zero before, is how many it found. */
typedef hs_status (*hs_use_fn)(void *context, hs_search *search, int64_t *n_pairs,
                               hs_failure *failure);

/* A search that leaves nothing but what `use` writes. failure: NULL, or what was wrong. The caller
 * has seen that the options are there, and where the result goes; the search checks the rest. */
hs_status hs_request_use(const hs_request *request, hs_use_fn use, void *context,
                         hs_failure *failure);

/* Fills the output, which is empty and of the options' columns, from an open search. */
typedef hs_status (*hs_fill_fn)(hs_search *search, hs_pairs *pairs, hs_failure *failure);

/* A result whose call, with these options, has been entered; *failure becomes where the failure
 * goes. hs_pairs_finish must follow. NULL when memory is short: then the call has ended. */
hs_pairs *hs_pairs_begin(const hs_options *options, hs_failure **failure);

/* These options for a search that only counts. */
hs_options hs_options_of_count(const hs_options *options);

/* These options for a search of nearest points, as far as they count there. */
hs_options hs_options_of_nearest(const hs_options *options);

/* A search whose pairs the caller gets, to be freed by hs_pairs_free; NULL on failure. */
hs_status hs_request_fill(const hs_request *request, hs_fill_fn fill, hs_pairs **result,
                          hs_failure *failure);

#endif
