/* SPDX-License-Identifier: BSD-3-Clause */
/* parallel.c: each worker has a walker and a backlog; ranges are committed in turn. A thread alone
 * writes straight to the output, by a walker that it may keep for the next search. */
#include "parallel.h"

#include "../base/outcome.h"
#include "crew.h"
#include "record.h"

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
    hs_walker_rest(search, walker);
    return status;
}

hs_status
hs_record_next(hs_search *search, hs_output *output, hs_walker *walker, hs_recorder *recorder,
               hs_failure *failure)
{
    return record_by(search, output, walker, recorder, hs_record_hits, recorder, failure);
}

hs_status
hs_record_alone(hs_search *search, hs_output *output, hs_failure *failure)
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
hs_record_all(hs_search *search, hs_output *output, hs_failure *failure)
{
    if (output->fixed) { /* a backlog keeps what is written ahead out of the caller's arrays */
        return hs_parallel_record(search, output, failure);
    }
    hs_output_expect(output, (double)output->n_pairs + search->grid.expected_pairs);
    return search->call->team != NULL ? hs_parallel_record(search, output, failure)
                                      : hs_record_alone(search, output, failure);
}
