/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_API_REQUEST_H
#define HS_API_REQUEST_H

#include "../../halfshell.h"
#include "../base/base.h"
#include "../collect/columns.h"
#include "../search/search.h"

/*
 * request.h: checks of the arguments that all searches share, and requests: what to search for,
 * from its arguments to an open search and to what the caller gets.
 */

/*
 * Checks of what a program of C may get wrong about the arguments of halfshell.h, so
 * that no memory is read or written out of bounds. The binding checks Python's arguments before.
 * Coordinates, boxes and cutoffs are checked when the scene is made (scene.h). Any pointer may be
 * NULL, except the options and the failure that are given to a function hs_check_*.
 */

/* Ends such a call: returns the status. *failure, unless NULL, has no details. */
hs_status hs_end_early(hs_status status, const hs_options *options, hs_failure *failure);

/* The counters, if any, of a call that ends before its search begins. */
void hs_clear_counters(const hs_options *options);

/* Whether a call that returns an object has these two, without which it cannot begin. *result,
 * unless NULL, is NULL afterwards. */
bool hs_can_return(hs_pairs **result, const hs_options *options);

/* hs_can_return for objects of other types, once their pointer, unless NULL, has been cleared. */
bool hs_can_begin(const void *result, const hs_options *options);

/* Whether an array is there that has one entry for each of these points, if there are any. */
bool hs_has_entries(const void *array, const hs_points *points);

/* HS_OK, HS_ERR_ARGUMENT, or HS_ERR_TOO_MANY for points and systems from 2^31 on. */
hs_status hs_check_points(const hs_points *points, hs_failure *failure);

/* n_systems and first of a set of several systems; what it reads is first alone. */
hs_status hs_check_systems(const hs_set *set, hs_failure *failure);

/* HS_OK or HS_ERR_ARGUMENT. The box may be NULL; ndim is that of the points. */
hs_status hs_check_box(const hs_box *box, int ndim);

/* Checks the options that every function uses: threads and the memory limit. */
hs_status hs_check_resources(const hs_options *options);

hs_status hs_check_options(const hs_options *options);

/* Most lengths that distances are sorted by: twice as many are int32. */
#define HS_MOST_LENGTHS (INT64_C(1) << 30)

/* The first of ascending lengths that is above 0, or 0. */
double hs_least_length(const double *lengths, int64_t n);

/* HS_OK, HS_ERR_ARGUMENT, or HS_ERR_EDGES. */
hs_status hs_check_histogram(const hs_histogram *histogram, hs_failure *failure);

/* Checks all of the above but systems; failure->in_queries tells queries from points. */
hs_status hs_check_arguments(const hs_points *points, const hs_points *queries, const hs_box *box,
                             const hs_options *options, hs_failure *failure);

/*
 * What the public searches of one scene share: from their arguments to an open search,
 * and from its end to what the caller gets. What each does with the search is its own.
 */

/* Whether these are several systems, or may be. */
HS_ALWAYS_INLINE bool
hs_has_systems(const hs_among *among)
{
    return among != NULL &&
           ((among->points != NULL && among->points->first != NULL) ||
            (among->queries != NULL && among->queries->first != NULL) || among->each != NULL);
}

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

/* `among` may be NULL, contradict itself or have several systems: then no points are set, which
 * opening refuses. */
hs_request hs_request_among(const hs_among *among, hs_list_kind kind, const hs_options *options);

/* Checks the arguments, and opens a search of them for a call that has begun. On failure it is
 * closed. */
hs_status hs_request_open(const hs_request *request, hs_call *call, hs_search *search,
                          hs_failure *failure);

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

/* A search whose pairs the caller gets, to be freed by hs_pairs_free; NULL on failure. */
hs_status hs_request_fill(const hs_request *request, hs_fill_fn fill, hs_pairs **result,
                          hs_failure *failure);

/* A result whose call, with these options, has been entered; *failure becomes where the failure
 * goes. hs_pairs_finish must follow. NULL when memory is short: then the call has ended. */
hs_pairs *hs_pairs_begin(const hs_options *options, hs_failure **failure);

/* These options for a search that only counts. */
hs_options hs_options_of_count(const hs_options *options);

/* These options for a search of nearest points, as far as they count there. */
hs_options hs_options_of_nearest(const hs_options *options);

#endif
