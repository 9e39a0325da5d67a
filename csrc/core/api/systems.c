/* SPDX-License-Identifier: BSD-3-Clause */
#include "systems.h"
#include "../base/sort.h"
#include "../search/choice.h"
#include "../search/search.h"
#include "../base/os.h"
#include "../box/lattice.h"
#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"
#include "../levels/levels.h"
#include "by_reach.h"
#include "request.h"

#include <string.h>
#include <math.h>

/* systems.c: many systems in one call: arrays of a system begin where those of the systems before
 * it end. */

/* Points first[s] to first[s + 1] of all. */
static hs_points
points_of_system(const hs_points *all, const int64_t *first, int64_t s)
{
    hs_points points = *all;
    points.n = first[s + 1] - first[s];
    if (points.n > 0) { /* without points there is no first row */
        points.data = (const char *)points.data + first[s] * points.row_stride;
    }
    return points;
}

const hs_box *
hs_box_of_system(const hs_systems *systems, int ndim, int64_t s, hs_box *own_box)
{
    if (systems->box == NULL || !hs_systems_have_boxes(systems)) {
        return systems->box;
    }
    const double *rows = systems->rows;
    *own_box = *systems->box;
    for (int l = 0; l < ndim; l++) {
        if (rows != NULL) {
            memcpy(own_box->rows[l], rows + (s * ndim + l) * ndim, (size_t)ndim * sizeof(double));
        }
        if (systems->periodic != NULL) {
            own_box->periodic[l] = systems->periodic[s] >> l & 1;
        }
    }
    return own_box;
}

static const double *
numbers_from(const double *numbers, int64_t first)
{
    return numbers != NULL ? numbers + first : NULL;
}

static const int32_t *
types_from(const int32_t *types, int64_t first)
{
    return types != NULL ? types + first : NULL;
}

static const int64_t *
labels_from(const int64_t *labels, int64_t first)
{
    return labels != NULL ? labels + first : NULL;
}

/* What pairs of system s have as their reach, where systems->reach is there. */
static hs_reach
reach_of_system(const hs_systems *systems, int ndim, int64_t s)
{
    const int64_t first = systems->first[s];
    const int64_t query = systems->first_query != NULL ? systems->first_query[s] : 0;
    const int64_t entries = (int64_t)ndim * ndim;
    hs_reach      reach = *systems->reach;
    reach.radii = numbers_from(reach.radii, first);
    reach.query_radii = numbers_from(reach.query_radii, query);
    reach.types = types_from(reach.types, first);
    reach.query_types = types_from(reach.query_types, query);
    reach.supports = numbers_from(reach.supports, first * entries);
    reach.query_supports = numbers_from(reach.query_supports, query * entries);
    return reach;
}

/* How many points, or queries, come before those of system s. */
static int64_t
first_asking(const hs_system_sets *sets, int64_t s)
{
    return sets->queries != NULL ? sets->systems->first_query[s] : sets->systems->first[s];
}

/* The system that has the point of this number, by where each of n systems begins. */
static int64_t
system_of(const int64_t *first, int64_t n, int64_t number)
{
    int64_t low = 0, high = n; /* first[low] <= number < first[high] */
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (first[middle] <= number) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

/* The system of both points of an excluded pair, or -1 for those of two systems. */
static int64_t
system_of_pair(const hs_system_sets *sets, const int64_t *pair)
{
    const hs_systems *systems = sets->systems;
    const int64_t    *first = sets->queries != NULL ? systems->first_query : systems->first;
    const int64_t     s = system_of(first, systems->n, pair[0]);
    return pair[1] >= systems->first[s] && pair[1] < systems->first[s + 1] ? s : -1;
}

hs_status
hs_excluded_parts_open(const hs_system_sets *sets, hs_account *account, hs_excluded_parts *parts)
{
    const hs_systems   *systems = sets->systems;
    const hs_selection *selection = systems->selection;
    const int64_t       n = systems->n;
    *parts = (hs_excluded_parts){NULL, NULL};
    if (selection == NULL || selection->n_excluded == 0) {
        return HS_OK;
    }
    parts->first = hs_alloc(account, HS_FOR_CANDIDATES, n + 2, sizeof *parts->first);
    parts->pairs =
        hs_alloc(account, HS_FOR_CANDIDATES, 2 * selection->n_excluded, sizeof *parts->pairs);
    if (parts->first == NULL || parts->pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(parts->first, 0, (size_t)(n + 2) * sizeof *parts->first);
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        const int64_t s = system_of_pair(sets, selection->excluded + 2 * e);
        parts->first[s + 2] += s >= 0; /* of pairs of two systems none is added */
    }
    hs_starts_of_lengths(parts->first + 1, n + 1);
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        const int64_t *pair = selection->excluded + 2 * e;
        const int64_t  s = system_of_pair(sets, pair);
        if (s >= 0) {
            const int64_t at = parts->first[s + 1]++;
            parts->pairs[2 * at] = pair[0] - first_asking(sets, s);
            parts->pairs[2 * at + 1] = pair[1] - systems->first[s];
        }
    }
    return HS_OK;
}

void
hs_excluded_parts_free(hs_account *account, hs_excluded_parts *parts)
{
    hs_free(account, parts->first);
    hs_free(account, parts->pairs);
    *parts = (hs_excluded_parts){NULL, NULL};
}

static hs_selection
selection_of(const hs_system_sets *sets, const hs_excluded_parts *excluded, int64_t s)
{
    hs_selection  selection = *sets->systems->selection;
    const int64_t first = sets->systems->first[s];
    const int64_t query = first_asking(sets, s);
    selection.groups = labels_from(selection.groups, first);
    selection.query_groups = labels_from(selection.query_groups, query);
    selection.labels = labels_from(selection.labels, first);
    selection.query_labels = labels_from(selection.query_labels, query);
    if (excluded->first != NULL) {
        selection.n_excluded = excluded->first[s + 1] - excluded->first[s];
        selection.excluded = excluded->pairs + 2 * excluded->first[s];
    }
    return selection;
}

void
hs_system_part_cut(const hs_system_sets *sets, const hs_excluded_parts *excluded, int64_t s,
                   hs_system_part *part)
{
    const hs_systems *systems = sets->systems;
    const int         ndim = sets->points->ndim;
    part->system = s;
    part->first_point = systems->first[s];
    part->first_asking = first_asking(sets, s);
    part->points = points_of_system(sets->points, systems->first, s);
    part->n_asking = part->points.n;
    part->among = (hs_among){.points = &part->points};
    part->among.box = hs_box_of_system(systems, ndim, s, &part->own_box);
    if (sets->queries != NULL) {
        part->queries = points_of_system(sets->queries, systems->first_query, s);
        part->n_asking = part->queries.n;
        part->among.queries = &part->queries;
    }
    if (systems->reach != NULL) {
        part->reach = reach_of_system(systems, ndim, s);
        part->among.reach = &part->reach;
    }
    if (systems->selection != NULL) {
        part->selection = selection_of(sets, excluded, s);
        part->among.selection = &part->selection;
    }
}

/* Takes a range of systems, searches one after the other, commits their pairs in
 * turn. */

/* Points that a range of systems should have: their pairs fit the backlog of a thread, so that
 * it seldom waits for others, and taking a range costs little beside them. */
#define RANGE_POINTS 512

/* Candidates between two polls, and as how many the rest of a system counts. */
#define POLL_WORK   (INT64_C(1) << 21)
#define SYSTEM_WORK 1024

/* What one thread works with. */
typedef struct worker {
    hs_committer          committer;
    const hs_systems_job *job;
    hs_call               call;      /* with this thread's poll */
    hs_search             search;    /* of one system after the other */
    bool                  has_scene; /* whether one was filled for a system before */
    hs_levels             levels; /* of the present system, where pairs have a reach of their own */
    hs_level_plan         plan;
    hs_level_search       step;
    hs_walker             walker;   /* kept from one system to the next */
    hs_recorder           recorder; /* like the walker */
    hs_choice             choice;   /* the job's with the present box, where pairs are excluded */
    hs_box                box;      /* of the present system, where each has its own */
    hs_output            *target;   /* the job's output, or the backlog's */
    hs_backlog            backlog;
    hs_output             found; /* pairs of one system before they are sorted */
    int64_t               work;  /* since the last poll */
} worker;

/* Makes the scene of a system ready; its points keep their numbers among the points of all
 * systems. */
static hs_status
build_system(worker *me, const hs_points *points, const hs_box *box, int64_t first)
{
    hs_failure     *failure = &me->committer.failure;
    const hs_sets   sets = {.points = points,
                            .follows = me->has_scene,
                            .least_cutoff = hs_choice_least_length(me->call.choice, 0.0)};
    const hs_status status = hs_search_build(&sets, box, &me->search, failure);
    me->has_scene = status == HS_OK;
    if (status == HS_OK) {
        hs_search_renumber(first, me->job->points->n, &me->search);
    } else if (status == HS_ERR_NOT_FINITE || status == HS_ERR_SHIFT_RANGE ||
               status == HS_ERR_ROUNDING) {
        failure->row += first;
    }
    return status;
}

static hs_status
count_pairs(worker *me, hs_search *search, int64_t s)
{
    hs_walker *walker = &me->walker;
    hs_status  status = hs_walker_renew(search, HS_BLOCK_COUNTS, NULL, NULL, walker);
    if (status == HS_OK) {
        const int64_t n = hs_search_asking(search)->n;
        status = hs_walk_or_tell(walker, 0, (int32_t)n, &me->committer.failure);
        me->job->counts[s] += walker->scanner.n_found;
    }
    hs_walker_flush_counters(search, walker);
    return status;
}

/* Adds the pairs to those of the system that are to be sorted. */
static hs_status
record_unsorted(worker *me, hs_search *search)
{
    hs_output     *found = &me->found;
    const unsigned columns = hs_sort_columns(search);
    if (found->columns != columns) { /* systems with images need more of them */
        hs_output_free(found);
        hs_output_init(&search->call->account, search->scene.ndim, columns, 4, found);
    }
    const hs_status status =
        hs_parallel_record_next(search, found, &me->walker, &me->recorder, &me->committer.failure);
    if (status == HS_ERR_MEMORY) {
        me->committer.failure.expected_pairs = (double)found->n_pairs;
    }
    return status;
}

static hs_status
find_pairs(worker *me, hs_search *search)
{
    hs_failure *failure = &me->committer.failure;
    hs_status   status = hs_estimate_by_sample(search, failure);
    if (status != HS_OK) {
        return status;
    }
    if (me->call.options.sorted) {
        return record_unsorted(me, search);
    }
    return me->job->is_direct
               ? hs_parallel_record_next(search, me->target, &me->walker, &me->recorder, failure)
               : hs_backlog_record(search, &me->backlog, &me->walker, failure);
}

/* Pairs of an open search of system s, which may be one of several. */
static hs_status
use_search(worker *me, hs_search *search, int64_t s)
{
    return me->job->output == NULL ? count_pairs(me, search, s) : find_pairs(me, search);
}

/* Writes the pairs of the present system in ascending order, where that is wanted. */
static hs_status
sort_system(worker *me, int64_t first, int64_t n)
{
    hs_output *found = &me->found;
    if (found->n_pairs == 0) {
        return HS_OK;
    }
    const hs_status status = hs_sort_pairs(&me->call, (int32_t)first, n, found, me->target);
    if (status == HS_ERR_MEMORY) {
        me->committer.failure.expected_pairs = (double)found->n_pairs;
    }
    return status;
}

/* What the pairs of a system have as their reach, and the further limit. */
static hs_status
reach_of(const worker *me, int64_t s, hs_reach *reach, double *bound, hs_failure *failure)
{
    const hs_systems *systems = me->job->systems;
    *reach = reach_of_system(systems, me->job->points->ndim, s);
    *bound = hs_cutoff_of_system(systems, s, me->job->total->options.cutoff);
    if (!(*bound >= 0.0) || (reach->n_types > 0 && !isfinite(*bound))) {
        failure->value = *bound;
        return HS_ERR_CUTOFF;
    }
    return HS_OK;
}

/* All searches of the plan, one after the other. */
static hs_status
search_steps(worker *me, int64_t s, const hs_box *box)
{
    hs_failure *failure = &me->committer.failure;
    hs_status   status = me->plan.n > 0 ? HS_OK : hs_box_check(box, failure);
    for (int64_t step = 0; status == HS_OK && step < me->plan.n; step++) {
        hs_search *search = &me->step.search;
        status =
            hs_level_open(&me->levels, &me->plan, step, box, false, &me->call, &me->step, failure);
        if (status == HS_OK) {
            search->first_point = me->job->systems->first[s];
            search->n_in_all = me->job->points->n;
            status = use_search(me, search, s);
            hs_level_close(&me->step);
        }
    }
    return status;
}

/* A system whose pairs have a reach of their own. */
static hs_status
search_by_reach(worker *me, int64_t s, const hs_points *points, const hs_box *box)
{
    hs_account   *account = &me->call.account;
    hs_failure   *failure = &me->committer.failure;
    const int64_t first = me->job->systems->first[s];
    hs_reach      reach;
    double        bound;
    hs_status     status = reach_of(me, s, &reach, &bound, failure);
    if (status != HS_OK) {
        return status;
    }
    status =
        hs_levels_divide(account, &me->call.options, points, NULL, &reach, &me->levels, failure);
    if (status != HS_OK) {
        failure->row += failure->row >= 0 ? first : 0;
        return status;
    }
    hs_levels_renumber((int32_t)first, &me->levels);
    status = hs_level_plan_choose(account, &me->call.options, &me->levels, box, bound,
                                  me->job->total->options.algorithm, &me->plan);
    if (status == HS_OK) {
        status = search_steps(me, s, box);
    }
    hs_level_plan_free(account, &me->plan);
    hs_levels_free(account, &me->levels);
    return status;
}

static hs_status
search_plainly(worker *me, int64_t s, const hs_points *points, const hs_box *box)
{
    const hs_systems *systems = me->job->systems;
    if (systems->cutoffs != NULL) {
        me->call.options.cutoff = systems->cutoffs[s];
    }
    hs_status status = build_system(me, points, box, systems->first[s]);
    if (status == HS_OK) {
        status = use_search(me, &me->search, s);
    }
    hs_search_close(&me->search);
    return status;
}

/* Which pairs of a system count, in its box. */
static hs_status
choose_in(worker *me, const hs_box *box)
{
    const hs_choice *shared = me->job->total->choice;
    if (shared == NULL || !hs_choice_excludes(shared)) {
        return HS_OK;
    }
    const hs_status status = hs_box_check(box, &me->committer.failure);
    return status == HS_OK ? hs_choice_set_box(box, me->job->points->ndim, &me->choice) : status;
}

/* After a system: what it took, and sometimes a poll. */
static hs_status
count_work(worker *me, int64_t s, int64_t n_candidates)
{
    const hs_systems_job *job = me->job;
    me->work += SYSTEM_WORK + n_candidates;
    if (me->work <= POLL_WORK) {
        return HS_OK;
    }
    me->work = 0;
    return hs_poll(&me->call.options, (double)job->systems->first[s + 1] / (double)job->points->n);
}

static hs_status
search_system(worker *me, int64_t s)
{
    const hs_systems_job *job = me->job;
    const int64_t         before = me->call.done.candidates;
    const hs_systems     *systems = job->systems;
    const hs_points       points = points_of_system(job->points, systems->first, s);
    const hs_box         *box = hs_box_of_system(systems, points.ndim, s, &me->box);
    me->found.n_pairs = 0;
    if (job->output == NULL) {
        job->counts[s] = 0;
    }
    hs_status status = choose_in(me, box);
    if (status == HS_OK) {
        status = job->systems->reach != NULL ? search_by_reach(me, s, &points, box)
                                             : search_plainly(me, s, &points, box);
    }
    if (status == HS_OK && me->call.options.sorted) {
        status = sort_system(me, job->systems->first[s], points.n);
    }
    hs_account_reset(&me->call.account);
    if (status != HS_OK) {
        me->committer.failure.system = s;
        return status;
    }
    return count_work(me, s, me->call.done.candidates - before);
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    worker               *me = context;
    const hs_systems_job *job = me->job;
    const int64_t         first = range * job->in_range, left = job->systems->n - first;
    const int64_t         end = first + (left < job->in_range ? left : job->in_range);
    hs_status             status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = search_system(me, s);
    }
    if (status != HS_OK || job->output == NULL) {
        return status;
    }
    const double done = (double)job->systems->first[end] / (double)job->points->n;
    if (job->is_direct && first == 0 && done > 0.0) {
        /* most batches have systems of similar size */
        hs_output_reserve_hint(job->output, (double)job->output->n_pairs / done);
    }
    /* Of nothing, where pairs are written directly: then it only says how far this has come. */
    return hs_commit(&me->committer, done, true);
}

/* Cannot fail: memory is taken as it is needed. */
static hs_status
open_worker(void *context, void *place)
{
    const hs_systems_job *job = context;
    const hs_options     *options = &job->total->options;
    worker               *me = place;
    me->job = job;
    hs_call_begin(options, &me->call);
    if (job->total->choice != NULL) {
        me->choice = *job->total->choice;
        me->call.choice = &me->choice;
    }
    me->call.options = *options; /* their poll counts already, for the whole call */
    hs_search_begin(&me->call, &me->search);
    me->committer.options = &me->call.options;
    if (job->output != NULL) {
        me->committer.pairs = &me->backlog.pairs;
        hs_backlog_init(job->output, &me->committer, &me->backlog);
        me->target = job->is_direct ? job->output : &me->backlog.pairs;
    }
    return HS_OK;
}

/* Adds what the worker did to `total`, and frees what it has. */
static void
close_worker(void *context, void *place)
{
    hs_call    *total = ((hs_systems_job *)context)->total;
    worker     *me = place;
    hs_account *account = &me->call.account;
    hs_backlog_free(account, &me->backlog);
    hs_walker_close(&me->search, &me->walker);
    hs_recorder_free(account, &me->recorder);
    hs_output_free(&me->found);
    hs_call_add_counters(total, &me->call.done);
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        total->account.total.bytes[p] += account->total.bytes[p];
    }
    total->account.total.bytes_peak += account->total.bytes_peak;
    hs_account_close(account);
}

hs_status
hs_systems_search(hs_systems_job *job, hs_failure *failure)
{
    const int64_t n_systems = job->systems->n;
    const int64_t in_range = RANGE_POINTS * n_systems / (job->points->n + 1);
    job->in_range = in_range > 1 ? in_range : 1;
    job->is_direct = hs_team_size(job->total->team) == 1 && job->output != NULL &&
                     !job->output->fixed;
    hs_crew crew = {.call = job->total,
                    .job = job,
                    .worker_size = sizeof(worker),
                    .open = open_worker,
                    .close = close_worker,
                    .n_ranges = (n_systems + job->in_range - 1) / job->in_range,
                    .search = search_range,
                    .output = job->output};
    return hs_crew_run(&crew, failure);
}

/* What all systems share is checked also where there are none. */

static hs_status
check_queries(const hs_system_sets *sets, hs_failure *failure)
{
    const hs_systems of_queries = {.n = sets->systems->n, .first = sets->systems->first_query};
    if (sets->queries == NULL) {
        return HS_OK;
    }
    const hs_status status = hs_check_systems(&of_queries, sets->queries->n, failure);
    failure->in_queries = status != HS_OK;
    return status;
}

/* The arguments of a call that has been entered, and its kernel. What a system has of its own is
 * looked at with it. */
static hs_status
systems_check(const hs_system_sets *sets, const hs_call *total, hs_failure *failure)
{
    const hs_systems *systems = sets->systems;
    const hs_box     *box = systems != NULL ? systems->box : NULL;
    hs_status         status =
        hs_check_arguments(sets->points, sets->queries, box, &total->options, failure);
    if (status == HS_OK) {
        status = hs_check_systems(systems, sets->points->n, failure);
    }
    if (status == HS_OK) {
        status = check_queries(sets, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    return total->kernel == NULL            ? HS_ERR_KERNEL
           : hs_systems_have_boxes(systems) ? HS_OK
                                            : hs_box_check(box, failure);
}

/* After that, where pairs have the cutoff or a reach as their limit, and what all systems share of
 * it; is_full: rules may have a direction. */
static hs_status
systems_check_limit(const hs_system_sets *sets, bool is_full, const hs_options *options,
                    hs_failure *failure)
{
    const hs_systems *systems = sets->systems;
    if (systems->reach != NULL) { /* limits of each system are looked at with it */
        hs_options       without = *options;
        const hs_request request = {
            .sets = {.points = sets->points, .queries = sets->queries, .is_full = is_full},
            .options = &without,
            .reach = systems->reach};
        without.cutoff = systems->cutoffs != NULL ? 0.0 : options->cutoff;
        return hs_by_reach_check(&request, failure);
    }
    if (systems->cutoffs == NULL && !(options->cutoff >= 0.0 && isfinite(options->cutoff))) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    return HS_OK;
}

/* Each thread has an account of its own: together they must not pass the limit of the call. */
static void
share_limit(hs_options *options, int n_threads)
{
    if (n_threads > 1 && options->find_limit != NULL) {
        options->memory_limit =
            fmin(options->memory_limit, options->find_limit(options->find_context));
        options->find_limit = NULL;
    }
    options->memory_limit /= n_threads;
}

/* The public searches of many systems: find and count. Threads take ranges of
 * them. */

/* What a search that was refused memory would have taken, all systems together. */
static void
tell_shortage(const hs_systems_job *job, hs_failure *failure)
{
    const hs_call *total = job->total;
    hs_shortage    shortage = {0.0, 0.0};
    for (int64_t s = 0; s < job->systems->n; s++) {
        hs_box          own_box;
        const hs_points points = points_of_system(job->points, job->systems->first, s);
        const hs_box   *box = hs_box_of_system(job->systems, points.ndim, s, &own_box);
        const double    cutoff = hs_cutoff_of_system(job->systems, s, total->options.cutoff);
        hs_shortage_add(&points, box, cutoff, &shortage);
    }
    hs_shortage_tell(&shortage, &total->options, job->points->ndim, total->account.limit, failure);
}

static hs_status
check_arguments(const hs_systems_job *job, hs_failure *failure)
{
    const hs_system_sets sets = {.points = job->points, .systems = job->systems};
    const hs_status      status = systems_check(&sets, job->total, failure);
    return status == HS_OK ? systems_check_limit(&sets, false, &job->total->options, failure)
                           : status;
}

/* Which pairs count. Boxes are looked at with their systems. */
static hs_status
open_choice(const hs_systems_job *job, hs_failure *failure)
{
    const hs_sets sets = {.points = job->points};
    hs_status     status = hs_choice_open(job->systems->selection, &sets, job->total, failure);
    if (status == HS_OK && job->total->choice != NULL && job->systems->box != NULL &&
        hs_choice_excludes(job->total->choice)) {
        status = hs_choice_keep_points(&sets, job->total, failure);
    }
    return status;
}

/* Both public functions once all is checked. */
static hs_status
search_systems(hs_systems_job *job, hs_failure *failure)
{
    hs_call          *total = job->total;
    const hs_options *options = &total->options;
    hs_status         status = open_choice(job, failure);
    if (status == HS_OK && job->systems->n > 0) {
        const int n_threads = hs_call_threads((double)job->points->n, options);
        const int most = job->systems->n < n_threads ? (int)job->systems->n : n_threads;
        total->team = hs_team_create(most);
        share_limit(&total->options, hs_team_size(total->team));
        status = hs_systems_search(job, failure);
    }
    hs_choice_close(total);
    if (status == HS_ERR_MEMORY) {
        const double found = job->output != NULL ? (double)job->output->n_pairs : 0.0;
        failure->expected_pairs = fmax(failure->expected_pairs, found);
        if (job->systems->reach == NULL) {
            tell_shortage(job, failure);
        } else {
            hs_call_tell_limit(total, status, failure);
        }
    }
    return status;
}

hs_status
hs_systems_find(const hs_points *points, const hs_systems *systems, const hs_options *options,
                hs_pairs **result, hs_failure *failure)
{
    if (!hs_can_return(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_pairs *pairs = hs_pairs_begin(options, &failure);
    if (pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_systems_job job = {
        .points = points, .systems = systems, .total = &pairs->call, .output = &pairs->output};
    hs_status status = check_arguments(&job, failure);
    if (status == HS_OK) {
        hs_pairs_open(pairs, points->ndim);
        status = search_systems(&job, failure);
        status = hs_pairs_conclude(&pairs->output, status, failure);
    }
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}

hs_status
hs_systems_count(const hs_points *points, const hs_systems *systems, const hs_options *options,
                 int64_t *counts, hs_failure *failure)
{
    hs_call        total;
    hs_systems_job job = {.points = points, .systems = systems, .total = &total, .counts = counts};
    int64_t        found = 0;
    if (options == NULL || (counts == NULL && systems != NULL && systems->n > 0)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options counting = hs_options_of_count(options);
    failure = hs_call_enter(&counting, failure, &total);
    hs_status status = check_arguments(&job, failure);
    if (status == HS_OK) {
        status = search_systems(&job, failure);
    }
    for (int64_t s = 0; status == HS_OK && s < systems->n; s++) {
        found += counts[s];
    }
    hs_call_leave(&total, found);
    hs_account_close(&total.account);
    return status;
}

/* A worker has its own options, whose poll tells how much of all systems is done.
 */

/* Points that a range of systems should have. */
#define CALL_RANGE_POINTS 512

/* What the threads share. */
typedef struct calls_job {
    const hs_systems_each *each;
    hs_excluded_parts      excluded;
    hs_call               *total;
    int64_t                n_points;  /* that are asked for, at least 1 */
    int64_t                in_range;  /* systems of a range */
    bool                   is_direct; /* the one thread writes to the output itself */
} calls_job;

/* What one thread works with. */
typedef struct caller {
    hs_committer     committer;
    const calls_job *job;
    hs_options       options; /* with this thread's poll */
    hs_counters      done;
    hs_output        backlog; /* pairs that wait for their turn; not charged to the account */
    hs_output       *target;  /* this one, or that of all */
    hs_system_part   part;
    double           first, share; /* of the present system, of all points */
} caller;

/* A hs_poll_fn: the fraction of all systems. */
static bool
poll_for_all(void *context, double fraction)
{
    caller *me = context;
    return hs_poll(&me->options, me->first + fraction * me->share) == HS_OK;
}

/* Adds a number to n of one column, every `step`-th from `at` on, but for -1, which is none. */
static void
add_to_column(hs_output *output, unsigned bit, int64_t at, int64_t n, int step, int64_t more)
{
    if (output->index_bytes == 4) {
        int32_t *numbers = hs_output_column(output, bit);
        for (int64_t e = 0; numbers != NULL && e < n; e++) {
            numbers[at + e * step] += numbers[at + e * step] >= 0 ? (int32_t)more : 0;
        }
    } else {
        int64_t *numbers = hs_output_column(output, bit);
        for (int64_t e = 0; numbers != NULL && e < n; e++) {
            numbers[at + e * step] += numbers[at + e * step] >= 0 ? more : 0;
        }
    }
}

/* Writes what a system has, numbered among all, behind what is there. */
static hs_status
append(caller *me, const hs_pairs *pairs)
{
    hs_output    *target = me->target;
    const int64_t n = pairs->output.n_pairs, at = target->n_pairs, end = at + n;
    const int64_t i = me->part.first_asking, j = me->part.first_point;
    if (hs_output_reserve(target, n, me->job->is_direct ? me->first + me->share : 0.0) != HS_OK) {
        me->committer.failure.expected_pairs = (double)end;
        return HS_ERR_MEMORY;
    }
    hs_output_copy(target, at, &pairs->output, 0, n);
    target->n_pairs = end;
    add_to_column(target, HS_WANT_I, at, n, 1, i);
    add_to_column(target, HS_WANT_J, at, n, 1, j);
    add_to_column(target, HS_WANT_BOTH, 2 * at, n, 2, i);
    add_to_column(target, HS_WANT_BOTH, 2 * at + 1, n, 2, j);
    return HS_OK;
}

/* Whether the row of a failure is that of a point, and not of the box. */
static bool
is_of_point(hs_status status, const hs_failure *failure)
{
    return failure->row >= 0 && status != HS_ERR_BOX_FINITE && status != HS_ERR_BOX_DEPENDENT;
}

static void
note(caller *me, const hs_counters *of_system)
{
    hs_counters *done = &me->done;
    done->pairs += of_system->pairs;
    done->groups += of_system->groups;
    done->candidates += of_system->candidates;
    done->ambiguous += of_system->ambiguous;
    done->by_float64 += of_system->by_float64;
    done->by_double_word += of_system->by_double_word;
    done->by_integers += of_system->by_integers;
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        const int64_t bytes = of_system->bytes[p];
        done->bytes[p] = bytes > done->bytes[p] ? bytes : done->bytes[p];
    }
    done->bytes_peak = of_system->bytes_peak > done->bytes_peak ? of_system->bytes_peak
                                                                : done->bytes_peak;
}

static hs_status
call_for_system(caller *me, int64_t s)
{
    const calls_job       *shared = me->job;
    const hs_systems_each *each = shared->each;
    const hs_systems      *systems = each->sets.systems;
    const hs_system_part  *part = &me->part;
    hs_failure            *failure = &me->committer.failure;
    hs_pairs              *pairs = NULL;
    hs_counters            counters = {.pairs = 0};
    hs_options             options = me->options;
    hs_system_part_cut(&each->sets, &shared->excluded, s, &me->part);
    me->first = (double)part->first_asking / (double)shared->n_points;
    me->share = (double)part->n_asking / (double)shared->n_points;
    options.cutoff = hs_cutoff_of_system(systems, s, options.cutoff);
    options.counters = &counters;
    options.poll = options.poll != NULL ? poll_for_all : NULL;
    options.poll_context = me;
    hs_status status = each->search(each->context, part, &options, &pairs, failure);
    note(me, &counters);
    if (status != HS_OK && is_of_point(status, failure)) {
        failure->row += failure->in_queries ? part->first_asking : part->first_point;
    }
    if (status == HS_OK && pairs != NULL) {
        status = append(me, pairs);
    }
    hs_pairs_free(pairs);
    if (status != HS_OK) {
        failure->system = s;
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
call_for_range(void *context, int64_t range)
{
    caller          *me = context;
    const calls_job *shared = me->job;
    const int64_t    n_systems = shared->each->sets.systems->n;
    const int64_t    first = range * shared->in_range, left = n_systems - first;
    const int64_t    end = first + (left < shared->in_range ? left : shared->in_range);
    hs_status        status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = call_for_system(me, s);
    }
    if (status == HS_OK) {
        status = hs_poll(&me->options, me->first + me->share);
    }
    if (status != HS_OK || shared->each->output == NULL) {
        return status;
    }
    /* Of nothing, where pairs are written directly: then it only says how far this has come. */
    return hs_commit(&me->committer, me->first + me->share, true);
}

/* Cannot fail: memory is taken as it is needed. */
static hs_status
open_caller(void *context, void *place)
{
    const calls_job *shared = context;
    hs_output       *output = shared->each->output;
    caller          *me = place;
    me->job = shared;
    me->options = shared->total->options;
    me->committer.options = &me->options;
    if (output != NULL) {
        hs_output_init(NULL, output->ndim, output->columns, output->index_bytes, &me->backlog);
        me->committer.pairs = &me->backlog;
        me->target = shared->is_direct ? output : &me->backlog;
    }
    return HS_OK;
}

/* Adds what the worker did to the call, and frees what it has. */
static void
close_caller(void *context, void *place)
{
    hs_call *total = ((calls_job *)context)->total;
    caller  *me = place;
    hs_output_free(&me->backlog);
    hs_call_add_counters(total, &me->done);
    total->done.pairs += me->done.pairs;
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        total->account.total.bytes[p] += me->done.bytes[p];
    }
    total->account.total.bytes_peak += me->done.bytes_peak;
}

/* Once all is checked. */
static hs_status
search_all(calls_job *shared, hs_failure *failure)
{
    hs_call               *total = shared->total;
    const hs_systems_each *each = shared->each;
    const int64_t          n_systems = each->sets.systems->n;
    const int              n_threads =
        hs_call_threads((double)(each->sets.points->n + shared->n_points), &total->options);
    total->team = hs_team_create(n_systems < n_threads ? (int)n_systems : n_threads);
    share_limit(&total->options, hs_team_size(total->team));
    total->options.threads = 1;
    total->options.out = NULL;
    shared->is_direct = hs_team_size(total->team) == 1 && each->output != NULL &&
                        !each->output->fixed;
    const int64_t in_range = CALL_RANGE_POINTS * n_systems / (shared->n_points + 1);
    shared->in_range = in_range > 1 ? in_range : 1;
    hs_crew crew = {.call = total,
                    .job = shared,
                    .worker_size = sizeof(caller),
                    .open = open_caller,
                    .close = close_caller,
                    .n_ranges = (n_systems + shared->in_range - 1) / shared->in_range,
                    .search = call_for_range,
                    .output = each->output};
    return hs_crew_run(&crew, failure);
}

/* Checks what the systems share, also where there are none, and does it, for a call that has been
 * entered. total->done.pairs becomes their number, failure->system the one that fails. */
static hs_status
systems_do_each(const hs_systems_each *each, hs_call *total, hs_failure *failure)
{
    const hs_system_sets *sets = &each->sets;
    calls_job             shared = {.each = each, .total = total};
    hs_status             status = systems_check(sets, total, failure);
    if (status == HS_OK && each->has_limit) {
        status = systems_check_limit(sets, true, &total->options, failure);
    }
    if (status == HS_OK && sets->systems->selection != NULL) {
        const hs_sets all = {.points = sets->points, .queries = sets->queries};
        status = hs_selection_check(sets->systems->selection, &all, &total->options, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    shared.n_points = sets->queries != NULL ? sets->queries->n : sets->points->n;
    shared.n_points += shared.n_points == 0;
    status = hs_excluded_parts_open(sets, &total->account, &shared.excluded);
    if (status == HS_OK && sets->systems->n > 0) {
        status = search_all(&shared, failure);
    }
    hs_excluded_parts_free(&total->account, &shared.excluded);
    hs_call_tell_limit(total, status, failure);
    return status;
}

/* The public searches of many systems whose results are rows, counts of rows,
 * and histograms. */

/* Where what is found goes besides the pairs. */
typedef struct rows_job {
    int64_t             k;       /* of the nearest; 0: all neighbours */
    int64_t            *offsets; /* of all rows; each length goes to the entry behind it */
    int64_t            *counts;  /* of all rows; NULL: there is a histogram */
    const hs_histogram *histogram;
} rows_job;

/* A hs_system_fn. */
static hs_status
find_neighbors(void *context, const hs_system_part *part, const hs_options *options,
               hs_pairs **pairs, hs_failure *failure)
{
    const rows_job *job = context;
    const hs_status status = hs_neighbors_find(&part->among, options, pairs, failure);
    if (status == HS_OK) {
        const int64_t *offsets = hs_pairs_offsets(*pairs), n = hs_pairs_rows(*pairs);
        for (int64_t i = 0; i < n; i++) {
            job->offsets[part->first_asking + i + 1] = offsets[i + 1] - offsets[i];
        }
    }
    return status;
}

/* A hs_system_fn. */
static hs_status
count_neighbors(void *context, const hs_system_part *part, const hs_options *options,
                hs_pairs **pairs, hs_failure *failure)
{
    const rows_job *job = context;
    (void)pairs;
    return hs_neighbors_count(&part->among, options, job->counts + part->first_asking, failure);
}

/* A hs_system_fn. */
static hs_status
find_nearest(void *context, const hs_system_part *part, const hs_options *options, hs_pairs **pairs,
             hs_failure *failure)
{
    const rows_job *job = context;
    return hs_nearest_find(&part->among, job->k, options, pairs, failure);
}

static hs_marks
marks_from(hs_marks marks, int64_t first)
{
    marks.types = marks.types != NULL ? marks.types + first : NULL;
    marks.weights = marks.weights != NULL ? marks.weights + first : NULL;
    return marks;
}

/* A hs_system_fn. */
static hs_status
count_by_distance(void *context, const hs_system_part *part, const hs_options *options,
                  hs_pairs **pairs, hs_failure *failure)
{
    const rows_job     *job = context;
    const hs_histogram *all = job->histogram;
    const int64_t       at = part->system * all->n_edges * all->n_types * all->n_types;
    hs_histogram        own = *all;
    (void)pairs;
    own.of_points = marks_from(own.of_points, part->first_point);
    own.of_queries = marks_from(own.of_queries, part->first_asking);
    own.counts = own.counts != NULL ? own.counts + at : NULL;
    own.sums = own.sums != NULL ? own.sums + at : NULL;
    return hs_pairs_histogram(&part->among, options, &own, failure);
}

static int64_t
number_asking(const hs_system_sets *sets)
{
    return sets->queries != NULL ? sets->queries->n : sets->points->n;
}

/* The largest distance of nearest points, which may be infinite. */
static hs_status
check_radius(const hs_system_sets *sets, const hs_options *options, hs_failure *failure)
{
    if (sets->systems->cutoffs != NULL || options->cutoff >= 0.0) {
        return HS_OK;
    }
    failure->value = options->cutoff;
    return HS_ERR_CUTOFF;
}

/* What a search that keeps pairs returns, from the check that it can to the end. */
static hs_status
find_rows(const hs_system_sets *sets, hs_system_fn search, int64_t k, const hs_options *options,
          hs_pairs **result, hs_failure *failure)
{
    hs_pairs *rows = hs_pairs_begin(options, &failure);
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    rows_job        job = {.k = k};
    hs_systems_each each = {.sets = *sets,
                            .search = search,
                            .context = &job,
                            .has_limit = k == 0,
                            .output = &rows->output};
    hs_status       status = systems_check(sets, &rows->call, failure);
    if (status == HS_OK) {
        hs_pairs_open(rows, sets->points->ndim);
        status = k > 0 ? check_radius(sets, options, failure)
                       : hs_pairs_open_offsets(&rows->call.account, number_asking(sets) + 1, rows,
                                               &job.offsets);
    }
    if (status == HS_OK) {
        status = systems_do_each(&each, &rows->call, failure);
    }
    if (status == HS_OK && k == 0) {
        job.offsets[0] = 0;
        hs_starts_of_lengths(job.offsets, number_asking(sets) + 1);
    }
    status = hs_pairs_conclude(&rows->output, status, failure);
    return hs_pairs_finish(rows, status, rows->output.n_pairs, result);
}

hs_status
hs_systems_neighbors(const hs_points *points, const hs_points *queries, const hs_systems *systems,
                     const hs_options *options, hs_pairs **rows, hs_failure *failure)
{
    const hs_system_sets sets = {points, queries, systems};
    if (!hs_can_return(rows, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options of_rows = *options;
    of_rows.sorted = false;
    return find_rows(&sets, find_neighbors, 0, &of_rows, rows, failure);
}

/* What the nearest points are not found among: those within a reach, or of a selection. */
static bool
is_selective(const hs_systems *systems)
{
    return systems != NULL && (systems->reach != NULL || systems->selection != NULL);
}

hs_status
hs_systems_nearest(const hs_points *points, const hs_points *queries, const hs_systems *systems,
                   int64_t k, const hs_options *options, hs_pairs **rows, hs_failure *failure)
{
    const hs_system_sets sets = {points, queries, systems};
    if (!hs_can_return(rows, options) || k < 1 || is_selective(systems)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options of_rows = hs_options_of_nearest(options);
    return find_rows(&sets, find_nearest, k, &of_rows, rows, failure);
}

/* The histogram of each system; with 2^31 entries the counts of all might pass int64. */
static hs_status
check_histogram(const hs_histogram *histogram, hs_failure *failure)
{
    const hs_status status = hs_check_histogram(histogram, failure);
    if (status != HS_OK) {
        return status;
    }
    const double n = (double)histogram->n_types;
    return n * n * (double)histogram->n_edges < 0x1p31 ? HS_OK : HS_ERR_MEMORY;
}

/* A search that keeps none. */
static hs_status
count_rows(const hs_systems_each *each, const hs_options *options, hs_failure *failure)
{
    const rows_job  *job = each->context;
    hs_call          call;
    hs_status        status = HS_OK;
    const hs_options counting = hs_options_of_count(options);
    failure = hs_call_enter(&counting, failure, &call);
    if (job->counts == NULL) {
        status = check_histogram(job->histogram, failure);
    }
    if (status == HS_OK) {
        status = systems_do_each(each, &call, failure);
    }
    hs_call_leave(&call, call.done.pairs);
    hs_account_close(&call.account);
    return status;
}

hs_status
hs_systems_coordination(const hs_points *points, const hs_points *queries,
                        const hs_systems *systems, const hs_options *options, int64_t *counts,
                        hs_failure *failure)
{
    int64_t         none; /* where there are no points, there may be no counts */
    rows_job        job = {.counts = counts != NULL ? counts : &none};
    hs_systems_each each = {.sets = {points, queries, systems},
                            .search = count_neighbors,
                            .context = &job,
                            .has_limit = true};
    if (options == NULL || !hs_has_entries(counts, queries != NULL ? queries : points)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    return count_rows(&each, options, failure);
}

hs_status
hs_systems_histogram(const hs_points *points, const hs_points *queries, const hs_systems *systems,
                     const hs_options *options, const hs_histogram *histogram, hs_failure *failure)
{
    rows_job        job = {.histogram = histogram};
    hs_systems_each each = {
        .sets = {points, queries, systems}, .search = count_by_distance, .context = &job};
    if (options == NULL || (systems != NULL && systems->reach != NULL)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_options of_search = *options;
    of_search.precision = HS_EXACT;
    return count_rows(&each, &of_search, failure);
}
