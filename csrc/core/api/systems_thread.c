/* SPDX-License-Identifier: BSD-3-Clause */
/* systems_thread.c: takes a range of systems, searches one after the other, commits their pairs in
 * turn. */
#include "systems_thread.h"

#include "../search/estimate.h"
#include "../base/poll.h"
#include "../collect/sort_pairs.h"
#include "../search/search_build.h"

#include <string.h>

/* Candidates between two polls, and as how many the rest of a system counts. */
#define POLL_WORK   (INT64_C(1) << 21)
#define SYSTEM_WORK 1024

const hs_box *
hs_systems_take(const hs_systems_crew *crew, int64_t s, hs_points *points, hs_box *own_box)
{
    const hs_systems *systems = crew->systems;
    const int64_t     first = systems->first[s];
    const int         d = crew->points->ndim;
    *points = *crew->points;
    points->n = systems->first[s + 1] - first;
    if (points->n > 0) { /* without points there is no first row */
        points->data = (const char *)points->data + first * points->row_stride;
    }
    if (systems->box == NULL || systems->rows == NULL) {
        return systems->box;
    }
    for (int l = 0; l < d; l++) {
        own_box->periodic[l] = systems->box->periodic[l];
        memcpy(own_box->rows[l], systems->rows + (s * d + l) * d, (size_t)d * sizeof(double));
    }
    own_box->ndim = d;
    return own_box;
}

/* Makes the scene of system s ready; its points keep their numbers among the points of all
 * systems. */
static hs_status
build_system(hs_systems_worker *worker, int64_t s)
{
    const hs_systems_crew *crew = worker->crew;
    const hs_systems      *systems = crew->systems;
    const int64_t          first = systems->first[s];
    hs_points              points;
    const hs_box          *box = hs_systems_take(crew, s, &points, &worker->box);
    if (systems->cutoffs != NULL) {
        worker->call.options.cutoff = systems->cutoffs[s];
    }
    const hs_status status =
        hs_search_build(&(hs_sets){.points = &points}, box, &worker->search, &worker->failure);
    if (status == HS_OK) {
        hs_search_renumber(first, crew->points->n, &worker->search);
    } else if (status == HS_ERR_NOT_FINITE || status == HS_ERR_SHIFT_RANGE ||
               status == HS_ERR_ROUNDING) {
        worker->failure.row += first;
    }
    return status;
}

/* What a walker did, before it is closed. */
static void
note_walk(hs_systems_worker *worker, const hs_walker *walker, hs_status status)
{
    worker->work += walker->scanner.n_candidates;
    if (status == HS_ERR_SHIFT_RANGE) {
        worker->failure.row = walker->scanner.failed_point;
    }
}

static hs_status
count_system(hs_systems_worker *worker, int64_t s)
{
    hs_search *search = &worker->search;
    hs_walker  walker;
    hs_status  status = hs_walker_init(search, HS_BLOCK_COUNTS, NULL, NULL, &walker);
    if (status == HS_OK) {
        status = hs_walk(&walker, 0, (int32_t)search->bins.n);
        worker->crew->counts[s] = walker.scanner.n_found;
        note_walk(worker, &walker, status);
        hs_walker_close(search, &walker);
    }
    return status;
}

/* Records all pairs of the present system, unsorted; `visit` takes the backlog or its recorder. */
static hs_status
record_system(hs_systems_worker *worker, hs_output *output, hs_visit_fn visit, void *context)
{
    hs_search   *search = &worker->search;
    hs_recorder *recorder = &worker->backlog.recorder;
    hs_walker    walker;
    hs_status    status =
        hs_walker_init(search, hs_record_use(output->columns), visit, context, &walker);
    if (status != HS_OK) {
        return status;
    }
    status =
        hs_recorder_init(&search->call->account, output, walker.scanner.block.most_hits, recorder);
    if (status == HS_OK) {
        status = hs_walk(&walker, 0, (int32_t)search->bins.n);
    }
    note_walk(worker, &walker, status);
    hs_recorder_free(&search->call->account, recorder);
    hs_walker_close(search, &walker);
    return status;
}

/* Writes the pairs of the present system in ascending order. */
static hs_status
sort_system(hs_systems_worker *worker)
{
    hs_search     *search = &worker->search;
    hs_output     *found = &worker->found;
    const unsigned columns = hs_sort_columns(search);
    if (found->columns != columns) { /* systems with images need more of them */
        hs_output_free(found);
        hs_output_init(&search->call->account, search->scene.ndim, columns, 4, found);
    }
    found->n_pairs = 0;
    hs_status status = record_system(worker, found, hs_record_hits, &worker->backlog.recorder);
    if (status == HS_OK) {
        status = hs_sort_pairs(search->call, search->first_point, search->scene.n, found,
                               worker->target);
    }
    if (status == HS_ERR_MEMORY) {
        worker->failure.expected_pairs = (double)found->n_pairs;
    }
    return status;
}

static hs_status
find_system(hs_systems_worker *worker)
{
    hs_status status = hs_estimate_by_sample(&worker->search, &worker->failure);
    if (status != HS_OK) {
        return status;
    }
    if (worker->call.options.sorted) {
        return sort_system(worker);
    }
    return worker->crew->is_direct
               ? record_system(worker, worker->target, hs_record_hits, &worker->backlog.recorder)
               : record_system(worker, worker->target, hs_backlog_hits, &worker->backlog);
}

static hs_status
search_system(hs_systems_worker *worker, int64_t s)
{
    hs_search *search = &worker->search;
    hs_status  status = build_system(worker, s);
    if (status == HS_OK) {
        status = worker->crew->output == NULL ? count_system(worker, s) : find_system(worker);
    }
    hs_search_close(search);
    hs_account_reset(&search->call->account);
    if (status != HS_OK) {
        worker->failure.system = s;
        return status;
    }
    worker->work += SYSTEM_WORK;
    if (worker->work > POLL_WORK) {
        const hs_systems_crew *crew = worker->crew;
        worker->work = 0;
        status = hs_poll(&search->call->options,
                         (double)crew->systems->first[s + 1] / (double)crew->points->n);
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    hs_systems_worker     *worker = context;
    const hs_systems_crew *crew = worker->crew;
    const int64_t          first = range * crew->in_range, left = crew->systems->n - first;
    const int64_t          end = first + (left < crew->in_range ? left : crew->in_range);
    hs_status              status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = search_system(worker, s);
    }
    if (status != HS_OK || crew->output == NULL) {
        return status;
    }
    const double done = (double)crew->systems->first[end] / (double)crew->points->n;
    if (crew->is_direct && first == 0 && done > 0.0) {
        /* most batches have systems of similar size */
        hs_output_expect(crew->output, (double)crew->output->n_pairs / done);
    }
    /* Of nothing, where pairs are written directly: then it only says how far this has come. */
    return hs_commit(&worker->committer, done, true);
}

void
hs_systems_work(void *context, int64_t task)
{
    hs_systems_crew   *crew = context;
    hs_systems_worker *worker = &crew->workers[task];
    hs_commits_join(crew->commits, &worker->call.options, &worker->backlog.pairs,
                    &worker->committer);
    hs_search_begin(&worker->call, &worker->search);
    hs_commits_work(&worker->committer, search_range, worker, &worker->failure);
}

void
hs_systems_open_worker(hs_systems_crew *crew, const hs_options *options, hs_systems_worker *worker)
{
    memset(worker, 0, sizeof *worker);
    worker->crew = crew;
    hs_call_begin(options, &worker->call);
    worker->call.options = *options; /* their poll counts already, for the whole call */
    worker->failure = HS_NO_FAILURE;
    if (crew->systems->box != NULL) {
        worker->box = *crew->systems->box;
    }
    if (crew->output != NULL) {
        hs_backlog_init(crew->output, &worker->committer, &worker->backlog);
        worker->target = crew->is_direct ? crew->output : &worker->backlog.pairs;
    }
}

void
hs_systems_close_worker(hs_systems_worker *worker, hs_call *total)
{
    hs_account *account = &worker->call.account;
    hs_backlog_free(account, &worker->backlog);
    hs_output_free(&worker->found);
    hs_call_note(total, &worker->call.done);
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        total->account.total.bytes[p] += account->total.bytes[p];
    }
    total->account.total.bytes_peak += account->total.bytes_peak;
    hs_account_close(account);
}
