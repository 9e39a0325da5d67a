/* SPDX-License-Identifier: BSD-3-Clause */
/* systems_thread.c: takes a range of systems, searches one after the other, commits their pairs in
 * turn. */
#include "systems_thread.h"

#include "system_part.h"

#include "../search/choice.h"
#include "../search/estimate.h"
#include "../base/poll.h"
#include "../box/lattice.h"
#include "../collect/crew.h"
#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"
#include "../levels/level_join.h"
#include "../levels/level_search.h"
#include "../search/search_open.h"

#include <math.h>
#include <string.h>

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
    hs_walker_rest(search, walker);
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
        hs_record_next(search, found, &me->walker, &me->recorder, &me->committer.failure);
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
               ? hs_record_next(search, me->target, &me->walker, &me->recorder, failure)
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
    *reach = hs_reach_of_system(systems, me->job->points->ndim, s);
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
    const hs_points       points = hs_points_of_system(job->points, systems->first, s);
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
        hs_output_expect(job->output, (double)job->output->n_pairs / done);
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
    hs_call_note(total, &me->call.done);
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
