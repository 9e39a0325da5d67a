/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck_unit.h: a list of a few points, put together by hand, whose pairs are decided anew, so
 * that a test can take the steps of that one by one. */
#ifndef HS_RECHECK_UNIT_H
#define HS_RECHECK_UNIT_H

#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/verlet/recheck.h"
#include "harness.h"

enum { RECHECK_POINTS = 6, RECHECK_IMAGES = 4 };

typedef struct recheck_unit {
    hs_call    call;
    hs_verlet  list;
    hs_recheck recheck;
    hs_output  output; /* fixed, so that batches are measured */
    int32_t    order[RECHECK_POINTS];
    int64_t    counts[RECHECK_POINTS * 3], jumps[RECHECK_POINTS * 3];
    int32_t    images[RECHECK_IMAGES * 3];
} recheck_unit;

/* All points in reverse, no jumps, counts and images of 0. */
static inline void
recheck_unit_open(const hs_points *points, const hs_box *box, double cutoff, unsigned want,
                  recheck_unit *unit)
{
    hs_options  options = hs_options_default();
    hs_failure  failure;
    double      rows[HS_MAX_DIM][HS_MAX_DIM];
    hs_recheck *recheck = &unit->recheck;
    memset(unit, 0, sizeof *unit);
    options.cutoff = cutoff;
    options.want = want;
    options.threads = 1;
    hs_call_begin(&options, &unit->call);
    unit->call.kernel = hs_kernel_select(NULL);
    CHECK(hs_frame_take(points, box, &options, &unit->list.frames[0], &failure) == HS_OK);
    for (int a = 0; a < points->n; a++)
        unit->order[a] = (int32_t)points->n - 1 - a;
    unit->list.cutoff = cutoff;
    unit->list.jumps_now = -1;
    recheck->list = &unit->list;
    recheck->now = &unit->list.frames[0];
    recheck->call = &unit->call;
    unit->output.fixed = true;
    recheck->output = &unit->output;
    recheck->d = points->ndim;
    recheck->m = hs_frame_periodic(recheck->now, recheck->vector_of_row);
    for (int r = 0; r < recheck->m; r++)
        memcpy(rows[r], box->rows[recheck->vector_of_row[r]], sizeof rows[r]);
    hs_metric_init(&recheck->given, recheck->d, recheck->m, (const double(*)[HS_MAX_DIM])rows,
                   cutoff, true);
    unit->list.listing.order = unit->order;
    unit->list.listing.images =
        (hs_images){.width = recheck->m, .of = unit->images, .n = RECHECK_IMAGES};
}

static inline void
recheck_unit_close(recheck_unit *unit)
{
    hs_account *account = &unit->call.account;
    hs_recheck *recheck = &unit->recheck;
    hs_scene_free(account, &recheck->scene);
    hs_free(account, recheck->counts);
    hs_free(account, recheck->y);
    hs_free(account, recheck->offset);
    hs_free(account, recheck->x);
    hs_free(account, recheck->image);
    hs_free(account, recheck->lag);
    hs_free(account, recheck->lagging);
    hs_free(account, recheck->few);
    hs_free(account, recheck->of_a);
    hs_frame_free(&unit->list.frames[0]);
    CHECK(account->held == 0);
    hs_account_close(account);
}

#endif
