/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck_find.c: from a list and its last step to a result: unsorted as found, or sorted at the
 * end. */
#include "../collect/sort_pairs.h"
#include "recheck.h"

#include <math.h>
#include <string.h>

/* The columns that are found: those wanted, and what putting them in order needs beside them. */
static unsigned
columns_to_sort(const hs_recheck *recheck)
{
    const bool images = recheck->list->listing.images.n > 0;
    return (recheck->call->options.want & ~(unsigned)HS_WANT_BOTH) | HS_WANT_I | HS_WANT_J |
           (images ? HS_WANT_SHIFT : 0);
}

static hs_status
find_sorted(hs_recheck *recheck, hs_output *output, hs_failure *failure)
{
    hs_call  *call = recheck->call;
    hs_output found;
    hs_output_init(&call->account, recheck->d, columns_to_sort(recheck), 4, &found);
    recheck->output = &found;
    hs_status status = hs_recheck_run(recheck, failure);
    if (status == HS_OK) {
        status = hs_sort_pairs(call, 0, recheck->now->points.n, &found, output);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)found.n_pairs;
    }
    hs_output_free(&found);
    return status;
}

static hs_status
find_pairs(hs_recheck *recheck, hs_output *output, hs_failure *failure)
{
    const hs_call *call = recheck->call;
    hs_status      status;
    if (call->options.sorted) {
        status = find_sorted(recheck, output, failure);
    } else {
        recheck->output = output;
        status = hs_recheck_run(recheck, failure);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = fmax(failure->expected_pairs, (double)output->n_pairs);
    }
    hs_call_tell_limit(call, status, failure);
    return hs_pairs_conclude(output, status, failure);
}

static void
set_recheck(const hs_verlet *list, hs_call *call, hs_recheck *recheck)
{
    const hs_frame *now = &list->frames[list->now];
    double          rows[HS_MAX_DIM][HS_MAX_DIM];
    memset(recheck, 0, sizeof *recheck);
    recheck->list = list;
    recheck->now = now;
    recheck->call = call;
    recheck->d = now->points.ndim;
    recheck->m = hs_frame_periodic(now, recheck->vector_of_row);
    recheck->measures = call->options.want & (HS_WANT_DISTANCE | HS_WANT_VECTOR);
    for (int r = 0; r < recheck->m; r++) {
        memcpy(rows[r], now->box.rows[recheck->vector_of_row[r]], sizeof rows[r]);
    }
    hs_metric_init(&recheck->given, recheck->d, recheck->m, (const double(*)[HS_MAX_DIM])rows,
                   list->cutoff, call->options.inclusive);
}

hs_status
hs_recheck_find(const hs_verlet *list, hs_pairs *pairs, hs_failure *failure)
{
    hs_recheck       recheck;
    hs_call         *call = &pairs->call;
    const hs_points *points = &list->frames[list->now].points;
    if (call->kernel == NULL) {
        return HS_ERR_KERNEL;
    }
    hs_call_gather(call, points->n);
    hs_pairs_open(pairs, points->ndim);
    set_recheck(list, call, &recheck);
    const hs_status status = find_pairs(&recheck, &pairs->output, failure);
    hs_scene_free(&call->account, &recheck.scene);
    return status;
}
