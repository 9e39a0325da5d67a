/* SPDX-License-Identifier: BSD-3-Clause */
/* reach_pairs.c: pairs of all searches in one output, in their order or in the ascending one. Rows
 * are made of ascending pairs: where the rule is the same both ways, of each pair and its mirror
 * image. */
#include "by_reach.h"

#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"
#include "../search/estimate.h"

#include <math.h>
#include <string.h>

/* A hs_use_fn. */
static hs_status
record_step(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    hs_output    *output = context;
    const int64_t before = output->n_pairs;
    hs_status     status = hs_estimate_by_sample(search, failure);
    if (status == HS_OK) {
        status = hs_record_all(search, output, failure);
    }
    *n_pairs = output->n_pairs - before;
    return status;
}

static hs_status
record(const hs_by_reach *by, hs_call *call, hs_output *output, hs_failure *failure)
{
    int64_t         n_pairs = 0;
    const hs_status status =
        hs_by_reach_each(by, false, call, record_step, output, &n_pairs, failure);
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)output->n_pairs);
    }
    return status;
}

/* Columns that put pairs in order and have all that is wanted. */
static unsigned
columns_of(const hs_request *request)
{
    bool repeats = false;
    for (int l = 0; request->box != NULL && l < request->box->ndim; l++) {
        repeats = repeats || request->box->periodic[l];
    }
    const unsigned wanted = request->options->want & ~(unsigned)HS_WANT_BOTH;
    return wanted | HS_WANT_I | HS_WANT_J | (repeats ? HS_WANT_SHIFT : 0);
}

/* Appends (j, i, -S) for each of the first n pairs (i, j, S). */
static hs_status
mirror(hs_output *found, bool wants_shift, hs_failure *failure)
{
    const int64_t n = found->n_pairs;
    const int     d = found->ndim;
    hs_status     status = hs_output_reserve(found, n, 1.0);
    if (status != HS_OK) {
        failure->expected_pairs = 2.0 * (double)n;
        return status;
    }
    int32_t *i = hs_output_column(found, HS_WANT_I), *j = hs_output_column(found, HS_WANT_J);
    int32_t *shift = hs_output_column(found, HS_WANT_SHIFT);
    double  *distance = hs_output_column(found, HS_WANT_DISTANCE);
    double  *vector = hs_output_column(found, HS_WANT_VECTOR);
    for (int64_t e = 0; e < n; e++) {
        i[n + e] = j[e];
        j[n + e] = i[e];
    }
    for (int64_t e = 0; distance != NULL && e < n; e++) {
        distance[n + e] = distance[e];
    }
    for (int64_t e = 0; vector != NULL && e < n * d; e++) {
        vector[n * d + e] = -vector[e] + 0.0; /* a zero has no sign */
    }
    for (int64_t e = 0; shift != NULL && e < n * d; e++) {
        if (wants_shift && shift[e] == INT32_MIN) {
            failure->row = j[e / d];
            return HS_ERR_SHIFT_RANGE;
        }
        shift[n * d + e] = (int32_t)(0u - (uint32_t)shift[e]);
    }
    found->n_pairs = 2 * n;
    return HS_OK;
}

/* Whether a point meets itself: in rows of one set that are not made of a half list. */
static bool
meets_itself(const hs_by_reach *by)
{
    return !by->levels.has_queries && !by->plan.is_half;
}

/* Whether each point is within its limit of itself, which the rows of one search count on. */
static bool
has_selves(const hs_request *request, const hs_by_reach *by)
{
    const hs_levels *levels = &by->levels;
    if (levels->has_queries || !by->plan.steps[0].has_limits) {
        return true;
    }
    for (int32_t l = 0; levels->cutoffs != NULL && l < levels->n; l++) {
        if (levels->cutoffs[l * levels->n + l] < 0.0) {
            return false;
        }
    }
    return request->options->inclusive && request->options->precision == HS_EXACT;
}

/* Whether rows are those of a single search. */
static bool
is_single(const hs_request *request, const hs_by_reach *by)
{
    return hs_level_plan_is_single(&by->levels, &by->plan) && !meets_itself(by) &&
           has_selves(request, by);
}

/* Moves pair `from` to place `to`. */
static void
move_pair(hs_output *found, int64_t from, int64_t to)
{
    for (unsigned bit = HS_WANT_I; bit <= HS_WANT_SHIFT; bit <<= 1) {
        char        *column = hs_output_column(found, bit);
        const size_t width = column != NULL ? hs_output_width(found, bit) : 0;
        if (column != NULL) {
            memmove(column + (size_t)to * width, column + (size_t)from * width, width);
        }
    }
}

/* Takes (i, i, S = 0) out. */
static void
drop_selves(hs_output *found)
{
    const int32_t *i = hs_output_column(found, HS_WANT_I), *j = hs_output_column(found, HS_WANT_J);
    const int32_t *shift = hs_output_column(found, HS_WANT_SHIFT);
    int64_t        kept = 0;
    for (int64_t e = 0; e < found->n_pairs; e++) {
        bool is_self = i[e] == j[e];
        for (int k = 0; is_self && shift != NULL && k < found->ndim; k++) {
            is_self = shift[e * found->ndim + k] == 0;
        }
        if (!is_self) {
            move_pair(found, e, kept++);
        }
    }
    found->n_pairs = kept;
}

/* All pairs, of both orders where rows are wanted of a half list, in an output that is opened. */
static hs_status
find(const hs_request *request, const hs_by_reach *by, hs_call *call, unsigned columns,
     bool as_rows, hs_output *found, hs_failure *failure)
{
    hs_output_init(&call->account, by->levels.points.ndim, columns, 4, found);
    hs_status status = record(by, call, found, failure);
    if (status == HS_OK && as_rows && by->plan.is_half) {
        status = mirror(found, request->options->want & HS_WANT_SHIFT, failure);
    }
    if (status == HS_OK && meets_itself(by)) {
        drop_selves(found);
    }
    return status;
}

/* Begins a result and opens what is searched; on failure of the second it holds nothing. NULL when
 * memory is short. */
static hs_pairs *
begin(const hs_request *request, hs_by_reach *by, hs_status *status, hs_failure **failure)
{
    hs_pairs *pairs = hs_pairs_begin(request->options, failure);
    if (pairs == NULL) {
        return NULL;
    }
    *status = hs_by_reach_open(request, &pairs->call, by, *failure);
    if (*status == HS_OK) {
        hs_pairs_open(pairs, by->levels.points.ndim);
    }
    return pairs;
}

/* Ends it. */
static hs_status
finish(hs_by_reach *by, hs_pairs *pairs, hs_status status, hs_pairs **result, hs_failure *failure)
{
    hs_by_reach_close(&pairs->call.account, by);
    status = hs_pairs_conclude(&pairs->output, status, failure);
    hs_by_reach_tell(&pairs->call, status, failure);
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}

static int64_t
count_asking(const hs_by_reach *by)
{
    return hs_levels_asking(&by->levels)->n;
}

/* Pairs in ascending order. */
static hs_status
find_sorted(const hs_request *request, const hs_by_reach *by, hs_pairs *pairs, hs_failure *failure)
{
    hs_output found;
    hs_status status = find(request, by, &pairs->call, columns_of(request), false, &found, failure);
    if (status == HS_OK) {
        status = hs_sort_pairs(&pairs->call, 0, count_asking(by), &found, &pairs->output);
    }
    hs_output_free(&found);
    return status;
}

hs_status
hs_by_reach_pairs(const hs_request *request, hs_pairs **result, hs_failure *failure)
{
    hs_by_reach by;
    hs_status   status;
    hs_pairs   *pairs = begin(request, &by, &status, &failure);
    if (pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    if (status == HS_OK && request->options->sorted) {
        status = find_sorted(request, &by, pairs, failure);
    } else if (status == HS_OK) {
        status = record(&by, &pairs->call, &pairs->output, failure);
    }
    return finish(&by, pairs, status, result, failure);
}

/* Where each row begins, once all pairs are known. */
static hs_status
find_offsets(hs_pairs *rows, const hs_output *found, int64_t n)
{
    const int32_t *i = hs_output_column(found, HS_WANT_I);
    hs_output_init(&rows->call.account, found->ndim, HS_WANT_I, 8, &rows->offsets);
    const hs_status status = hs_output_reserve(&rows->offsets, n + 1, 0.0);
    if (status != HS_OK) {
        return status;
    }
    rows->offsets.n_pairs = n + 1;
    int64_t *offsets = hs_output_column(&rows->offsets, HS_WANT_I);
    memset(offsets, 0, (size_t)(n + 1) * sizeof *offsets);
    for (int64_t e = 0; e < found->n_pairs; e++) {
        offsets[i[e] + 1]++;
    }
    for (int64_t row = 0; row < n; row++) {
        offsets[row + 1] += offsets[row];
    }
    return HS_OK;
}

/* Rows of the pairs of several searches. */
static hs_status
find_rows(const hs_request *request, const hs_by_reach *by, hs_pairs *rows, hs_failure *failure)
{
    hs_output found;
    hs_status status = find(request, by, &rows->call, columns_of(request), true, &found, failure);
    if (status == HS_OK) {
        status = find_offsets(rows, &found, count_asking(by));
    }
    if (status == HS_OK) {
        status = hs_sort_pairs(&rows->call, 0, count_asking(by), &found, &rows->output);
    }
    hs_output_free(&found);
    return status;
}

/* Rows that a single search fills. */
typedef struct filling {
    hs_fill_fn fill;
    hs_pairs  *rows;
} filling;

/* A hs_use_fn. */
static hs_status
fill_rows(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    const filling  *doing = context;
    const hs_status status = doing->fill(search, doing->rows, failure);
    *n_pairs = doing->rows->output.n_pairs;
    return status;
}

hs_status
hs_by_reach_rows(const hs_request *request, hs_fill_fn fill, hs_pairs **result, hs_failure *failure)
{
    hs_by_reach by;
    hs_status   status;
    int64_t     n_pairs = 0;
    hs_pairs   *rows = begin(request, &by, &status, &failure);
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    if (status == HS_OK && is_single(request, &by)) {
        filling doing = {fill, rows};
        status = hs_by_reach_single(&by, &rows->call, fill_rows, &doing, &n_pairs, failure);
    } else if (status == HS_OK) {
        status = find_rows(request, &by, rows, failure);
    }
    return finish(&by, rows, status, result, failure);
}

/* Lengths of the rows of several searches. */
static hs_status
count_rows(const hs_request *request, const hs_by_reach *by, hs_call *call, int64_t *counts,
           int64_t *n_entries, hs_failure *failure)
{
    hs_output       found;
    const unsigned  columns = meets_itself(by) ? columns_of(request) : HS_WANT_I | HS_WANT_J;
    const hs_status status = find(request, by, call, columns, true, &found, failure);
    if (status == HS_OK) {
        const int32_t *i = hs_output_column(&found, HS_WANT_I);
        const int64_t  n = count_asking(by);
        if (n > 0) { /* otherwise counts may be NULL */
            memset(counts, 0, (size_t)n * sizeof *counts);
        }
        for (int64_t e = 0; e < found.n_pairs; e++) {
            counts[i[e]]++;
        }
        *n_entries = found.n_pairs;
    }
    hs_output_free(&found);
    return status;
}

hs_status
hs_by_reach_count_rows(const hs_request *request, hs_use_fn count, int64_t *counts,
                       hs_failure *failure)
{
    hs_call     call;
    hs_by_reach by;
    int64_t     n_entries = 0;
    failure = hs_call_enter(request->options, failure, &call);
    hs_status status = hs_by_reach_open(request, &call, &by, failure);
    if (status == HS_OK && is_single(request, &by)) {
        status = hs_by_reach_single(&by, &call, count, counts, &n_entries, failure);
    } else if (status == HS_OK) {
        status = count_rows(request, &by, &call, counts, &n_entries, failure);
    }
    hs_by_reach_close(&call.account, &by);
    hs_by_reach_tell(&call, status, failure);
    hs_call_leave(&call, n_entries);
    hs_account_close(&call.account);
    return status;
}
