/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * stage.h: pairs on their way to a result that they cannot be written to at once, because it is
 * the caller's and has no room to spare, or because several threads write to it in turn.
 */
#ifndef HS_STAGE_H
#define HS_STAGE_H

#include "record.h"

/* Called with a stage that is full, or at the end: takes its pairs. */
typedef struct hs_stage hs_stage;
typedef hs_status (*hs_flush_fn)(void *context, hs_stage *stage, double fraction);

struct hs_stage {
    hs_output   pairs; /* owned; counted by nobody: it is small and does not stay */
    hs_recorder recorder;
    hs_flush_fn flush;
    void       *flush_context;
};

/* Columns as those of `target`. */
hs_status hs_stage_init(hs_account *account, const hs_output *target, int32_t most_hits,
                        hs_flush_fn flush, void *context, hs_stage *stage);
void      hs_stage_free(hs_account *account, hs_stage *stage);

/* A hs_visit_fn. */
hs_status hs_stage_hits(void *stage, hs_walker *walker, int32_t first, const hs_rows *rows);

#endif
