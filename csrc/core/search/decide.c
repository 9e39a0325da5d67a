/* SPDX-License-Identifier: BSD-3-Clause */
/* decide.c: a batch of pairs at a time by the batch kernel; pairs that it leaves, one by one. */
#include "decide.h"

#include "../exact/metric_float.h"
#include "limits.h"
#include "supports.h"

#include <math.h>
#include <string.h>

/* A fraction of the square of the cutoff, far above the rounding of a sum of 8 squares. */
#define SCALED_MARGIN 0x1p-47

/* Takes the first n of scan->unsure from the hits of points [first, next). */
static void
remove_hits(hs_scan *scan, int32_t n, int32_t first, int32_t next)
{
    int32_t t = first, removed = 0;
    for (int32_t r = 0; r < n; r++) {
        for (; t < scan->unsure[r].t; t++) {
            scan->end[t] -= removed;
        }
        const int32_t from = scan->unsure[r].at + 1;
        const int32_t to = r + 1 < n ? scan->unsure[r + 1].at : (int32_t)scan->n_hits;
        memmove(scan->hits + from - removed - 1, scan->hits + from,
                (size_t)(to - from) * sizeof *scan->hits);
        removed++;
    }
    for (; t < next; t++) {
        scan->end[t] -= removed;
    }
}

/* Takes the first n of scan->unsure from the counts, where hits are not listed. */
static void
remove_counts(hs_scan *scan, int32_t n, int32_t first, int32_t next)
{
    int32_t removed = 0;
    for (int32_t t = first; t < next; t++) {
        while (removed < n && scan->unsure[removed].t == t) {
            removed++;
        }
        scan->end[t] -= removed;
    }
}

/* Decides one pair of the batch, by all stages or by the last alone. */
static bool
decide_pair(hs_scanner *scanner, const hs_metric *metric, int32_t e, bool others_failed)
{
    double         p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t        of_pair[HS_MAX_DIM];
    const int64_t *shift = hs_trace_pair(&scanner->trace, e, p, q, of_pair);
    if (scanner->options.precision == HS_DOUBLE) {
        return hs_metric_within_double(metric, p, q, shift);
    }
    return others_failed ? hs_metric_settle(metric, p, q, shift, &scanner->stages)
                         : hs_metric_within(metric, p, q, shift, &scanner->stages);
}

/*
 * Where squares would leave float64's range: judges differences that are scaled so that the cutoff
 * is r in [1, 2). Rounding and what scaling loses change the sum of d squares, where it is near
 * r^2, by at most (d + 4) 2^-53 of it. Pairs without a shift only.
 */
static void
judge_scaled(const hs_metric *metric, const hs_trace *trace, uint8_t *verdict, hs_stages *stages)
{
    const hs_scale scale = hs_scale_of(metric->cutoff > 0.0 ? ilogb(metric->cutoff) : 0);
    const double   r = hs_scale_apply(scale, metric->cutoff);
    const double   in = r * r * (1.0 - SCALED_MARGIN), out = r * r * (1.0 + SCALED_MARGIN);
    double         square[HS_BATCH] = {0.0}, size[HS_BATCH] = {0.0};
    for (int k = 0; k < metric->ndim; k++) {
        for (int32_t e = 0; e < trace->n; e++) {
            const double component = trace->q[k][e] - trace->p[k][e];
            const double scaled = hs_scale_apply(scale, component);
            square[e] += scaled * scaled;
            size[e] += fabs(component); /* for cutoff 0: 0 only if all are */
        }
    }
    for (int32_t e = 0; e < trace->n; e++) {
        const bool within = r > 0.0 ? square[e] < in : size[e] == 0.0 && metric->inclusive;
        const bool beyond = r > 0.0 ? square[e] > out : !within;
        verdict[e] = within   ? (uint8_t)HS_WITHIN
                     : beyond ? (uint8_t)HS_BEYOND
                              : (uint8_t)HS_UNDECIDED;
        stages->by_float64 += within || beyond;
    }
}

void
hs_decide_traced(hs_scanner *scanner, const hs_metric *metric, uint8_t *within)
{
    hs_trace  *trace = &scanner->trace;
    const bool by_batch = scanner->options.precision != HS_DOUBLE && !trace->is_wide;
    uint8_t    verdict[HS_BATCH + HS_BATCH_PADDING];
    if (by_batch && !metric->floats_usable && !trace->is_shifted) {
        judge_scaled(metric, trace, verdict, &scanner->stages);
    } else if (by_batch) {
        const hs_batch batch = hs_trace_batch(trace);
        scanner->search->call->kernel->judge(metric, &batch, verdict, &scanner->stages);
    }
    for (int32_t e = 0; e < trace->n; e++) {
        within[e] = by_batch && verdict[e] != HS_UNDECIDED
                        ? verdict[e] == HS_WITHIN
                        : decide_pair(scanner, metric, e, by_batch);
    }
}

/* Decides one pair of the batch, whose limit is its own. */
static bool
decide_by_limit(hs_scanner *scanner, int32_t e, hs_dw limit)
{
    double         p[HS_MAX_DIM], q[HS_MAX_DIM];
    int64_t        of_pair[HS_MAX_DIM];
    hs_metric      metric = scanner->search->scene.metric;
    const int64_t *shift = hs_trace_pair(&scanner->trace, e, p, q, of_pair);
    if (limit.hi < 0.0) {
        return false;
    }
    if (scanner->options.precision == HS_SINGLE) {
        return scanner->options.inclusive; /* its square is that of the limit */
    }
    if (scanner->options.precision == HS_DOUBLE) {
        hs_metric_set_cutoff(limit.hi, &metric);
        return hs_metric_within_double(&metric, p, q, shift);
    }
    return hs_metric_within_sum(&metric, limit, p, q, shift, &scanner->stages);
}

/* Whether each pair of the batch is within its own limit. Where that is one number, as for points
 * of one size in a crystal, they are decided together. */
static void
decide_by_limits(hs_scanner *scanner, uint8_t *within)
{
    const int32_t n = scanner->trace.n;
    hs_dw         limits[HS_BATCH];
    bool          is_one = scanner->options.precision != HS_SINGLE;
    for (int32_t e = 0; e < n; e++) {
        limits[e] = hs_limit_of_pair(scanner, e);
        is_one = is_one && limits[e].hi == limits[0].hi && limits[e].hi >= 0.0 &&
                 limits[e].lo == 0.0;
    }
    if (is_one) {
        hs_metric metric = scanner->search->scene.metric;
        hs_metric_set_cutoff(limits[0].hi, &metric);
        hs_decide_traced(scanner, &metric, within);
        return;
    }
    for (int32_t e = 0; e < n; e++) {
        within[e] = decide_by_limit(scanner, e, limits[e]);
    }
}

/* Whether each pair of the batch is within its supports, and within the cutoff where these reach
 * further. Supports of no extent hold nothing but D = 0. */
static void
decide_by_supports(hs_scanner *scanner, uint8_t *within)
{
    const hs_supports *supports = scanner->search->limits->supports;
    hs_metric          ball = scanner->search->scene.metric;
    uint8_t            in_ball[HS_BATCH];
    if (supports->metric.limit.cutoff == 0.0) {
        hs_metric_set_cutoff(0.0, &ball);
        hs_decide_traced(scanner, &ball, within);
        return;
    }
    hs_supports_decide(scanner, within);
    if (supports->is_bounded) {
        const hs_stages counted = scanner->stages;
        hs_decide_traced(scanner, &ball, in_ball);
        scanner->stages = counted; /* a pair counts once */
        for (int32_t e = 0; e < scanner->trace.n; e++) {
            within[e] = within[e] && in_ball[e];
        }
    }
}

/* Traces unsure hits from `u` on, as many as fit a batch; *next: the first that did not. */
static hs_status
trace_unsure(hs_scanner *scanner, const hs_scan *scan, int32_t u, int32_t *next)
{
    hs_trace *trace = &scanner->trace;
    hs_trace_clear(trace);
    for (; u < scan->n_unsure && trace->n < HS_BATCH; u++) {
        const hs_unsure unsure = scan->unsure[u];
        hs_trace_put(trace, scanner->group.first + unsure.t,
                     scanner->is_ordered ? scanner->block.origin[unsure.place] : unsure.place);
    }
    *next = u;
    return hs_trace_look_up(trace, true, &scanner->failed_point);
}

hs_status
hs_decide(hs_scanner *scanner, hs_scan *scan, int32_t first, int32_t next)
{
    int32_t n_beyond = 0;
    uint8_t within[HS_BATCH];
    for (int32_t u = 0, end; u < scan->n_unsure; u = end) {
        const hs_status status = trace_unsure(scanner, scan, u, &end);
        if (status != HS_OK) {
            return status;
        }
        if (scanner->search->limits != NULL && scanner->search->limits->supports != NULL) {
            decide_by_supports(scanner, within);
        } else if (scanner->search->limits != NULL) {
            decide_by_limits(scanner, within);
        } else {
            hs_decide_traced(scanner, &scanner->search->scene.metric, within);
        }
        for (int32_t e = 0; e < end - u; e++) {
            scan->unsure[n_beyond] = scan->unsure[u + e]; /* those beyond gather in front */
            n_beyond += !within[e];
        }
    }
    scanner->n_ambiguous += scan->n_unsure;
    if (n_beyond > 0 && scanner->scans == HS_BLOCK_COUNTS) {
        remove_counts(scan, n_beyond, first, next);
    } else if (n_beyond > 0) {
        remove_hits(scan, n_beyond, first, next);
    }
    scan->n_hits -= n_beyond;
    return HS_OK;
}
