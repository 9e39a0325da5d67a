/* SPDX-License-Identifier: BSD-3-Clause */
#include "by_reach.h"
#include "../base/status.h"
#include "../exact/ellipsoid.h"
#include "../search/choice.h"
#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"
#include "../search/search.h"

#include <math.h>
#include <string.h>

/* by_reach.c: arguments, the division into levels, and one search after the other. */

/* Several searches take as long for each point as one that has so many pairs of it, at least. */
#define PAIRS_PER_POINT 60.0

/* Whether a set has what the reach goes by. */
static bool
has_marks(const hs_reach *reach, const hs_points *points, const hs_set *known, bool is_needed)
{
    const hs_set set = hs_set_with(points, known);
    return set.at.n == 0 || (reach->n_types > 0    ? set.types != NULL
                             : !is_needed          ? true
                             : reach->has_supports ? set.supports != NULL
                                                   : set.radii != NULL);
}

/* Whether the limit is that of one of the two points: supports do not add up, and neither do radii
 * that count several times. */
static bool
takes_one(hs_rule rule)
{
    return rule != HS_RULE_SUM && rule != HS_RULE_MEAN;
}

/* Whether radii may count so many times. */
static bool
may_extend(const hs_reach *reach)
{
    return reach->has_supports || reach->extent == 0.0 ||
           (takes_one(reach->rule) && reach->n_types == 0 && reach->extent >= 0x1p-64 &&
            reach->extent <= 0x1p64);
}

hs_status
hs_by_reach_check(const hs_request *request, hs_failure *failure)
{
    const hs_sets  *sets = &request->sets;
    const hs_reach *reach = request->reach;
    const bool      asks = hs_rule_needs_asking(reach->rule);
    const bool      meets = hs_rule_needs_other(reach->rule);
    const double    cutoff = request->options->cutoff;
    if ((unsigned)reach->rule >= HS_RULE_END || reach->n_types < 0 || !may_extend(reach) ||
        (reach->n_types > 0 && reach->cutoffs == NULL) ||
        (reach->has_supports &&
         (reach->n_types > 0 || sets->points->ndim > HS_SUPPORT_DIM || !takes_one(reach->rule))) ||
        (!sets->is_full && hs_rule_is_directed(reach->rule) && reach->n_types == 0)) {
        return HS_ERR_ARGUMENT;
    }
    if (!(cutoff >= 0.0) || (reach->n_types > 0 && !isfinite(cutoff))) {
        failure->value = cutoff;
        return HS_ERR_CUTOFF;
    }
    if (reach->has_supports && !(reach->extent >= 0.0 && isfinite(reach->extent))) {
        failure->value = reach->extent;
        return HS_ERR_EXTENT;
    }
    return has_marks(reach, sets->points, sets->of_points, meets || sets->queries == NULL) &&
                   (sets->queries == NULL ||
                    has_marks(reach, sets->queries, sets->of_queries, asks))
               ? HS_OK
               : HS_ERR_ARGUMENT;
}

/* Divides the sets of a request by its reach, without what its rule does not look at. */
static hs_status
divide(const hs_request *request, hs_call *call, hs_levels *levels, hs_failure *failure)
{
    const hs_sets  *sets = &request->sets;
    const hs_reach *reach = request->reach;
    const bool      has_queries = sets->queries != NULL;
    hs_set          points = hs_set_with(sets->points, sets->of_points);
    hs_set          queries = hs_set_with(sets->queries, sets->of_queries);
    if (has_queries && !hs_rule_needs_other(reach->rule)) {
        points.radii = points.supports = NULL;
    } else if (!hs_rule_needs_asking(reach->rule)) {
        queries.radii = queries.supports = NULL;
    }
    return hs_levels_divide(&call->account, &call->options, &points, has_queries ? &queries : NULL,
                            reach, levels, failure);
}

hs_status
hs_by_reach_open(const hs_request *request, hs_call *call, hs_by_reach *by, hs_failure *failure)
{
    const hs_sets *sets = &request->sets;
    *by = (hs_by_reach){.box = request->box};
    hs_status status =
        hs_check_arguments(sets->points, sets->queries, request->box, request->options, failure);
    if (status == HS_OK) {
        status = hs_by_reach_check(request, failure);
    }
    if (status == HS_OK) {
        status = call->kernel == NULL ? HS_ERR_KERNEL : hs_box_check(request->box, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    const int64_t n = sets->points->n + (sets->queries != NULL ? sets->queries->n : 0);
    hs_call_gather(call, n);
    hs_call_gather_for(call, n, PAIRS_PER_POINT * (double)n);
    status = divide(request, call, &by->levels, failure);
    if (status == HS_OK) {
        status = hs_level_plan_choose(&call->account, &call->options, &by->levels, by->box,
                                      request->options->cutoff, request->options->algorithm,
                                      &by->plan);
    }
    if (status == HS_OK) {
        status = hs_choice_of_request(request, INFINITY, call, failure);
    }
    if (status != HS_OK) {
        hs_by_reach_close(call, by);
    }
    return status;
}

void
hs_by_reach_close(hs_call *call, hs_by_reach *by)
{
    hs_account *account = &call->account;
    hs_choice_close(call);
    hs_level_plan_free(account, &by->plan);
    hs_levels_free(account, &by->levels);
}

/* Opens a step, and uses it. */
static hs_status
use_step(const hs_by_reach *by, int64_t step, bool keeps_none, hs_call *call, hs_use_fn use,
         void *context, int64_t *n_pairs, hs_failure *failure)
{
    hs_level_search  open;
    int64_t          n = 0;
    const double     n_steps = (double)by->plan.n;
    const hs_stretch whole =
        hs_call_begin_part(call, (double)step / n_steps, ((double)step + 1.0) / n_steps);
    hs_status status =
        hs_level_open(&by->levels, &by->plan, step, by->box, keeps_none, call, &open, failure);
    if (status == HS_OK) {
        status = use(context, &open.search, &n, failure);
        hs_level_close(&open);
        *n_pairs += n;
        failure->in_queries = failure->in_queries && by->levels.has_queries;
    }
    hs_call_end_part(call, whole);
    return status;
}

/* Uses each search in turn, as long as that gives HS_OK; *n_pairs, zero before, is how many all of
 * them found. keeps_none: pairs are not kept. */
static hs_status
by_reach_each(const hs_by_reach *by, bool keeps_none, hs_call *call, hs_use_fn use, void *context,
              int64_t *n_pairs, hs_failure *failure)
{
    hs_status status = HS_OK;
    for (int64_t s = 0; status == HS_OK && s < by->plan.n; s++) {
        status = use_step(by, s, keeps_none, call, use, context, n_pairs, failure);
    }
    return status;
}

/* Uses the one search that there is, of all neighbours of each asking point. */
static hs_status
by_reach_single(hs_by_reach *by, hs_call *call, hs_use_fn use, void *context, int64_t *n_pairs,
                hs_failure *failure)
{
    HS_ASSERT(hs_level_plan_is_single(&by->levels, &by->plan));
    by->plan.is_half = false;
    return use_step(by, 0, false, call, use, context, n_pairs, failure);
}

hs_status
hs_by_reach_each_step(const hs_request *request, hs_use_fn use, void *context, hs_failure *failure)
{
    hs_call call;
    int64_t n_pairs = 0;
    if (request->reach == NULL) {
        return hs_request_use(request, use, context, failure);
    }
    failure = hs_call_enter(request->options, failure, &call);
    hs_by_reach by;
    hs_status   status = hs_by_reach_open(request, &call, &by, failure);
    if (status == HS_OK) {
        status =
            by_reach_each(&by, request->sets.keeps_none, &call, use, context, &n_pairs, failure);
        hs_by_reach_close(&call, &by);
    }
    hs_call_tell_limit(&call, status, failure);
    hs_call_leave(&call, n_pairs);
    hs_account_close(&call.account);
    return status;
}

/* Pairs of all searches in one output, in their order or in the ascending one. Rows
 * are made of ascending pairs: where the rule is the same both ways, each pair is in two of
 * them. */

/* A hs_use_fn. */
static hs_status
record_step(void *context, hs_search *search, int64_t *n_pairs, hs_failure *failure)
{
    hs_output    *output = context;
    const int64_t before = output->n_pairs;
    hs_status     status = hs_estimate_by_sample(search, failure);
    if (status == HS_OK) {
        status = hs_parallel_record_all(search, output, failure);
    }
    *n_pairs = output->n_pairs - before;
    return status;
}

static hs_status
record(const hs_by_reach *by, hs_call *call, hs_output *output, hs_failure *failure)
{
    int64_t         n_pairs = 0;
    const hs_status status = by_reach_each(by, false, call, record_step, output, &n_pairs, failure);
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)output->n_pairs);
    }
    return status;
}

/* Whether two points may be a pair in several images, or one with itself. Twice the cutoff is
 * shorter than any period where not, by far more than rounding errors. */
static bool
images_repeat(const hs_by_reach *by)
{
    hs_lattice lattice;
    double     cutoff = 0.0;
    for (int64_t s = 0; s < by->plan.n; s++) {
        cutoff = hs_larger(by->plan.steps[s].cutoff, cutoff);
    }
    hs_lattice_init(by->box, by->levels.points.ndim, hs_scale_of(0), &lattice);
    for (int k = 0; k < lattice.ndim; k++) {
        if (lattice.row_of_axis[k] >= 0 && !(2.1 * cutoff < lattice.period[k])) {
            return true;
        }
    }
    return false;
}

/* Columns that put pairs in order and have all that is wanted. */
static unsigned
columns_of(const hs_request *request, const hs_by_reach *by)
{
    const unsigned wanted = request->options->want & ~(unsigned)HS_WANT_BOTH;
    return wanted | HS_WANT_I | HS_WANT_J | (images_repeat(by) ? HS_WANT_SHIFT : 0);
}

/* Whether a point meets itself: in rows of one set that are not made of a half list. */
static bool
meets_itself(const hs_by_reach *by)
{
    return !by->levels.has_queries && !by->plan.is_half;
}

/* Whether each point is within its limit of itself, which the rows of one search count on. */
static bool
has_selves(const hs_request *request, const hs_levels *levels)
{
    if (levels->has_queries) {
        return true;
    }
    for (int32_t l = 0; l < levels->n; l++) {
        if (levels->cutoffs[l * levels->n + l] < 0.0) {
            return false;
        }
    }
    return request->options->inclusive && request->options->precision == HS_EXACT;
}

/* Whether rows are those of a single search. It goes over all points twice: where pairs have limits
 * by radii, whose scans take long, sorting them is quicker. */
static bool
is_single(const hs_request *request, const hs_by_reach *by)
{
    return hs_level_plan_is_single(&by->levels, &by->plan) && !meets_itself(by) &&
           (!by->plan.steps[0].has_limits ||
            (by->levels.cutoffs != NULL && has_selves(request, &by->levels)));
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

/* All pairs, in an output that is opened. */
static hs_status
find(const hs_by_reach *by, hs_call *call, unsigned columns, hs_output *found, hs_failure *failure)
{
    hs_output_init(&call->account, by->levels.points.ndim, columns, 4, found);
    const hs_status status = record(by, call, found, failure);
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
    hs_by_reach_close(&pairs->call, by);
    status = hs_pairs_conclude(&pairs->output, status, failure);
    hs_call_tell_limit(&pairs->call, status, failure);
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}

static int64_t
count_asking(const hs_by_reach *by)
{
    return hs_levels_asking(&by->levels)->n;
}

/* Rows that each pair is in. */
static double
ways(const hs_by_reach *by)
{
    return by->plan.is_half ? 2.0 : 1.0;
}

/* Pairs in ascending order. */
static hs_status
find_sorted(const hs_request *request, const hs_by_reach *by, hs_pairs *pairs, hs_failure *failure)
{
    hs_output found;
    hs_status status = find(by, &pairs->call, columns_of(request, by), &found, failure);
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

/* Rows of the pairs of several searches. */
static hs_status
find_rows(const hs_request *request, const hs_by_reach *by, hs_pairs *rows, hs_failure *failure)
{
    const int64_t n = count_asking(by);
    int64_t      *offsets = NULL;
    hs_output     found;
    hs_status     status = find(by, &rows->call, columns_of(request, by), &found, failure);
    if (status == HS_OK && by->plan.is_half && (request->options->want & HS_WANT_SHIFT)) {
        status = hs_output_check_opposites(&found, failure);
    }
    if (status == HS_OK) {
        status = hs_pairs_open_offsets(&rows->call.account, n + 1, rows, &offsets);
    }
    if (status == HS_OK) {
        status = hs_sort_rows(&rows->call, n, &found, by->plan.is_half, offsets, &rows->output);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, ways(by) * (double)found.n_pairs);
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
        status = by_reach_single(&by, &rows->call, fill_rows, &doing, &n_pairs, failure);
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
    const unsigned  columns = meets_itself(by) ? columns_of(request, by) : HS_WANT_I | HS_WANT_J;
    const hs_status status = find(by, call, columns, &found, failure);
    if (status == HS_OK) {
        const int32_t *i = hs_output_column(&found, HS_WANT_I);
        const int32_t *j = hs_output_column(&found, HS_WANT_J);
        const int64_t  n = count_asking(by);
        if (n > 0) { /* otherwise counts may be NULL */
            memset(counts, 0, (size_t)n * sizeof *counts);
        }
        for (int64_t e = 0; e < found.n_pairs; e++) {
            counts[i[e]]++;
        }
        for (int64_t e = 0; by->plan.is_half && e < found.n_pairs; e++) {
            counts[j[e]]++;
        }
        *n_entries = (by->plan.is_half ? 2 : 1) * found.n_pairs;
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
        status = by_reach_single(&by, &call, count, counts, &n_entries, failure);
    } else if (status == HS_OK) {
        status = count_rows(request, &by, &call, counts, &n_entries, failure);
    }
    hs_by_reach_close(&call, &by);
    hs_call_tell_limit(&call, status, failure);
    hs_call_leave(&call, n_entries);
    hs_account_close(&call.account);
    return status;
}
