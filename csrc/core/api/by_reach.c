/* SPDX-License-Identifier: BSD-3-Clause */
/* by_reach.c: arguments, the division into levels, and one search after the other. */
#include "by_reach.h"

#include "../base/rule.h"
#include "../exact/support.h"
#include "../search/choice.h"

#include <math.h>

/* Several searches take as long for each point as one that has so many pairs of it, at least. */
#define PAIRS_PER_POINT 60.0

/* Whether a set of points has what the rule goes by. */
static bool
has_marks(const hs_reach *reach, const hs_points *points, const double *numbers,
          const int32_t *types, bool needs_numbers)
{
    if (reach->n_types > 0) {
        return types != NULL || points->n == 0;
    }
    return numbers != NULL || points->n == 0 || !needs_numbers;
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
    const double   *own = reach->has_supports ? reach->supports : reach->radii;
    const double   *of_queries = reach->has_supports ? reach->query_supports : reach->query_radii;
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
    if (sets->queries == NULL) {
        return has_marks(reach, sets->points, own, reach->types, true) ? HS_OK : HS_ERR_ARGUMENT;
    }
    return has_marks(reach, sets->points, own, reach->types, meets) &&
                   has_marks(reach, sets->queries, of_queries, reach->query_types, asks)
               ? HS_OK
               : HS_ERR_ARGUMENT;
}

/* The caller's reach, without what its rule does not look at. */
static hs_reach
needed_of(const hs_request *request)
{
    hs_reach reach = *request->reach;
    if (request->sets.queries != NULL && !hs_rule_needs_other(reach.rule)) {
        reach.radii = reach.supports = NULL;
    } else if (!hs_rule_needs_asking(reach.rule)) {
        reach.query_radii = reach.query_supports = NULL;
    }
    return reach;
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
    const hs_reach reach = needed_of(request);
    const int64_t  n = sets->points->n + (sets->queries != NULL ? sets->queries->n : 0);
    hs_call_gather(call, n);
    hs_call_gather_for(call, n, PAIRS_PER_POINT * (double)n);
    status = hs_levels_divide(&call->account, &call->options, sets->points, sets->queries, &reach,
                              &by->levels, failure);
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
    hs_level_search open;
    int64_t         n = 0;
    hs_status       status =
        hs_level_open(&by->levels, &by->plan, step, by->box, keeps_none, call, &open, failure);
    if (status == HS_OK) {
        status = use(context, &open.search, &n, failure);
        hs_level_close(&open);
        *n_pairs += n;
        failure->in_queries = failure->in_queries && by->levels.has_queries;
    }
    return status;
}

hs_status
hs_by_reach_each(const hs_by_reach *by, bool keeps_none, hs_call *call, hs_use_fn use,
                 void *context, int64_t *n_pairs, hs_failure *failure)
{
    hs_status status = HS_OK;
    for (int64_t s = 0; status == HS_OK && s < by->plan.n; s++) {
        status = use_step(by, s, keeps_none, call, use, context, n_pairs, failure);
    }
    return status;
}

hs_status
hs_by_reach_single(hs_by_reach *by, hs_call *call, hs_use_fn use, void *context, int64_t *n_pairs,
                   hs_failure *failure)
{
    HS_ASSERT(hs_level_plan_is_single(&by->levels, &by->plan));
    by->plan.is_half = false;
    return use_step(by, 0, false, call, use, context, n_pairs, failure);
}

hs_status
hs_by_reach_use(const hs_request *request, hs_use_fn use, void *context, hs_failure *failure)
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
            hs_by_reach_each(&by, request->sets.keeps_none, &call, use, context, &n_pairs, failure);
        hs_by_reach_close(&call, &by);
    }
    hs_call_tell_limit(&call, status, failure);
    hs_call_leave(&call, n_pairs);
    hs_account_close(&call.account);
    return status;
}
