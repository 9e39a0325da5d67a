/* SPDX-License-Identifier: BSD-3-Clause */
/* api_systems.c: the public searches of many systems: find and count. Threads take ranges of
 * them. */
#include "../search/choice.h"
#include "../search/estimate.h"
#include "../box/lattice.h"
#include "request.h"
#include "systems_check.h"
#include "systems_thread.h"

#include <math.h>

/* What a search that was refused memory would have taken, all systems together. */
static void
tell_shortage(const hs_systems_job *job, hs_failure *failure)
{
    const hs_call *total = job->total;
    hs_shortage    shortage = {0.0, 0.0};
    for (int64_t s = 0; s < job->systems->n; s++) {
        hs_box          own_box;
        const hs_points points = hs_points_of_system(job->points, job->systems->first, s);
        const hs_box   *box = hs_box_of_system(job->systems, points.ndim, s, &own_box);
        const double    cutoff = hs_cutoff_of_system(job->systems, s, total->options.cutoff);
        hs_shortage_add(&points, box, cutoff, &shortage);
    }
    hs_shortage_tell(&shortage, &total->options, job->points->ndim, total->account.limit, failure);
}

static hs_status
check_arguments(const hs_systems_job *job, hs_failure *failure)
{
    const hs_system_sets sets = {.points = job->points, .systems = job->systems};
    const hs_status      status = hs_systems_check(&sets, job->total, failure);
    return status == HS_OK ? hs_systems_check_limit(&sets, false, &job->total->options, failure)
                           : status;
}

/* Which pairs count. Boxes are looked at with their systems. */
static hs_status
open_choice(const hs_systems_job *job, hs_failure *failure)
{
    const hs_sets sets = {.points = job->points};
    hs_status     status = hs_choice_open(job->systems->selection, &sets, job->total, failure);
    if (status == HS_OK && job->total->choice != NULL && job->systems->box != NULL &&
        hs_choice_excludes(job->total->choice)) {
        status = hs_choice_keep_points(&sets, job->total, failure);
    }
    return status;
}

/* Both public functions once all is checked. */
static hs_status
search_systems(hs_systems_job *job, hs_failure *failure)
{
    hs_call          *total = job->total;
    const hs_options *options = &total->options;
    hs_status         status = open_choice(job, failure);
    if (status == HS_OK && job->systems->n > 0) {
        const int n_threads = hs_call_threads((double)job->points->n, options);
        const int most = job->systems->n < n_threads ? (int)job->systems->n : n_threads;
        total->team = hs_team_create(most);
        hs_share_limit(&total->options, hs_team_size(total->team));
        status = hs_systems_search(job, failure);
    }
    hs_choice_close(total);
    if (status == HS_ERR_MEMORY) {
        const double found = job->output != NULL ? (double)job->output->n_pairs : 0.0;
        failure->expected_pairs = fmax(failure->expected_pairs, found);
        if (job->systems->reach == NULL) {
            tell_shortage(job, failure);
        } else {
            hs_call_tell_limit(total, status, failure);
        }
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
    hs_systems_job job = {
        .points = points, .systems = systems, .total = &pairs->call, .output = &pairs->output};
    hs_status status = check_arguments(&job, failure);
    if (status == HS_OK) {
        hs_pairs_open(pairs, points->ndim);
        status = search_systems(&job, failure);
        status = hs_pairs_conclude(&pairs->output, status, failure);
    }
    return hs_pairs_finish(pairs, status, pairs->output.n_pairs, result);
}

hs_status
hs_systems_count(const hs_points *points, const hs_systems *systems, const hs_options *options,
                 int64_t *counts, hs_failure *failure)
{
    hs_call        total;
    hs_systems_job job = {.points = points, .systems = systems, .total = &total, .counts = counts};
    int64_t        found = 0;
    if (options == NULL || (counts == NULL && systems != NULL && systems->n > 0)) {
        return hs_end_early(HS_ERR_ARGUMENT, options, failure);
    }
    const hs_options counting = hs_options_of_count(options);
    failure = hs_call_enter(&counting, failure, &total);
    hs_status status = check_arguments(&job, failure);
    if (status == HS_OK) {
        status = search_systems(&job, failure);
    }
    for (int64_t s = 0; status == HS_OK && s < systems->n; s++) {
        found += counts[s];
    }
    hs_call_leave(&total, found);
    hs_account_close(&total.account);
    return status;
}
