/* SPDX-License-Identifier: BSD-3-Clause */
/* decide.c: see decide.h. */
#include "decide.h"

/* S = image + turns_i - turns_j over B, then over the rows as given. Without turns they are all
 * known to cancel or not to be needed. */
static bool
shift_as_given(const hs_search *search, int32_t si, int32_t sj, const int64_t *image,
               int64_t *given)
{
    const int      m = search->bins.n_periodic;
    const int64_t *turns = search->bins.turns;
    int64_t        reduced[HS_MAX_DIM];
    for (int r = 0; r < m; r++) {
        reduced[r] = image[r];
        if (turns != NULL) {
            reduced[r] += turns[(int64_t)si * m + r] - turns[(int64_t)sj * m + r];
        }
    }
    return hs_lattice_shift(&search->scene.lattice, reduced, given);
}

hs_status
hs_trace(const hs_search *search, int32_t si, int32_t place, bool needs_given, hs_cursor *cursor,
         hs_traced *pair)
{
    const hs_bins *bins = &search->bins;
    const int      d = bins->ndim;
    while (cursor->run[1].at <= place) {
        cursor->run++;
    }
    const hs_run *run = cursor->run;
    pair->sj = run->si + (place - run->at);
    bool shifted = false;
    for (int r = 0; r < bins->n_periodic; r++) {
        pair->image[r] = run->image[r];
        shifted = shifted || run->image[r] != 0;
    }
    if (bins->originals != NULL) {
        pair->p = bins->originals + (int64_t)si * d;
        pair->q = bins->originals + (int64_t)pair->sj * d;
        pair->metric_shift = bins->n_periodic > 0 ? pair->given : NULL;
        needs_given = bins->n_periodic > 0;
    } else {
        for (int k = 0; k < d; k++) {
            pair->buffer[0][k] = bins->x[k][si];
            pair->buffer[1][k] = bins->x[k][pair->sj];
        }
        pair->p = pair->buffer[0];
        pair->q = pair->buffer[1];
        pair->metric_shift = shifted ? pair->image : NULL;
    }
    if (needs_given && !shift_as_given(search, si, pair->sj, pair->image, pair->given)) {
        return HS_ERR_SHIFT_RANGE;
    }
    return HS_OK;
}

/* The float32 square that the filter is about; any rounding of it will do. */
static float
filter_square(const hs_search *search, const float *q, int32_t place)
{
    float s = 0.0f;
    for (int k = 0; k < search->scene.ndim; k++) {
        const float along = search->block.y[k][place] - q[k];
        s += along * along;
    }
    return s;
}

hs_status
hs_decide_hits(hs_search *search, int32_t t, hs_thresholds thresholds, int32_t *n_hits)
{
    const hs_metric *metric = &search->scene.metric;
    const float     *q = search->group.q[t];
    int32_t         *hits = search->block.hits;
    hs_cursor        cursor = {search->block.runs};
    int32_t          n_kept = 0;
    for (int32_t h = 0; h < *n_hits; h++) {
        const int32_t place = hits[h];
        bool          within = filter_square(search, q, place) < thresholds.in;
        if (!within) {
            hs_traced       pair;
            const hs_status status =
                hs_trace(search, search->group.first + t, place, false, &cursor, &pair);
            if (status != HS_OK) {
                return status;
            }
            search->n_ambiguous++;
            within = search->options.precision == HS_DOUBLE
                         ? hs_metric_within_double(metric, pair.p, pair.q, pair.metric_shift)
                         : hs_metric_within(metric, pair.p, pair.q, pair.metric_shift,
                                            &search->stages);
        }
        hits[n_kept] = place;
        n_kept += within;
    }
    *n_hits = n_kept;
    return HS_OK;
}
