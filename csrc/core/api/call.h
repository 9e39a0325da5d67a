/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * call.h: what the public searches of one scene share: from their arguments to an open search,
 * and from its end to what the caller gets. What each does with the search is its own.
 */
#ifndef HS_CALL_H
#define HS_CALL_H

#include "../collect/result.h"

/* All borrowed. */
typedef struct hs_request {
    const hs_sets    *sets;
    const hs_box     *box;
    const hs_options *options;
} hs_request;

/* Uses an open search; *n_pairs, zero before, is how many it found. */
typedef hs_status (*hs_use_fn)(void *context, hs_search *search, int64_t *n_pairs,
                               hs_failure *failure);

/* A search that leaves nothing but what `use` writes. failure: NULL, or what was wrong. The caller
 * has seen that the options are there, and where the result goes; the search checks the rest. */
hs_status hs_request_use(const hs_request *request, hs_use_fn use, void *context,
                         hs_failure *failure);

/* Fills the output, which is empty and of the options' columns, from the search. */
typedef hs_status (*hs_fill_fn)(hs_pairs *pairs, hs_failure *failure);

/* A search whose pairs the caller gets, to be freed by hs_pairs_free; NULL on failure. */
hs_status hs_request_fill(const hs_request *request, hs_fill_fn fill, hs_pairs **result,
                          hs_failure *failure);

#endif
