/* SPDX-License-Identifier: BSD-3-Clause */
/* parallel.c: see parallel.h. */
#include "parallel.h"

#include "backlog.h"
#include "poll.h"
#include "team.h"

#include <string.h>

/* Points of a range: some groups at least, and so few that their pairs, with all that may be asked
 * for, fit what a thread can hold back: it seldom waits for others. */
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
    hs_search  *search;
    hs_output  *output; /* NULL: only counting */
    hs_worker  *workers;
    hs_commits *commits;
};

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    hs_worker     *worker = context;
    const hs_crew *crew = worker->crew;
    const int64_t  n = crew->search->bins.n, first = range * RANGE_POINTS;
    const int64_t  end = first + (n - first < RANGE_POINTS ? n - first : RANGE_POINTS);
    hs_status      status = hs_walk(&worker->walker, (int32_t)first, (int32_t)end);
    if (status == HS_ERR_SHIFT_RANGE) {
        worker->failure.row = worker->walker.failed_point;
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
    hs_commits_join(crew->commits, &worker->walker.options, &worker->backlog.pairs,
                    &worker->committer);
    hs_commits_work(&worker->committer, search_range, worker, &worker->failure);
}

static hs_status
open_worker(hs_crew *crew, hs_worker *worker)
{
    hs_search *search = crew->search;
    worker->crew = crew;
    worker->failure = HS_NO_FAILURE;
    if (crew->output == NULL) {
        return hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, &worker->walker);
    }
    hs_backlog_init(crew->output, &worker->committer, &worker->backlog);
    hs_status status = hs_walker_init(search, hs_record_use(crew->output->columns),
                                      hs_backlog_hits, &worker->backlog, &worker->walker);
    if (status == HS_OK) {
        status = hs_recorder_init(&search->account, &worker->backlog.pairs,
                                  worker->walker.block.most_hits, &worker->backlog.recorder);
    }
    return status;
}

static hs_status
run_crew(hs_crew *crew, hs_failure *failure)
{
    hs_search    *search = crew->search;
    const int64_t n_ranges = (search->bins.n + RANGE_POINTS - 1) / RANGE_POINTS;
    crew->commits = hs_commits_new(&search->account, crew->output, n_ranges);
    if (crew->commits == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_team_run(search->team, hs_team_size(search->team), work, crew);
    return hs_commits_end(&search->account, crew->commits, failure);
}

/* Everybody walks; *count: what they found. */
static hs_status
walk_together(hs_search *search, hs_output *output, int64_t *count, hs_failure *failure)
{
    hs_account *account = &search->account;
    const int   n_workers = hs_team_size(search->team);
    hs_crew     crew = {.search = search, .output = output};
    hs_status   status = HS_OK;
    int         opened = 0;
    crew.workers = hs_alloc(account, HS_FOR_CANDIDATES, n_workers, sizeof(hs_worker));
    if (crew.workers == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(crew.workers, 0, (size_t)n_workers * sizeof(hs_worker));
    while (opened < n_workers && status == HS_OK) {
        status = open_worker(&crew, &crew.workers[opened++]);
    }
    if (status == HS_OK) {
        status = run_crew(&crew, failure);
    }
    *count = 0;
    for (int w = 0; w < opened; w++) {
        *count += crew.workers[w].walker.n_found;
        hs_walker_close(search, &crew.workers[w].walker);
        if (output != NULL) {
            hs_backlog_free(account, &crew.workers[w].backlog);
        }
    }
    hs_free(account, crew.workers);
    return status;
}

hs_status
hs_parallel_record(hs_search *search, hs_output *output, hs_failure *failure)
{
    int64_t count;
    return walk_together(search, output, &count, failure);
}

hs_status
hs_parallel_count(hs_search *search, int64_t *count, hs_failure *failure)
{
    return walk_together(search, NULL, count, failure);
}
