/* SPDX-License-Identifier: BSD-3-Clause */
/* systems_each.c: a worker has its own options, whose poll tells how much of all systems is done.
 */
#include "systems_each.h"

#include "systems_check.h"

#include "../base/poll.h"
#include "../collect/crew.h"
#include "../collect/result.h"
#include "../search/choice.h"

/* Points that a range of systems should have. */
#define RANGE_POINTS 512

/* What the threads share. */
typedef struct job {
    const hs_systems_each *each;
    hs_excluded_parts      excluded;
    hs_call               *total;
    int64_t                n_points;  /* that are asked for, at least 1 */
    int64_t                in_range;  /* systems of a range */
    bool                   is_direct; /* the one thread writes to the output itself */
} job;

/* What one thread works with. */
typedef struct worker {
    hs_committer   committer;
    const job     *job;
    hs_options     options; /* with this thread's poll */
    hs_counters    done;
    hs_output      backlog; /* pairs that wait for their turn; on no account: they do not stay */
    hs_output     *target;  /* this one, or that of all */
    hs_system_part part;
    double         first, share; /* of the present system, of all points */
} worker;

/* A hs_poll_fn: the fraction of all systems. */
static bool
poll_for_all(void *context, double fraction)
{
    worker *me = context;
    return hs_poll(&me->options, me->first + fraction * me->share) == HS_OK;
}

/* Adds a number to n of one column, every `step`-th from `at` on, but for -1, which is none. */
static void
add_to_column(hs_output *output, unsigned bit, int64_t at, int64_t n, int step, int64_t more)
{
    if (output->index_bytes == 4) {
        int32_t *numbers = hs_output_column(output, bit);
        for (int64_t e = 0; numbers != NULL && e < n; e++) {
            numbers[at + e * step] += numbers[at + e * step] >= 0 ? (int32_t)more : 0;
        }
    } else {
        int64_t *numbers = hs_output_column(output, bit);
        for (int64_t e = 0; numbers != NULL && e < n; e++) {
            numbers[at + e * step] += numbers[at + e * step] >= 0 ? more : 0;
        }
    }
}

/* Writes what a system has, numbered among all, behind what is there. */
static hs_status
append(worker *me, const hs_pairs *pairs)
{
    hs_output    *target = me->target;
    const int64_t n = pairs->output.n_pairs, at = target->n_pairs, end = at + n;
    const int64_t i = me->part.first_asking, j = me->part.first_point;
    if (hs_output_reserve(target, n, me->job->is_direct ? me->first + me->share : 0.0) != HS_OK) {
        me->committer.failure.expected_pairs = (double)end;
        return HS_ERR_MEMORY;
    }
    hs_output_copy(target, at, &pairs->output, 0, n);
    target->n_pairs = end;
    add_to_column(target, HS_WANT_I, at, n, 1, i);
    add_to_column(target, HS_WANT_J, at, n, 1, j);
    add_to_column(target, HS_WANT_BOTH, 2 * at, n, 2, i);
    add_to_column(target, HS_WANT_BOTH, 2 * at + 1, n, 2, j);
    return HS_OK;
}

/* Whether the row of a failure is that of a point, and not of the box. */
static bool
is_of_point(hs_status status, const hs_failure *failure)
{
    return failure->row >= 0 && status != HS_ERR_BOX_FINITE && status != HS_ERR_BOX_DEPENDENT;
}

static void
note(worker *me, const hs_counters *of_system)
{
    hs_counters *done = &me->done;
    done->pairs += of_system->pairs;
    done->groups += of_system->groups;
    done->candidates += of_system->candidates;
    done->ambiguous += of_system->ambiguous;
    done->by_float64 += of_system->by_float64;
    done->by_double_word += of_system->by_double_word;
    done->by_integers += of_system->by_integers;
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        const int64_t bytes = of_system->bytes[p];
        done->bytes[p] = bytes > done->bytes[p] ? bytes : done->bytes[p];
    }
    done->bytes_peak = of_system->bytes_peak > done->bytes_peak ? of_system->bytes_peak
                                                                : done->bytes_peak;
}

static hs_status
search_system(worker *me, int64_t s)
{
    const job             *shared = me->job;
    const hs_systems_each *each = shared->each;
    const hs_systems      *systems = each->sets.systems;
    const hs_system_part  *part = &me->part;
    hs_failure            *failure = &me->committer.failure;
    hs_pairs              *pairs = NULL;
    hs_counters            counters = {.pairs = 0};
    hs_options             options = me->options;
    hs_system_part_cut(&each->sets, &shared->excluded, s, &me->part);
    me->first = (double)part->first_asking / (double)shared->n_points;
    me->share = (double)part->n_asking / (double)shared->n_points;
    options.cutoff = hs_cutoff_of_system(systems, s, options.cutoff);
    options.counters = &counters;
    options.poll = options.poll != NULL ? poll_for_all : NULL;
    options.poll_context = me;
    hs_status status = each->search(each->context, part, &options, &pairs, failure);
    note(me, &counters);
    if (status != HS_OK && is_of_point(status, failure)) {
        failure->row += failure->in_queries ? part->first_asking : part->first_point;
    }
    if (status == HS_OK && pairs != NULL) {
        status = append(me, pairs);
    }
    hs_pairs_free(pairs);
    if (status != HS_OK) {
        failure->system = s;
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    worker       *me = context;
    const job    *shared = me->job;
    const int64_t n_systems = shared->each->sets.systems->n;
    const int64_t first = range * shared->in_range, left = n_systems - first;
    const int64_t end = first + (left < shared->in_range ? left : shared->in_range);
    hs_status     status = HS_OK;
    for (int64_t s = first; s < end && status == HS_OK; s++) {
        status = search_system(me, s);
    }
    if (status == HS_OK) {
        status = hs_poll(&me->options, me->first + me->share);
    }
    if (status != HS_OK || shared->each->output == NULL) {
        return status;
    }
    /* Of nothing, where pairs are written directly: then it only says how far this has come. */
    return hs_commit(&me->committer, me->first + me->share, true);
}

/* Cannot fail: memory is taken as it is needed. */
static hs_status
open_worker(void *context, void *place)
{
    const job *shared = context;
    hs_output *output = shared->each->output;
    worker    *me = place;
    me->job = shared;
    me->options = shared->total->options;
    me->committer.options = &me->options;
    if (output != NULL) {
        hs_output_init(NULL, output->ndim, output->columns, output->index_bytes, &me->backlog);
        me->committer.pairs = &me->backlog;
        me->target = shared->is_direct ? output : &me->backlog;
    }
    return HS_OK;
}

/* Adds what the worker did to the call, and frees what it has. */
static void
close_worker(void *context, void *place)
{
    hs_call *total = ((job *)context)->total;
    worker  *me = place;
    hs_output_free(&me->backlog);
    hs_call_note(total, &me->done);
    total->done.pairs += me->done.pairs;
    for (int p = 0; p < HS_PURPOSE_END; p++) {
        total->account.total.bytes[p] += me->done.bytes[p];
    }
    total->account.total.bytes_peak += me->done.bytes_peak;
}

/* Once all is checked. */
static hs_status
search_all(job *shared, hs_failure *failure)
{
    hs_call               *total = shared->total;
    const hs_systems_each *each = shared->each;
    const int64_t          n_systems = each->sets.systems->n;
    const int              n_threads =
        hs_call_threads((double)(each->sets.points->n + shared->n_points), &total->options);
    total->team = hs_team_create(n_systems < n_threads ? (int)n_systems : n_threads);
    hs_share_limit(&total->options, hs_team_size(total->team));
    total->options.threads = 1;
    total->options.out = NULL;
    shared->is_direct = hs_team_size(total->team) == 1 && each->output != NULL &&
                        !each->output->fixed;
    const int64_t in_range = RANGE_POINTS * n_systems / (shared->n_points + 1);
    shared->in_range = in_range > 1 ? in_range : 1;
    hs_crew crew = {.call = total,
                    .job = shared,
                    .worker_size = sizeof(worker),
                    .open = open_worker,
                    .close = close_worker,
                    .n_ranges = (n_systems + shared->in_range - 1) / shared->in_range,
                    .search = search_range,
                    .output = each->output};
    return hs_crew_run(&crew, failure);
}

hs_status
hs_systems_do_each(const hs_systems_each *each, hs_call *total, hs_failure *failure)
{
    const hs_system_sets *sets = &each->sets;
    job                   shared = {.each = each, .total = total};
    hs_status             status = hs_systems_check(sets, total, failure);
    if (status == HS_OK && each->has_limit) {
        status = hs_systems_check_limit(sets, true, &total->options, failure);
    }
    if (status == HS_OK && sets->systems->selection != NULL) {
        const hs_sets all = {.points = sets->points, .queries = sets->queries};
        status = hs_selection_check(sets->systems->selection, &all, &total->options, failure);
    }
    if (status != HS_OK) {
        return status;
    }
    shared.n_points = sets->queries != NULL ? sets->queries->n : sets->points->n;
    shared.n_points += shared.n_points == 0;
    status = hs_excluded_parts_open(sets, &total->account, &shared.excluded);
    if (status == HS_OK && sets->systems->n > 0) {
        status = search_all(&shared, failure);
    }
    hs_excluded_parts_free(&total->account, &shared.excluded);
    hs_call_tell_limit(total, status, failure);
    return status;
}
