/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck_decide.c: the exact decision of the listed pairs that float32 cannot tell. */
#include "recheck.h"

#include "../exact/metric_float.h"

#include <string.h>

/* Pairs of a batch that are to be decided, as the kernels take them. */
typedef struct open_batch {
    double  p[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    double  q[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    double  times[HS_MAX_DIM][HS_BATCH + HS_BATCH_PADDING];
    int64_t shift[HS_BATCH][HS_MAX_DIM];
    bool    is_shifted, is_wide;
} open_batch;

static void
fill_open(const hs_refilter *refilter, const hs_sifted *slab, const uint16_t *unsure, int32_t n,
          open_batch *open)
{
    const hs_listing *listing = &refilter->list->listing;
    const hs_frame   *now = refilter->now;
    open->is_shifted = open->is_wide = false;
    for (int32_t b = 0; b < n; b++) {
        const int64_t e = slab->first + slab->hits[unsure[b]];
        hs_refilter_shift(refilter, e, open->shift[b]);
        for (int k = 0; k < refilter->d; k++) {
            const int64_t i = listing->order[listing->i[e]], j = listing->order[listing->j[e]];
            open->p[k][b] = hs_frame_entry(now->rows, now->points.real, i * refilter->d + k);
            open->q[k][b] = hs_frame_entry(now->rows, now->points.real, j * refilter->d + k);
        }
        for (int r = 0; r < refilter->m; r++) {
            const int64_t shift = open->shift[b][r];
            open->times[r][b] = (double)shift;
            open->is_shifted = open->is_shifted || shift != 0;
            open->is_wide = open->is_wide || shift > INT64_C(1) << 53 ||
                            shift < -(INT64_C(1) << 53);
        }
    }
}

/* Whether each of n pairs is within the cutoff: by the kernel, and what that leaves one by one. */
static void
decide_open(const hs_refilter *refilter, const open_batch *open, int32_t n, hs_stages *stages,
            uint8_t *within)
{
    const hs_metric *metric = &refilter->given;
    uint8_t          verdict[HS_BATCH + HS_BATCH_PADDING] = {0};
    hs_batch         batch = {.n = n};
    for (int k = 0; k < refilter->d; k++) {
        batch.p[k] = open->p[k];
        batch.q[k] = open->q[k];
    }
    for (int r = 0; open->is_shifted && r < refilter->m; r++) {
        batch.shift[r] = open->times[r];
    }
    if (!open->is_wide) {
        refilter->search->kernel->judge(metric, &batch, verdict, stages);
    }
    for (int32_t b = 0; b < n; b++) {
        double p[HS_MAX_DIM], q[HS_MAX_DIM];
        if (verdict[b] != HS_UNDECIDED) {
            within[b] = verdict[b] == HS_WITHIN;
            continue;
        }
        for (int k = 0; k < refilter->d; k++) {
            p[k] = open->p[k][b];
            q[k] = open->q[k][b];
        }
        within[b] = open->is_wide ? hs_metric_within(metric, p, q, open->shift[b], stages)
                                  : hs_metric_settle(metric, p, q, open->shift[b], stages);
    }
}

void
hs_refilter_settle(const hs_refilter *refilter, int32_t n_unsure, hs_sifted *slab)
{
    open_batch open;
    int32_t    to = slab->unsure[0], from = to; /* hits before `from` have been moved to `to` */
    memset(&open, 0, sizeof open);              /* kernels read a little beyond the last pair */
    for (int32_t u = 0; u < n_unsure; u += HS_BATCH) {
        const int32_t n = n_unsure - u < HS_BATCH ? n_unsure - u : HS_BATCH;
        uint8_t       within[HS_BATCH];
        fill_open(refilter, slab, slab->unsure + u, n, &open);
        decide_open(refilter, &open, n, &slab->stages, within);
        for (int32_t b = 0; b < n; b++) {
            const int32_t at = slab->unsure[u + b];
            memmove(slab->hits + to, slab->hits + from, (size_t)(at - from) * sizeof *slab->hits);
            to += at - from;
            slab->hits[to] = slab->hits[at];
            to += within[b];
            from = at + 1;
        }
    }
    memmove(slab->hits + to, slab->hits + from,
            (size_t)(slab->n_hits - from) * sizeof *slab->hits);
    slab->n_hits -= from - to;
}
