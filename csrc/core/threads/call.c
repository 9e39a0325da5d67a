/* SPDX-License-Identifier: BSD-3-Clause */
/* call.c: options, memory, threads and counters of a call are in one struct, to which every step
 * adds. */
#include "call.h"

#include "../base/outcome.h"
#include "../base/want.h"

#include <string.h>

/* An hs_poll_fn: the caller's, counted. */
static bool
counted_poll(void *context, double fraction)
{
    hs_call *call = context;
    call->done.polls++;
    return call->callers_poll(call->callers_context, fraction);
}

void
hs_call_set_poll(hs_poll_fn poll, void *context, hs_call *call)
{
    call->callers_poll = poll;
    call->callers_context = context;
    call->options.poll = poll != NULL ? counted_poll : NULL;
    call->options.poll_context = call;
}

void
hs_call_begin(const hs_options *options, hs_call *call)
{
    call->options = *options;
    call->kernel = hs_kernel_select(options->kernel);
    call->team = NULL;
    call->done = (hs_counters){.pairs = 0};
    call->choice = NULL;
    hs_call_set_poll(options->poll, options->poll_context, call);
    hs_account_init(&call->account, options);
}

hs_failure *
hs_enter(hs_failure *failure, hs_entry *entry)
{
    failure = failure != NULL ? failure : &entry->ignored;
    *failure = HS_NO_FAILURE;
    entry->saved = hs_fpenv_enter();
    return failure;
}

void
hs_leave(const hs_entry *entry)
{
    hs_fpenv_leave(entry->saved);
}

hs_failure *
hs_call_enter(const hs_options *options, hs_failure *failure, hs_call *call)
{
    failure = hs_enter(failure, &call->entry);
    hs_call_begin(options, call);
    return failure;
}

void
hs_call_leave(hs_call *call, int64_t n_pairs)
{
    hs_call_dismiss(call);
    hs_call_report(call, n_pairs);
    hs_leave(&call->entry);
}

void
hs_call_tell_limit(const hs_call *call, hs_status status, hs_failure *failure)
{
    if (status == HS_ERR_MEMORY) {
        failure->limit_bytes = call->account.limit;
    }
}

/*
 * Work from which on threads are worth starting, in points that have few neighbours: half a
 * millisecond. Two threads take as long as one at 5000 points with 52 neighbours, at 1000 with 419.
 */
#ifdef HS_TESTING
static double worth_threads = 0.0;

double
hs_test_worth_threads(double n_points)
{
    const double before = worth_threads;
    worth_threads = n_points;
    return before;
}
#else
static const double worth_threads = 10000.0;
#endif
/* A pair takes as long as so much of such a point, and half as long again for 16 bytes of it. */
#define POINTS_PER_PAIR (1.0 / 45.0)
#define POINTS_PER_BYTE (POINTS_PER_PAIR / 32.0)

int
hs_call_threads(double n_points, const hs_options *options)
{
    const double least = options->threads < 0 ? (double)HS_POINTS_FOR_THREADS : worth_threads;
    const int    most = options->threads < 0 ? -options->threads : options->threads;
    return n_points < least ? 1 : most < HS_MOST_THREADS ? most : HS_MOST_THREADS;
}

void
hs_call_gather(hs_call *call, int64_t n_points)
{
    if (call->team == NULL) {
        call->team = hs_team_create(hs_call_threads((double)n_points, &call->options));
    }
}

void
hs_call_gather_for(hs_call *call, int64_t n_points, double n_pairs)
{
    const hs_options *options = &call->options;
    if (call->team == NULL && options->threads > 1) {
        const int64_t bytes = hs_want_bytes(options->want, HS_MAX_DIM / 2, options->index_bytes);
        const double  of_pair = POINTS_PER_PAIR + POINTS_PER_BYTE * (double)bytes;
        call->team = hs_team_create(hs_call_threads((double)n_points + of_pair * n_pairs, options));
    }
}

void
hs_call_dismiss(hs_call *call)
{
    hs_team_free(call->team);
    call->team = NULL;
}

void
hs_call_note(hs_call *call, const hs_counters *done)
{
    hs_counters *sum = &call->done;
    sum->groups += done->groups;
    sum->candidates += done->candidates;
    sum->ambiguous += done->ambiguous;
    sum->by_float64 += done->by_float64;
    sum->by_double_word += done->by_double_word;
    sum->by_integers += done->by_integers;
    sum->polls += done->polls;
}

void
hs_call_report(const hs_call *call, int64_t n_pairs)
{
    hs_counters *counters = call->options.counters;
    if (counters == NULL) {
        return;
    }
    *counters = call->done;
    memcpy(counters->bytes, call->account.total.bytes, sizeof counters->bytes);
    counters->bytes_peak = call->account.total.bytes_peak;
    counters->pairs = n_pairs;
}

void
hs_call_restart(hs_call *call)
{
    const hs_account before = call->account;
    hs_account_close(&call->account);
    hs_account_init(&call->account, &call->options);
    call->account.limit = before.limit;
    call->account.find_limit = before.find_limit;
    call->done = (hs_counters){.polls = call->done.polls};
}

void
hs_call_detach(hs_call *call)
{
    hs_call_set_poll(NULL, NULL, call);
    call->options.counters = NULL;
    call->options.kernel = NULL;
    call->options.out = NULL;
    call->options.shells = NULL;
}
