/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_COLLECT_PARALLEL_H
#define HS_COLLECT_PARALLEL_H

#include "../search/walk.h"
#include "record.h"

/*
 * parallel.h: the threads of a call at one job, a crew, and the walk over all points by them. Work
 * is cut into numbered ranges, which are handed out one at a time; what is found in one is written
 * when all earlier ranges have been, so that the result does not depend on the number of threads.
 */

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

/* What one thread needs to take ranges and commit their pairs; each worker begins with one, which
 * is set before the worker is opened. */
typedef struct hs_committer {
    hs_options        *options; /* the poll of these tells whether to go on: own_options, unless
                                 * those of a walker are put in their place */
    hs_output         *pairs;   /* where the thread collects them: own_pairs, unless others are */
    hs_options         own_options;
    hs_output          own_pairs;  /* columns as those of the crew's output; not charged */
    hs_failure         failure;    /* of its range that fails */
    struct hs_commits *commits;    /* borrowed, as is the next */
    void              *job;        /* the crew's */
    int64_t            most_bytes; /* held back: one of the two numbers above */
    int64_t            range;      /* that the thread is working on */
    int64_t            written;    /* of the pairs, those that are in the output already */
    bool               is_full;    /* the output has most pairs, and the range goes on: leave it */
    int64_t            work;       /* since the last poll, as it is told of */
    int                n_parts;
    hs_commit_part     parts[HS_COMMIT_PARTS]; /* that wait until earlier ranges are written */
} hs_committer;

/* Does the work of one range. */
typedef hs_status (*hs_range_fn)(void *worker, int64_t range);

/* Notes work of the thread, and polls once there is more than `most` of it. */
HS_ALWAYS_INLINE hs_status
hs_note_work(hs_committer *committer, int64_t work, int64_t most, double fraction)
{
    committer->work += work;
    if (committer->work <= most) {
        return HS_OK;
    }
    committer->work = 0;
    return hs_poll(committer->options, fraction);
}

/*
 * Commits what has been collected: with `ends` the whole range, else a part of it. Writes it if the
 * earlier ranges have been written, and waits for these only when the range goes on or much is held
 * back. What is written leaves the collected pairs, sooner or later. HS_STOPPED: another thread has
 * failed.
 */
hs_status hs_commit(hs_committer *committer, double fraction, bool ends);

/* A job, and a worker of each thread: a struct that the caller's thread opens before the job and
 * closes after it, also when opening a later one has failed. */
typedef struct hs_crew {
    hs_call *call;        /* borrowed */
    void    *job;         /* borrowed; what the workers share */
    size_t   worker_size; /* bytes */
    /* The worker is zero before, but for its committer. It is closed also when this fails. */
    hs_status (*open)(void *job, void *worker);
    void (*close)(void *job, void *worker);
    int64_t     n_ranges;
    hs_range_fn search;       /* collects pairs and calls hs_commit, for the last time at its end */
    hs_output  *output;       /* borrowed; NULL when nothing is committed */
    int64_t     enough, most; /* pairs in the output: from `enough` on no range is begun, and
                               * from `most` on none is ended but the one that is due; 0: all */
    int64_t     n_written;    /* set at the end: the first ranges, written to their end */
} hs_crew;

/* Opens the workers, which take ranges, and closes them. Returns the failure of the earliest range
 * that had one. */
hs_status hs_crew_run(hs_crew *crew, hs_failure *failure);

/*
 * What the hits of a walk are for, in place of being recorded. Each thread has a state of its own,
 * zeros at first, which is opened and closed as a worker is: in turn, by the caller's thread.
 */
typedef struct hs_visitor {
    hs_block_use            use;
    const hs_neighbourhood *most;       /* NULL, or of hs_walker_init */
    hs_visit_fn             visit;      /* gets the state */
    void                   *shared;     /* borrowed */
    size_t                  state_size; /* bytes; 0: the shared one is the state */
    hs_status (*open)(void *shared, void *state, const hs_walker *walker); /* or NULL */
    void (*close)(void *shared, void *state);                              /* or NULL */
} hs_visitor;

/* Visits all groups, in no order. *most, if not NULL: the largest neighbourhood. */
hs_status hs_parallel_visit(hs_search *search, const hs_visitor *visitor, hs_neighbourhood *most,
                            hs_failure *failure);

/* What one thread finds pairs with, and may keep from one search to the next; zeros at first. */
typedef struct hs_keeper {
    hs_committer *committer; /* borrowed; NULL, or takes the pairs when they are many */
    hs_walker     walker;
    hs_recorder   recorder;
} hs_keeper;

/* Idempotent. */
void hs_keeper_close(hs_search *search, hs_keeper *keeper);

/* Records all pairs behind those that the output has: by this keeper and the calling thread, or
 * where that is NULL by the threads of the call. HS_ERR_SHIFT_RANGE sets failure->row. */
hs_status hs_parallel_record(hs_search *search, hs_keeper *keeper, hs_output *output,
                             hs_failure *failure);

/* Adds the number of all pairs to *count, likewise. */
hs_status hs_parallel_count(hs_search *search, hs_keeper *keeper, int64_t *count,
                            hs_failure *failure);

/*
 * Records pairs from the bookmark on, until the output has `enough` pairs or all have been found:
 * then the bookmark says where to go on. The output has at most HS_COMMIT_BYTES_OF_BLOCKS a thread
 * and one block of candidates more than that. A failure leaves the bookmark, and in the output what
 * it may.
 */
hs_status hs_parallel_record_on(hs_search *search, hs_output *output, int64_t enough,
                                hs_bookmark *bookmark, hs_failure *failure);

#endif
