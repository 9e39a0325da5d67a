/* SPDX-License-Identifier: BSD-3-Clause */
#include "request.h"
#include "../base/status.h"
#include "cells.h"
#include "../search/choice.h"

#include <limits.h>
#include <math.h>

/* request.c: counts and pointers first, then what they lead to: nothing is read before it is known
 * to be there. Then checks, opens, uses and closes, in this order for every search. */

/* Most bytes from one end of an array to the other: a little less than addresses allow, because the
 * sum that is compared with it is rounded. */
#define MOST_EXTENT (0.99 * (double)PTRDIFF_MAX)

static hs_status
status_of(bool sound)
{
    return sound ? HS_OK : HS_ERR_ARGUMENT;
}

void
hs_clear_counters(const hs_options *options)
{
    if (options != NULL && options->counters != NULL) {
        *options->counters = (hs_counters){.pairs = 0};
    }
}

hs_status
hs_end_early(hs_status status, const hs_options *options, hs_failure *failure)
{
    if (failure != NULL) {
        *failure = HS_NO_FAILURE;
    }
    hs_clear_counters(options);
    return status;
}

bool
hs_can_return(hs_pairs **result, const hs_options *options)
{
    if (result != NULL) {
        *result = NULL;
    }
    return hs_can_begin(result, options);
}

bool
hs_can_begin(const void *result, const hs_options *options)
{
    return result != NULL && options != NULL;
}

bool
hs_has_entries(const void *array, const hs_points *points)
{
    return array != NULL || (points != NULL && points->n == 0);
}

static bool
is_dimension(int ndim)
{
    return ndim >= 1 && ndim <= HS_MAX_DIM;
}

static bool
is_index_size(int bytes)
{
    return bytes == 4 || bytes == 8;
}

/* Whether entries are there, if any, no further apart than addresses can be. */
static bool
has_coordinates(const hs_points *points)
{
    const double rows = (double)(points->n - 1) * (double)points->row_stride;
    const double columns = (double)(points->ndim - 1) * (double)points->column_stride;
    return points->n == 0 || (points->data != NULL && fabs(rows) + fabs(columns) <= MOST_EXTENT);
}

hs_status
hs_check_points(const hs_points *points, hs_failure *failure)
{
    if (points == NULL || !is_dimension(points->ndim) || points->n < 0 ||
        (points->real != HS_FLOAT32 && points->real != HS_FLOAT64)) {
        return HS_ERR_ARGUMENT;
    }
    if (points->n > INT32_MAX) {
        failure->value = (double)points->n;
        return HS_ERR_TOO_MANY;
    }
    return status_of(has_coordinates(points));
}

hs_status
hs_check_systems(const hs_set *set, hs_failure *failure)
{
    const int64_t *first = set->first;
    if (set->n_systems < 0 || first == NULL) {
        return HS_ERR_ARGUMENT;
    }
    if (set->n_systems > INT32_MAX) {
        failure->value = (double)set->n_systems;
        return HS_ERR_TOO_MANY;
    }
    for (int64_t s = 0; s < set->n_systems; s++) {
        if (first[s + 1] < first[s]) {
            failure->system = s;
            return HS_ERR_ARGUMENT;
        }
    }
    return status_of(first[0] == 0 && first[set->n_systems] == set->at.n);
}

hs_status
hs_check_box(const hs_box *box, int ndim)
{
    return status_of(box == NULL || (is_dimension(ndim) && box->ndim == ndim));
}

static bool
has_all(const hs_pair_arrays *out, unsigned want)
{
    return (!(want & HS_WANT_I) || out->i != NULL) && (!(want & HS_WANT_J) || out->j != NULL) &&
           (!(want & HS_WANT_BOTH) || out->both != NULL) &&
           (!(want & HS_WANT_DISTANCE) || out->distance != NULL) &&
           (!(want & HS_WANT_VECTOR) || out->vector != NULL) &&
           (!(want & HS_WANT_SHIFT) || out->shift != NULL) &&
           (!(want & HS_WANT_SHELL) || out->shell != NULL);
}

/* Each array that is wanted is there, if anything is to be written to it. */
static bool
can_hold(const hs_pair_arrays *out, unsigned want)
{
    return is_index_size(out->index_bytes) && out->capacity >= 0 &&
           (out->capacity == 0 || has_all(out, want));
}

hs_status
hs_check_resources(const hs_options *options)
{
    return status_of(options->threads > INT_MIN && options->memory_limit >= 0.0);
}

/* These options, of which `known` are bits that may be wanted. */
static hs_status
check_options(const hs_options *options, unsigned known)
{
    const unsigned        want = options->want;
    const hs_pair_arrays *out = options->out;
    if (hs_check_resources(options) != HS_OK) {
        return HS_ERR_ARGUMENT;
    }
    return status_of((want & ~known) == 0 && (want == 0 || is_index_size(options->index_bytes)) &&
                     (out == NULL || can_hold(out, want)) && options->cell_size >= 0.0 &&
                     (unsigned)options->algorithm < HS_ALGORITHM_END &&
                     (options->precision == HS_EXACT || options->precision == HS_DOUBLE ||
                      options->precision == HS_SINGLE));
}

hs_status
hs_check_options(const hs_options *options)
{
    return check_options(options, HS_WANT_ALL);
}

/* HS_OK, or HS_ERR_EDGES unless there are some, finite, not negative and not descending. */
static hs_status
check_lengths(const double *lengths, int64_t n, hs_failure *failure)
{
    if (n < 1 || n >= HS_MOST_LENGTHS) {
        return HS_ERR_EDGES;
    }
    for (int64_t k = 0; k < n; k++) {
        if (!isfinite(lengths[k]) || lengths[k] < 0.0 || (k > 0 && lengths[k] < lengths[k - 1])) {
            failure->row = k;
            failure->value = lengths[k];
            return HS_ERR_EDGES;
        }
    }
    return HS_OK;
}

hs_status
hs_check_histogram(const hs_histogram *histogram, hs_failure *failure)
{
    if (histogram == NULL || histogram->edges == NULL || histogram->n_types < 1) {
        return HS_ERR_ARGUMENT;
    }
    return check_lengths(histogram->edges, histogram->n_edges, failure);
}

double
hs_least_length(const double *lengths, int64_t n)
{
    for (int64_t k = 0; k < n; k++) {
        if (lengths[k] > 0.0) {
            return lengths[k];
        }
    }
    return 0.0;
}

/* Shells are those of an exact search, up to its cutoff. */
static hs_status
check_shells(const hs_options *options, hs_failure *failure)
{
    if (options->shells == NULL || options->precision != HS_EXACT) {
        return HS_ERR_ARGUMENT;
    }
    const hs_status status = check_lengths(options->shells, options->n_shells, failure);
    return status == HS_OK ? status_of(options->shells[options->n_shells - 1] == options->cutoff)
                           : status;
}

/* Points, queries and box. */
static hs_status
check_sets(const hs_points *points, const hs_points *queries, const hs_box *box,
           hs_failure *failure)
{
    hs_status status = hs_check_points(points, failure);
    if (status == HS_OK) {
        status = hs_check_box(box, points->ndim);
    }
    if (status == HS_OK && queries != NULL) {
        status = hs_check_points(queries, failure);
        failure->in_queries = status != HS_OK;
        status = status == HS_OK ? status_of(queries->ndim == points->ndim) : status;
    }
    return status;
}

hs_status
hs_check_arguments(const hs_points *points, const hs_points *queries, const hs_box *box,
                   const hs_options *options, hs_failure *failure)
{
    const hs_status status = check_sets(points, queries, box, failure);
    return status == HS_OK ? hs_check_options(options) : status;
}

/* The same for lists of pairs, which may have shells. */
static hs_status
check_request(const hs_request *request, hs_failure *failure)
{
    const hs_sets    *sets = &request->sets;
    const hs_options *options = request->options;
    hs_status         status = check_sets(sets->points, sets->queries, request->box, failure);
    if (status == HS_OK) {
        status = check_options(options, HS_WANT_ALL | HS_WANT_SHELL);
    }
    return status == HS_OK && (options->want & HS_WANT_SHELL) ? check_shells(options, failure)
                                                              : status;
}

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
    if (hs_has_systems(among) || among == NULL ||
        (kind == HS_HALF_LIST && among->queries != NULL)) {
        return request;
    }
    const hs_set *points = among->points, *queries = among->queries;
    request.reach = among->reach;
    request.selection = among->selection;
    request.sets.of_points = points;
    request.sets.of_queries = queries;
    request.sets.queries = queries != NULL ? &queries->at : NULL;
    request.sets.is_full = kind == HS_FULL_LIST || queries != NULL;
    if (among->cells == NULL) {
        request.sets.points = points != NULL ? &points->at : NULL;
        request.box = among->box;
    } else if ((points == NULL || points->at.data == NULL) && among->box == NULL) {
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
    hs_status         sound = check_request(request, failure);
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

/* Closes it, and what was opened with it. */
static void
request_close(hs_call *call, hs_search *search)
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
        request_close(&call, &search);
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
        request_close(&pairs->call, &search);
    }
    if (status == HS_ERR_MEMORY) {
        tell_shortage(request, &search, failure);
    }
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}
