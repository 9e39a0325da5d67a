/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_COLLECT_PARALLEL_H
#define HS_COLLECT_PARALLEL_H

#include "columns.h"
#include "../threads/call.h"
#include "../search/walk.h"
#include "record.h"

/*
 * parallel.h: the walk over all points by several threads. Points are handed out in ranges; what a
 * thread finds in one waits in a backlog of its own until all earlier ranges have been written, so
 * that the result does not depend on the number of threads.
 */

/*
 * Several threads that fill one output in a fixed order. The work is cut into numbered
 * ranges, which are handed out one at a time; what is found in one is written when all earlier
 * ranges have been, so that the result does not depend on the number of threads.
 *
 * Usage: hs_crew_run, whose `search` collects pairs of a range and calls hs_commit, for the last
 * time at its end.
 */

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

/*
 * Commits what has been collected: with `ends` the whole range, else a part of it. Writes it if the
 * earlier ranges have been written, and waits for these only when the range goes on or much is held
 * back. What is written leaves the collected pairs, sooner or later. HS_STOPPED: another thread has
 * failed.
 */
hs_status hs_commit(hs_committer *committer, double fraction, bool ends);

/*
 * The threads of a call at one job. Each has a worker of its own, a struct that the
 * caller's thread opens before the job and closes after it, also when opening a later one has
 * failed. Work that is cut into ranges is handed out one range at a time; what is found is written
 * in their order.
 */

typedef struct hs_crew {
    hs_call *call;        /* borrowed */
    void    *job;         /* borrowed; what the workers share */
    size_t   worker_size; /* bytes */
    /* The worker is zero before. It is closed also when this fails. */
    hs_status (*open)(void *job, void *worker);
    void (*close)(void *job, void *worker);
    void *workers; /* owned; one for each thread, one behind another */
    int   n_open;  /* so many of them */
    /* For hs_crew_run: */
    int64_t     n_ranges;
    hs_range_fn search;
    hs_output  *output;       /* borrowed; NULL when nothing is committed */
    int64_t     enough, most; /* pairs in the output: from `enough` on no range is begun, and
                               * from `most` on none is ended but the one that is due; 0: all */
    int64_t     n_written;    /* set at the end: the first ranges, written to their end */
} hs_crew;

/* Opens a worker for each thread. hs_crew_close must follow, also on failure. */
hs_status hs_crew_open(hs_crew *crew);
void      hs_crew_close(hs_crew *crew);

/* Opens workers, each of which begins with a hs_committer and sets its `options` and `pairs`; they
 * take ranges, and are closed. Returns the failure of the earliest range that had one. */
hs_status hs_crew_run(hs_crew *crew, hs_failure *failure);

/* What each thread's walker shall do with its hits, in place of recording them. */
typedef struct hs_visitors {
    hs_block_use            use;
    const hs_neighbourhood *most; /* NULL, or for hs_walker_init_ordered */
    hs_visit_fn             visit;
    void                   *contexts; /* borrowed; of each thread, as hs_crew.workers */
    size_t                  context_size;
} hs_visitors;

/* Records all pairs behind those that the output has, by the calling thread, with a walker and a
 * recorder that are kept from one search to the next: all zeros before the first, and closed by the
 * caller. */
hs_status hs_parallel_record_next(hs_search *search, hs_output *output, hs_walker *walker,
                                  hs_recorder *recorder, hs_failure *failure);

/* Records all pairs in the output, by search->call->team. HS_ERR_SHIFT_RANGE sets failure->row. */
hs_status hs_parallel_record(hs_search *search, hs_output *output, hs_failure *failure);

/*
 * Records pairs from the bookmark on, until the output has `enough` pairs or all have been found:
 * then the bookmark says where to go on. The output has at most HS_COMMIT_BYTES_OF_BLOCKS a thread
 * and one block of candidates more than that. A failure leaves the bookmark, and in the output what
 * it may.
 */
hs_status hs_parallel_record_on(hs_search *search, hs_output *output, int64_t enough,
                                hs_bookmark *bookmark, hs_failure *failure);

/* Records all pairs behind those that the output has, by the threads of the call or alone. */
hs_status hs_parallel_record_all(hs_search *search, hs_output *output, hs_failure *failure);

/* Visits all groups, in no order. *most, if not NULL: the largest neighbourhood. */
hs_status hs_parallel_visit(hs_search *search, const hs_visitors *visitors, hs_neighbourhood *most,
                            hs_failure *failure);

/* Counts all pairs. */
hs_status hs_parallel_count(hs_search *search, int64_t *count, hs_failure *failure);

/*
 * Pairs on their way to a result that they cannot be written to at once, because it is
 * the caller's and has no room to spare, or because several threads fill it in a fixed order.
 */

typedef struct hs_backlog {
    hs_output     pairs; /* owned; not charged to the account (short-lived) */
    hs_recorder   recorder;
    hs_committer *committer; /* borrowed; takes the pairs when they are many */
} hs_backlog;

/* Columns as those of `target`; no recorder yet. */
void hs_backlog_init(const hs_output *target, hs_committer *committer, hs_backlog *backlog);

/* Its pairs and recorder; idempotent. */
void hs_backlog_free(hs_account *account, hs_backlog *backlog);

/* hs_parallel_record_next for a backlog. */
hs_status hs_backlog_record(hs_search *search, hs_backlog *backlog, hs_walker *walker,
                            hs_failure *failure);

#endif
