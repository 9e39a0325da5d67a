/* SPDX-License-Identifier: BSD-3-Clause */
/* record_shells.c: by the rounded distance where that is far enough from all edges, which are
 * nearly all pairs; the others are decided exactly, those at one edge together. */
#include "record_shells.h"

#include "../search/decide.h"
#include "../search/shells.h"

/* A pair that is beyond `low` edges, at most `high`. */
typedef struct open_pair {
    int32_t hit, si;
    int32_t low, high;
} open_pair;

/* Pairs that are to be decided, and where their shells go. */
typedef struct open_pairs {
    hs_scanner    *scanner;
    const int32_t *places;
    double        *distance;
    int32_t       *shell;
    int32_t        n;
    open_pair      pair[HS_BATCH];
} open_pairs;

/* Traces the open pairs whose next edge is this one; of[e]: which of them is pair e. */
static hs_status
trace_at(const open_pairs *open, int32_t edge, int32_t *of)
{
    hs_trace *trace = &open->scanner->trace;
    hs_trace_clear(trace);
    for (int32_t u = 0; u < open->n; u++) {
        const open_pair *pair = &open->pair[u];
        if (pair->low == edge) {
            of[trace->n] = u;
            hs_trace_put(trace, pair->si, open->places[pair->hit]);
        }
    }
    return hs_trace_look_up(trace, true, &open->scanner->failed_point);
}

/* Decides the pairs that are traced at this edge. */
static void
decide_at(open_pairs *open, int32_t edge, const int32_t *of)
{
    const hs_metric *given = &open->scanner->search->scene.metric;
    const hs_shells *shells = &open->scanner->search->shells;
    hs_metric        metric;
    uint8_t          within[HS_BATCH];
    hs_metric_init(&metric, given->ndim, given->n_rows, (const double(*)[HS_MAX_DIM])given->rows,
                   shells->at[edge], shells->inclusive);
    hs_decide_traced(open->scanner, &metric, within);
    for (int32_t e = 0; e < open->scanner->trace.n; e++) {
        open_pair *pair = &open->pair[of[e]];
        if (within[e]) {
            pair->high = edge;
        } else {
            pair->low = edge + 1;
        }
    }
}

/* Writes those that are decided, and keeps the others. */
static void
put_decided(open_pairs *open)
{
    const hs_shells *shells = &open->scanner->search->shells;
    int32_t          n = 0;
    for (int32_t u = 0; u < open->n; u++) {
        const open_pair pair = open->pair[u];
        if (pair.low < pair.high) {
            open->pair[n++] = pair;
        } else {
            double *distance = &open->distance[pair.hit];
            *distance = hs_shells_keep(shells, pair.low, *distance);
            open->shell[pair.hit] = pair.low;
        }
    }
    open->n = n;
}

static hs_status
decide_open(open_pairs *open)
{
    int32_t of[HS_BATCH];
    open->scanner->n_ambiguous += open->n;
    while (open->n > 0) {
        const int32_t   edge = open->pair[0].low;
        const hs_status status = trace_at(open, edge, of);
        if (status != HS_OK) {
            return status;
        }
        decide_at(open, edge, of);
        put_decided(open);
    }
    return HS_OK;
}

/* Looks again at the distances that are too near to an edge. */
static hs_status
look_again(open_pairs *open, int32_t first, const hs_hits *hits)
{
    const hs_shells *shells = &open->scanner->search->shells;
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        for (; h < hits->end[t]; h++) {
            int32_t low = open->shell[h], high;
            hs_shells_range(shells, open->distance[h], &low, &high);
            open->shell[h] = low;
            if (low < high) {
                open->pair[open->n++] = (open_pair){h, first + t, low, high};
            }
            if (open->n == HS_BATCH) {
                const hs_status status = decide_open(open);
                if (status != HS_OK) {
                    return status;
                }
            }
        }
    }
    return decide_open(open);
}

hs_status
hs_put_shells(const hs_recorder *recorder, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    const hs_shells *shells = &scanner->search->shells;
    const int32_t    n = hits->end[hits->n - 1];
    open_pairs       open; /* large, and seldom used: not cleared */
    if (!(recorder->columns & HS_WANT_SHELL)) {
        return HS_OK;
    }
    open.scanner = scanner;
    open.places = hits->label;
    open.distance = hs_recorder_distances(recorder);
    open.shell = hs_output_next(recorder->output, HS_WANT_SHELL);
    open.n = 0;
    const bool is_open = hs_shells_find(shells, open.distance, n, open.shell);
    return is_open ? look_again(&open, first, hits) : HS_OK;
}
