/* SPDX-License-Identifier: BSD-3-Clause */
/* tally.c: slots of all hits by table; hits that stay unsure wait for the edge that halves their
 * range, and a batch decides them. */
#include "tally.h"

#include "../search/decide.h"

#include <math.h>

/* Slots up to which a histogram has copies: together they stay in the first-level cache. */
#define FEW_SLOTS 1024

static bool
allocate(hs_tally *tally, int32_t block_capacity, int32_t most_hits)
{
    const hs_tally_plan *plan = tally->plan;
    hs_account          *account = plan->account;
    const int64_t        n_counts = tally->n_copies * plan->n_groups * tally->n_slots;
    tally->counts = hs_alloc(account, HS_FOR_CANDIDATES, n_counts, sizeof(int64_t));
    tally->slots = hs_alloc(account, HS_FOR_CANDIDATES, most_hits, sizeof(int32_t));
    tally->open = hs_alloc(account, HS_FOR_CANDIDATES, HS_TALLY_OPEN, sizeof(hs_tally_open));
    tally->asked = hs_alloc(account, HS_FOR_CANDIDATES, HS_TALLY_OPEN, sizeof(int32_t));
    tally->waiting = hs_alloc(account, HS_FOR_CANDIDATES, plan->edges.n, sizeof(int32_t));
    bool complete = tally->counts != NULL && tally->slots != NULL && tally->open != NULL &&
                    tally->asked != NULL && tally->waiting != NULL;
    if (complete && plan->has_types) {
        tally->type = hs_alloc(account, HS_FOR_CANDIDATES, block_capacity, sizeof(int32_t));
        complete = tally->type != NULL;
    }
    if (complete && plan->sums) {
        tally->value = hs_alloc(account, HS_FOR_CANDIDATES, block_capacity, sizeof(int64_t));
        tally->place = hs_alloc(account, HS_FOR_CANDIDATES, block_capacity, sizeof(int32_t));
        complete = tally->value != NULL && tally->place != NULL &&
                   hs_sums_init(account, plan->n_groups * (plan->edges.n + 1),
                                &plan->asking->weights, &plan->points.weights,
                                &tally->sums) == HS_OK;
    }
    return complete;
}

hs_status
hs_tally_init(const hs_tally_plan *plan, int32_t block_capacity, int32_t most_hits, hs_tally *tally)
{
    *tally = (hs_tally){.plan = plan, .n_slots = 2 * plan->edges.n + 1, .block = -1};
    tally->n_copies = !plan->has_types && tally->n_slots <= FEW_SLOTS ? HS_TALLY_COPIES : 1;
    if (!allocate(tally, block_capacity, most_hits)) {
        hs_tally_free(tally);
        return HS_ERR_MEMORY;
    }
    memset(tally->counts, 0,
           (size_t)(tally->n_copies * plan->n_groups * tally->n_slots) * sizeof(int64_t));
    for (int64_t k = 0; k < plan->edges.n; k++) {
        tally->waiting[k] = -1;
    }
    return HS_OK;
}

void
hs_tally_free(hs_tally *tally)
{
    if (tally->plan == NULL) {
        return;
    }
    hs_account *account = tally->plan->account;
    for (int e = 0; e < HS_TALLY_TABLES; e++) {
        hs_edge_table_free(&tally->tables[e]);
    }
    hs_free(account, tally->counts);
    hs_free(account, tally->slots);
    hs_free(account, tally->open);
    hs_free(account, tally->asked);
    hs_free(account, tally->waiting);
    hs_free(account, tally->type);
    hs_free(account, tally->value);
    hs_free(account, tally->place);
    hs_sums_free(account, &tally->sums);
    *tally = (hs_tally){.plan = NULL};
}

int64_t
hs_tally_count(const hs_tally *tally, int64_t group, int64_t n_reached)
{
    int64_t sum = 0;
    for (int copy = 0; copy < tally->n_copies; copy++) {
        const int64_t *counts =
            tally->counts + (copy * tally->plan->n_groups + group) * tally->n_slots;
        sum += counts[2 * n_reached];
    }
    return sum;
}

/* The table for groups up to this extent, rounded up to a power of two so that there are few. */
static const hs_edge_table *
table_for(hs_tally *tally, double extent)
{
    int exponent = 0;
    if (!(extent > 0.0) || !isfinite(extent)) { /* NaN, with which nothing is sure, or one point */
        extent = extent == 0.0 ? 0x1p-1000 : INFINITY;
    } else if (frexp(extent, &exponent) > 0.5) {
        extent = ldexp(1.0, exponent);
    }
    hs_edge_table *table = &tally->tables[(unsigned)exponent % HS_TALLY_TABLES];
    if (table->extent != extent &&
        hs_edge_table_build(&tally->plan->edges, extent, table) != HS_OK) {
        return NULL;
    }
    return table;
}

/* Types and weights of the candidates, once for each block. */
static void
load_block(hs_tally *tally, const hs_scanner *scanner)
{
    const hs_block   *block = &scanner->block;
    const hs_weights *weights = &tally->plan->points.weights;
    if (tally->block == scanner->n_blocks || (tally->type == NULL && tally->value == NULL)) {
        return;
    }
    tally->block = scanner->n_blocks;
    for (int32_t c = 0; tally->value != NULL && c < block->n; c++) {
        const int32_t si = block->number[c];
        tally->value[c] = weights->value != NULL ? weights->value[si] : 1;
        tally->place[c] = weights->place != NULL ? weights->place[si] : 0;
    }
    for (int32_t c = 0; tally->type != NULL && c < block->n; c++) {
        tally->type[c] = tally->plan->points.type[block->number[c]];
    }
}

/* The groups of pairs of point si, by the type of the other point. */
static const int32_t *
groups_of(const hs_tally *tally, int32_t si)
{
    const hs_tally_plan *plan = tally->plan;
    return plan->group + (int64_t)plan->asking->type[si] * plan->n_types;
}

static int64_t
group_of(const hs_tally *tally, int32_t si, int32_t place)
{
    return tally->plan->has_types ? groups_of(tally, si)[tally->type[place]] : 0;
}

/* The weight of point si. */
static int64_t
weight_of(const hs_tally *tally, int32_t si, int32_t *place)
{
    const hs_weights *weights = &tally->plan->asking->weights;
    *place = weights->place != NULL ? weights->place[si] : 0;
    return weights->value != NULL ? weights->value[si] : 1;
}

/* The sum of a group for pairs that reach so many edges. */
static int64_t *
limbs_of(const hs_tally *tally, int64_t group, int32_t n_reached)
{
    const int64_t n_bins = tally->plan->edges.n + 1;
    return tally->sums.limbs + (group * n_bins + n_reached) * tally->sums.n_limbs;
}

static void
sum_pair(hs_tally *tally, int64_t group, int32_t si, int32_t candidate, int32_t n_reached)
{
    int32_t       place;
    const int64_t value = weight_of(tally, si, &place);
    hs_sums_expect(&tally->sums, 1);
    hs_sums_add(limbs_of(tally, group, n_reached), value, tally->value[candidate],
                place + tally->place[candidate]);
}

static void
count_plain(hs_tally *tally, int32_t n)
{
    const int32_t *slots = tally->slots;
    const int64_t  n_slots = tally->n_slots;
    int64_t       *counts = tally->counts;
    int32_t        h = 0;
    for (; tally->n_copies == HS_TALLY_COPIES && h + HS_TALLY_COPIES <= n; h += HS_TALLY_COPIES) {
        counts[slots[h]]++;
        counts[n_slots + slots[h + 1]]++;
        counts[2 * n_slots + slots[h + 2]]++;
        counts[3 * n_slots + slots[h + 3]]++;
    }
    for (; h < n; h++) {
        counts[slots[h]]++;
    }
}

/* Counts hits [begin, end) of point si. */
static void
count_typed(hs_tally *tally, int32_t si, const int32_t *places, int32_t begin, int32_t end)
{
    const int32_t *groups = groups_of(tally, si), *type = tally->type;
    for (int32_t h = begin; h < end; h++) {
        tally->counts[groups[type[places[h]]] * tally->n_slots + tally->slots[h]]++;
    }
}

/* Sums weights of the hits of point si whose slots are even; those beyond the last edge add to a
 * sum that is never read. has_places: otherwise all places of weights are 0. */
HS_ALWAYS_INLINE void
sum_hits(hs_tally *tally, int32_t si, const int32_t *places, int32_t begin, int32_t end,
         const bool has_places)
{
    int32_t        own_place;
    const int64_t  own = weight_of(tally, si, &own_place), *value = tally->value;
    const int64_t  n_limbs = tally->sums.n_limbs;
    const int32_t *slots = tally->slots;
    int64_t       *first = tally->sums.limbs;
    hs_sums_expect(&tally->sums, end - begin);
    for (int32_t h = begin; h < end; h++) {
        const int32_t place = has_places ? own_place + tally->place[places[h]] : 0;
        if (!(slots[h] & 1)) {
            int64_t *limbs = tally->plan->has_types
                                 ? limbs_of(tally, group_of(tally, si, places[h]), slots[h] / 2)
                                 : first + slots[h] / 2 * n_limbs;
            hs_sums_add(limbs, own, value[places[h]], place);
        }
    }
}

/* An open pair whose range is empty is decided; others wait for the edge in the middle. */
static void
settle_or_wait(hs_tally *tally, int32_t u)
{
    hs_tally_open *pair = &tally->open[u];
    if (pair->low < pair->high) {
        const int32_t edge = pair->low + (pair->high - pair->low) / 2;
        if (tally->waiting[edge] < 0) {
            tally->asked[tally->n_asked++] = edge;
        }
        pair->next = tally->waiting[edge];
        tally->waiting[edge] = u;
        return;
    }
    const int64_t group = group_of(tally, pair->si, pair->place);
    if (tally->plan->sums) {
        sum_pair(tally, group, pair->si, pair->place, pair->low);
    }
    tally->counts[group * tally->n_slots + 2 * pair->low]++;
}

/* Traces pairs that wait for an edge, from u on; *next: the first that did not fit the batch. */
static hs_status
trace_waiting(hs_tally *tally, hs_scanner *scanner, int32_t u, int32_t *next)
{
    hs_trace *trace = &scanner->trace;
    hs_trace_clear(trace);
    while (u >= 0 && trace->n < HS_BATCH) {
        hs_trace_put(trace, tally->open[u].si, tally->open[u].place);
        u = tally->open[u].next;
    }
    *next = u;
    return hs_trace_look_up(trace, true, &scanner->failed_point);
}

/* Decides all pairs that wait for one edge. */
static hs_status
decide_edge(hs_tally *tally, hs_scanner *scanner, int32_t edge)
{
    const hs_metric *given = &scanner->search->scene.metric;
    const hs_edges  *edges = &tally->plan->edges;
    hs_metric        metric;
    uint8_t          within[HS_BATCH];
    int32_t          u = tally->waiting[edge], end;
    tally->waiting[edge] = -1;
    hs_metric_init(&metric, given->ndim, given->n_rows, (const double(*)[HS_MAX_DIM])given->rows,
                   edges->at[edge], hs_edge_is_inclusive(edges, edge));
    while (u >= 0) {
        const hs_status status = trace_waiting(tally, scanner, u, &end);
        if (status != HS_OK) {
            return status;
        }
        hs_decide_traced(scanner, &metric, within);
        for (int32_t e = 0; u != end; e++) {
            hs_tally_open *pair = &tally->open[u];
            const int32_t  next = pair->next;
            if (within[e]) {
                pair->high = edge;
            } else {
                pair->low = edge + 1;
            }
            settle_or_wait(tally, u);
            u = next;
        }
    }
    return HS_OK;
}

/* Decides all open pairs. */
static hs_status
decide_open(hs_tally *tally, hs_scanner *scanner)
{
    hs_status status = HS_OK;
    scanner->n_ambiguous += tally->n_open;
    for (int32_t u = 0; u < tally->n_open; u++) {
        settle_or_wait(tally, u);
    }
    while (status == HS_OK && tally->n_asked > 0) {
        status = decide_edge(tally, scanner, tally->asked[--tally->n_asked]);
    }
    tally->n_open = 0;
    return status;
}

/* Looks again at hits with odd slots. */
static hs_status
look_again(hs_tally *tally, hs_scanner *scanner, const hs_edge_table *table, int32_t first,
           const hs_hits *hits)
{
    hs_status status = HS_OK;
    for (int32_t t = 0, h = 0; t < hits->n; t++) {
        for (; h < hits->end[t]; h++) {
            if (!(tally->slots[h] & 1)) {
                continue;
            }
            hs_tally_open *pair = &tally->open[tally->n_open];
            *pair = (hs_tally_open){.si = first + t, .place = hits->label[h]};
            hs_edge_range(table, &tally->plan->edges, scanner->block.squares[h], &pair->low,
                          &pair->high);
            if (pair->low == pair->high) { /* of a cell with several bands, but in none of these */
                settle_or_wait(tally, tally->n_open);
            } else if (++tally->n_open == HS_TALLY_OPEN) {
                status = decide_open(tally, scanner);
            }
            if (status != HS_OK) {
                return status;
            }
        }
    }
    return decide_open(tally, scanner);
}

hs_status
hs_tally_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_tally            *tally = context;
    const hs_edge_table *table = table_for(tally, scanner->form->extent);
    const int32_t        n = hits->end[hits->n - 1];
    if (table == NULL) {
        return HS_ERR_MEMORY;
    }
    load_block(tally, scanner);
    const bool has_places = tally->plan->points.weights.place != NULL ||
                            tally->plan->asking->weights.place != NULL;
    const bool is_open = hs_edge_slots(table, scanner->block.squares, n, tally->slots);
    if (!tally->plan->has_types) {
        count_plain(tally, n);
    }
    for (int32_t t = 0, begin = 0; t < hits->n; t++) {
        const int32_t end = hits->end[t];
        if (tally->plan->has_types) {
            count_typed(tally, first + t, hits->label, begin, end);
        }
        if (tally->plan->sums && has_places) {
            sum_hits(tally, first + t, hits->label, begin, end, true);
        } else if (tally->plan->sums) {
            sum_hits(tally, first + t, hits->label, begin, end, false);
        }
        begin = end;
    }
    return is_open ? look_again(tally, scanner, table, first, hits) : HS_OK;
}
