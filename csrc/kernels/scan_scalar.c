/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan_scalar.c: the scan kernel in plain C; the specification of the others. See kernel.h.
 *
 * Two short loops for each chunk of candidates: the first tests, without branches or stores at
 * changing addresses, so that compilers vectorise it for whatever the baseline CPU has; the second
 * packs the labels. Measured: half the time of one loop that does both.
 */
#include "kernel.h"

/* Candidates tested before they are packed; their flags stay in the first-level cache. */
#define CHUNK 128

HS_ALWAYS_INLINE int32_t
scan_loop(const hs_candidates *candidates, int32_t first, int32_t last, const float *q,
          hs_thresholds thresholds, const int ndim, int32_t *hits, bool *ambiguous)
{
    const float *y[HS_MAX_DIM];
    float        centre[HS_MAX_DIM];
    int32_t      near[CHUNK];
    int32_t      unsure = 0, n_hits = 0;
    for (int k = 0; k < ndim; k++) {
        y[k] = candidates->y[k];
        centre[k] = q[k];
    }
    for (int32_t begin = first; begin < last; begin += CHUNK) {
        const int32_t  n = last - begin < CHUNK ? last - begin : CHUNK;
        const int32_t *label = candidates->label + begin;
        for (int32_t c = 0; c < n; c++) {
            float s = 0.0f;
            for (int k = 0; k < ndim; k++) {
                const float along = y[k][begin + c] - centre[k];
                s = k == 0 ? along * along : s + along * along;
            }
            near[c] = !(s > thresholds.out);
            unsure |= near[c] & !(s < thresholds.in);
        }
        for (int32_t c = 0; c < n; c++) {
            hits[n_hits] = label[c];
            n_hits += near[c];
        }
    }
    *ambiguous = *ambiguous || unsure != 0;
    return n_hits;
}

int32_t
hs_scan_scalar(const hs_candidates *candidates, int32_t first, int32_t last, const float *q,
               hs_thresholds thresholds, int ndim, int32_t *hits, bool *ambiguous)
{
#define SCAN(ndim) \
    scan_loop(candidates, first, last, q, thresholds, ndim, hits, ambiguous)
    switch (ndim) {
    case 1: return SCAN(1);
    case 2: return SCAN(2);
    case 3: return SCAN(3);
    case 4: return SCAN(4);
    case 5: return SCAN(5);
    case 6: return SCAN(6);
    case 7: return SCAN(7);
    default: return SCAN(8);
    }
#undef SCAN
}
