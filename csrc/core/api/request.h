/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * request.h: what the public searches of one scene share: from their arguments to an open search,
 * and from its end to what the caller gets. What each does with the search is its own.
 */
#ifndef HS_REQUEST_H
#define HS_REQUEST_H

#include "../../halfshell.h"
#include "../base/base.h"
#include "../collect/result.h"

/* All borrowed. */
typedef struct hs_request {
    const hs_sets    *sets;
    const hs_box     *box;
    const hs_options *options;
} hs_request;

/* Checks the arguments, and opens a search of them for a call that has begun. On failure it is
 * closed. */
hs_status hs_request_open(const hs_request *request, hs_call *call, hs_search *search,
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

/* A search whose pairs the caller gets, to be freed by hs_pairs_free; NULL on failure. */
hs_status hs_request_fill(const hs_request *request, hs_fill_fn fill, hs_pairs **result,
                          hs_failure *failure);

/*
 * Checks of what a program of C may get wrong about the arguments of halfshell.h, where memory
 * would be read or written out of bounds. Python checks its own before. Coordinates, boxes and
 * cutoffs are checked when the scene is made (scene.h). Any pointer may be NULL, except the options
 * and the failure that are given to a function hs_check_*.
 */

/* The counters, if any, of a call that ends before its search begins. */
void hs_clear_counters(const hs_options *options);

/* Ends such a call: returns the status. *failure, unless NULL, has no details. */
hs_status hs_end_early(hs_status status, const hs_options *options, hs_failure *failure);

/* Whether a call that returns an object has these two, without which it cannot begin. *result,
 * unless NULL, is NULL afterwards. */
bool hs_can_return(hs_pairs **result, const hs_options *options);

/* The same for objects of other types, once their pointer, unless NULL, has been cleared. */
bool hs_can_begin(const void *result, const hs_options *options);

/* Whether an array is there that has one entry for each of these points, if there are any. */
bool hs_has_entries(const void *array, const hs_points *points);

/* HS_OK, HS_ERR_ARGUMENT, or HS_ERR_TOO_MANY for points and systems from 2^31 on. */
hs_status hs_check_points(const hs_points *points, hs_failure *failure);

/* first and n of systems that share out so many points; what it reads is first alone. */
hs_status hs_check_systems(const hs_systems *systems, int64_t n_points, hs_failure *failure);

/* HS_OK or HS_ERR_ARGUMENT. The box may be NULL; ndim is that of the points. */
hs_status hs_check_box(const hs_box *box, int ndim);

/* Those of the options that every function heeds: threads and the limit of memory. */
hs_status hs_check_resources(const hs_options *options);

hs_status hs_check_options(const hs_options *options);

/* All of these but systems; the failure says whether it is of the queries, if there are any. */
hs_status hs_check_arguments(const hs_points *points, const hs_points *queries, const hs_box *box,
                             const hs_options *options, hs_failure *failure);

/* The functions of halfshell.h of these names, for sets of points. */
hs_status hs_pairs_find_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                           hs_pairs **pairs, hs_failure *failure);
hs_status hs_pairs_count_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                            int64_t *count, hs_failure *failure);
hs_status hs_neighbors_find_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                               hs_pairs **rows, hs_failure *failure);
hs_status hs_neighbors_count_in(const hs_sets *sets, const hs_box *box, const hs_options *options,
                                int64_t *counts, hs_failure *failure);
hs_status hs_nearest_find_in(const hs_sets *sets, const hs_box *box, int64_t k,
                             const hs_options *options, hs_pairs **rows, hs_failure *failure);

#endif
