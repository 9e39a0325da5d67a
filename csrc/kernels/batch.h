/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * batch.h: the contract of the batch kernels: the float stages of the decision
 * (core/exact/metric.h) and the measuring of D, for many pairs at once.
 *
 * Both give, pair by pair, what the functions of core/exact/metric.h give for one pair: equal
 * verdicts by the same stages, equal bits. They leave to those functions what they cannot do. They
 * must be called with round to nearest and without flushing, too.
 */
#ifndef HS_BATCH_H
#define HS_BATCH_H

#include "../core/base/base.h"
#include "../core/exact/metric.h"

/* Arrays of a batch, also those that are written to, have room for n entries rounded up to a
 * multiple of this, the lanes of the widest vectors. Past n they hold any finite numbers; zeros
 * will do. */
#define HS_BATCH_PADDING 8

/* A good number of pairs: the arrays of so many in 3-D take 27 kB, so they stay in the first-level
 * cache. Measured: from 64 to 1024 the time per pair changes by less than the noise. */
#define HS_BATCH 128

/* n pairs, one array per number. Borrowed; 64-byte alignment is faster but not needed. */
typedef struct hs_batch {
    int32_t       n;
    const double *p[HS_MAX_DIM], *q[HS_MAX_DIM]; /* finite; one array per axis */
    /* One array per row of the metric: whole numbers of at most 2^53. All NULL when no pair is
     * shifted. A pair whose shifts are all zero counts as not shifted. */
    const double *shift[HS_MAX_DIM];
} hs_batch;

/*
 * verdict[e] is an hs_verdict (core/exact/metric.h). HS_UNDECIDED leaves pair e to
 * hs_metric_decide_by_integers. Adds the pairs that it decides to *stages.
 */
typedef void (*hs_decide_batch_fn)(const hs_metric *metric, const hs_batch *batch, uint8_t *verdict,
                                   hs_stages *stages);

/*
 * distance[e] and vector[k][e] as hs_metric_measure; vector is NULL or has an array for every axis.
 * done[e] is 1, or 0 for a pair that must be left to hs_metric_measure.
 */
typedef void (*hs_measure_fn)(const hs_metric *metric, const hs_batch *batch, double *distance,
                              double *const *vector, uint8_t *done);

/* batch_baseline.c: what every CPU of this kind can do. */
void hs_decide_batch_baseline(const hs_metric *metric, const hs_batch *batch, uint8_t *verdict,
                              hs_stages *stages);
void hs_measure_baseline(const hs_metric *metric, const hs_batch *batch, double *distance,
                         double *const *vector, uint8_t *done);

/* wide_avx2.c, wide_avx512.c: x86-64 only. */
void hs_decide_batch_avx2(const hs_metric *metric, const hs_batch *batch, uint8_t *verdict,
                          hs_stages *stages);
void hs_measure_avx2(const hs_metric *metric, const hs_batch *batch, double *distance,
                     double *const *vector, uint8_t *done);
void hs_decide_batch_avx512(const hs_metric *metric, const hs_batch *batch, uint8_t *verdict,
                            hs_stages *stages);
void hs_measure_avx512(const hs_metric *metric, const hs_batch *batch, double *distance,
                       double *const *vector, uint8_t *done);

#endif
