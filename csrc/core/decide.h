/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * decide.h: from a place in the gathered block back to the numbers that were given: the exact
 * decision of ambiguous hits, and the distance, vector and shift of a pair.
 */
#ifndef HS_DECIDE_H
#define HS_DECIDE_H

#include "search.h"

/* A walk along the runs of a block; places must be asked for in ascending order. */
typedef struct hs_cursor {
    const hs_run *run;
} hs_cursor;

/* One candidate pair, traced back. */
typedef struct hs_traced {
    int32_t       sj;                    /* j in cell order */
    const double *p, *q;                 /* what the metric measures between ... */
    const int64_t *metric_shift;         /* ... and its shift, or NULL when there is none */
    int64_t       image[HS_MAX_DIM];     /* shift over B, of X */
    int64_t       given[HS_MAX_DIM];     /* S over the periodic rows as given */
    double        buffer[2][HS_MAX_DIM]; /* room for p and q */
} hs_traced;

/*
 * Trace the pair of point si and the candidate at `place`. `needs_given`: fill `given` also where
 * the metric can do without. HS_ERR_SHIFT_RANGE when a shift passes int64.
 */
hs_status hs_trace(const hs_search *search, int32_t si, int32_t place, bool needs_given,
                   hs_cursor *cursor, hs_traced *pair);

/* Of the *n_hits places in block.hits, keep those that are within the cutoff; the order stays. */
hs_status hs_decide_hits(hs_search *search, int32_t t, hs_thresholds thresholds, int32_t *n_hits);

#endif
