/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * parallel.h: the walk over all points by several threads. Points are handed out in ranges; what a
 * thread finds in one waits in a backlog of its own until all earlier ranges have been written, so
 * that the result does not depend on the number of threads.
 */
#ifndef HS_PARALLEL_H
#define HS_PARALLEL_H

#include "../search/walk.h"
#include "columns.h"
#include "in_turn.h"
#include "recorder.h"

/* What each thread's walker shall do with its hits, in place of recording them. */
typedef struct hs_visitors {
    hs_block_use            use;
    const hs_neighbourhood *most; /* NULL, or for hs_walker_init_ordered */
    hs_visit_fn             visit;
    void                   *contexts; /* borrowed; of each thread, as hs_crew.workers */
    size_t                  context_size;
} hs_visitors;

/* Records all pairs by this thread, straight into an output that grows. */
hs_status hs_record_alone(hs_search *search, hs_output *output, hs_failure *failure);

/* The same with a walker and a recorder that are kept from one search to the next; all zeros before
 * the first, and closed by the caller. */
hs_status hs_record_next(hs_search *search, hs_output *output, hs_walker *walker,
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
hs_status hs_record_all(hs_search *search, hs_output *output, hs_failure *failure);

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
    hs_output     pairs; /* owned; on no account: it is small and does not stay */
    hs_recorder   recorder;
    hs_committer *committer; /* borrowed; takes the pairs when they are many */
} hs_backlog;

/* Columns as those of `target`; no recorder yet. */
void hs_backlog_init(const hs_output *target, hs_committer *committer, hs_backlog *backlog);

/* Its pairs and recorder; harmless twice. */
void hs_backlog_free(hs_account *account, hs_backlog *backlog);

/* hs_record_next for a backlog. */
hs_status hs_backlog_record(hs_search *search, hs_backlog *backlog, hs_walker *walker,
                            hs_failure *failure);

#endif
