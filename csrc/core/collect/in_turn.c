/* SPDX-License-Identifier: BSD-3-Clause */
/* in_turn.c: a mutex guards the number of the range that is due; pairs are copied without it. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "in_turn.h"

#include "../base/outcome.h"
#include "../base/poll.h"
#include "../base/os_thread.h"

#include <string.h>

struct hs_commits {
    hs_output       *output;
    hs_thread_id     caller;
    int64_t          n_ranges;
    volatile int64_t next_range; /* atomic */
    hs_mutex         mutex;      /* guards all below, and the output but for what columns hold */
    hs_condition     changed;    /* due, n_copying or status */
    int64_t          due;        /* the range whose pairs are next in the output */
    double           done;       /* of the whole search, in order: it never falls */
    int              n_copying;  /* threads that write to columns: these must not move then */
    int              n_working;  /* threads that may still have a range */
    hs_status        status;
    hs_failure       failure;
    int64_t          failed_range;
    int64_t          enough, most; /* in pairs: limits set by hs_commits_limit */
    bool             has_enough;
    int64_t          full_range; /* the last one that is written, n_ranges at first */
};

hs_commits *
hs_commits_new(hs_account *account, hs_output *output, int64_t n_ranges)
{
    hs_commits *commits = hs_alloc(account, HS_FOR_CANDIDATES, 1, sizeof *commits);
    if (commits != NULL) {
        *commits = (hs_commits){.output = output,
                                .n_ranges = n_ranges,
                                .enough = INT64_MAX,
                                .most = INT64_MAX,
                                .full_range = n_ranges};
        commits->caller = hs_thread_self();
        hs_mutex_init(&commits->mutex);
        hs_condition_init(&commits->changed);
    }
    return commits;
}

void
hs_commits_limit(hs_commits *commits, int64_t enough, int64_t most)
{
    commits->enough = enough;
    commits->most = most;
}

int64_t
hs_commits_written(const hs_commits *commits)
{
    return commits->due;
}

hs_status
hs_commits_end(hs_account *account, hs_commits *commits, hs_failure *failure)
{
    const hs_status status = commits->status;
    if (status != HS_OK) {
        *failure = commits->failure;
    }
    hs_condition_destroy(&commits->changed);
    hs_mutex_destroy(&commits->mutex);
    hs_free(account, commits);
    return status;
}

/* A hs_poll_fn of the threads that may not call the caller's: true until a thread has failed. */
static bool
goes_on(void *context, double fraction)
{
    hs_commits *commits = context;
    (void)fraction;
    hs_mutex_lock(&commits->mutex);
    const bool result = commits->status == HS_OK;
    hs_mutex_unlock(&commits->mutex);
    return result;
}

/* A hs_poll_fn of the caller's thread. What it has done counts once all earlier ranges are written:
 * it may be far ahead of the others, and what is found beyond a full output is given up. */
static bool
ask_caller(void *context, double fraction)
{
    hs_committer *committer = context;
    hs_commits   *commits = committer->commits;
    hs_mutex_lock(&commits->mutex);
    if (commits->output == NULL || committer->range == commits->due) {
        commits->done = hs_larger(commits->done, fraction);
    }
    const double done = commits->done;
    hs_mutex_unlock(&commits->mutex);
    return committer->poll(committer->poll_context, done);
}

void
hs_commits_join(hs_commits *commits, hs_committer *committer)
{
    hs_options *options = committer->options;
    committer->failure = HS_NO_FAILURE;
    committer->commits = commits;
    committer->poll = options->poll;
    committer->poll_context = options->poll_context;
    committer->range = -1;
    committer->most_bytes = commits->enough < INT64_MAX ? HS_COMMIT_BYTES_OF_BLOCKS
                                                        : HS_COMMIT_BYTES;
    hs_mutex_lock(&commits->mutex);
    commits->n_working++;
    hs_mutex_unlock(&commits->mutex);
    if (!hs_thread_is(commits->caller)) {
        options->poll = goes_on;
        options->poll_context = commits;
    } else if (options->poll != NULL) {
        options->poll = ask_caller;
        options->poll_context = committer;
    }
}

/* Takes the next range; false when there is none, when a thread has failed, or when there are
 * enough pairs. */
static bool
take_range(hs_committer *committer)
{
    hs_commits *commits = committer->commits;
    hs_mutex_lock(&commits->mutex);
    const bool more = commits->status == HS_OK && !commits->has_enough;
    hs_mutex_unlock(&commits->mutex);
    if (!more) {
        return false;
    }
    committer->range = hs_fetch_increment(&commits->next_range);
    return committer->range < commits->n_ranges;
}

/* This range has failed: all threads stop. A status that only follows from another failure is not
 * noted. */
static void
fail(hs_committer *committer, hs_status status)
{
    hs_commits *commits = committer->commits;
    const bool  stopped = status == HS_STOPPED ||
                         (status == HS_ERR_INTERRUPTED && committer->options->poll == goes_on);
    hs_mutex_lock(&commits->mutex);
    if (!stopped && (commits->status == HS_OK || committer->range < commits->failed_range)) {
        commits->status = status;
        commits->failure = committer->failure;
        commits->failed_range = committer->range;
    }
    hs_condition_wake(&commits->changed);
    hs_mutex_unlock(&commits->mutex);
}

/* With the mutex held: waits for a change. The caller's thread goes on polling meanwhile. */
static hs_status
wait_for_change(hs_commits *commits, const hs_committer *committer, double fraction)
{
    if (committer->options->poll == goes_on) {
        hs_condition_wait(&commits->changed, &commits->mutex);
        return HS_OK;
    }
    hs_condition_wait_briefly(&commits->changed, &commits->mutex);
    hs_mutex_unlock(&commits->mutex);
    const hs_status status = hs_poll(committer->options, fraction);
    hs_mutex_lock(&commits->mutex);
    return status;
}

/* With the mutex held: settles where in the output the n pairs that are due go. */
static hs_status
claim(hs_commits *commits, int64_t n, double fraction, int64_t *at)
{
    hs_output *output = commits->output;
    if (!hs_output_has_room(output, n)) {
        while (commits->n_copying > 0) { /* soon over */
            hs_condition_wait(&commits->changed, &commits->mutex);
        }
        /* An output with a limit does not grow with the work that is left. */
        const bool      is_limited = commits->enough < INT64_MAX;
        const hs_status status = hs_output_reserve(output, n, is_limited ? 0.0 : fraction);
        if (status != HS_OK) {
            return status;
        }
    }
    *at = output->n_pairs;
    output->n_pairs += n;
    hs_output_touch(output, *at, n);
    return HS_OK;
}

/* With the mutex held: notes whether the output has `enough` or `most` pairs. */
static void
heed_limits(hs_committer *committer, const hs_commit_part *part)
{
    hs_commits   *commits = committer->commits;
    const int64_t n = commits->output->n_pairs;
    commits->has_enough = commits->has_enough || n >= commits->enough;
    if (n >= commits->most && commits->full_range == commits->n_ranges) {
        commits->full_range = part->range;
        committer->is_full = !part->is_last;
        hs_condition_wake(&commits->changed);
    }
}

/* Writes the part that is due. The mutex is held, but not while it copies. */
static hs_status
write_part(hs_committer *committer, const hs_commit_part *part)
{
    hs_commits     *commits = committer->commits;
    int64_t         at = 0;
    const hs_status status = claim(commits, part->end - committer->written, part->fraction, &at);
    if (status != HS_OK) {
        return status;
    }
    heed_limits(committer, part);
    commits->done = hs_larger(commits->done, part->fraction);
    commits->n_copying++;
    if (part->is_last) {
        commits->due++;
        hs_condition_wake(&commits->changed);
    }
    hs_mutex_unlock(&commits->mutex);
    hs_output_copy(commits->output, at, committer->pairs, committer->written, part->end);
    committer->written = part->end;
    hs_mutex_lock(&commits->mutex);
    if (--commits->n_copying == 0) {
        hs_condition_wake(&commits->changed);
    }
    return HS_OK;
}

/* Writes parts as long as they are due; with `waits`, all of them. */
static hs_status
write_parts(hs_committer *committer, bool waits)
{
    hs_commits *commits = committer->commits;
    hs_status   status = HS_OK;
    int         done = 0;
    hs_mutex_lock(&commits->mutex);
    while (done < committer->n_parts && status == HS_OK) {
        const hs_commit_part *part = &committer->parts[done];
        if (commits->status != HS_OK || part->range > commits->full_range) {
            status = HS_STOPPED; /* another thread has failed, or has filled the output */
        } else if (commits->due == part->range) {
            status = write_part(committer, part);
            done++;
        } else if (waits) {
            status = wait_for_change(commits, committer, part->fraction);
        } else {
            break;
        }
    }
    hs_mutex_unlock(&commits->mutex);
    committer->n_parts -= done;
    memmove(committer->parts, committer->parts + done,
            (size_t)committer->n_parts * sizeof committer->parts[0]);
    if (committer->n_parts == 0) {
        committer->pairs->n_pairs = committer->written = 0;
    }
    return status;
}

hs_status
hs_commit(hs_committer *committer, double fraction, bool ends)
{
    const hs_output *pairs = committer->pairs;
    const int64_t    bytes = pairs->n_pairs * hs_output_bytes_per_pair(pairs);
    committer->parts[committer->n_parts++] = (hs_commit_part){
        .range = committer->range, .end = pairs->n_pairs, .fraction = fraction, .is_last = ends};
    return write_parts(committer, !ends || committer->n_parts == HS_COMMIT_PARTS ||
                                      bytes >= committer->most_bytes);
}

/* There is no range left for this thread. The caller's thread goes on polling for the others. */
static hs_status
leave(hs_committer *committer)
{
    hs_commits *commits = committer->commits;
    const bool  waits = committer->options->poll != goes_on;
    hs_status   status = HS_OK;
    hs_mutex_lock(&commits->mutex);
    commits->n_working--;
    hs_condition_wake(&commits->changed);
    while (waits && status == HS_OK && commits->status == HS_OK && commits->n_working > 0) {
        const double left = (double)commits->n_working / (double)commits->n_ranges;
        status = wait_for_change(commits, committer, hs_larger(1.0 - left, 0.0));
    }
    hs_mutex_unlock(&commits->mutex);
    return status;
}

void
hs_commits_work(hs_committer *committer, hs_range_fn search_range, void *worker)
{
    hs_status status = HS_OK;
    while (status == HS_OK && take_range(committer)) {
        status = search_range(worker, committer->range);
    }
    if (status == HS_OK && committer->n_parts > 0) {
        status = write_parts(committer, true);
    }
    if (status != HS_OK) {
        fail(committer, status);
    }
    status = leave(committer);
    if (status != HS_OK) {
        fail(committer, status);
    }
}
