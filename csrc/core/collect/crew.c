/* SPDX-License-Identifier: BSD-3-Clause */
/* crew.c: workers are opened one after the other; then each thread of the team has one. */
#include "crew.h"

#include <string.h>

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
    hs_commits_join(shared->commits, worker);
    hs_commits_work(worker, shared->crew->search, worker);
}

static hs_status
search_ranges(hs_crew *crew, hs_failure *failure)
{
    hs_account *account = &crew->call->account;
    sharing     shared = {crew, hs_commits_new(account, crew->output, crew->n_ranges)};
    if (shared.commits == NULL) {
        return HS_ERR_MEMORY;
    }
    if (crew->enough > 0) {
        hs_commits_limit(shared.commits, crew->enough, crew->most);
    }
    hs_team_run(crew->call->team, crew->n_open, work, &shared);
    crew->n_written = hs_commits_written(shared.commits);
    return hs_commits_end(account, shared.commits, failure);
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
