/* SPDX-License-Identifier: BSD-3-Clause */
/* recheck_settle.c: the exact decision of the listed pairs that float32 cannot tell, from the
 * points as given and S. */
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
fill_open(const hs_recheck *recheck, const hs_sifted *slab, const hs_open_pair *pairs, int32_t n,
          open_batch *open)
{
    const hs_listing *listing = &recheck->list->listing;
    const hs_frame   *now = recheck->now;
    open->is_shifted = open->is_wide = false;
    for (int32_t e = 0; e < n; e++) {
        const int64_t a = slab->bundles[pairs[e].bundle].point;
        const int64_t b = listing->j[slab->first + pairs[e].pair];
        const int64_t i = listing->order[a], j = listing->order[b];
        hs_recheck_shift(recheck, a, b, hs_recheck_image(recheck, slab, pairs[e].bundle),
                         open->shift[e]);
        for (int k = 0; k < recheck->d; k++) {
            open->p[k][e] = hs_frame_entry(now->rows, now->points.real, i * recheck->d + k);
            open->q[k][e] = hs_frame_entry(now->rows, now->points.real, j * recheck->d + k);
        }
        for (int r = 0; r < recheck->m; r++) {
            const int64_t shift = open->shift[e][r];
            open->times[r][e] = (double)shift;
            open->is_shifted = open->is_shifted || shift != 0;
            open->is_wide = open->is_wide || shift > INT64_C(1) << 53 ||
                            shift < -(INT64_C(1) << 53);
        }
    }
}

/* Whether each of n pairs is within the cutoff: by the kernel, and what that leaves one by one. */
static void
decide_open(const hs_recheck *recheck, const open_batch *open, int32_t n, hs_stages *stages,
            uint8_t *within)
{
    const hs_metric *metric = &recheck->given;
    uint8_t          verdict[HS_BATCH + HS_BATCH_PADDING] = {0};
    hs_batch         batch = {.n = n};
    for (int k = 0; k < recheck->d; k++) {
        batch.p[k] = open->p[k];
        batch.q[k] = open->q[k];
    }
    for (int r = 0; open->is_shifted && r < recheck->m; r++) {
        batch.shift[r] = open->times[r];
    }
    if (!open->is_wide) {
        recheck->call->kernel->judge(metric, &batch, verdict, stages);
    }
    for (int32_t b = 0; b < n; b++) {
        double p[HS_MAX_DIM], q[HS_MAX_DIM];
        if (verdict[b] != HS_UNDECIDED) {
            within[b] = verdict[b] == HS_WITHIN;
            continue;
        }
        for (int k = 0; k < recheck->d; k++) {
            p[k] = open->p[k][b];
            q[k] = open->q[k][b];
        }
        within[b] = open->is_wide ? hs_metric_within(metric, p, q, open->shift[b], stages)
                                  : hs_metric_settle(metric, p, q, open->shift[b], stages);
    }
}

/* Takes the hits whose numbers are in `gone`, ascending, from a slab. */
static void
drop_hits(hs_sifted *slab, const int32_t *gone, int32_t n)
{
    int32_t to = gone[0], before = 0;
    for (int32_t g = 0; g < n; g++) {
        const int32_t from = gone[g] + 1, end = g + 1 < n ? gone[g + 1] : slab->n_hits;
        memmove(slab->hits + to, slab->hits + from, (size_t)(end - from) * sizeof *slab->hits);
        to += end - from;
    }
    for (int32_t t = 0; t < slab->n_bundles; t++) {
        while (before < n && gone[before] < slab->hits_end[t]) {
            before++;
        }
        slab->hits_end[t] -= before;
    }
    slab->n_hits -= n;
}

void
hs_recheck_settle(const hs_recheck *recheck, hs_sifted *slab)
{
    int32_t    gone[HS_SIFT], n_gone = 0;
    open_batch open;
    memset(&open, 0, sizeof open); /* kernels read a little beyond the last pair */
    for (int32_t u = 0; u < slab->n_open; u += HS_BATCH) {
        const int32_t n = slab->n_open - u < HS_BATCH ? slab->n_open - u : HS_BATCH;
        uint8_t       within[HS_BATCH];
        fill_open(recheck, slab, slab->open + u, n, &open);
        decide_open(recheck, &open, n, &slab->stages, within);
        for (int32_t b = 0; b < n; b++) {
            gone[n_gone] = slab->open[u + b].at;
            n_gone += !within[b];
        }
    }
    if (n_gone > 0) {
        drop_hits(slab, gone, n_gone);
    }
}
