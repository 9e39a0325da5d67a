/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * backlog.h: pairs on their way to a result that they cannot be written to at once, because it is
 * the caller's and has no room to spare, or because several threads fill it in a fixed order.
 */
#ifndef HS_BACKLOG_H
#define HS_BACKLOG_H

#include "in_turn.h"
#include "record.h"

typedef struct hs_backlog {
    hs_output     pairs; /* owned; counted by nobody: it is small and does not stay */
    hs_recorder   recorder;
    hs_committer *committer; /* borrowed; takes the pairs when they are many */
} hs_backlog;

/* Columns as those of `target`; no recorder yet. */
void hs_backlog_init(const hs_output *target, hs_committer *committer, hs_backlog *backlog);

/* Its pairs and recorder; harmless twice. */
void hs_backlog_free(hs_account *account, hs_backlog *backlog);

/* A hs_visit_fn. */
hs_status hs_backlog_hits(void *backlog, hs_walker *walker, int32_t first, const hs_hits *hits);

#endif
