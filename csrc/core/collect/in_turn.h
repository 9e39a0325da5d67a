/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * in_turn.h: several threads that fill one output in a fixed order. The work is cut into numbered
 * ranges, which are handed out one at a time; what is found in one is written when all earlier
 * ranges have been, so that the result does not depend on the number of threads.
 *
 * Usage, in each thread of a crew (crew.h), with the committer's options and pairs set:
 *     hs_commits_join(commits, &committer);
 *     hs_commits_work(&committer, search_range, worker);
 * where search_range collects pairs and calls hs_commit, for the last time at its end.
 */
#ifndef HS_IN_TURN_H
#define HS_IN_TURN_H

#include "columns.h"

typedef struct hs_commits hs_commits;

/* What a thread may hold back at a time: so many parts, and about so many bytes, a second-level
 * cache of them: threads that sleep cost more than pairs that come from the third. */
#define HS_COMMIT_PARTS 32
#define HS_COMMIT_BYTES (1024 * 1024)
/* As many where the output is to have few pairs at a time: what is held back is memory besides. */
#define HS_COMMIT_BYTES_OF_BLOCKS (256 * 1024)
/* A range should have no more: a thread whose range is not due yet can go on with others. */
#define HS_RANGE_BYTES (HS_COMMIT_BYTES / 8)

/* Pairs of one range that are ready: of those collected, the ones before `end` that are in no
 * earlier part. */
typedef struct hs_commit_part {
    int64_t range;
    int64_t end;
    double  fraction; /* of the whole search that is done with it */
    bool    is_last;  /* of its range */
} hs_commit_part;

/* What one thread needs to take ranges and commit their pairs. */
typedef struct hs_committer {
    hs_options    *options;    /* borrowed; its poll tells whether to go on */
    hs_output     *pairs;      /* borrowed: where the thread collects them; NULL when counting */
    hs_failure     failure;    /* of its range that fails */
    hs_commits    *commits;    /* borrowed */
    int64_t        most_bytes; /* held back: one of the two above */
    hs_poll_fn     poll;       /* as it was before; for the caller's thread */
    void          *poll_context;
    int64_t        range;   /* that the thread is working on */
    int64_t        written; /* of the pairs, those that are in the output already */
    bool           is_full; /* the output has most pairs, and the range goes on: leave it */
    int            n_parts;
    hs_commit_part parts[HS_COMMIT_PARTS]; /* that wait until earlier ranges are written */
} hs_committer;

/* Does the work of one range. */
typedef hs_status (*hs_range_fn)(void *worker, int64_t range);

/* output: borrowed; NULL when nothing is written. The thread that calls this is the only one that
 * may poll. NULL when memory is short. */
hs_commits *hs_commits_new(hs_account *account, hs_output *output, int64_t n_ranges);

/* Before any thread joins: from `enough` pairs in the output on no range is begun, and from `most`
 * on none is ended but the one that is due, which is to be left (hs_committer.is_full). */
void hs_commits_limit(hs_commits *commits, int64_t enough, int64_t most);

/* After all threads are done: how many ranges have been written to their end, the first ones. */
int64_t hs_commits_written(const hs_commits *commits);

/* After all threads are done: HS_OK, or the failure of the earliest range that had one. Frees. */
hs_status hs_commits_end(hs_account *account, hs_commits *commits, hs_failure *failure);

/* Called by the thread itself, whose committer has options and pairs, and nothing else. The options
 * are changed: threads that may not poll look whether another has failed, and the caller's thread
 * tells a fraction that never falls. committer must outlive them. */
void hs_commits_join(hs_commits *commits, hs_committer *committer);

/*
 * Takes ranges as long as there are any and no thread has failed, and waits until all that was
 * committed has been written. All threads stop when a range fails; the committer's failure tells
 * why it did. The caller's thread then waits for the others, and polls meanwhile.
 */
void hs_commits_work(hs_committer *committer, hs_range_fn search_range, void *worker);

/*
 * Commits what has been collected: with `ends` the whole range, else a part of it. Writes it if the
 * earlier ranges have been written, and waits for these only when the range goes on or much is held
 * back. What is written leaves the collected pairs, sooner or later. HS_STOPPED: another thread has
 * failed.
 */
hs_status hs_commit(hs_committer *committer, double fraction, bool ends);

#endif
