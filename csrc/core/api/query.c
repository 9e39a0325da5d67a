/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"

#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

/* query.c: counts and pointers first, then what they lead to: nothing is read before it is known
 * to be there. Then checks, plans, finds and closes, in this order for every search. */

hs_status
hs_end_early(hs_status status, const hs_options *options, hs_failure *failure)
{
    if (failure != NULL) {
        *failure = HS_NO_FAILURE;
    }
    if (options != NULL && options->counters != NULL) {
        *options->counters = (hs_counters){.pairs = 0};
    }
    return status;
}

bool
hs_has_entries(const void *array, const hs_points *points)
{
    return array != NULL || (points != NULL && points->n == 0);
}

hs_status
hs_check_box(const hs_box *box, int ndim)
{
    return box == NULL || (ndim >= 1 && ndim <= HS_MAX_DIM && box->ndim == ndim) ? HS_OK
                                                                                 : HS_ERR_ARGUMENT;
}

hs_status
hs_check_resources(const hs_options *options)
{
    return options->threads > INT_MIN && options->memory_limit >= 0.0 ? HS_OK : HS_ERR_ARGUMENT;
}

hs_status
hs_check_options(const hs_options *options, unsigned known)
{
    const unsigned want = options->want;
    const bool     is_known = (want & ~known) == 0;
    const bool     has_index = want == 0 || options->index_bytes == 4 || options->index_bytes == 8;
    bool           can_hold = true;
    if (options->out != NULL) { /* each array is there, if anything is to be written to it */
        const hs_pair_arrays *out = options->out;
        const bool            has_all = (!(want & HS_WANT_I) || out->i != NULL) &&
                             (!(want & HS_WANT_J) || out->j != NULL) &&
                             (!(want & HS_WANT_BOTH) || out->both != NULL) &&
                             (!(want & HS_WANT_DISTANCE) || out->distance != NULL) &&
                             (!(want & HS_WANT_VECTOR) || out->vector != NULL) &&
                             (!(want & HS_WANT_SHIFT) || out->shift != NULL) &&
                             (!(want & HS_WANT_SHELL) || out->shell != NULL);
        can_hold = (out->index_bytes == 4 || out->index_bytes == 8) && out->capacity >= 0 &&
                   (out->capacity == 0 || has_all);
    }
    return can_hold && is_known && has_index && hs_check_resources(options) == HS_OK &&
                   options->cell_size >= 0.0 && (unsigned)options->algorithm < HS_ALGORITHM_END &&
                   (options->precision == HS_EXACT || options->precision == HS_DOUBLE ||
                    options->precision == HS_SINGLE)
               ? HS_OK
               : HS_ERR_ARGUMENT;
}

/* Shells are those of an exact search, up to its cutoff: some, finite, not negative and not
 * descending. */
static hs_status
check_shells(const hs_options *options, hs_failure *failure)
{
    const double *at = options->shells;
    const int64_t n = options->n_shells;
    if (at == NULL || options->precision != HS_EXACT) {
        return HS_ERR_ARGUMENT;
    }
    if (n < 1 || n >= HS_MOST_LENGTHS) {
        return HS_ERR_EDGES;
    }
    for (int64_t k = 0; k < n; k++) {
        if (!hs_is_length(at[k]) || (k > 0 && at[k] < at[k - 1])) {
            failure->row = k;
            failure->value = at[k];
            return HS_ERR_EDGES;
        }
    }
    return at[n - 1] == options->cutoff ? HS_OK : HS_ERR_ARGUMENT;
}

hs_status
hs_check_sets(const hs_points *points, const hs_points *queries, const hs_box *box,
              hs_failure *failure)
{
    hs_status status = hs_check_points(points, failure);
    if (status == HS_OK) {
        status = hs_check_box(box, points->ndim);
    }
    if (status == HS_OK && queries != NULL) {
        status = hs_check_points(queries, failure);
        failure->in_queries = status != HS_OK;
        status = status == HS_OK && queries->ndim != points->ndim ? HS_ERR_ARGUMENT : status;
    }
    return status;
}

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

/* Whether the query has all that its reach needs. */
static hs_status
check_reach(const hs_query *query, hs_failure *failure)
{
    const hs_sets  *sets = &query->sets;
    const hs_reach *reach = query->reach;
    const bool      asks = hs_rule_needs_asking(reach->rule);
    const bool      meets = hs_rule_needs_other(reach->rule);
    /* Supports do not add up, and neither do radii that count several times. */
    const bool takes_one = reach->rule != HS_RULE_SUM && reach->rule != HS_RULE_MEAN;
    const bool may_extend = takes_one && reach->n_types == 0 && reach->extent >= 0x1p-64 &&
                            reach->extent <= 0x1p64;
    if ((unsigned)reach->rule >= HS_RULE_END || reach->n_types < 0 ||
        (!reach->has_supports && reach->extent != 0.0 && !may_extend) ||
        (reach->n_types > 0 && reach->cutoffs == NULL) ||
        (reach->has_supports &&
         (reach->n_types > 0 || sets->points->ndim > HS_SUPPORT_DIM || !takes_one)) ||
        (!sets->is_full && hs_rule_is_directed(reach->rule) && reach->n_types == 0)) {
        return HS_ERR_ARGUMENT;
    }
    if (reach->has_supports && !hs_is_length(reach->extent)) {
        failure->value = reach->extent;
        return HS_ERR_EXTENT;
    }
    return has_marks(reach, sets->points, sets->of_points, meets || sets->queries == NULL) &&
                   (sets->queries == NULL ||
                    has_marks(reach, sets->queries, sets->of_queries, asks))
               ? HS_OK
               : HS_ERR_ARGUMENT;
}

hs_query
hs_query_among(const hs_among *among, hs_list_kind kind, const hs_options *options)
{
    hs_query query = {.options = options != NULL ? *options : hs_options_default(),
                      .is_incomplete = options == NULL};
    query.is_by_length = query.options.want & HS_WANT_SHELL;
    if (among == NULL || (kind == HS_HALF_LIST && among->queries != NULL)) {
        return query;
    }
    const hs_set *points = among->points, *queries = among->queries;
    if ((points != NULL && points->first != NULL) || (queries != NULL && queries->first != NULL) ||
        among->each != NULL) {
        query.among = among;
    }
    query.reach = among->reach;
    query.selection = among->selection;
    query.sets.of_points = points;
    query.sets.of_queries = queries;
    query.sets.queries = queries != NULL ? &queries->at : NULL;
    query.sets.is_full = kind == HS_FULL_LIST || queries != NULL;
    if (among->cells == NULL) {
        query.sets.points = points != NULL ? &points->at : NULL;
        query.box = among->box;
    } else if ((points == NULL || points->at.data == NULL) && among->box == NULL) {
        const hs_cells *cells = among->cells;
        query.sets.points = &cells->points;
        query.sets.built = &cells->search;
        query.sets.trees = cells->trees;
        query.box = hs_cells_box(cells);
    }
    return query;
}

/* How far pairs may be apart: the cutoff, or the further limit of a reach. */
static hs_status
check_cutoff(const hs_query *query, const hs_finder *finder, hs_failure *failure)
{
    const double cutoff = query->options.cutoff;
    const bool   may_be_infinite = finder->is_nearest ||
                                 (query->reach != NULL && query->reach->n_types == 0);
    if (!(cutoff >= 0.0) || !(isfinite(cutoff) || may_be_infinite)) {
        failure->value = cutoff;
        return HS_ERR_CUTOFF;
    }
    return HS_OK;
}

/* Whether each of several systems has this of its own. */
static bool
have_cutoffs(const hs_query *query)
{
    return query->among != NULL && query->among->each != NULL &&
           query->among->each->cutoffs != NULL && !query->is_by_length;
}

/* Arguments, and what all systems share of the limit of pairs. */
static hs_status
check_query(const hs_query *query, const hs_finder *finder, const hs_call *call,
            hs_failure *failure)
{
    const hs_sets    *sets = &query->sets;
    const hs_options *options = &query->options;
    const bool        has_shells = query->reach == NULL && query->among == NULL;
    hs_status         status = hs_check_sets(sets->points, sets->queries, query->box, failure);
    if (status == HS_OK) {
        status = hs_check_options(options, HS_WANT_ALL | (has_shells ? HS_WANT_SHELL : 0));
    }
    if (status == HS_OK && query->is_by_length) {
        status = check_shells(options, failure);
    }
    if (status == HS_OK && query->among != NULL) {
        status = hs_systems_check(query, failure);
    }
    if (status == HS_OK && query->reach != NULL) {
        status = finder->is_nearest ? HS_ERR_ARGUMENT : check_reach(query, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    return call->kernel == NULL  ? HS_ERR_KERNEL
           : have_cutoffs(query) ? HS_OK
                                 : check_cutoff(query, finder, failure);
}

hs_status
hs_query_plan(hs_query_run *run)
{
    const hs_query *query = run->query;
    const hs_sets  *sets = &query->sets;
    hs_call        *call = run->call;
    hs_status       status = HS_OK;
    if (have_cutoffs(query)) {
        status = check_cutoff(query, run->finder, run->failure);
    }
    if (query->reach == NULL || status != HS_OK) {
        run->plan.n = 1;
        return status;
    }
    const bool    has_queries = sets->queries != NULL;
    const int64_t n = sets->points->n + (has_queries ? sets->queries->n : 0);
    status = hs_box_check(query->box, run->failure);
    if (status != HS_OK) {
        return status;
    }
    hs_call_gather(call, n);
    hs_call_gather_for(call, n, PAIRS_PER_POINT * (double)n, false);
    hs_set points = hs_set_with(sets->points, sets->of_points);
    hs_set queries = hs_set_with(sets->queries, sets->of_queries);
    /* Without what the rule does not look at. */
    if (has_queries && !hs_rule_needs_other(query->reach->rule)) {
        points.radii = points.supports = NULL;
    } else if (!hs_rule_needs_asking(query->reach->rule)) {
        queries.radii = queries.supports = NULL;
    }
    status = hs_levels_divide(&call->account, &call->options, &points,
                              has_queries ? &queries : NULL, query->reach, &run->levels,
                              run->failure);
    if (status == HS_OK) {
        run->has_levels = true;
        if (run->is_numbered) {
            hs_levels_renumber((int32_t)run->first_point, &run->levels);
        }
        status = hs_level_plan_make(&call->account, &run->levels, query->box, query->options.cutoff,
                                    query->options.algorithm, &run->plan);
    } else if (run->is_numbered) {
        hs_query_name_point(run, status);
    }
    return status;
}

void
hs_query_name_point(const hs_query_run *run, hs_status status)
{
    hs_failure *failure = run->failure;
    if (failure->row >= 0 && status != HS_ERR_BOX_FINITE && status != HS_ERR_BOX_DEPENDENT) {
        failure->row += failure->in_queries ? run->first_asking : run->first_point;
    }
}

void
hs_query_begin(const hs_query *query, const hs_finder *finder, hs_call *call, hs_failure *failure,
               hs_query_run *run)
{
    memset(run, 0, offsetof(hs_query_run, step));
    run->query = query;
    run->finder = finder;
    run->call = call;
    run->failure = failure;
}

hs_status
hs_query_open(const hs_query *query, const hs_finder *finder, hs_call *call, hs_query_run *run,
              hs_failure *failure)
{
    hs_query_begin(query, finder, call, failure, run);
    hs_status status = check_query(query, finder, call, failure);
    if (status == HS_OK && query->among == NULL) {
        status = hs_query_plan(run);
    }
    if (status == HS_OK && query->selection != NULL) {
        status = hs_choice_open(query->selection, &query->sets, call, failure);
    }
    if (status == HS_OK && call->choice != NULL && query->among == NULL) {
        /* None that are further apart than the cutoff. */
        const double cutoff = query->reach != NULL ? INFINITY : query->options.cutoff;
        status = hs_choice_set_scene(&query->sets, query->box, cutoff, call, failure);
    } else if (status == HS_OK && call->choice != NULL && query->box != NULL &&
               hs_choice_excludes(call->choice)) { /* boxes are looked at with their systems */
        status = hs_choice_keep_points(&query->sets, call, failure);
    }
    if (status != HS_OK) {
        hs_query_close(run);
    }
    return status;
}

void
hs_query_close(hs_query_run *run)
{
    hs_account *account = &run->call->account;
    hs_query_close_step(run);
    if (!run->is_part) {
        hs_choice_close(run->call);
    }
    if (run->has_levels) {
        hs_level_plan_free(account, &run->plan);
        hs_levels_free(account, &run->levels);
        run->has_levels = false;
    }
}

hs_status
hs_query_open_step(hs_query_run *run, int64_t number)
{
    const hs_query *query = run->query;
    hs_call        *call = run->call;
    hs_search      *search = &run->step.search;
    hs_sets         sets = query->sets;
    hs_status       status;
    if (run->has_levels) {
        status = hs_level_open(&run->plan, number, query->box, sets.keeps_none, call, &run->step,
                               run->failure);
    } else {
        if (query->is_by_length) {
            sets.is_plain = true;
            for (int64_t k = 0; sets.least_cutoff <= 0.0 && k < query->options.n_shells; k++) {
                sets.least_cutoff = query->options.shells[k]; /* the first above 0, or 0 */
            }
        }
        sets.least_cutoff = hs_choice_least_length(call->choice, sets.least_cutoff);
        sets.follows = run->has_scene;
        if (run->keeper == NULL) {
            status = hs_search_open(&sets, query->box, call, search, run->failure);
        } else { /* a thread that searches several systems has begun it */
            status = hs_search_build(&sets, query->box, search, run->failure);
            run->has_scene = status == HS_OK;
            if (status != HS_OK) {
                hs_search_close(search);
            }
        }
        for (int64_t si = 0; run->is_numbered && status == HS_OK && si < search->bins.n; si++) {
            search->bins.order[si] += (int32_t)run->first_point;
        }
        if (run->is_numbered && status != HS_OK) {
            hs_query_name_point(run, status);
        }
    }
    if (status != HS_OK) {
        return status;
    }
    run->search = search;
    if (run->is_numbered) { /* all that is found is a part of the same */
        search->n_before = run->first_asking;
        search->n_in_all = run->n_in_all;
    }
    return HS_OK;
}

void
hs_query_close_step(hs_query_run *run)
{
    if (run->search != NULL && run->has_levels) {
        hs_level_close(&run->step);
    } else if (run->search != NULL) {
        hs_search_close(run->search);
    }
    run->search = NULL;
}

hs_status
hs_query_each_step(hs_query_run *run, hs_use_fn use, void *context)
{
    hs_status status = HS_OK;
    for (int64_t s = 0; status == HS_OK && s < run->plan.n; s++) {
        status = hs_query_open_step(run, s);
        if (status == HS_OK) {
            status = use(context, run);
            hs_query_close_step(run);
            run->failure->in_queries = run->failure->in_queries && run->query->sets.queries != NULL;
        }
    }
    return status;
}

hs_status
hs_query_find(hs_query_run *run)
{
    const hs_finder *finder = run->finder;
    return finder->find != NULL ? finder->find(finder->context, run)
                                : hs_query_each_step(run, finder->step, finder->context);
}

hs_pairs *
hs_result_begin(bool has_input, const hs_options *options, hs_pairs **result, hs_failure **failure,
                hs_status *status)
{
    const bool can_begin = has_input && result != NULL && options != NULL;
    hs_pairs  *made = can_begin ? hs_pairs_new() : NULL;
    if (result != NULL) {
        *result = NULL;
    }
    if (made == NULL) {
        *status = hs_end_early(can_begin ? HS_ERR_MEMORY : HS_ERR_ARGUMENT, options, *failure);
        return NULL;
    }
    *failure = hs_call_enter(options, *failure, &made->call);
    *status = HS_OK;
    return made;
}

hs_status
hs_result_end(hs_pairs *made, hs_status status, hs_pairs **result, hs_failure *failure)
{
    if (made == NULL) {
        return status;
    }
    hs_call_tell_limit(&made->call, status, failure);
    return hs_pairs_finish(made, status, made->output.n_pairs, result);
}

void
hs_query_want_none(hs_query *query)
{
    query->options.want = 0;
    query->is_by_length = false;
    query->options.sorted = false;
    query->options.out = NULL;
}

hs_status
hs_query_answer(const hs_query *query, const hs_finder *finder, hs_pairs **result,
                hs_failure *failure)
{
    const hs_options *options = &query->options;
    hs_query_run      run;
    hs_call           own, *call = &own;
    hs_pairs         *pairs = NULL;
    if (finder->has_result) {
        hs_status early;
        pairs = hs_result_begin(!query->is_incomplete, options, result, &failure, &early);
        if (pairs == NULL) {
            return early;
        }
        call = &pairs->call;
    } else if (query->is_incomplete) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    } else {
        failure = hs_call_enter(options, failure, call);
    }
    hs_status status = hs_query_open(query, finder, call, &run, failure);
    if (status == HS_OK && pairs != NULL) {
        hs_pairs_open(pairs, query->sets.points->ndim);
        run.output = &pairs->output;
        run.offsets = &pairs->offsets;
    }
    if (status == HS_OK) {
        status = query->among != NULL ? hs_systems_find(&run) : hs_query_find(&run);
    }
    hs_query_close(&run);
    hs_call_tell_limit(call, status, failure);
    if (status == HS_ERR_MEMORY && !query->sets.keeps_none && query->reach == NULL &&
        !finder->is_nearest) { /* else the number of pairs is not the reason */
        hs_shortage shortage = {0.0, 0.0};
        if (run.output != NULL) {
            failure->expected_pairs = fmax(failure->expected_pairs, (double)run.output->n_pairs);
        }
        if (query->among != NULL) {
            hs_systems_add_shortage(query, &shortage);
        } else {
            hs_shortage_add(&query->sets, query->box, options->cutoff, &shortage);
        }
        hs_shortage_tell(&shortage, &call->options, query->sets.points->ndim, failure);
    }
    if (pairs != NULL) {
        status = hs_pairs_conclude(&pairs->output, status, failure);
        return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
    }
    hs_call_leave(call, run.n_pairs);
    hs_account_close(&call->account);
    return status;
}
