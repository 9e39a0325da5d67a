/* SPDX-License-Identifier: BSD-3-Clause */
/* stage.c: see stage.h. */
#include "stage.h"

/* Bytes at which a stage is emptied: a share of the second-level cache. */
#define STAGE_BYTES (256 * 1024)

hs_status
hs_stage_init(hs_account *account, const hs_output *target, int32_t most_hits, hs_flush_fn flush,
              void *context, hs_stage *stage)
{
    *stage = (hs_stage){.flush = flush, .flush_context = context};
    hs_output_init(NULL, target->ndim, target->columns, target->index_bytes, &stage->pairs);
    return hs_recorder_init(account, &stage->pairs, most_hits, &stage->recorder);
}

void
hs_stage_free(hs_account *account, hs_stage *stage)
{
    hs_recorder_free(account, &stage->recorder);
    hs_output_free(&stage->pairs);
}

hs_status
hs_stage_hits(void *context, hs_walker *walker, int32_t first, const hs_rows *rows)
{
    hs_stage       *stage = context;
    const hs_status status = hs_record_hits(&stage->recorder, walker, first, rows);
    if (status == HS_OK &&
        stage->pairs.n_pairs * hs_output_bytes_per_pair(&stage->pairs) >= STAGE_BYTES) {
        return stage->flush(stage->flush_context, stage, hs_walk_fraction(walker));
    }
    return status;
}
