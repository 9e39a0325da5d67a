/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "parallel.h"
#include "../base/status.h"
#include "../base/os.h"
#include "../base/os_thread.h"

#include <string.h>

/* parallel.c: each worker has a walker and a backlog; ranges are committed in turn. A mutex guards
 * the number of the range that is due; pairs are copied without it. A thread alone writes straight
 * to the output, by a walker that it may keep for the next search. */

struct hs_commits {
    hs_output       *output;
    hs_thread_id     caller;
    int64_t          n_ranges;
    volatile int64_t next_range; /* atomic */
    hs_mutex         mutex;      /* guards all below, and the output but for what columns hold */
    hs_condition     changed;    /* due, n_copying or status */
    int64_t          due;        /* the range whose pairs are next in the output */
    double           done;       /* of the whole search, in order: it never falls */
    int              n_copying;  /* threads that write to columns: these must not move then */
    int              n_working;  /* threads that may still have a range */
    hs_status        status;
    hs_failure       failure;
    int64_t          failed_range;
    int64_t          enough, most; /* in pairs: limits set by commits_limit */
    bool             has_enough;
    int64_t          full_range; /* the last one that is written, n_ranges at first */
};

/* output: borrowed; NULL when nothing is written. The thread that calls this is the only one that
 * may poll. NULL when memory is short. */
static hs_commits *
commits_new(hs_account *account, hs_output *output, int64_t n_ranges)
{
    hs_commits *commits = hs_alloc(account, HS_FOR_CANDIDATES, 1, sizeof *commits);
    if (commits != NULL) {
        *commits = (hs_commits){.output = output,
                                .n_ranges = n_ranges,
                                .enough = INT64_MAX,
                                .most = INT64_MAX,
                                .full_range = n_ranges};
        commits->caller = hs_thread_self();
        hs_mutex_init(&commits->mutex);
        hs_condition_init(&commits->changed);
    }
    return commits;
}

/* Before any thread joins: from `enough` pairs in the output on no range is begun, and from `most`
 * on none is ended but the one that is due, which is to be left (hs_committer.is_full). */
static void
commits_limit(hs_commits *commits, int64_t enough, int64_t most)
{
    commits->enough = enough;
    commits->most = most;
}

/* After all threads are done: how many ranges have been written to their end, the first ones. */
static int64_t
commits_written(const hs_commits *commits)
{
    return commits->due;
}

/* After all threads are done: HS_OK, or the failure of the earliest range that had one. Frees. */
static hs_status
commits_end(hs_account *account, hs_commits *commits, hs_failure *failure)
{
    const hs_status status = commits->status;
    if (status != HS_OK) {
        *failure = commits->failure;
    }
    hs_condition_destroy(&commits->changed);
    hs_mutex_destroy(&commits->mutex);
    hs_free(account, commits);
    return status;
}

/* A hs_poll_fn of the threads that may not call the caller's: true until a thread has failed. */
static bool
goes_on(void *context, double fraction)
{
    hs_commits *commits = context;
    (void)fraction;
    hs_mutex_lock(&commits->mutex);
    const bool result = commits->status == HS_OK;
    hs_mutex_unlock(&commits->mutex);
    return result;
}

/* A hs_poll_fn of the caller's thread. What it has done counts once all earlier ranges are written:
 * it may be far ahead of the others, and what is found beyond a full output is given up. */
static bool
ask_caller(void *context, double fraction)
{
    hs_committer *committer = context;
    hs_commits   *commits = committer->commits;
    hs_mutex_lock(&commits->mutex);
    if (commits->output == NULL || committer->range == commits->due) {
        commits->done = hs_larger(commits->done, fraction);
    }
    const double done = commits->done;
    hs_mutex_unlock(&commits->mutex);
    return committer->poll(committer->poll_context, done);
}

/* Called by the thread itself, whose committer has options and pairs, and nothing else. The options
 * are changed: threads that may not poll look whether another has failed, and the caller's thread
 * tells a fraction that never falls. committer must outlive them. */
static void
commits_join(hs_commits *commits, hs_committer *committer)
{
    hs_options *options = committer->options;
    committer->failure = HS_NO_FAILURE;
    committer->commits = commits;
    committer->poll = options->poll;
    committer->poll_context = options->poll_context;
    committer->range = -1;
    committer->most_bytes = commits->enough < INT64_MAX ? HS_COMMIT_BYTES_OF_BLOCKS
                                                        : HS_COMMIT_BYTES;
    hs_mutex_lock(&commits->mutex);
    commits->n_working++;
    hs_mutex_unlock(&commits->mutex);
    if (!hs_thread_is(commits->caller)) {
        options->poll = goes_on;
        options->poll_context = commits;
    } else if (options->poll != NULL) {
        options->poll = ask_caller;
        options->poll_context = committer;
    }
}

/* Takes the next range; false when there is none, when a thread has failed, or when there are
 * enough pairs. */
static bool
take_range(hs_committer *committer)
{
    hs_commits *commits = committer->commits;
    hs_mutex_lock(&commits->mutex);
    const bool more = commits->status == HS_OK && !commits->has_enough;
    hs_mutex_unlock(&commits->mutex);
    if (!more) {
        return false;
    }
    committer->range = hs_fetch_increment(&commits->next_range);
    return committer->range < commits->n_ranges;
}

/* This range has failed: all threads stop. A status that only follows from another failure is not
 * noted. */
static void
fail(hs_committer *committer, hs_status status)
{
    hs_commits *commits = committer->commits;
    const bool  stopped = status == HS_STOPPED ||
                         (status == HS_ERR_INTERRUPTED && committer->options->poll == goes_on);
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
wait_for_change(hs_commits *commits, const hs_committer *committer, double fraction)
{
    if (committer->options->poll == goes_on) {
        hs_condition_wait(&commits->changed, &commits->mutex);
        return HS_OK;
    }
    hs_condition_wait_briefly(&commits->changed, &commits->mutex);
    hs_mutex_unlock(&commits->mutex);
    const hs_status status = hs_poll(committer->options, fraction);
    hs_mutex_lock(&commits->mutex);
    return status;
}

/* With the mutex held: settles where in the output the n pairs that are due go. */
static hs_status
claim(hs_commits *commits, int64_t n, double fraction, int64_t *at)
{
    hs_output *output = commits->output;
    if (!hs_output_has_room(output, n)) {
        while (commits->n_copying > 0) { /* soon over */
            hs_condition_wait(&commits->changed, &commits->mutex);
        }
        /* An output with a limit does not grow with the work that is left. */
        const bool      is_limited = commits->enough < INT64_MAX;
        const hs_status status = hs_output_reserve(output, n, is_limited ? 0.0 : fraction);
        if (status != HS_OK) {
            return status;
        }
    }
    *at = output->n_pairs;
    output->n_pairs += n;
    hs_output_touch(output, *at, n);
    return HS_OK;
}

/* With the mutex held: notes whether the output has `enough` or `most` pairs. */
static void
heed_limits(hs_committer *committer, const hs_commit_part *part)
{
    hs_commits   *commits = committer->commits;
    const int64_t n = commits->output->n_pairs;
    commits->has_enough = commits->has_enough || n >= commits->enough;
    if (n >= commits->most && commits->full_range == commits->n_ranges) {
        commits->full_range = part->range;
        committer->is_full = !part->is_last;
        hs_condition_wake(&commits->changed);
    }
}

/* Writes the part that is due. The mutex is held, but not while it copies. */
static hs_status
write_part(hs_committer *committer, const hs_commit_part *part)
{
    hs_commits     *commits = committer->commits;
    int64_t         at = 0;
    const hs_status status = claim(commits, part->end - committer->written, part->fraction, &at);
    if (status != HS_OK) {
        return status;
    }
    heed_limits(committer, part);
    commits->done = hs_larger(commits->done, part->fraction);
    commits->n_copying++;
    if (part->is_last) {
        commits->due++;
        hs_condition_wake(&commits->changed);
    }
    hs_mutex_unlock(&commits->mutex);
    hs_output_copy(commits->output, at, committer->pairs, committer->written, part->end);
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
            status = wait_for_change(commits, committer, part->fraction);
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

/* There is no range left for this thread. The caller's thread goes on polling for the others. */
static hs_status
leave(hs_committer *committer)
{
    hs_commits *commits = committer->commits;
    const bool  waits = committer->options->poll != goes_on;
    hs_status   status = HS_OK;
    hs_mutex_lock(&commits->mutex);
    commits->n_working--;
    hs_condition_wake(&commits->changed);
    while (waits && status == HS_OK && commits->status == HS_OK && commits->n_working > 0) {
        const double left = (double)commits->n_working / (double)commits->n_ranges;
        status = wait_for_change(commits, committer, hs_larger(1.0 - left, 0.0));
    }
    hs_mutex_unlock(&commits->mutex);
    return status;
}

/*
 * Takes ranges as long as there are any and no thread has failed, and waits until all that was
 * committed has been written. All threads stop when a range fails; the committer's failure tells
 * why it did. The caller's thread then waits for the others, and polls meanwhile.
 */
static void
commits_work(hs_committer *committer, hs_range_fn search_range, void *worker)
{
    hs_status status = HS_OK;
    while (status == HS_OK && take_range(committer)) {
        status = search_range(worker, committer->range);
    }
    if (status == HS_OK && committer->n_parts > 0) {
        status = write_parts(committer, true);
    }
    if (status != HS_OK) {
        fail(committer, status);
    }
    status = leave(committer);
    if (status != HS_OK) {
        fail(committer, status);
    }
}

/* Workers are opened one after the other; then each thread of the team has one. */

static void *
worker_of(const hs_crew *crew, int64_t number)
{
    return (char *)crew->workers + (size_t)number * crew->worker_size;
}

hs_status
hs_crew_open(hs_crew *crew)
{
    const int n = hs_team_size(crew->call->team);
    hs_status status = HS_OK;
    crew->n_open = 0;
    crew->workers = hs_alloc(&crew->call->account, HS_FOR_CANDIDATES, n, crew->worker_size);
    if (crew->workers == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(crew->workers, 0, (size_t)n * crew->worker_size);
    while (crew->n_open < n && status == HS_OK) {
        status = crew->open(crew->job, worker_of(crew, crew->n_open++));
    }
    return status;
}

void
hs_crew_close(hs_crew *crew)
{
    for (int w = 0; w < crew->n_open; w++) {
        crew->close(crew->job, worker_of(crew, w));
    }
    hs_free(&crew->call->account, crew->workers);
}

/* A crew at work. */
typedef struct sharing {
    const hs_crew *crew;
    hs_commits    *commits;
} sharing;

/* A hs_task_fn: ranges, as long as there are any. */
static void
work(void *context, int64_t task)
{
    const sharing *shared = context;
    hs_committer  *worker = worker_of(shared->crew, task);
    commits_join(shared->commits, worker);
    commits_work(worker, shared->crew->search, worker);
}

static hs_status
search_ranges(hs_crew *crew, hs_failure *failure)
{
    hs_account *account = &crew->call->account;
    sharing     shared = {crew, commits_new(account, crew->output, crew->n_ranges)};
    if (shared.commits == NULL) {
        return HS_ERR_MEMORY;
    }
    if (crew->enough > 0) {
        commits_limit(shared.commits, crew->enough, crew->most);
    }
    hs_team_run(crew->call->team, crew->n_open, work, &shared);
    crew->n_written = commits_written(shared.commits);
    return commits_end(account, shared.commits, failure);
}

hs_status
hs_crew_run(hs_crew *crew, hs_failure *failure)
{
    hs_status status = hs_crew_open(crew);
    if (status == HS_OK) {
        status = search_ranges(crew, failure);
    }
    hs_crew_close(crew);
    return status;
}

/* Points of a range: a group at least, and so few that their pairs are a part of what a thread can
 * hold back: it seldom waits for others. */
#define LEAST_POINTS 32
#define MOST_POINTS  256

/* What the threads share. */
typedef struct walk_job {
    hs_search         *search;
    hs_output         *output;   /* NULL: nothing is recorded */
    int64_t            in_range; /* points of a range */
    int64_t            enough;   /* pairs in it; 0: all */
    hs_bookmark        start;    /* where the first range begins */
    hs_bookmark        left;     /* set by the worker that has left its range */
    bool               is_left;
    const hs_visitors *visitors; /* NULL: hits are recorded, or only counted */
    int                n_opened; /* workers */
    hs_neighbourhood   most;     /* set at the end, as is `n_found` */
    int64_t            n_found;
} walk_job;

/* What one thread works with. */
typedef struct worker {
    hs_committer committer;
    walk_job    *job;
    hs_walker    walker;
    hs_backlog   backlog;
} worker;

/* The output is full: what the worker has is written, and its place is kept. */
static hs_status
leave_range(worker *me)
{
    walk_job         *job = me->job;
    const hs_scanner *scanner = &me->walker.scanner;
    const hs_status   status = hs_commit(&me->committer, hs_scanner_fraction(scanner), false);
    if (status != HS_OK) {
        return status;
    }
    job->left = (hs_bookmark){.point = scanner->group.first, .blocks = scanner->blocks};
    job->is_left = true;
    return HS_STOPPED;
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    worker         *me = context;
    const walk_job *job = me->job;
    const int64_t   n = hs_search_asking(job->search)->n;
    const int64_t   first = job->start.point + range * job->in_range;
    const int64_t   end = first + (n - first < job->in_range ? n - first : job->in_range);
    me->walker.scanner.blocks_to_skip = range == 0 ? job->start.blocks : 0;
    hs_status status =
        hs_walk_or_tell(&me->walker, (int32_t)first, (int32_t)end, &me->committer.failure);
    if (status == HS_STOPPED && me->walker.scanner.leaves) {
        return leave_range(me);
    }
    if (status == HS_OK && job->output != NULL) {
        status = hs_commit(&me->committer, hs_search_fraction(job->search, end), true);
    }
    return status;
}

/* A hs_visit_fn. */
static hs_status
backlog_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_backlog      *backlog = context;
    const hs_output *pairs = &backlog->pairs;
    const hs_status  status = hs_record_hits(&backlog->recorder, scanner, first, hits);
    const int64_t    n_bytes = pairs->n_pairs * hs_output_bytes_per_pair(pairs);
    if (status == HS_OK && n_bytes >= backlog->committer->most_bytes) {
        const hs_status committed =
            hs_commit(backlog->committer, hs_scanner_fraction(scanner), false);
        scanner->leaves = backlog->committer->is_full;
        return committed;
    }
    return status;
}

/* A walker that visits; the workers take the contexts in turn. */
static hs_status
open_visitor(walk_job *job, hs_walker *walker)
{
    const hs_visitors *visitors = job->visitors;
    const size_t       at = (size_t)job->n_opened++ * visitors->context_size;
    void              *context = (char *)visitors->contexts + at;
    return visitors->most == NULL
               ? hs_walker_init(job->search, visitors->use, visitors->visit, context, walker)
               : hs_walker_init_ordered(job->search, visitors->use, visitors->most, visitors->visit,
                                        context, walker);
}

static hs_status
open_worker(void *context, void *place)
{
    walk_job  *job = context;
    hs_search *search = job->search;
    worker    *me = place;
    me->job = job;
    me->committer.options = &me->walker.scanner.options;
    if (job->visitors != NULL) {
        return open_visitor(job, &me->walker);
    }
    if (job->output == NULL) {
        return hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, &me->walker);
    }
    hs_backlog_init(job->output, &me->committer, &me->backlog);
    me->committer.pairs = &me->backlog.pairs;
    hs_status status = hs_walker_init(search, hs_record_use(job->output->columns), backlog_hits,
                                      &me->backlog, &me->walker);
    if (status == HS_OK) {
        status = hs_recorder_init(&search->call->account, &me->backlog.pairs,
                                  me->walker.scanner.block.most_hits, &me->backlog.recorder);
    }
    return status;
}

/* What a worker has found, and its end. */
static void
close_worker(void *context, void *place)
{
    walk_job               *job = context;
    worker                 *me = place;
    const hs_neighbourhood *most = &me->walker.scanner.most;
    job->n_found += me->walker.scanner.n_found;
    job->most.runs = most->runs > job->most.runs ? most->runs : job->most.runs;
    if (most->candidates > job->most.candidates) {
        job->most.candidates = most->candidates;
    }
    hs_walker_close(job->search, &me->walker);
    if (job->output != NULL) {
        hs_backlog_free(&job->search->call->account, &me->backlog);
    }
}

/* Threads may end the ranges that they work on, as long as these are no longer than usual. */
static int64_t
most_pairs(const walk_job *job)
{
    const int64_t bytes = hs_output_bytes_per_pair(job->output);
    const int64_t slack = hs_team_size(job->search->call->team) *
                          (int64_t)HS_COMMIT_BYTES_OF_BLOCKS / (bytes > 0 ? bytes : 1);
    return job->enough <= INT64_MAX - slack ? job->enough + slack : INT64_MAX;
}

/* Points of which HS_RANGE_BYTES are expected, in an even scene. */
static int64_t
points_in_range(const walk_job *job)
{
    const hs_search *search = job->search;
    const double     pairs = search->grid.expected_pairs * search->pairs_per_half;
    const double     each = (double)hs_output_bytes_per_pair(job->output) * pairs;
    const double     n = HS_RANGE_BYTES * (double)hs_search_asking(search)->n / each;
    return n > MOST_POINTS ? MOST_POINTS : n > LEAST_POINTS ? (int64_t)n : LEAST_POINTS;
}

/* Runs all workers. */
static hs_status
walk_together(walk_job *job, hs_failure *failure)
{
    const int64_t n_left = hs_search_asking(job->search)->n - job->start.point;
    job->in_range = job->output != NULL ? points_in_range(job) : MOST_POINTS;
    hs_crew         crew = {.call = job->search->call,
                            .job = job,
                            .worker_size = sizeof(worker),
                            .open = open_worker,
                            .close = close_worker,
                            .n_ranges = (n_left + job->in_range - 1) / job->in_range,
                            .search = search_range,
                            .output = job->output,
                            .enough = job->enough,
                            .most = job->enough > 0 ? most_pairs(job) : 0};
    const hs_status status = hs_crew_run(&crew, failure);
    if (!job->is_left) {
        const int64_t done = crew.n_written * job->in_range;
        job->left = (hs_bookmark){.point = job->start.point + (done < n_left ? done : n_left)};
    }
    return status;
}

hs_status
hs_parallel_record(hs_search *search, hs_output *output, hs_failure *failure)
{
    walk_job job = {.search = search, .output = output};
    return walk_together(&job, failure);
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
hs_parallel_visit(hs_search *search, const hs_visitors *visitors, hs_neighbourhood *most,
                  hs_failure *failure)
{
    walk_job        job = {.search = search, .visitors = visitors};
    const hs_status status = walk_together(&job, failure);
    if (most != NULL) {
        *most = job.most;
    }
    return status;
}

hs_status
hs_parallel_count(hs_search *search, int64_t *count, hs_failure *failure)
{
    walk_job        job = {.search = search};
    const hs_status status = walk_together(&job, failure);
    *count = job.n_found;
    return status;
}

void
hs_backlog_init(const hs_output *target, hs_committer *committer, hs_backlog *backlog)
{
    *backlog = (hs_backlog){.committer = committer};
    hs_output_init(NULL, target->ndim, target->columns, target->index_bytes, &backlog->pairs);
}

void
hs_backlog_free(hs_account *account, hs_backlog *backlog)
{
    hs_recorder_free(account, &backlog->recorder);
    hs_output_free(&backlog->pairs);
}

/* A recorder for this output and so many hits at a time, that before if it is one. */
static hs_status
renew_recorder(hs_search *search, hs_output *output, int32_t most_hits, hs_recorder *recorder)
{
    hs_account *account = &search->call->account;
    if (recorder->output == output && recorder->columns == output->columns &&
        recorder->most_hits >= most_hits) {
        return HS_OK;
    }
    hs_recorder_free(account, recorder);
    const hs_status status = hs_recorder_init(account, output, most_hits, recorder);
    hs_account_keep(account);
    return status;
}

static hs_status
walk_all(const hs_search *search, hs_walker *walker, hs_failure *failure)
{
    return hs_walk_or_tell(walker, 0, (int32_t)hs_search_asking(search)->n, failure);
}

/* By a walker that is kept; `visit` writes to the output by the recorder. */
static hs_status
record_by(hs_search *search, hs_output *output, hs_walker *walker, hs_recorder *recorder,
          hs_visit_fn visit, void *context, hs_failure *failure)
{
    hs_status status =
        hs_walker_renew(search, hs_record_use(output->columns), visit, context, walker);
    if (status == HS_OK) {
        status = renew_recorder(search, output, walker->scanner.block.most_hits, recorder);
    }
    if (status == HS_OK) {
        status = walk_all(search, walker, failure);
    }
    hs_walker_flush_counters(search, walker);
    return status;
}

hs_status
hs_parallel_record_next(hs_search *search, hs_output *output, hs_walker *walker,
                        hs_recorder *recorder, hs_failure *failure)
{
    return record_by(search, output, walker, recorder, hs_record_hits, recorder, failure);
}

/* Records all pairs by this thread, straight into an output that grows. */
static hs_status
record_alone(hs_search *search, hs_output *output, hs_failure *failure)
{
    hs_account *account = &search->call->account;
    hs_walker   walker;
    hs_recorder recorder = {0};
    hs_status   status =
        hs_walker_init(search, hs_record_use(output->columns), hs_record_hits, &recorder, &walker);
    if (status == HS_OK) {
        status = hs_recorder_init(account, output, walker.scanner.block.most_hits, &recorder);
    }
    if (status == HS_OK) {
        status = walk_all(search, &walker, failure);
    }
    hs_recorder_free(account, &recorder);
    hs_walker_close(search, &walker);
    return status;
}

hs_status
hs_backlog_record(hs_search *search, hs_backlog *backlog, hs_walker *walker, hs_failure *failure)
{
    return record_by(search, &backlog->pairs, walker, &backlog->recorder, backlog_hits, backlog,
                     failure);
}

hs_status
hs_parallel_record_all(hs_search *search, hs_output *output, hs_failure *failure)
{
    if (output->fixed) { /* a backlog keeps what is written ahead out of the caller's arrays */
        return hs_parallel_record(search, output, failure);
    }
    hs_output_reserve_hint(output, (double)output->n_pairs + search->grid.expected_pairs);
    return search->call->team != NULL ? hs_parallel_record(search, output, failure)
                                      : record_alone(search, output, failure);
}
