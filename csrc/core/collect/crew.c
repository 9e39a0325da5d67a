/* SPDX-License-Identifier: BSD-3-Clause */
/* crew.c: one worker for each thread, with a walker and a backlog of its own; ranges are committed
 * in turn. */
#include "crew.h"

#include <string.h>

#include "../base/outcome.h"
#include "../base/poll.h"
#include "../threads/team.h"

/* Points of a range: some groups at least, and so few that their pairs, with all quantities, fit
 * what a thread can hold back: it seldom waits for others. */
#define RANGE_POINTS 256

typedef struct hs_crew hs_crew;

/* What one thread works with. */
typedef struct hs_worker {
    hs_crew     *crew;
    hs_walker    walker;
    hs_backlog   backlog;
    hs_committer committer;
    hs_failure   failure;
} hs_worker;

struct hs_crew {
    hs_search         *search;
    hs_output         *output; /* NULL: nothing is recorded */
    int64_t            enough; /* pairs in it; 0: all */
    hs_bookmark        start;  /* where the first range begins */
    hs_bookmark        left;   /* set by the worker that has left its range */
    bool               is_left;
    const hs_visitors *visitors; /* NULL: hits are recorded, or only counted */
    hs_worker         *workers;
    hs_commits        *commits;
    hs_neighbourhood   most; /* set at the end, as is `n_found` */
    int64_t            n_found;
};

/* The output is full: what the worker has is written, and its place is kept. */
static hs_status
leave_range(hs_worker *worker)
{
    hs_crew          *crew = worker->crew;
    const hs_scanner *scanner = &worker->walker.scanner;
    const hs_status   status = hs_commit(&worker->committer, hs_scanner_fraction(scanner), false);
    if (status != HS_OK) {
        return status;
    }
    crew->left = (hs_bookmark){.point = scanner->group.first, .blocks = scanner->blocks};
    crew->is_left = true;
    return HS_STOPPED;
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    hs_worker     *worker = context;
    const hs_crew *crew = worker->crew;
    const int64_t  n = hs_search_asking(crew->search)->n;
    const int64_t  first = crew->start.point + range * RANGE_POINTS;
    const int64_t  end = first + (n - first < RANGE_POINTS ? n - first : RANGE_POINTS);
    worker->walker.scanner.blocks_to_skip = range == 0 ? crew->start.blocks : 0;
    hs_status status =
        hs_walk_or_tell(&worker->walker, (int32_t)first, (int32_t)end, &worker->failure);
    if (status == HS_STOPPED && worker->walker.scanner.leaves) {
        return leave_range(worker);
    }
    if (status == HS_OK && crew->output != NULL) {
        status = hs_commit(&worker->committer, (double)end / (double)n, true);
    }
    return status;
}

/* A hs_task_fn: ranges, as long as there are any. */
static void
work(void *context, int64_t task)
{
    hs_crew   *crew = context;
    hs_worker *worker = &crew->workers[task];
    hs_commits_join(crew->commits, &worker->walker.scanner.options, &worker->backlog.pairs,
                    &worker->committer);
    hs_commits_work(&worker->committer, search_range, worker, &worker->failure);
}

/* The walker of worker number w. */
static hs_status
open_visitor(const hs_crew *crew, int w, hs_walker *walker)
{
    const hs_visitors *visitors = crew->visitors;
    void              *context = (char *)visitors->contexts + (size_t)w * visitors->context_size;
    return visitors->most == NULL
               ? hs_walker_init(crew->search, visitors->use, visitors->visit, context, walker)
               : hs_walker_init_ordered(crew->search, visitors->use, visitors->most,
                                        visitors->visit, context, walker);
}

static hs_status
open_worker(hs_crew *crew, int w)
{
    hs_search *search = crew->search;
    hs_worker *worker = &crew->workers[w];
    worker->crew = crew;
    worker->failure = HS_NO_FAILURE;
    if (crew->visitors != NULL) {
        return open_visitor(crew, w, &worker->walker);
    }
    if (crew->output == NULL) {
        return hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, &worker->walker);
    }
    hs_backlog_init(crew->output, &worker->committer, &worker->backlog);
    hs_status status = hs_walker_init(search, hs_record_use(crew->output->columns), hs_backlog_hits,
                                      &worker->backlog, &worker->walker);
    if (status == HS_OK) {
        status = hs_recorder_init(&search->call->account, &worker->backlog.pairs,
                                  worker->walker.scanner.block.most_hits,
                                  &worker->backlog.recorder);
    }
    return status;
}

/* Threads may end the ranges that they work on, as long as these are no longer than usual. */
static void
limit_crew(const hs_crew *crew)
{
    const int64_t bytes = hs_output_bytes_per_pair(crew->output);
    const int64_t slack =
        hs_team_size(crew->search->call->team) * (int64_t)HS_COMMIT_BYTES / (bytes > 0 ? bytes : 1);
    const bool is_bounded = crew->enough <= INT64_MAX - slack;
    hs_commits_limit(crew->commits, crew->enough, is_bounded ? crew->enough + slack : INT64_MAX);
}

static hs_status
run_crew(hs_crew *crew, hs_failure *failure)
{
    hs_search    *search = crew->search;
    const int64_t n = hs_search_asking(search)->n, n_left = n - crew->start.point;
    const int64_t n_ranges = (n_left + RANGE_POINTS - 1) / RANGE_POINTS;
    crew->commits = hs_commits_new(&search->call->account, crew->output, n_ranges);
    if (crew->commits == NULL) {
        return HS_ERR_MEMORY;
    }
    if (crew->enough > 0) {
        limit_crew(crew);
    }
    hs_team_run(search->call->team, hs_team_size(search->call->team), work, crew);
    if (!crew->is_left) {
        const int64_t done = hs_commits_written(crew->commits) * RANGE_POINTS;
        crew->left = (hs_bookmark){.point = crew->start.point + (done < n_left ? done : n_left)};
    }
    return hs_commits_end(&search->call->account, crew->commits, failure);
}

/* What a worker has found, and its end. */
static void
close_worker(hs_crew *crew, hs_worker *worker)
{
    const hs_neighbourhood *most = &worker->walker.scanner.most;
    crew->n_found += worker->walker.scanner.n_found;
    crew->most.runs = most->runs > crew->most.runs ? most->runs : crew->most.runs;
    if (most->candidates > crew->most.candidates) {
        crew->most.candidates = most->candidates;
    }
    hs_walker_close(crew->search, &worker->walker);
    if (crew->output != NULL) {
        hs_backlog_free(&crew->search->call->account, &worker->backlog);
    }
}

/* Runs all workers. */
static hs_status
walk_together(hs_crew *crew, hs_failure *failure)
{
    hs_account *account = &crew->search->call->account;
    const int   n_workers = hs_team_size(crew->search->call->team);
    hs_status   status = HS_OK;
    int         opened = 0;
    crew->workers = hs_alloc(account, HS_FOR_CANDIDATES, n_workers, sizeof(hs_worker));
    if (crew->workers == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(crew->workers, 0, (size_t)n_workers * sizeof(hs_worker));
    while (opened < n_workers && status == HS_OK) {
        status = open_worker(crew, opened++);
    }
    if (status == HS_OK) {
        status = run_crew(crew, failure);
    }
    for (int w = 0; w < opened; w++) {
        close_worker(crew, &crew->workers[w]);
    }
    hs_free(account, crew->workers);
    return status;
}

hs_status
hs_parallel_record(hs_search *search, hs_output *output, hs_failure *failure)
{
    hs_crew crew = {.search = search, .output = output};
    return walk_together(&crew, failure);
}

hs_status
hs_parallel_record_on(hs_search *search, hs_output *output, int64_t enough, hs_bookmark *bookmark,
                      hs_failure *failure)
{
    hs_crew crew = {.search = search, .output = output, .enough = enough, .start = *bookmark};
    const hs_status status = walk_together(&crew, failure);
    if (status == HS_OK) {
        *bookmark = crew.left;
    }
    return status;
}

hs_status
hs_parallel_visit(hs_search *search, const hs_visitors *visitors, hs_neighbourhood *most,
                  hs_failure *failure)
{
    hs_crew         crew = {.search = search, .visitors = visitors};
    const hs_status status = walk_together(&crew, failure);
    if (most != NULL) {
        *most = crew.most;
    }
    return status;
}

hs_status
hs_parallel_count(hs_search *search, int64_t *count, hs_failure *failure)
{
    hs_crew         crew = {.search = search};
    const hs_status status = walk_together(&crew, failure);
    *count = crew.n_found;
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

hs_status
hs_backlog_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_backlog      *backlog = context;
    const hs_output *pairs = &backlog->pairs;
    const hs_status  status = hs_record_hits(&backlog->recorder, scanner, first, hits);
    if (status == HS_OK && pairs->n_pairs * hs_output_bytes_per_pair(pairs) >= HS_COMMIT_BYTES) {
        const hs_status committed =
            hs_commit(backlog->committer, hs_scanner_fraction(scanner), false);
        scanner->leaves = backlog->committer->is_full;
        return committed;
    }
    return status;
}
