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

/* The points of system s. */
static hs_points
points_of_system(const hs_set *all, int64_t s)
{
    hs_points points = all->at;
    points.n = all->first[s + 1] - all->first[s];
    if (points.n > 0) { /* without points there is no first row */
        points.data = (const char *)points.data + all->first[s] * points.row_stride;
    }
    return points;
}

/* With what is known of them. */
static hs_set
set_of_system(const hs_set *all, int64_t s)
{
    const int64_t first = all->first[s], entries = (int64_t)all->at.ndim * all->at.ndim;
    return (hs_set){.at = points_of_system(all, s),
                    .radii = all->radii != NULL ? all->radii + first : NULL,
                    .supports = all->supports != NULL ? all->supports + first * entries : NULL,
                    .weights = all->weights != NULL ? all->weights + first : NULL,
                    .types = all->types != NULL ? all->types + first : NULL,
                    .groups = all->groups != NULL ? all->groups + first : NULL,
                    .labels = all->labels != NULL ? all->labels + first : NULL};
}

/* Those that ask: queries, or the points. */
static const hs_set *
asking_of(const hs_among *among)
{
    return among->queries != NULL ? among->queries : among->points;
}

/* Whether each system has something of a box of its own. */
static bool
have_boxes(const hs_among *among)
{
    return among->each != NULL && (among->each->rows != NULL || among->each->periodic != NULL);
}

static bool
have_cutoffs(const hs_among *among)
{
    return among->each != NULL && among->each->cutoffs != NULL;
}

const hs_box *
hs_box_of_system(const hs_among *among, int64_t s, hs_box *own_box)
{
    const int ndim = among->points->at.ndim;
    if (among->box == NULL || !have_boxes(among)) {
        return among->box;
    }
    const hs_each_system *each = among->each;
    *own_box = *among->box;
    for (int l = 0; l < ndim; l++) {
        if (each->rows != NULL) {
            memcpy(own_box->rows[l], each->rows + (s * ndim + l) * ndim,
                   (size_t)ndim * sizeof(double));
        }
        if (each->periodic != NULL) {
            own_box->periodic[l] = each->periodic[s] >> l & 1;
        }
    }
    return own_box;
}

/* The system that has the point of this number. */
static int64_t
system_of(const hs_set *set, int64_t number)
{
    int64_t low = 0, high = set->n_systems; /* first[low] <= number < first[high] */
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (set->first[middle] <= number) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

/* The set that the first numbers of excluded pairs are of. */
static const hs_set *
numbered(const hs_among *among)
{
    return among->selection->query_numbers != NULL ? among->points : asking_of(among);
}

/* The system of both points of an excluded pair, or -1 for those of two systems. */
static int64_t
system_of_pair(const hs_among *among, const int64_t *pair)
{
    const int64_t *first = among->points->first, s = system_of(numbered(among), pair[0]);
    return pair[1] >= first[s] && pair[1] < first[s + 1] ? s : -1;
}

static bool
sort_excluded(const hs_among *among, hs_account *account, hs_selected_parts *parts)
{
    const hs_selection *selection = among->selection;
    const int64_t       n = among->points->n_systems;
    parts->first = hs_alloc(account, HS_FOR_CANDIDATES, n + 2, sizeof *parts->first);
    parts->pairs =
        hs_alloc(account, HS_FOR_CANDIDATES, 2 * selection->n_excluded, sizeof *parts->pairs);
    if (parts->first == NULL || parts->pairs == NULL) {
        return false;
    }
    memset(parts->first, 0, (size_t)(n + 2) * sizeof *parts->first);
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        const int64_t s = system_of_pair(among, selection->excluded + 2 * e);
        parts->first[s + 2] += s >= 0; /* of pairs of two systems none is added */
    }
    hs_starts_of_lengths(parts->first + 1, n + 1);
    for (int64_t e = 0; e < selection->n_excluded; e++) {
        const int64_t *pair = selection->excluded + 2 * e;
        const int64_t  s = system_of_pair(among, pair);
        if (s >= 0) {
            const int64_t at = parts->first[s + 1]++;
            parts->pairs[2 * at] = pair[0] - numbered(among)->first[s];
            parts->pairs[2 * at + 1] = pair[1] - among->points->first[s];
        }
    }
    return true;
}

/* Those that are points of another system are out of range then. */
static bool
cut_query_numbers(const hs_among *among, hs_account *account, hs_selected_parts *parts)
{
    const hs_set  *points = among->points, *queries = among->queries;
    const int64_t *numbers = among->selection->query_numbers;
    parts->query_numbers =
        hs_alloc(account, HS_FOR_CANDIDATES, queries->at.n, sizeof *parts->query_numbers);
    for (int64_t s = 0; parts->query_numbers != NULL && s < points->n_systems; s++) {
        for (int64_t q = queries->first[s]; q < queries->first[s + 1]; q++) {
            parts->query_numbers[q] = numbers[q] - points->first[s];
        }
    }
    return parts->query_numbers != NULL;
}

hs_status
hs_selected_parts_open(const hs_among *among, hs_account *account, hs_selected_parts *parts)
{
    const hs_selection *selection = among->selection;
    *parts = (hs_selected_parts){NULL, NULL, NULL};
    if (selection == NULL) {
        return HS_OK;
    }
    const bool has_numbers = selection->query_numbers != NULL && among->queries != NULL;
    return (selection->n_excluded == 0 || sort_excluded(among, account, parts)) &&
                   (!has_numbers || cut_query_numbers(among, account, parts))
               ? HS_OK
               : HS_ERR_MEMORY;
}

void
hs_selected_parts_free(hs_account *account, hs_selected_parts *parts)
{
    hs_free(account, parts->first);
    hs_free(account, parts->pairs);
    hs_free(account, parts->query_numbers);
    *parts = (hs_selected_parts){NULL, NULL, NULL};
}

void
hs_system_part_cut(const hs_among *among, const hs_selected_parts *selected, int64_t s,
                   hs_system_part *part)
{
    part->system = s;
    part->first_point = among->points->first[s];
    part->first_asking = asking_of(among)->first[s];
    part->points = set_of_system(among->points, s);
    part->n_asking = part->points.at.n;
    part->among = (hs_among){.points = &part->points, .reach = among->reach};
    part->among.box = hs_box_of_system(among, s, &part->own_box);
    if (among->queries != NULL) {
        part->queries = set_of_system(among->queries, s);
        part->n_asking = part->queries.at.n;
        part->among.queries = &part->queries;
    }
    if (among->selection != NULL) {
        part->selection = *among->selection;
        part->among.selection = &part->selection;
        if (selected->first != NULL) {
            part->selection.n_excluded = selected->first[s + 1] - selected->first[s];
            part->selection.excluded = selected->pairs + 2 * selected->first[s];
        }
        if (selected->query_numbers != NULL) {
            part->selection.query_numbers = selected->query_numbers + part->first_asking;
        }
    }
}

/* The threads that search many systems. Each searches one after the other with the same account and
 * arena; what they find is written in the order of the systems (parallel.h). */

/* Searches a system by a call of a public function. *pairs, NULL before, receives what goes to the
 * output, to be freed. */
struct systems_job;
typedef hs_status (*system_fn)(const struct systems_job *job, const hs_system_part *part,
                               const hs_options *options, hs_pairs **pairs, hs_failure *failure);

/* What the threads share. */
typedef struct systems_job {
    const hs_among *among;
    const hs_set   *points;    /* of it */
    hs_call        *total;     /* has the account of the output, and sums up what was done */
    hs_output      *output;    /* NULL: only counting, into ... */
    int64_t        *counts;    /* of the systems, or of all rows */
    int64_t         n_asking;  /* points, or queries; at least 1 */
    int64_t         in_range;  /* systems of a range; set by search_by_team */
    bool            is_direct; /* the one thread writes to the output itself; set there, too */
    /* Not for half lists: */
    system_fn           search;
    bool                has_limit; /* the cutoff, or a reach, is the limit of pairs */
    int64_t             k;         /* of the nearest; 0: all neighbours */
    int64_t            *offsets;   /* of all rows; each length goes to the entry behind it */
    const hs_histogram *histogram;
    hs_selected_parts   selected;
} systems_job;

static systems_job
job_of(const hs_among *among, hs_call *total)
{
    systems_job   job = {.among = among, .points = among->points, .total = total};
    const int64_t n = among->points != NULL ? asking_of(among)->at.n : 0;
    job.n_asking = n > 0 ? n : 1;
    return job;
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
    hs_committer       committer;
    const systems_job *job;
    hs_call            call;      /* with this thread's poll */
    hs_search          search;    /* of one system after the other */
    bool               has_scene; /* whether one was filled for a system before */
    hs_levels          levels;    /* of the present system, where pairs have a reach of their own */
    hs_level_plan      plan;
    hs_level_search    step;
    hs_walker          walker;   /* kept from one system to the next */
    hs_recorder        recorder; /* like the walker */
    hs_choice          choice;   /* the job's with the present box, where pairs are excluded */
    hs_box             box;      /* of the present system, where each has its own */
    hs_output         *target;   /* the job's output, or the backlog's */
    hs_backlog         backlog;
    hs_output          found; /* pairs of one system before they are sorted */
    int64_t            work;  /* since the last poll */
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
        hs_search_renumber(first, me->job->points->at.n, &me->search);
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

/* The further limit of pairs of a system that have a reach. */
static hs_status
bound_of(const worker *me, int64_t s, double *bound, hs_failure *failure)
{
    const hs_among *among = me->job->among;
    *bound = hs_cutoff_of_system(among, s, me->job->total->options.cutoff);
    if (!(*bound >= 0.0) || (among->reach->n_types > 0 && !isfinite(*bound))) {
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
            search->first_point = me->job->points->first[s];
            search->n_in_all = me->job->points->at.n;
            status = use_search(me, search, s);
            hs_level_close(&me->step);
        }
    }
    return status;
}

/* A system whose pairs have a reach of their own. */
static hs_status
search_by_reach(worker *me, int64_t s, const hs_box *box)
{
    hs_account   *account = &me->call.account;
    hs_failure   *failure = &me->committer.failure;
    const hs_set *all = me->job->points;
    const hs_set  points = set_of_system(all, s);
    const int64_t first = all->first[s];
    double        bound;
    hs_status     status = bound_of(me, s, &bound, failure);
    if (status != HS_OK) {
        return status;
    }
    status = hs_levels_divide(account, &me->call.options, &points, NULL, me->job->among->reach,
                              &me->levels, failure);
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
    const systems_job *job = me->job;
    me->call.options.cutoff = hs_cutoff_of_system(job->among, s, job->total->options.cutoff);
    hs_status status = build_system(me, points, box, job->points->first[s]);
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
    return status == HS_OK ? hs_choice_set_box(box, me->job->points->at.ndim, &me->choice) : status;
}

/* After a system: what it took, and sometimes a poll. */
static hs_status
count_work(worker *me, int64_t s, int64_t n_candidates)
{
    const systems_job *job = me->job;
    me->work += SYSTEM_WORK + n_candidates;
    if (me->work <= POLL_WORK) {
        return HS_OK;
    }
    me->work = 0;
    return hs_poll(&me->call.options,
                   (double)job->points->first[s + 1] / (double)job->points->at.n);
}

static hs_status
search_system(worker *me, int64_t s)
{
    const systems_job *job = me->job;
    const int64_t      before = me->call.done.candidates;
    const hs_points    points = points_of_system(job->points, s);
    const hs_box      *box = hs_box_of_system(job->among, s, &me->box);
    me->found.n_pairs = 0;
    if (job->output == NULL) {
        job->counts[s] = 0;
    }
    hs_status status = choose_in(me, box);
    if (status == HS_OK) {
        status = job->among->reach != NULL ? search_by_reach(me, s, box)
                                           : search_plainly(me, s, &points, box);
    }
    if (status == HS_OK && me->call.options.sorted) {
        status = sort_system(me, job->points->first[s], points.n);
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
    worker            *me = context;
    const systems_job *job = me->job;
    const int64_t      first = range * job->in_range, left = job->points->n_systems - first;
    const int64_t      end = first + (left < job->in_range ? left : job->in_range);
    hs_status          status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = search_system(me, s);
    }
    if (status != HS_OK || job->output == NULL) {
        return status;
    }
    const double done = (double)job->points->first[end] / (double)job->points->at.n;
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
    const systems_job *job = context;
    const hs_options  *options = &job->total->options;
    worker            *me = place;
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

/* Adds what a worker did to the call, and the bytes that it took. */
static void
add_work(hs_call *total, const hs_counters *done, const hs_counters *bytes)
{
    hs_call_add_counters(total, done);
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        total->account.total.bytes[p] += bytes->bytes[p];
    }
    total->account.total.bytes_peak += bytes->bytes_peak;
}

/* Adds what the worker did to `total`, and frees what it has. */
static void
close_worker(void *context, void *place)
{
    worker     *me = place;
    hs_account *account = &me->call.account;
    hs_backlog_free(account, &me->backlog);
    hs_walker_close(&me->search, &me->walker);
    hs_recorder_free(account, &me->recorder);
    hs_output_free(&me->found);
    add_work(((systems_job *)context)->total, &me->call.done, &account->total);
    hs_account_close(account);
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

/* Searches all systems, of which there is one at least, by a team for so many points. crew: what
 * its workers are. */
static hs_status
search_by_team(systems_job *job, double n_points, hs_crew crew, hs_failure *failure)
{
    hs_call      *total = job->total;
    const int64_t n_systems = job->points->n_systems;
    const int64_t in_range = RANGE_POINTS * n_systems / (job->n_asking + 1);
    const int     n_threads = hs_call_threads(n_points, &total->options);
    total->team = hs_team_create(n_systems < n_threads ? (int)n_systems : n_threads);
    share_limit(&total->options, hs_team_size(total->team));
    job->in_range = in_range > 1 ? in_range : 1;
    job->is_direct = hs_team_size(total->team) == 1 && job->output != NULL && !job->output->fixed;
    crew.call = total;
    crew.job = job;
    crew.n_ranges = (n_systems + job->in_range - 1) / job->in_range;
    crew.output = job->output;
    return hs_crew_run(&crew, failure);
}

/* What all systems share is checked also where there are none. */

/* All points, and all queries. */
static hs_sets
sets_of(const hs_among *among)
{
    const hs_set *points = among->points, *queries = among->queries;
    return (hs_sets){.points = &points->at,
                     .of_points = points,
                     .queries = queries != NULL ? &queries->at : NULL,
                     .of_queries = queries};
}

/* The arguments of a call that has been entered, and its kernel. What a system has of its own is
 * looked at with it. */
static hs_status
systems_check(const hs_among *among, const hs_call *total, hs_failure *failure)
{
    const hs_set *points = among->points, *queries = among->queries;
    if (points == NULL || among->cells != NULL) {
        return HS_ERR_ARGUMENT;
    }
    hs_status status = hs_check_arguments(&points->at, queries != NULL ? &queries->at : NULL,
                                          among->box, &total->options, failure);
    if (status == HS_OK) {
        status = hs_check_systems(points, failure);
    }
    if (status == HS_OK && queries != NULL) {
        status = queries->n_systems == points->n_systems ? hs_check_systems(queries, failure)
                                                         : HS_ERR_ARGUMENT;
        failure->in_queries = status != HS_OK;
    }
    if (status != HS_OK) {
        return status;
    }
    return total->kernel == NULL ? HS_ERR_KERNEL
           : have_boxes(among)   ? HS_OK
                                 : hs_box_check(among->box, failure);
}

/* After that, where pairs have the cutoff or a reach as their limit, and what all systems share of
 * it; is_full: rules may have a direction. */
static hs_status
systems_check_limit(const hs_among *among, bool is_full, const hs_options *options,
                    hs_failure *failure)
{
    if (among->reach != NULL) { /* limits of each system are looked at with it */
        hs_options without = *options;
        hs_request request = {.options = &without, .reach = among->reach};
        request.sets = sets_of(among);
        request.sets.is_full = is_full;
        without.cutoff = have_cutoffs(among) ? 0.0 : options->cutoff;
        return hs_by_reach_check(&request, failure);
    }
    if (!have_cutoffs(among) && !(options->cutoff >= 0.0 && isfinite(options->cutoff))) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    return HS_OK;
}

/* The public searches of half lists: find and count. */

/* What a search that was refused memory would have taken, all systems together. */
static void
tell_shortage(const systems_job *job, hs_failure *failure)
{
    const hs_call *total = job->total;
    hs_shortage    shortage = {0.0, 0.0};
    for (int64_t s = 0; s < job->points->n_systems; s++) {
        hs_box          own_box;
        const hs_points points = points_of_system(job->points, s);
        const hs_box   *box = hs_box_of_system(job->among, s, &own_box);
        const double    cutoff = hs_cutoff_of_system(job->among, s, total->options.cutoff);
        hs_shortage_add(&points, box, cutoff, &shortage);
    }
    hs_shortage_tell(&shortage, &total->options, job->points->at.ndim, total->account.limit,
                     failure);
}

static hs_status
check_arguments(const systems_job *job, hs_failure *failure)
{
    const hs_among *among = job->among;
    const hs_status status = among->queries == NULL ? systems_check(among, job->total, failure)
                                                    : HS_ERR_ARGUMENT;
    return status == HS_OK ? systems_check_limit(among, false, &job->total->options, failure)
                           : status;
}

/* Which pairs count. Boxes are looked at with their systems. */
static hs_status
open_choice(const systems_job *job, hs_failure *failure)
{
    const hs_sets sets = sets_of(job->among);
    hs_status     status = hs_choice_open(job->among->selection, &sets, job->total, failure);
    if (status == HS_OK && job->total->choice != NULL && job->among->box != NULL &&
        hs_choice_excludes(job->total->choice)) {
        status = hs_choice_keep_points(&sets, job->total, failure);
    }
    return status;
}

/* Both public functions once all is checked. */
static hs_status
search_systems(systems_job *job, hs_failure *failure)
{
    hs_call      *total = job->total;
    const hs_crew crew = {.worker_size = sizeof(worker),
                          .open = open_worker,
                          .close = close_worker,
                          .search = search_range};
    hs_status     status = open_choice(job, failure);
    if (status == HS_OK && job->points->n_systems > 0) {
        status = search_by_team(job, (double)job->points->at.n, crew, failure);
    }
    hs_choice_close(total);
    if (status == HS_ERR_MEMORY) {
        const double found = job->output != NULL ? (double)job->output->n_pairs : 0.0;
        failure->expected_pairs = fmax(failure->expected_pairs, found);
        if (job->among->reach == NULL) {
            tell_shortage(job, failure);
        } else {
            hs_call_tell_limit(total, status, failure);
        }
    }
    return status;
}

hs_status
hs_systems_pairs(const hs_among *among, const hs_options *options, hs_pairs **result,
                 hs_failure *failure)
{
    hs_pairs *pairs = hs_pairs_begin(options, &failure);
    if (pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    systems_job job = job_of(among, &pairs->call);
    job.output = &pairs->output;
    hs_status status = check_arguments(&job, failure);
    if (status == HS_OK) {
        hs_pairs_open(pairs, among->points->at.ndim);
        status = search_systems(&job, failure);
        status = hs_pairs_conclude(&pairs->output, status, failure);
    }
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}

/* The pairs of each system, each once. */
static hs_status
count_half(const hs_among *among, const hs_options *options, int64_t *counts, hs_failure *failure)
{
    hs_call     total;
    systems_job job = job_of(among, &total);
    int64_t     found = 0;
    job.counts = counts;
    failure = hs_call_enter(options, failure, &total);
    hs_status status = check_arguments(&job, failure);
    if (status == HS_OK) {
        status = search_systems(&job, failure);
    }
    for (int64_t s = 0; status == HS_OK && s < among->points->n_systems; s++) {
        found += counts[s];
    }
    hs_call_leave(&total, found);
    hs_account_close(&total.account);
    return status;
}

/*
 * One call of a public search for each of many systems. Threads take ranges of
 * them; each call has one thread, what it finds goes behind what those before it found, with
 * numbers among the points of all. Half lists have a loop of their own, which
 * keeps the search of one system for the next.
 */

/* A worker has its own options, whose poll tells how much of all systems is done. */

/* What one thread works with. */
typedef struct caller {
    hs_committer       committer;
    const systems_job *job;
    hs_options         options; /* with this thread's poll */
    hs_counters        done;
    hs_output          backlog; /* pairs that wait for their turn; not charged to the account */
    hs_output         *target;  /* this one, or that of all */
    hs_system_part     part;
    double             first, share; /* of the present system, of all points */
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
    const systems_job    *job = me->job;
    const hs_system_part *part = &me->part;
    hs_failure           *failure = &me->committer.failure;
    hs_pairs             *pairs = NULL;
    hs_counters           counters = {.pairs = 0};
    hs_options            options = me->options;
    hs_system_part_cut(job->among, &job->selected, s, &me->part);
    me->first = (double)part->first_asking / (double)job->n_asking;
    me->share = (double)part->n_asking / (double)job->n_asking;
    options.cutoff = hs_cutoff_of_system(job->among, s, options.cutoff);
    options.counters = &counters;
    options.poll = options.poll != NULL ? poll_for_all : NULL;
    options.poll_context = me;
    hs_status status = job->search(job, part, &options, &pairs, failure);
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
    caller            *me = context;
    const systems_job *job = me->job;
    const int64_t      first = range * job->in_range, left = job->points->n_systems - first;
    const int64_t      end = first + (left < job->in_range ? left : job->in_range);
    hs_status          status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = call_for_system(me, s);
    }
    if (status == HS_OK) {
        status = hs_poll(&me->options, me->first + me->share);
    }
    if (status != HS_OK || job->output == NULL) {
        return status;
    }
    /* Of nothing, where pairs are written directly: then it only says how far this has come. */
    return hs_commit(&me->committer, me->first + me->share, true);
}

/* Cannot fail: memory is taken as it is needed. */
static hs_status
open_caller(void *context, void *place)
{
    const systems_job *job = context;
    hs_output         *output = job->output;
    caller            *me = place;
    me->job = job;
    me->options = job->total->options;
    me->options.threads = 1;
    me->options.out = NULL;
    me->committer.options = &me->options;
    if (output != NULL) {
        hs_output_init(NULL, output->ndim, output->columns, output->index_bytes, &me->backlog);
        me->committer.pairs = &me->backlog;
        me->target = job->is_direct ? output : &me->backlog;
    }
    return HS_OK;
}

/* Adds what the worker did to the call, and frees what it has. */
static void
close_caller(void *context, void *place)
{
    hs_call *total = ((systems_job *)context)->total;
    caller  *me = place;
    hs_output_free(&me->backlog);
    add_work(total, &me->done, &me->done);
    total->done.pairs += me->done.pairs;
}

/* Checks what the systems share, also where there are none, and does it, for a call that has been
 * entered. total->done.pairs becomes their number, failure->system the one that fails. */
static hs_status
call_for_each(systems_job *job, hs_failure *failure)
{
    const hs_among *among = job->among;
    hs_call        *total = job->total;
    const hs_crew   crew = {.worker_size = sizeof(caller),
                            .open = open_caller,
                            .close = close_caller,
                            .search = call_for_range};
    hs_status       status = systems_check(among, total, failure);
    if (status == HS_OK && job->has_limit) {
        status = systems_check_limit(among, true, &total->options, failure);
    }
    if (status == HS_OK && among->selection != NULL) {
        const hs_sets all = sets_of(among);
        status = hs_selection_check(among->selection, &all, &total->options, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    status = hs_selected_parts_open(among, &total->account, &job->selected);
    if (status == HS_OK && job->points->n_systems > 0) {
        status = search_by_team(job, (double)(job->points->at.n + job->n_asking), crew, failure);
    }
    hs_selected_parts_free(&total->account, &job->selected);
    hs_call_tell_limit(total, status, failure);
    return status;
}

/* The public searches of many systems whose results are rows, counts of rows,
 * and histograms. */

/* A system_fn. */
static hs_status
find_neighbors(const systems_job *job, const hs_system_part *part, const hs_options *options,
               hs_pairs **pairs, hs_failure *failure)
{
    const hs_status status = hs_neighbors_find(&part->among, options, pairs, failure);
    if (status == HS_OK) {
        const int64_t *offsets = hs_pairs_offsets(*pairs), n = hs_pairs_rows(*pairs);
        for (int64_t i = 0; i < n; i++) {
            job->offsets[part->first_asking + i + 1] = offsets[i + 1] - offsets[i];
        }
    }
    return status;
}

/* A system_fn. */
static hs_status
count_neighbors(const systems_job *job, const hs_system_part *part, const hs_options *options,
                hs_pairs **pairs, hs_failure *failure)
{
    (void)pairs;
    return hs_neighbors_count(&part->among, options, job->counts + part->first_asking, failure);
}

/* A system_fn. */
static hs_status
find_nearest(const systems_job *job, const hs_system_part *part, const hs_options *options,
             hs_pairs **pairs, hs_failure *failure)
{
    return hs_nearest_find(&part->among, job->k, options, pairs, failure);
}

/* A system_fn. */
static hs_status
count_all(const systems_job *job, const hs_system_part *part, const hs_options *options,
          hs_pairs **pairs, hs_failure *failure)
{
    (void)pairs;
    return hs_pairs_count(&part->among, options, job->counts + part->system, failure);
}

/* A system_fn. */
static hs_status
count_by_distance(const systems_job *job, const hs_system_part *part, const hs_options *options,
                  hs_pairs **pairs, hs_failure *failure)
{
    const hs_histogram *all = job->histogram;
    const int64_t       at = part->system * all->n_edges * all->n_types * all->n_types;
    hs_histogram        own = *all;
    (void)pairs;
    own.counts = own.counts != NULL ? own.counts + at : NULL;
    own.sums = own.sums != NULL ? own.sums + at : NULL;
    return hs_pairs_histogram(&part->among, options, &own, failure);
}

/* The largest distance of nearest points, which may be infinite. */
static hs_status
check_radius(const hs_among *among, const hs_options *options, hs_failure *failure)
{
    if (have_cutoffs(among) || options->cutoff >= 0.0) {
        return HS_OK;
    }
    failure->value = options->cutoff;
    return HS_ERR_CUTOFF;
}

/* What a search that keeps pairs returns, from the check that it can to the end. */
static hs_status
find_rows(const hs_among *among, system_fn search, int64_t k, const hs_options *options,
          hs_pairs **result, hs_failure *failure)
{
    hs_pairs *rows = hs_pairs_begin(options, &failure);
    if (rows == NULL) {
        return HS_ERR_MEMORY;
    }
    systems_job job = job_of(among, &rows->call);
    job.output = &rows->output;
    job.search = search;
    job.has_limit = k == 0;
    job.k = k;
    hs_status status = systems_check(among, &rows->call, failure);
    if (status == HS_OK) {
        hs_pairs_open(rows, among->points->at.ndim);
        status = k > 0 ? check_radius(among, options, failure)
                       : hs_pairs_open_offsets(&rows->call.account, asking_of(among)->at.n + 1,
                                               rows, &job.offsets);
    }
    if (status == HS_OK) {
        status = call_for_each(&job, failure);
    }
    if (status == HS_OK && k == 0) {
        job.offsets[0] = 0;
        hs_starts_of_lengths(job.offsets, asking_of(among)->at.n + 1);
    }
    status = hs_pairs_conclude(&rows->output, status, failure);
    return hs_pairs_finish(rows, status, rows->output.n_pairs, result);
}

hs_status
hs_systems_neighbors(const hs_among *among, const hs_options *options, hs_pairs **result,
                     hs_failure *failure)
{
    return find_rows(among, find_neighbors, 0, options, result, failure);
}

hs_status
hs_systems_nearest(const hs_among *among, int64_t k, const hs_options *options, hs_pairs **result,
                   hs_failure *failure)
{
    if (k < 1 || among->reach != NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    return find_rows(among, find_nearest, k, options, result, failure);
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
count_rows(systems_job *job, const hs_options *options, hs_failure *failure)
{
    hs_call          call;
    hs_status        status = HS_OK;
    const hs_options counting = hs_options_of_count(options);
    failure = hs_call_enter(&counting, failure, &call);
    job->total = &call;
    if (job->counts == NULL) {
        status = check_histogram(job->histogram, failure);
    }
    if (status == HS_OK) {
        status = call_for_each(job, failure);
    }
    hs_call_leave(&call, call.done.pairs);
    hs_account_close(&call.account);
    return status;
}

hs_status
hs_systems_neighbors_count(const hs_among *among, const hs_options *options, int64_t *counts,
                           hs_failure *failure)
{
    int64_t     none; /* where there are no points, there may be no counts */
    systems_job job = job_of(among, NULL);
    if (among->points == NULL || !hs_has_entries(counts, &asking_of(among)->at)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    job.counts = counts != NULL ? counts : &none;
    job.search = count_neighbors;
    job.has_limit = true;
    return count_rows(&job, options, failure);
}

hs_status
hs_systems_count(const hs_among *among, const hs_options *options, int64_t *counts,
                 hs_failure *failure)
{
    systems_job job = job_of(among, NULL);
    job.counts = counts;
    job.search = count_all;
    job.has_limit = true;
    return among->queries != NULL ? count_rows(&job, options, failure)
                                  : count_half(among, options, counts, failure);
}

hs_status
hs_systems_histogram(const hs_among *among, const hs_options *options,
                     const hs_histogram *histogram, hs_failure *failure)
{
    systems_job job = job_of(among, NULL);
    hs_options  of_search = *options;
    if (among->reach != NULL) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    job.histogram = histogram;
    job.search = count_by_distance;
    of_search.precision = HS_EXACT;
    return count_rows(&job, &of_search, failure);
}
