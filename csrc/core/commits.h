/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * commits.h: several threads that fill one output in a fixed order. The work is cut into numbered
 * ranges, which are handed out one at a time; what is found in one is written when all earlier
 * ranges have been, so that the result is the same for any number of threads.
 */
#ifndef HS_COMMITS_H
#define HS_COMMITS_H

#include "output.h"

typedef struct hs_commits hs_commits;

#define HS_TURN_PARTS 32 /* that a thread may hold back at a time */

/* Pairs of one range that are ready: of a stage, those before `end` that are in no earlier part. */
typedef struct hs_turn_part {
    int64_t range;
    int64_t end;
    double  fraction; /* of the whole search that is done with it */
    bool    is_last;  /* of its range */
} hs_turn_part;

/* One thread's part in it. */
typedef struct hs_turn {
    hs_commits  *turns;    /* borrowed */
    hs_options  *options; /* borrowed; its poll tells whether to go on */
    hs_output   *stage;   /* borrowed: where the thread collects pairs; NULL when counting */
    int64_t      range;   /* that the thread is working on */
    int64_t      written; /* pairs of the stage that are in the output already */
    int          n_parts;
    hs_turn_part parts[HS_TURN_PARTS]; /* that wait for their turn */
} hs_turn;

/* output: borrowed; NULL when nothing is written. The thread that calls this is the only one that
 * may poll. NULL when memory is short. */
hs_commits *hs_commits_new(hs_account *account, hs_output *output, int64_t n_ranges);

/* After all threads are done: HS_OK, or the failure of the earliest range that had one. Frees. */
hs_status hs_commits_end(hs_account *account, hs_commits *turns, hs_failure *failure);

/* Called by the thread itself. stage: NULL when it writes nothing in turn. options: those that it
 * works with; for threads that may not poll they are changed to ask whether anybody has failed. */
void hs_turn_join(hs_commits *turns, hs_options *options, hs_output *stage, hs_turn *turn);

/* Takes the next range; false when there is none, or when somebody has failed. */
bool hs_turn_next(hs_turn *turn);

/*
 * What the stage holds of this range is all of it, or with `ends` false all but what comes: writes
 * what has its turn and waits for the rest only when the range goes on or much is held back. What
 * is written leaves the stage, sooner or later. HS_STATUS_END: somebody else has failed.
 */
hs_status hs_turn_commit(hs_turn *turn, double fraction, bool ends);

/* Waits until all that was committed has been written. */
hs_status hs_turn_finish(hs_turn *turn);

/* This range has failed: everybody stops. A status that only follows from another's failure is
 * not noted. */
void hs_turn_fail(hs_turn *turn, hs_status status, const hs_failure *failure);

#endif
