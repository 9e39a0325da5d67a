/* SPDX-License-Identifier: BSD-3-Clause */
/* recorder.c: takes only the arrays that the columns of the output need. */
#include "recorder.h"

hs_block_use
hs_record_use(unsigned columns)
{
    return columns & (HS_MEASURED | HS_WANT_SHIFT) ? HS_BLOCK_LISTS_PLACES : HS_BLOCK_LISTS_IDS;
}

hs_status
hs_recorder_init(hs_account *account, hs_output *output, int32_t most_hits, hs_recorder *recorder)
{
    const int64_t  n = most_hits + HS_PADDING, in_batch = HS_BATCH + HS_PADDING;
    const unsigned columns = output->columns;
    bool           complete = true;
    *recorder = (hs_recorder){.output = output, .columns = columns, .most_hits = most_hits};
    if (hs_record_use(columns) == HS_BLOCK_LISTS_PLACES) {
        recorder->ids = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(int32_t));
        complete = recorder->ids != NULL;
    }
    if (columns & HS_WANT_BOTH) {
        recorder->ends[0] = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(int32_t));
        recorder->ends[1] = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(int32_t));
        complete = complete && recorder->ends[0] != NULL && recorder->ends[1] != NULL;
    }
    if (columns & HS_MEASURED) {
        recorder->distance = hs_alloc(account, HS_FOR_CANDIDATES, in_batch, sizeof(double));
        complete = complete && recorder->distance != NULL;
    }
    for (int k = 0; (columns & HS_WANT_VECTOR) && k < output->ndim; k++) {
        recorder->vector[k] = hs_alloc(account, HS_FOR_CANDIDATES, in_batch, sizeof(double));
        complete = complete && recorder->vector[k] != NULL;
    }
    if ((columns & HS_WANT_SHELL) && !(columns & HS_WANT_DISTANCE)) {
        recorder->all_distances = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(double));
        complete = complete && recorder->all_distances != NULL;
    }
    if (!complete) {
        hs_recorder_free(account, recorder);
        return HS_ERR_MEMORY;
    }
    return HS_OK;
}

void
hs_recorder_free(hs_account *account, hs_recorder *recorder)
{
    hs_free(account, recorder->ids);
    hs_free(account, recorder->ends[0]);
    hs_free(account, recorder->ends[1]);
    hs_free(account, recorder->distance);
    hs_free(account, recorder->all_distances);
    for (int k = 0; k < HS_MAX_DIM; k++) {
        hs_free(account, recorder->vector[k]);
    }
    *recorder = (hs_recorder){0};
}
