/* SPDX-License-Identifier: BSD-3-Clause */
/* commits.c: see commits.h. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for thread_shim.h */
#endif
#include "commits.h"

#include "poll.h"
#include "thread_shim.h"

#include <string.h>

/* Bytes that a thread holds back at most: a share of the second-level cache. */
#define MOST_BYTES (256 * 1024)

struct hs_commits {
    hs_output       *output;
    hs_thread_id     caller;
    int64_t          n_ranges;
    volatile int64_t next_range; /* atomic */
    hs_mutex         mutex;      /* guards all below, and the output but for what columns hold */
    hs_condition     changed;    /* turn, n_copying or status */
    int64_t          turn;       /* the range whose pairs are next in the output */
    int              n_copying;  /* threads that write to columns: these must not move then */
    hs_status        status;
    hs_failure       failure;
    int64_t          failed_range;
};

hs_commits *
hs_commits_new(hs_account *account, hs_output *output, int64_t n_ranges)
{
    hs_commits *turns = hs_alloc(account, HS_FOR_CANDIDATES, 1, sizeof *turns);
    if (turns != NULL) {
        *turns = (hs_commits){.output = output, .n_ranges = n_ranges};
        turns->caller = hs_thread_self();
        hs_mutex_init(&turns->mutex);
        hs_condition_init(&turns->changed);
    }
    return turns;
}

hs_status
hs_commits_end(hs_account *account, hs_commits *turns, hs_failure *failure)
{
    const hs_status status = turns->status;
    if (status != HS_OK) {
        *failure = turns->failure;
    }
    hs_condition_destroy(&turns->changed);
    hs_mutex_destroy(&turns->mutex);
    hs_free(account, turns);
    return status;
}

/* A hs_poll_fn of the threads that may not ask the caller: has nobody failed? */
static bool
goes_on(void *context, double fraction)
{
    hs_commits *turns = context;
    (void)fraction;
    hs_mutex_lock(&turns->mutex);
    const bool result = turns->status == HS_OK;
    hs_mutex_unlock(&turns->mutex);
    return result;
}

void
hs_turn_join(hs_commits *turns, hs_options *options, hs_output *stage, hs_turn *turn)
{
    *turn = (hs_turn){.turns = turns, .options = options, .stage = stage};
    if (!hs_thread_is(turns->caller)) {
        options->poll = goes_on;
        options->poll_context = turns;
    }
}

bool
hs_turn_next(hs_turn *turn)
{
    hs_commits *turns = turn->turns;
    if (!goes_on(turns, 0.0)) {
        return false;
    }
    turn->range = hs_fetch_increment(&turns->next_range);
    return turn->range < turns->n_ranges;
}

void
hs_turn_fail(hs_turn *turn, hs_status status, const hs_failure *failure)
{
    hs_commits  *turns = turn->turns;
    const bool stopped = status == HS_STATUS_END ||
                         (status == HS_ERR_INTERRUPTED && turn->options->poll == goes_on);
    hs_mutex_lock(&turns->mutex);
    if (!stopped && (turns->status == HS_OK || turn->range < turns->failed_range)) {
        turns->status = status;
        turns->failure = *failure;
        turns->failed_range = turn->range;
    }
    hs_condition_wake(&turns->changed);
    hs_mutex_unlock(&turns->mutex);
}

/* With the mutex held: waits for a change. The caller's thread goes on polling meanwhile. */
static hs_status
wait_for_change(hs_commits *turns, const hs_turn *turn, double fraction)
{
    if (turn->options->poll == goes_on) {
        hs_condition_wait(&turns->changed, &turns->mutex);
        return HS_OK;
    }
    hs_condition_wait_briefly(&turns->changed, &turns->mutex);
    hs_mutex_unlock(&turns->mutex);
    const hs_status status = hs_poll(turn->options, fraction);
    hs_mutex_lock(&turns->mutex);
    return status;
}

/* With the mutex held: settles where the n pairs go whose turn it is. */
static hs_status
claim(hs_commits *turns, int64_t n, double fraction, int64_t *at)
{
    hs_output *output = turns->output;
    if (!hs_output_has_room(output, n)) {
        while (turns->n_copying > 0) { /* soon over */
            hs_condition_wait(&turns->changed, &turns->mutex);
        }
        const hs_status status = hs_output_reserve(output, n, fraction);
        if (status != HS_OK) {
            return status;
        }
    }
    *at = output->n_pairs;
    output->n_pairs += n;
    return HS_OK;
}

/* With the mutex held, which it gives up while it copies: the part whose turn it is. */
static hs_status
write_part(hs_turn *turn, const hs_turn_part *part)
{
    hs_commits       *turns = turn->turns;
    int64_t         at = 0;
    const hs_status status = claim(turns, part->end - turn->written, part->fraction, &at);
    if (status != HS_OK) {
        return status;
    }
    turns->n_copying++;
    if (part->is_last) {
        turns->turn++;
        hs_condition_wake(&turns->changed);
    }
    hs_mutex_unlock(&turns->mutex);
    hs_output_copy(turns->output, at, turn->stage, turn->written, part->end);
    turn->written = part->end;
    hs_mutex_lock(&turns->mutex);
    if (--turns->n_copying == 0) {
        hs_condition_wake(&turns->changed);
    }
    return HS_OK;
}

/* Writes parts as long as it is their turn; with `waits`, all of them. */
static hs_status
write_parts(hs_turn *turn, bool waits)
{
    hs_commits *turns = turn->turns;
    hs_status status = HS_OK;
    int       done = 0;
    hs_mutex_lock(&turns->mutex);
    while (done < turn->n_parts && status == HS_OK) {
        const hs_turn_part *part = &turn->parts[done];
        if (turns->status != HS_OK) {
            status = HS_STATUS_END; /* somebody else has failed */
        } else if (turns->turn == part->range) {
            status = write_part(turn, part);
            done++;
        } else if (waits) {
            status = wait_for_change(turns, turn, part->fraction);
        } else {
            break;
        }
    }
    hs_mutex_unlock(&turns->mutex);
    turn->n_parts -= done;
    memmove(turn->parts, turn->parts + done, (size_t)turn->n_parts * sizeof *turn->parts);
    if (turn->n_parts == 0) {
        turn->stage->n_pairs = turn->written = 0;
    }
    return status;
}

hs_status
hs_turn_commit(hs_turn *turn, double fraction, bool ends)
{
    const hs_output *stage = turn->stage;
    const int64_t    bytes = stage->n_pairs * hs_output_bytes_per_pair(stage);
    turn->parts[turn->n_parts++] = (hs_turn_part){.range = turn->range,
                                                  .end = stage->n_pairs,
                                                  .fraction = fraction,
                                                  .is_last = ends};
    return write_parts(turn, !ends || turn->n_parts == HS_TURN_PARTS || bytes >= MOST_BYTES);
}

hs_status
hs_turn_finish(hs_turn *turn)
{
    return turn->n_parts > 0 ? write_parts(turn, true) : HS_OK;
}
