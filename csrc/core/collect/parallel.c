/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "parallel.h"
#include "../base/os_thread.h"

#include <string.h>

/* parallel.c: a mutex guards the number of the range that is due; pairs are copied without it. A
 * thread alone writes straight to the output, by a walker that it may keep for the next search. */

typedef struct hs_commits {
    const hs_crew   *crew;
    void            *workers;    /* owned; one of each thread, one behind another */
    hs_thread_id     caller;     /* the only thread that may poll */
    volatile int64_t next_range; /* atomic */
    hs_mutex         mutex;      /* guards all below, and the output but for what columns hold */
    hs_condition     changed;    /* due, n_copying or status */
    int64_t          due;        /* the range whose pairs are next in the output */
    int              n_copying;  /* threads that write to columns: these must not move then */
    int              n_working;  /* threads that may still have a range */
    hs_status        status;
    hs_failure       failure; /* of the earliest range that had one */
    int64_t          failed_range;
    int64_t          full_range; /* the last one that is written, n_ranges at first */
} hs_commits;

/* A hs_poll_fn of the threads that may not call the caller's: true until a thread has failed. */
static bool
none_has_failed(void *context, double fraction)
{
    hs_commits *commits = context;
    (void)fraction;
    hs_mutex_lock(&commits->mutex);
    const bool result = commits->status == HS_OK;
    hs_mutex_unlock(&commits->mutex);
    return result;
}

/* This range has failed: all threads stop. A status that only follows from another failure is not
 * noted. */
static void
fail(hs_committer *committer, hs_status status)
{
    hs_commits *commits = committer->commits;
    const bool  stopped = status == HS_STOPPED || (status == HS_ERR_INTERRUPTED &&
                                                  committer->options->poll == none_has_failed);
    hs_mutex_lock(&commits->mutex);
    if (!stopped && (commits->status == HS_OK || committer->range < commits->failed_range)) {
        commits->status = status;
        commits->failure = committer->failure;
        commits->failed_range = committer->range;
    }
    hs_condition_wake(&commits->changed);
    hs_mutex_unlock(&commits->mutex);
}

/* With the mutex held: waits for a change. The caller's thread goes on polling meanwhile. */
static hs_status
wait_for_change(hs_commits *commits, const hs_committer *committer)
{
    if (committer->options->poll == none_has_failed) {
        hs_condition_wait(&commits->changed, &commits->mutex);
        return HS_OK;
    }
    hs_condition_wait_briefly(&commits->changed, &commits->mutex);
    hs_mutex_unlock(&commits->mutex);
    const hs_status status = hs_poll(committer->options, 0.0); /* what was told last */
    hs_mutex_lock(&commits->mutex);
    return status;
}

/* Writes the part that is due. The mutex is held, but not while it copies. */
static hs_status
write_part(hs_committer *committer, const hs_commit_part *part)
{
    hs_commits    *commits = committer->commits;
    const hs_crew *crew = commits->crew;
    hs_output     *output = crew->output;
    const int64_t  n = part->end - committer->written, at = output->n_pairs;
    const bool     is_limited = crew->enough > 0;
    if (!hs_output_has_room(output, n)) {
        while (commits->n_copying > 0) { /* soon over */
            hs_condition_wait(&commits->changed, &commits->mutex);
        }
        /* An output with a limit does not grow with the work that is left. */
        const hs_status status = hs_output_reserve(output, n, is_limited ? 0.0 : part->fraction);
        if (status != HS_OK) {
            return status;
        }
    }
    output->n_pairs += n;
    hs_output_touch(output, at, n);
    if (is_limited && output->n_pairs >= crew->most && commits->full_range == crew->n_ranges) {
        commits->full_range = part->range;
        committer->is_full = !part->is_last;
        hs_condition_wake(&commits->changed);
    }
    commits->n_copying++;
    if (part->is_last) {
        commits->due++;
        hs_condition_wake(&commits->changed);
    }
    hs_mutex_unlock(&commits->mutex);
    hs_output_copy(output, at, committer->pairs, committer->written, part->end);
    committer->written = part->end;
    hs_mutex_lock(&commits->mutex);
    if (--commits->n_copying == 0) {
        hs_condition_wake(&commits->changed);
    }
    return HS_OK;
}

/* Writes parts as long as they are due; with `waits`, all of them. */
static hs_status
write_parts(hs_committer *committer, bool waits)
{
    hs_commits *commits = committer->commits;
    hs_status   status = HS_OK;
    int         done = 0;
    hs_mutex_lock(&commits->mutex);
    while (done < committer->n_parts && status == HS_OK) {
        const hs_commit_part *part = &committer->parts[done];
        if (commits->status != HS_OK || part->range > commits->full_range) {
            status = HS_STOPPED; /* another thread has failed, or has filled the output */
        } else if (commits->due == part->range) {
            status = write_part(committer, part);
            done++;
        } else if (waits) {
            status = wait_for_change(commits, committer);
        } else {
            break;
        }
    }
    hs_mutex_unlock(&commits->mutex);
    committer->n_parts -= done;
    memmove(committer->parts, committer->parts + done,
            (size_t)committer->n_parts * sizeof committer->parts[0]);
    if (committer->n_parts == 0) {
        committer->pairs->n_pairs = committer->written = 0;
    }
    return status;
}

hs_status
hs_commit(hs_committer *committer, double fraction, bool ends)
{
    const hs_output *pairs = committer->pairs;
    const int64_t    bytes = pairs->n_pairs * hs_output_bytes_per_pair(pairs);
    committer->parts[committer->n_parts++] = (hs_commit_part){
        .range = committer->range, .end = pairs->n_pairs, .fraction = fraction, .is_last = ends};
    return write_parts(committer, !ends || committer->n_parts == HS_COMMIT_PARTS ||
                                      bytes >= committer->most_bytes);
}

static void *
worker_of(const hs_commits *commits, int64_t number)
{
    return (char *)commits->workers + (size_t)number * commits->crew->worker_size;
}

/*
 * A hs_task_fn: takes ranges as long as there are any and no thread has failed, and waits until all
 * that was committed has been written. All threads stop when a range fails; the committer's failure
 * tells why it did. The caller's thread then waits for the others, and polls meanwhile.
 */
static void
work(void *context, int64_t task)
{
    hs_commits    *commits = context;
    const hs_crew *crew = commits->crew;
    hs_committer  *committer = worker_of(commits, task);
    hs_status      status = HS_OK;
    hs_mutex_lock(&commits->mutex);
    commits->n_working++;
    hs_mutex_unlock(&commits->mutex);
    if (!hs_thread_is(commits->caller)) { /* which alone may poll */
        committer->options->poll = none_has_failed;
        committer->options->poll_context = commits;
    }
    while (status == HS_OK) {
        hs_mutex_lock(&commits->mutex);
        const bool stops = commits->status != HS_OK ||
                           (crew->enough > 0 && crew->output->n_pairs >= crew->enough);
        hs_mutex_unlock(&commits->mutex);
        committer->range = stops ? crew->n_ranges : hs_atomic_add(&commits->next_range, 1);
        if (committer->range >= crew->n_ranges) {
            break;
        }
        status = crew->search(committer, committer->range);
    }
    if (status == HS_OK && committer->n_parts > 0) {
        status = write_parts(committer, true);
    }
    if (status != HS_OK) {
        fail(committer, status);
    }
    const bool polls = committer->options->poll != none_has_failed;
    status = HS_OK;
    hs_mutex_lock(&commits->mutex);
    commits->n_working--;
    hs_condition_wake(&commits->changed);
    while (polls && status == HS_OK && commits->status == HS_OK && commits->n_working > 0) {
        status = wait_for_change(commits, committer);
    }
    hs_mutex_unlock(&commits->mutex);
    if (status != HS_OK) {
        fail(committer, status);
    }
}

hs_status
hs_crew_run(hs_crew *crew, hs_failure *failure)
{
    hs_account *account = &crew->call->account;
    const int   n = hs_team_size(crew->call->team);
    hs_commits  commits = {.crew = crew, .full_range = crew->n_ranges};
    int         n_open = 0;
    hs_status   status = HS_OK;
    commits.workers = hs_alloc(account, HS_FOR_CANDIDATES, n, crew->worker_size);
    if (commits.workers == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(commits.workers, 0, (size_t)n * crew->worker_size);
    while (n_open < n && status == HS_OK) {
        hs_committer    *worker = worker_of(&commits, n_open++);
        const hs_output *output = crew->output;
        worker->own_options = crew->call->options;
        worker->options = &worker->own_options;
        worker->pairs = &worker->own_pairs;
        worker->failure = HS_NO_FAILURE;
        worker->commits = &commits;
        worker->job = crew->job;
        worker->most_bytes = crew->enough > 0 ? HS_COMMIT_BYTES_OF_BLOCKS : HS_COMMIT_BYTES;
        if (output != NULL) {
            hs_output_init(NULL, output->ndim, output->columns, output->index_bytes, worker->pairs);
        }
        status = crew->open(crew->job, worker);
    }
    if (status == HS_OK) {
        commits.caller = hs_thread_self();
        hs_mutex_init(&commits.mutex);
        hs_condition_init(&commits.changed);
        hs_team_run(crew->call->team, n, work, &commits);
        hs_condition_destroy(&commits.changed);
        hs_mutex_destroy(&commits.mutex);
        crew->n_written = commits.due;
        status = commits.status;
        if (status != HS_OK) {
            *failure = commits.failure;
        } else { /* the others may have come last */
            status = hs_poll(&crew->call->options, crew->enough > 0 ? 0.0 : 1.0);
        }
    }
    for (int w = 0; w < n_open; w++) {
        hs_committer *worker = worker_of(&commits, w);
        crew->close(crew->job, worker);
        hs_output_free(&worker->own_pairs);
    }
    hs_free(account, commits.workers);
    return status;
}

/* The walk over all points, by a crew of walkers. */

/* Points of a range: a group at least, and so few that their pairs are a part of what a thread can
 * hold back: it seldom waits for others. */
#define LEAST_POINTS 32
#define MOST_POINTS  256

/* What the threads share. */
typedef struct walk_job {
    hs_search        *search;
    hs_output        *output;   /* NULL: nothing is recorded */
    int64_t           in_range; /* points of a range */
    int64_t           enough;   /* pairs in it; 0: all */
    hs_bookmark       start;    /* where the first range begins */
    hs_bookmark       left;     /* set by the worker that has left its range */
    bool              is_left;
    const hs_visitor *visitor; /* where nothing is recorded */
    hs_neighbourhood  most;    /* set at the end, as is `n_found` */
    int64_t           n_found;
} walk_job;

/* What one thread works with; the state of a visitor lies behind it. */
typedef struct walk_worker {
    hs_committer committer;
    hs_keeper    keeper;
} walk_worker;

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    walk_worker      *me = context;
    walk_job         *job = me->committer.job;
    hs_walker        *walker = &me->keeper.walker;
    const hs_scanner *scanner = &walker->scanner;
    const int64_t     n = hs_search_asking(job->search)->n;
    const int64_t     first = job->start.point + range * job->in_range;
    const int64_t     end = first + (n - first < job->in_range ? n - first : job->in_range);
    walker->scanner.blocks_to_skip = range == 0 ? job->start.blocks : 0;
    hs_status status = hs_walk(walker, (int32_t)first, (int32_t)end, &me->committer.failure);
    if (status == HS_STOPPED && scanner->leaves) {
        /* The output is full: what the worker has is written, and its place is kept. */
        status = hs_commit(&me->committer,
                           hs_search_fraction(scanner->search, scanner->group.first), false);
        if (status == HS_OK) {
            job->left = (hs_bookmark){.point = scanner->group.first, .blocks = scanner->blocks};
            job->is_left = true;
            status = HS_STOPPED;
        }
    } else if (status == HS_OK && job->output != NULL) {
        status = hs_commit(&me->committer, hs_search_fraction(job->search, end), true);
    }
    return status;
}

/* A hs_visit_fn: to the pairs of a committer, which takes them when they are many. */
static hs_status
collect_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_keeper       *keeper = context;
    hs_committer    *committer = keeper->committer;
    const hs_output *pairs = committer->pairs;
    const hs_status  status = hs_record_hits(&keeper->recorder, scanner, first, hits);
    const int64_t    n_bytes = pairs->n_pairs * hs_output_bytes_per_pair(pairs);
    if (status == HS_OK && n_bytes >= committer->most_bytes) {
        const hs_status committed =
            hs_commit(committer, hs_search_fraction(scanner->search, scanner->group.first), false);
        scanner->leaves = committer->is_full;
        return committed;
    }
    return status;
}

/* Without a visitor, pairs are recorded as they are by a keeper. */
static hs_status
open_walk_worker(void *context, void *place)
{
    walk_job         *job = context;
    hs_search        *search = job->search;
    walk_worker      *me = place;
    hs_walker        *walker = &me->keeper.walker;
    const hs_visitor *visitor = job->visitor;
    hs_status         status;
    me->committer.options = &walker->scanner.options;
    me->keeper.committer = &me->committer;
    if (visitor == NULL) {
        status = hs_walker_init(search, hs_record_use(job->output->columns), NULL, collect_hits,
                                &me->keeper, walker);
        return status == HS_OK
                   ? hs_recorder_init(&search->call->account, me->committer.pairs,
                                      walker->scanner.block.most_hits, &me->keeper.recorder)
                   : status;
    }
    void *state = visitor->state_size > 0 ? (void *)(me + 1) : visitor->shared;
    status = hs_walker_init(search, visitor->use, visitor->most, visitor->visit, state, walker);
    return status == HS_OK && visitor->open != NULL ? visitor->open(visitor->shared, state, walker)
                                                    : status;
}

/* What a worker has found, and its end. */
static void
close_walk_worker(void *context, void *place)
{
    walk_job               *job = context;
    walk_worker            *me = place;
    const hs_visitor       *visitor = job->visitor;
    const hs_neighbourhood *most = &me->keeper.walker.scanner.most;
    job->n_found += me->keeper.walker.scanner.n_found;
    job->most.runs = most->runs > job->most.runs ? most->runs : job->most.runs;
    if (most->candidates > job->most.candidates) {
        job->most.candidates = most->candidates;
    }
    if (visitor != NULL && visitor->close != NULL) {
        visitor->close(visitor->shared, me + 1);
    }
    hs_keeper_close(job->search, &me->keeper);
}

/* Runs all workers. */
static hs_status
walk_together(walk_job *job, hs_failure *failure)
{
    const hs_search *search = job->search;
    const double     n = (double)hs_search_asking(search)->n;
    const int64_t    n_left = hs_search_asking(search)->n - job->start.point;
    hs_crew          crew = {.call = search->call,
                             .job = job,
                             .worker_size = sizeof(walk_worker),
                             .open = open_walk_worker,
                             .close = close_walk_worker,
                             .search = search_range,
                             .output = job->output,
                             .enough = job->enough};
    job->in_range = MOST_POINTS;
    if (job->output != NULL) { /* points of which HS_RANGE_BYTES are expected, in an even scene */
        const double pairs = search->grid.expected_pairs * search->pairs_per_half;
        const double most =
            HS_RANGE_BYTES * n / ((double)hs_output_bytes_per_pair(job->output) * pairs);
        job->in_range = most > MOST_POINTS    ? MOST_POINTS
                        : most > LEAST_POINTS ? (int64_t)most
                                              : LEAST_POINTS;
    } else {
        crew.worker_size += job->visitor->state_size;
    }
    if (job->enough > 0) {
        /* Threads may end the ranges that they work on, if these are no longer than usual. */
        const int64_t bytes = hs_output_bytes_per_pair(job->output);
        const int64_t slack = hs_team_size(search->call->team) *
                              (int64_t)HS_COMMIT_BYTES_OF_BLOCKS / (bytes > 0 ? bytes : 1);
        crew.most = job->enough <= INT64_MAX - slack ? job->enough + slack : INT64_MAX;
    }
    crew.n_ranges = (n_left + job->in_range - 1) / job->in_range;
    const hs_status status = hs_crew_run(&crew, failure);
    if (!job->is_left) {
        const int64_t done = crew.n_written * job->in_range;
        job->left = (hs_bookmark){.point = job->start.point + (done < n_left ? done : n_left)};
    }
    return status;
}

hs_status
hs_parallel_record_on(hs_search *search, hs_output *output, int64_t enough, hs_bookmark *bookmark,
                      hs_failure *failure)
{
    walk_job job = {.search = search, .output = output, .enough = enough, .start = *bookmark};
    const hs_status status = walk_together(&job, failure);
    if (status == HS_OK) {
        *bookmark = job.left;
    }
    return status;
}

hs_status
hs_parallel_visit(hs_search *search, const hs_visitor *visitor, hs_neighbourhood *most,
                  hs_failure *failure)
{
    walk_job        job = {.search = search, .visitor = visitor};
    const hs_status status = walk_together(&job, failure);
    if (most != NULL) {
        *most = job.most;
    }
    return status;
}

void
hs_keeper_close(hs_search *search, hs_keeper *keeper)
{
    hs_recorder_free(&search->call->account, &keeper->recorder);
    hs_walker_close(search, &keeper->walker);
}

/* By a keeper, which is new, or has served before: then it may have a walker and a recorder that
 * will do. */
static hs_status
record_alone(hs_search *search, bool is_new, hs_keeper *keeper, hs_output *output,
             hs_failure *failure)
{
    hs_account        *account = &search->call->account;
    hs_recorder       *recorder = &keeper->recorder;
    hs_walker         *walker = &keeper->walker;
    const bool         collects = keeper->committer != NULL && output == keeper->committer->pairs;
    const hs_block_use use = hs_record_use(output->columns);
    const hs_visit_fn  visit = collects ? collect_hits : hs_record_hits;
    void              *context = collects ? (void *)keeper : recorder;
    hs_status          status = is_new ? hs_walker_init(search, use, NULL, visit, context, walker)
                                       : hs_walker_renew(search, use, visit, context, walker);
    if (status == HS_OK && (recorder->output != output || recorder->columns != output->columns ||
                            recorder->most_hits < walker->scanner.block.most_hits)) {
        hs_recorder_free(account, recorder);
        status = hs_recorder_init(account, output, walker->scanner.block.most_hits, recorder);
        hs_account_keep(account);
    }
    if (status == HS_OK) {
        status = hs_walk(walker, 0, (int32_t)hs_search_asking(search)->n, failure);
    }
    if (!is_new) {
        hs_walker_flush_counters(search, walker);
    }
    return status;
}

hs_status
hs_parallel_record(hs_search *search, hs_keeper *keeper, hs_output *output, hs_failure *failure)
{
    if (keeper != NULL) {
        return record_alone(search, false, keeper, output, failure);
    }
    if (!output->fixed) {
        hs_output_reserve_hint(output, (double)output->n_pairs + search->grid.expected_pairs);
    }
    if (output->fixed || search->call->team != NULL) {
        hs_bookmark none = {.point = 0};
        /* what is written ahead is kept out of the caller's arrays */
        return hs_parallel_record_on(search, output, 0, &none, failure);
    }
    hs_keeper own; /* its walker is large, and filled before it is read */
    own.committer = NULL;
    own.recorder = (hs_recorder){.output = NULL};
    const hs_status status = record_alone(search, true, &own, output, failure);
    hs_keeper_close(search, &own);
    return status;
}

hs_status
hs_parallel_count(hs_search *search, hs_keeper *keeper, int64_t *count, hs_failure *failure)
{
    if (keeper == NULL) {
        const hs_visitor visitor = {.use = HS_BLOCK_COUNTS};
        walk_job         job = {.search = search, .visitor = &visitor};
        const hs_status  status = walk_together(&job, failure);
        *count += job.n_found;
        return status;
    }
    hs_status status = hs_walker_renew(search, HS_BLOCK_COUNTS, NULL, NULL, &keeper->walker);
    if (status == HS_OK) {
        const int64_t n = hs_search_asking(search)->n;
        status = hs_walk(&keeper->walker, 0, (int32_t)n, failure);
        *count += keeper->walker.scanner.n_found;
    }
    hs_walker_flush_counters(search, &keeper->walker);
    return status;
}
