/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * recheck_write.c: hits in 2-D and 3-D are measured while they are written, by the writer of a
 * search (kernels/write.h), where a thread writes to memory of ours. Its shift is the one that
 * the metric multiplies: the lag of b, and for each bundle image less the lag of a.
 */
#include "recheck.h"

#include "../collect/measures.h"

#include <math.h>
#include <string.h>

/* Lags and images up to here: their sums fit. */
#define MOST_SHIFT (INT64_C(1) << 29)

/* Whether a point may be its own neighbour: then the writer would go by the sign of its shift,
 * which is not that of S. B is diagonal here. */
static bool
has_own_images(const hs_recheck *recheck)
{
    const hs_metric *metric = &recheck->scene.metric;
    for (int r = 0; r < recheck->m; r++) {
        double longest = 0.0;
        for (int k = 0; k < recheck->d; k++) {
            longest = hs_larger(fabs(metric->rows[r][k]), longest);
        }
        if (!(longest > metric->cutoff)) {
            return true;
        }
    }
    return false;
}

static bool
are_small(const int64_t *shifts, int64_t n)
{
    uint64_t any = 0;
    for (int64_t e = 0; e < n; e++) {
        any |= (uint64_t)shifts[e] + (uint64_t)MOST_SHIFT;
    }
    return any < 2 * (uint64_t)MOST_SHIFT;
}

/* Records of lags, unless all are zero. */
static bool
set_few(hs_recheck *recheck)
{
    const int64_t n = recheck->now->points.n;
    const int     m = recheck->m;
    unsigned      any = 0;
    for (int64_t a = 0; m > 0 && a < n; a++) {
        any |= recheck->lagging[a];
    }
    if (any == 0) {
        return true;
    }
    recheck->few =
        hs_alloc(&recheck->call->account, HS_FOR_WRAPS, n * HS_RECORD, sizeof *recheck->few);
    for (int64_t a = 0; recheck->few != NULL && a < n; a++) {
        for (int r = 0; r < HS_RECORD; r++) {
            recheck->few[a * HS_RECORD + r] = r < m ? (int32_t)recheck->lag[a * m + r] : 0;
        }
    }
    return recheck->few != NULL;
}

hs_status
hs_recheck_plan_write(hs_recheck *recheck)
{
    const hs_scene *scene = &recheck->scene;
    const int       d = recheck->d, m = recheck->m;
    const bool      is_ours = !recheck->output->fixed || recheck->shared;
    recheck->writes = recheck->call->kernel->write != NULL && d >= 2 && d <= HS_WRITE_MOST_DIM &&
                      is_ours && !(recheck->output->columns & HS_WANT_BOTH) &&
                      !scene->keeps_originals && !scene->extreme && scene->metric.floats_usable &&
                      !has_own_images(recheck) &&
                      are_small(recheck->lag, recheck->now->points.n * m) &&
                      are_small(recheck->image, recheck->list->listing.images.n * m);
    if (!recheck->writes) {
        return HS_OK;
    }
    return set_few(recheck) ? HS_OK : HS_ERR_MEMORY;
}

/* What the writer is told of the point a of each bundle. */
static void
describe_points(const hs_recheck *recheck, const hs_sifted *slab, bool shifted, hs_write *write)
{
    hs_bundle_points *of = recheck->of_a;
    const bool        has_images = hs_sifted_has_images(recheck, slab);
    for (int32_t t = 0; t < slab->n_bundles; t++) {
        const hs_bundle *bundle = &slab->bundles[t];
        const int64_t    a = bundle->point;
        of->number[t] = recheck->list->listing.order[a];
        for (int k = 0; k < recheck->d; k++) {
            of->p[k][t] = recheck->x[a * HS_RECORD + k];
        }
        for (int r = 0; shifted && r < recheck->m; r++) {
            const int64_t image =
                has_images ? recheck->image[(int64_t)bundle->image * recheck->m + r] : 0;
            of->turns[r][t] = (int32_t)(image - recheck->lag[a * recheck->m + r]);
        }
    }
    for (int k = 0; k < recheck->d; k++) {
        write->p[k] = of->p[k];
    }
    for (int r = 0; shifted && r < recheck->m; r++) {
        write->turns[r] = of->turns[r];
    }
}

bool
hs_recheck_write(const hs_recheck *recheck, hs_sifted *slab)
{
    const bool shifted = hs_sifted_has_images(recheck, slab) || recheck->few != NULL;
    hs_write   write = {
          .ndim = recheck->d,
          .is_half = true,
          .is_shifted = shifted,
          .by_S = true,
          .metric = &recheck->scene.metric,
          .q = recheck->x,
          .few = recheck->few,
          .index_bytes = recheck->output->index_bytes,
          .i = hs_recheck_column(recheck, HS_WANT_I, slab->at),
          .j = hs_recheck_column(recheck, HS_WANT_J, slab->at),
          .distance = hs_recheck_column(recheck, HS_WANT_DISTANCE, slab->at),
          .vector = hs_recheck_column(recheck, HS_WANT_VECTOR, slab->at),
    };
    const hs_hits hits = {.n = slab->n_bundles,
                          .point = recheck->of_a->number,
                          .end = slab->hits_end,
                          .label = slab->hits};
    hs_measures_tell(&recheck->scene, &recheck->call->options, &write);
    describe_points(recheck, slab, shifted, &write);
    memset(slab->hits + slab->n_hits, 0, HS_PADDING * sizeof *slab->hits);
    return recheck->call->kernel->write(&write, &hits);
}
