/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * pair_batch.h: from places in the gathered block back to the numbers that were given, a batch of
 * pairs at a time, as the exact decision and the measuring want them.
 */
#ifndef HS_PAIR_BATCH_H
#define HS_PAIR_BATCH_H

#include "records.h"

/* A batch of pairs. Arrays have one entry for each pair, HS_BATCH and some more of doubles; those
 * of shifts are one for each row of B. */
typedef struct hs_trace {
    const hs_search *search;   /* borrowed */
    void            *memory;   /* owned: of the arrays */
    hs_records       of;       /* the candidates */
    int              n_rows;   /* of B, and ... */
    bool             as_given; /* ... whether the metric measures between points as given */
    bool             is_plain; /* shifts over B are those over the box vectors as given */
    int32_t          n;
    int32_t         *place, *si;                    /* of the candidate, and of the asking point */
    double          *p[HS_MAX_DIM], *q[HS_MAX_DIM]; /* what the metric measures between */
    double          *times[HS_MAX_DIM];             /* its shift */
    int64_t         *image[HS_MAX_DIM];             /* shift over B, of X */
    int64_t *given[HS_MAX_DIM]; /* S over the periodic box vectors as given; when needs_given */
    int32_t *shift[HS_MAX_DIM]; /* S as int32, when is_narrow */
    bool     has_zeros;         /* image holds nothing but zeros */
    bool     is_shifted;        /* some entry of times is not zero */
    bool     is_wide;           /* some entry is too large for the batch kernels */
} hs_trace;

/* needs_given: whether S is wanted, or else only what the metric needs. */
hs_status hs_trace_init(const hs_search *search, const hs_block *block, const hs_options *polls,
                        bool needs_given, hs_trace *trace);
void      hs_trace_free(hs_account *account, hs_trace *trace);

/* Makes it ready for what its search has become, with as many axes. False if it has other arrays
 * than that needs. */
bool hs_trace_renew(bool needs_given, hs_trace *trace);

/* Empties the batch. */
HS_ALWAYS_INLINE void
hs_trace_clear(hs_trace *trace)
{
    trace->n = 0;
    trace->is_shifted = trace->is_wide = false;
}

/* Adds the pair of point si with the candidate at a place; there must be room. */
HS_ALWAYS_INLINE void
hs_trace_put(hs_trace *trace, int32_t si, int32_t place)
{
    trace->si[trace->n] = si;
    trace->place[trace->n] = place;
    trace->n++;
}

/* Adds the pairs of point si with the candidates at n places, as far as there is room; returns how
 * many. They are looked up together, because one point has few hits. */
int32_t hs_trace_add(hs_trace *trace, int32_t si, const int32_t *places, int32_t n);

/*
 * Fills the arrays of the batch: S, when needs_given, and unless `metric` is false and S needs
 * nothing else, what the metric measures between. HS_OK; HS_ERR_SHIFT_RANGE when a shift passes its
 * range, with the number of the point; HS_ERR_INTERRUPTED.
 */
hs_status hs_trace_look_up(hs_trace *trace, bool metric, int64_t *failed_point);

/* The batch as the batch kernels take it. */
hs_batch hs_trace_batch(hs_trace *trace);

/* Pair e as the functions of metric.h take it; returns shift, filled, or NULL for none. */
const int64_t *hs_trace_pair(const hs_trace *trace, int32_t e, double *p, double *q,
                             int64_t *shift);

#endif
