/* SPDX-License-Identifier: BSD-3-Clause */
/* backlog.c: see backlog.h. */
#include "backlog.h"

void
hs_backlog_init(const hs_output *target, hs_committer *committer, hs_backlog *backlog)
{
    *backlog = (hs_backlog){.committer = committer};
    hs_output_init(NULL, target->ndim, target->columns, target->index_bytes, &backlog->pairs);
}

void
hs_backlog_free(hs_account *account, hs_backlog *backlog)
{
    hs_recorder_free(account, &backlog->recorder);
    hs_output_free(&backlog->pairs);
}

hs_status
hs_backlog_hits(void *context, hs_walker *walker, int32_t first, const hs_hits *hits)
{
    hs_backlog      *backlog = context;
    const hs_output *pairs = &backlog->pairs;
    const hs_status  status = hs_record_hits(&backlog->recorder, walker, first, hits);
    if (status == HS_OK &&
        pairs->n_pairs * hs_output_bytes_per_pair(pairs) >= HS_COMMIT_BYTES) {
        const hs_status committed =
            hs_commit(backlog->committer, hs_walk_fraction(walker), false);
        walker->leaves = backlog->committer->is_full;
        return committed;
    }
    return status;
}
