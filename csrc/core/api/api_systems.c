/* SPDX-License-Identifier: BSD-3-Clause */
/* api_systems.c: the public searches of many systems: find and count. Threads take ranges of
 * them. */
#include "request.h"
#include "../search/estimate.h"
#include "../collect/result.h"
#include "../base/poll.h"
#include "systems_thread.h"

#include <math.h>

/* Points that a range of systems should have: their pairs fit the backlog of a thread, so that
 * it seldom waits for others, and taking a range costs little beside them. */
#define RANGE_POINTS 512

/* Runs all workers. `total` has the account of the output and sums up what was done. */
static hs_status
run_crew(hs_systems_crew *crew, hs_call *total, hs_failure *failure)
{
    const hs_options *options = &total->options;
    const int         n_workers = hs_team_size(total->team);
    const int64_t     n_systems = crew->systems->n, n_points = crew->points->n;
    const int64_t     in_range = RANGE_POINTS * n_systems / (n_points + 1);
    crew->in_range = in_range > 1 ? in_range : 1;
    crew->is_direct = n_workers == 1 && crew->output != NULL && !crew->output->fixed;
    crew->workers =
        hs_alloc(&total->account, HS_FOR_CANDIDATES, n_workers, sizeof(hs_systems_worker));
    crew->commits = hs_commits_new(&total->account, crew->output,
                                   (n_systems + crew->in_range - 1) / crew->in_range);
    hs_status status = HS_ERR_MEMORY;
    for (int w = 0; w < n_workers && crew->workers != NULL; w++) {
        hs_systems_open_worker(crew, options, &crew->workers[w]);
    }
    if (crew->workers != NULL && crew->commits != NULL) {
        hs_team_run(total->team, n_workers, hs_systems_work, crew);
        status = HS_OK;
    }
    for (int w = 0; w < n_workers && crew->workers != NULL; w++) {
        hs_systems_close_worker(&crew->workers[w], total);
    }
    if (crew->commits != NULL) {
        const hs_status ended = hs_commits_end(&total->account, crew->commits, failure);
        status = status == HS_OK ? ended : status;
    }
    hs_free(&total->account, crew->workers);
    return status;
}

/* What all systems share is checked also where there are none. */
static hs_status
check_shared(const hs_points *points, const hs_systems *systems, const hs_options *options,
             hs_failure *failure)
{
    const hs_box *box = systems != NULL ? systems->box : NULL;
    hs_status     status = hs_check_arguments(points, NULL, box, options, failure);
    if (status == HS_OK) {
        status = hs_check_systems(systems, points->n, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    if (hs_kernel_select(options->kernel) == NULL) {
        return HS_ERR_KERNEL;
    }
    if (systems->cutoffs == NULL && !(options->cutoff >= 0.0 && isfinite(options->cutoff))) {
        failure->value = options->cutoff;
        return HS_ERR_CUTOFF;
    }
    return systems->rows == NULL ? hs_box_check(systems->box, failure) : HS_OK;
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

/* What a search that was refused memory would have taken, all systems together. */
static void
tell_shortage(const hs_systems_crew *crew, const hs_call *total, hs_failure *failure)
{
    hs_shortage shortage = {0.0, 0.0};
    for (int64_t s = 0; s < crew->systems->n; s++) {
        hs_box        own_box;
        hs_points     points;
        const hs_box *box = hs_systems_take(crew, s, &points, &own_box);
        const double  cutoff = crew->systems->cutoffs != NULL ? crew->systems->cutoffs[s]
                                                              : total->options.cutoff;
        hs_shortage_add(&points, box, cutoff, &shortage);
    }
    hs_shortage_tell(&shortage, &total->options, crew->points->ndim, total->account.limit, failure);
}

/* Both public functions once all is checked. `total`: where the account and the counters
 * are kept. */
static hs_status
search_systems(hs_systems_crew *crew, hs_call *total, hs_failure *failure)
{
    const hs_options *options = &total->options;
    hs_status         status = HS_OK;
    if (crew->systems->n > 0) {
        const int n_threads = hs_call_threads(crew->points->n, options);
        const int most = crew->systems->n < n_threads ? (int)crew->systems->n : n_threads;
        total->team = hs_team_create(most);
        share_limit(&total->options, hs_team_size(total->team));
        status = run_crew(crew, total, failure);
    }
    if (status == HS_ERR_MEMORY) {
        const double found = crew->output != NULL ? (double)crew->output->n_pairs : 0.0;
        failure->expected_pairs = fmax(failure->expected_pairs, found);
        tell_shortage(crew, total, failure);
    }
    return status;
}

hs_status
hs_systems_find(const hs_points *points, const hs_systems *systems, const hs_options *options,
                hs_pairs **result, hs_failure *failure)
{
    if (!hs_can_return(result, options)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    hs_pairs *pairs = hs_pairs_begin(options, &failure);
    if (pairs == NULL) {
        return HS_ERR_MEMORY;
    }
    hs_systems_crew crew = {.points = points, .systems = systems, .output = &pairs->output};
    hs_status       status = check_shared(points, systems, options, failure);
    if (status == HS_OK) {
        hs_pairs_open(pairs, points->ndim);
        status = search_systems(&crew, &pairs->call, failure);
        status = hs_pairs_conclude(&pairs->output, status, failure);
    }
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}

hs_status
hs_systems_count(const hs_points *points, const hs_systems *systems, const hs_options *options,
                 int64_t *counts, hs_failure *failure)
{
    hs_call         total;
    hs_systems_crew crew = {.points = points, .systems = systems, .counts = counts};
    int64_t         found = 0;
    if (options == NULL || (counts == NULL && systems != NULL && systems->n > 0)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options counting = hs_options_of_count(options);
    failure = hs_call_enter(&counting, failure, &total);
    hs_status status = check_shared(points, systems, &counting, failure);
    if (status == HS_OK) {
        status = search_systems(&crew, &total, failure);
    }
    for (int64_t s = 0; status == HS_OK && s < systems->n; s++) {
        found += counts[s];
    }
    hs_call_leave(&total, found);
    hs_account_close(&total.account);
    return status;
}
