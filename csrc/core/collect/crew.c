/* SPDX-License-Identifier: BSD-3-Clause */
/* crew.c: workers are opened one after the other; then each thread of the team has one. */
#include "crew.h"

#include <string.h>

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
        status = crew->open(crew->job, hs_crew_worker(crew, crew->n_open++));
    }
    return status;
}

void
hs_crew_close(hs_crew *crew)
{
    for (int w = 0; w < crew->n_open; w++) {
        crew->close(crew->job, hs_crew_worker(crew, w));
    }
    hs_free(&crew->call->account, crew->workers);
}

/* The ranges that a crew searches. */
typedef struct sharing {
    const hs_crew   *crew;
    const hs_ranges *ranges;
    hs_commits      *commits;
} sharing;

/* A hs_task_fn: ranges, as long as there are any. */
static void
work(void *context, int64_t task)
{
    const sharing *shared = context;
    hs_committer  *worker = hs_crew_worker(shared->crew, task);
    hs_commits_join(shared->commits, worker);
    hs_commits_work(worker, shared->ranges->search, worker);
}

hs_status
hs_crew_search(hs_crew *crew, hs_ranges *ranges, hs_failure *failure)
{
    hs_account *account = &crew->call->account;
    sharing     shared = {.crew = crew, .ranges = ranges};
    shared.commits = hs_commits_new(account, ranges->output, ranges->n);
    if (shared.commits == NULL) {
        return HS_ERR_MEMORY;
    }
    if (ranges->enough > 0) {
        hs_commits_limit(shared.commits, ranges->enough, ranges->most);
    }
    hs_team_run(crew->call->team, crew->n_open, work, &shared);
    ranges->n_written = hs_commits_written(shared.commits);
    return hs_commits_end(account, shared.commits, failure);
}
