/* SPDX-License-Identifier: BSD-3-Clause */
#include "query.h"
#include "../base/sort.h"

#include <math.h>
#include <string.h>

/* systems.c: many systems in one call: arrays of a system begin where those of the systems before
 * it end. Threads take ranges of them. Each has one run, account and arena, and searches one system
 * after the other; what is found is written in the order of the systems (parallel.h). */

/* Points that a range of systems should have: their pairs fit the backlog of a thread, so that
 * it seldom waits for others, and taking a range costs little beside them. */
#define RANGE_POINTS 512

/* Candidates between two polls, and as how many the rest of a system counts. */
#define POLL_WORK   (INT64_C(1) << 21)
#define SYSTEM_WORK 1024

/* The points of system s, with what is known of them. */
static hs_set
set_of_system(const hs_set *all, int64_t s)
{
    const int64_t first = all->first[s], entries = (int64_t)all->at.ndim * all->at.ndim;
    hs_set        set = {.at = all->at,
                         .radii = all->radii != NULL ? all->radii + first : NULL,
                         .supports = all->supports != NULL ? all->supports + first * entries : NULL,
                         .weights = all->weights != NULL ? all->weights + first : NULL,
                         .types = all->types != NULL ? all->types + first : NULL,
                         .groups = all->groups != NULL ? all->groups + first : NULL,
                         .labels = all->labels != NULL ? all->labels + first : NULL};
    set.at.n = all->first[s + 1] - first;
    if (set.at.n > 0) { /* without points there is no first row */
        set.at.data = (const char *)set.at.data + first * set.at.row_stride;
    }
    return set;
}

/* n_systems and first of a set; what it reads is first alone. */
static hs_status
check_first(const hs_set *set, hs_failure *failure)
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
    return first[0] == 0 && first[set->n_systems] == set->at.n ? HS_OK : HS_ERR_ARGUMENT;
}

/* Whether each system has something of a box of its own. */
static bool
have_boxes(const hs_among *among)
{
    return among->each != NULL && (among->each->rows != NULL || among->each->periodic != NULL);
}

hs_status
hs_systems_check(const hs_query *query, hs_failure *failure)
{
    const hs_among *among = query->among;
    const hs_set   *points = among->points, *queries = among->queries;
    if (among->cells != NULL) {
        return HS_ERR_ARGUMENT;
    }
    hs_status status = check_first(points, failure);
    if (status == HS_OK && queries != NULL) {
        status = queries->n_systems == points->n_systems ? check_first(queries, failure)
                                                         : HS_ERR_ARGUMENT;
        failure->in_queries = status != HS_OK;
    }
    if (status == HS_OK && queries != NULL && query->selection != NULL &&
        query->selection->query_numbers != NULL) {
        /* Queries that are points are those of their own system. */
        const int64_t *numbers = query->selection->query_numbers, *first = points->first;
        for (int64_t s = 0; status == HS_OK && s < points->n_systems; s++) {
            for (int64_t q = queries->first[s]; q < queries->first[s + 1]; q++) {
                if (numbers[q] < first[s] || numbers[q] >= first[s + 1]) {
                    failure->system = s;
                    status = HS_ERR_ARGUMENT;
                    break;
                }
            }
        }
    }
    return status == HS_OK && !have_boxes(among) ? hs_box_check(among->box, failure) : status;
}

static void
cut_system(const hs_query *all, int64_t s, hs_system *system)
{
    const hs_among       *among = all->among;
    const hs_each_system *each = among->each;
    const int             ndim = among->points->at.ndim;
    system->points = set_of_system(among->points, s);
    system->query.sets.points = &system->points.at;
    system->query.sets.of_points = &system->points;
    if (among->queries != NULL) {
        system->queries = set_of_system(among->queries, s);
        system->query.sets.queries = &system->queries.at;
        system->query.sets.of_queries = &system->queries;
    }
    system->query.box = among->box;
    if (among->box != NULL && have_boxes(among)) {
        hs_box *box = &system->own_box;
        system->query.box = box;
        *box = *among->box;
        for (int l = 0; l < ndim; l++) {
            if (each->rows != NULL) {
                memcpy(box->rows[l], each->rows + (s * ndim + l) * ndim,
                       (size_t)ndim * sizeof(double));
            }
            if (each->periodic != NULL) {
                box->periodic[l] = each->periodic[s] >> l & 1;
            }
        }
    }
    if (each != NULL && each->cutoffs != NULL && !all->is_by_length) {
        system->query.options.cutoff = each->cutoffs[s];
    }
}

void
hs_system_begin(const hs_query *all, const hs_finder *finder, hs_call *call, hs_failure *failure,
                hs_system *system, hs_query_run *run)
{
    const hs_among *among = all->among;
    system->query = *all;
    hs_query_begin(&system->query, finder, call, failure, run);
    run->is_part = true;
    run->is_numbered = finder->is_numbered;
    run->n_in_all = (among->queries != NULL ? among->queries : among->points)->at.n;
}

hs_status
hs_system_open(const hs_query *all, int64_t s, const hs_choice *choice, hs_system *system,
               hs_query_run *run)
{
    const hs_among *among = all->among;
    hs_status       status = HS_OK;
    cut_system(all, s, system);
    run->system = s;
    run->first_point = among->points->first[s];
    run->first_asking = (among->queries != NULL ? among->queries : among->points)->first[s];
    run->call->options.cutoff = system->query.options.cutoff;
    if (choice != NULL) {
        run->call->choice = &system->choice;
        hs_choice_cut(choice, run->is_numbered ? 0 : run->first_point,
                      run->is_numbered ? 0 : run->first_asking, &system->choice);
        if (hs_choice_excludes(choice)) {
            status = hs_choice_set_box(system->query.box, among->points->at.ndim, &system->choice,
                                       run->failure);
        }
    }
    return status == HS_OK ? hs_query_plan(run) : status;
}

void
hs_systems_add_shortage(const hs_query *query, hs_shortage *shortage)
{
    hs_system cut = {.query = *query};
    for (int64_t s = 0; s < query->among->points->n_systems; s++) {
        cut_system(query, s, &cut);
        hs_shortage_add(&cut.query.sets, cut.query.box, cut.query.options.cutoff, shortage);
    }
}

/* What the threads share. */
typedef struct systems_job {
    const hs_query_run *all;      /* of the call, which has the output and sums up what was done */
    const hs_set       *asking;   /* points, or queries */
    double              n_asking; /* at least 1 */
    int64_t             in_range; /* systems of a range */
    int64_t *lengths;   /* of all rows, each in the entry behind it; NULL: there are none */
    bool     is_direct; /* the one thread writes to the output itself */
    int64_t  n_pairs;   /* that were counted, by threads that have ended */
} systems_job;

/* What one thread works with. */
typedef struct worker {
    hs_committer committer;
    hs_call      call;
    hs_system    system; /* the present one */
    hs_keeper    keeper;
    hs_output   *target;           /* that of all, or the backlog */
    hs_output    entries, offsets; /* owned; of one system, which are numbered afterwards */
    hs_query_run run;
} worker;

/* How much of all is done when this system begins. */
static double
done_before(const systems_job *job, int64_t s)
{
    return (double)job->asking->first[s] / job->n_asking;
}

/* Adds a number to one column, every `step`-th from `at` on, but for -1, which is none. */
static void
add_to_column(hs_output *output, unsigned bit, int64_t at, int step, int64_t more)
{
    int32_t      *narrow = hs_output_column(output, bit);
    int64_t      *wide = hs_output_column(output, bit);
    const int64_t end = wide != NULL ? output->n_pairs * step : 0;
    for (int64_t e = at; output->index_bytes == 4 && e < end; e += step) {
        narrow[e] += narrow[e] >= 0 ? (int32_t)more : 0;
    }
    for (int64_t e = at; output->index_bytes == 8 && e < end; e += step) {
        wide[e] += wide[e] >= 0 ? more : 0;
    }
}

static hs_status
search_system(worker *me, int64_t s)
{
    const systems_job *job = me->committer.job;
    const hs_finder   *finder = job->all->finder;
    hs_query_run      *run = &me->run;
    hs_call           *call = &me->call;
    const int64_t      before = call->done.candidates;
    hs_stretch         whole = {0.0, 1.0};
    if (!finder->is_numbered) { /* it tells how much of this system is done */
        whole = hs_call_begin_part(call, done_before(job, s), done_before(job, s + 1));
    }
    if (run->output == &me->entries) {
        const hs_output *output = job->all->output;
        hs_output_init(&call->account, output->ndim, output->columns, output->index_bytes,
                       &me->entries);
    }
    hs_status status = hs_system_open(job->all->query, s, job->all->call->choice, &me->system, run);
    if (status == HS_OK) {
        status = hs_query_find(run);
    }
    hs_query_close(run);
    call->part = whole;
    if (status == HS_OK && !finder->is_numbered && run->output != NULL) {
        /* What was found, numbered among all, goes behind what is there. */
        hs_output     *target = me->target;
        const int64_t *offsets = hs_output_column(&me->offsets, HS_WANT_I);
        const int64_t  n = me->entries.n_pairs, at = target->n_pairs;
        status = hs_output_reserve(target, n, job->is_direct ? done_before(job, s + 1) : 0.0);
        if (status == HS_OK) {
            add_to_column(&me->entries, HS_WANT_I, 0, 1, run->first_asking);
            add_to_column(&me->entries, HS_WANT_J, 0, 1, run->first_point);
            add_to_column(&me->entries, HS_WANT_BOTH, 0, 2, run->first_asking);
            add_to_column(&me->entries, HS_WANT_BOTH, 1, 2, run->first_point);
            hs_output_copy(target, at, &me->entries, 0, n);
            target->n_pairs = at + n;
        } else {
            me->committer.failure.expected_pairs = (double)(at + n);
        }
        for (int64_t r = 0; job->lengths != NULL && r + 1 < me->offsets.n_pairs; r++) {
            job->lengths[run->first_asking + r + 1] = offsets[r + 1] - offsets[r];
        }
    } else if (status != HS_OK && !finder->is_numbered) {
        hs_query_name_point(run, status);
    }
    if (run->output == &me->entries) {
        hs_output_free(&me->entries);
        hs_output_free(&me->offsets);
    }
    hs_account_reset(&call->account);
    if (status != HS_OK) {
        me->committer.failure.system = s;
        return status;
    }
    return hs_note_work(&me->committer, SYSTEM_WORK + call->done.candidates - before, POLL_WORK,
                        done_before(job, s + 1));
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    worker            *me = context;
    const systems_job *job = me->committer.job;
    hs_output         *output = job->all->output;
    const int64_t      first = range * job->in_range, left = job->asking->n_systems - first;
    const int64_t      end = first + (left < job->in_range ? left : job->in_range);
    hs_status          status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = search_system(me, s);
    }
    if (status != HS_OK || output == NULL) {
        return status;
    }
    const double done = done_before(job, end);
    if (job->is_direct && first == 0 && done > 0.0) {
        /* most batches have systems of similar size */
        hs_output_reserve_hint(output, (double)output->n_pairs / done);
    }
    return job->is_direct ? HS_OK : hs_commit(&me->committer, done, true);
}

/* Cannot fail: memory is taken as it is needed. */
static hs_status
open_worker(void *context, void *place)
{
    systems_job        *job = context;
    const hs_query_run *all = job->all;
    const hs_options   *options = &all->call->options;
    worker             *me = place;
    hs_query_run       *run = &me->run;
    hs_call_begin(options, &me->call);
    me->call.options.threads = 1;
    me->call.options.out = NULL;
    me->committer.options = &me->call.options; /* whose poll asks that of the whole call */
    hs_system_begin(all->query, all->finder, &me->call, &me->committer.failure, &me->system, run);
    run->keeper = &me->keeper;
    hs_search_begin(&me->call, &run->step.search);
    if (all->output != NULL) {
        me->keeper.committer = &me->committer;
        me->target = job->is_direct ? all->output : me->committer.pairs;
        run->output = all->finder->is_numbered ? me->target : &me->entries;
        run->offsets = &me->offsets;
    }
    return HS_OK;
}

/* Adds what a worker did to the call, and the bytes that it took; frees what it has. */
static void
close_worker(void *context, void *place)
{
    systems_job *job = context;
    worker      *me = place;
    hs_account  *account = &me->call.account;
    hs_call     *total = job->all->call;
    hs_keeper_close(&me->run.step.search, &me->keeper);
    me->call.done.polls = 0; /* counted by the call */
    hs_call_add_counters(total, &me->call.done);
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        total->account.total.bytes[p] += account->total.bytes[p];
    }
    total->account.total.bytes_peak += account->total.bytes_peak;
    job->n_pairs += me->run.n_pairs;
    hs_account_close(account);
}

hs_status
hs_systems_find(hs_query_run *all)
{
    const hs_query  *query = all->query;
    const hs_finder *finder = all->finder;
    hs_call         *total = all->call;
    hs_options      *options = &total->options;
    hs_output       *output = all->output;
    const hs_set    *points = query->among->points;
    const hs_set    *asking = query->among->queries != NULL ? query->among->queries : points;
    systems_job   job = {.all = all, .asking = asking, .n_asking = fmax((double)asking->at.n, 1.0)};
    const int64_t n = asking->n_systems;
    hs_status     status = HS_OK;
    if (finder->has_rows) {
        status =
            hs_output_open_offsets(&total->account, asking->at.n + 1, all->offsets, &job.lengths);
    }
    if (status == HS_OK && n > 0) {
        const double  n_points = (double)points->at.n;
        const double  work = finder->is_numbered ? n_points : n_points + job.n_asking;
        const int     n_threads = finder->one_thread ? 1 : hs_call_threads(work, options);
        const int64_t in_range = (int64_t)(RANGE_POINTS * n / (job.n_asking + 1.0));
        total->team = hs_team_create(n < n_threads ? (int)n : n_threads);
        const int team_size = hs_team_size(total->team);
        /* Each thread has an account of its own: together they must not pass the limit of the
         * call. */
        if (team_size > 1 && options->find_limit != NULL) {
            options->memory_limit =
                fmin(options->memory_limit, options->find_limit(options->find_context));
            options->find_limit = NULL;
        }
        options->memory_limit /= team_size;
        job.in_range = in_range > 1 ? in_range : 1;
        job.is_direct = team_size == 1 && output != NULL && !output->fixed;
        hs_crew crew = {.call = total,
                        .job = &job,
                        .worker_size = sizeof(worker),
                        .open = open_worker,
                        .close = close_worker,
                        .search = search_range,
                        .n_ranges = (n + job.in_range - 1) / job.in_range,
                        .output = output};
        status = hs_crew_run(&crew, all->failure);
    }
    if (status == HS_OK && job.lengths != NULL) {
        job.lengths[0] = 0;
        hs_starts_of_lengths(job.lengths, asking->at.n + 1);
    }
    all->n_pairs = job.n_pairs;
    return status;
}
