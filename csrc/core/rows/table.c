/* SPDX-License-Identifier: BSD-3-Clause */
#include "table.h"
#include "../base/sort.h"
#include "../collect/parallel.h"
#include "../collect/sort_pairs.h"

#include <math.h>
#include <string.h>

/* table.c: lengths of table rows by a counting walk, or by the one walk that keeps them; their sums
 * are the offsets. Hits come in the order of the table; the point itself is left out, the others
 * are recorded as those of any list, and each column of a row is copied to its place. Where pairs
 * are few and candidates many, a list of pairs is found and sorted instead. */

/* Bytes of rows that wait for their places. */
#define MOST_KEPT (6 << 20)

/* A table that is being made. */
typedef struct table {
    hs_search       *search; /* borrowed, as are the next two */
    hs_output       *entries;
    int64_t         *offsets;
    hs_neighbourhood most; /* the largest neighbourhood */
    hs_output        kept; /* owned; rows in cell order, until they have places */
} table;

/* What one thread fills rows with; the context of put_rows. */
typedef struct row_filler {
    table      *all;
    hs_output  *to;       /* borrowed; the rows of one visit, or all that are kept */
    hs_output   visit;    /* owned */
    hs_recorder recorder; /* owned; of `to` */
} row_filler;

/* The place of the group's first point itself among the candidates as gathered; the others follow
 * it. */
static int32_t
own_place(const hs_scanner *scanner)
{
    const hs_block *block = &scanner->block;
    const int       m = scanner->search->bins.n_periodic;
    for (const hs_run *run = block->runs; run < block->runs + block->n_runs; run++) {
        bool is_home = true;
        for (int r = 0; r < m; r++) {
            is_home = is_home && run->image[r] == 0;
        }
        for (int32_t place = run->at; is_home && place < run[1].at; place++) {
            if (block->number[place] == scanner->group.first) {
                return place;
            }
        }
    }
    return -1;
}

/* The hits that the rows of a visit have: no point itself, and where each pair is listed once,
 * none that is before it. end: receives where those of each point end. */
static hs_hits
hits_of_rows(hs_scanner *scanner, int32_t first, const hs_hits *hits, int32_t *end)
{
    const hs_search *search = scanner->search;
    const bool       by_place = scanner->use == HS_BLOCK_LISTS_PLACES;
    int32_t         *label = scanner->block.hits, to = 0;
    hs_hits          rows = *hits;
    if (search->has_queries) {
        return rows;
    }
    const int32_t own = by_place ? own_place(scanner) + first - scanner->group.first : 0;
    for (int32_t t = 0, from = 0; t < hits->n; t++) {
        const int32_t *of = label + from, n = hits->end[t] - from;
        const int32_t  itself = by_place ? own + t : hits->point[t];
        int32_t        below = 0, equal = 0, at = 0;  /* at: which hit is the point itself */
        for (int32_t h = 0; by_place && h < n; h++) { /* all of them: a branch costs more */
            at |= of[h] == itself ? h : 0;
        }
        for (int32_t h = 0; !by_place && h < n; h++) {
            below += of[h] < itself;
            equal += of[h] == itself;
        }
        if (!by_place) { /* they ascend: as many images of it are before it as behind it */
            HS_ASSERT(equal % 2 == 1);
            at = below + equal / 2;
        }
        HS_ASSERT(at < n && of[at] == itself);
        if (!search->is_half) {
            memmove(label + to, of, (size_t)at * sizeof *of);
            to += at;
        }
        memmove(label + to, of + at + 1, (size_t)(n - at - 1) * sizeof *of);
        to += n - at - 1;
        end[t] = to;
        from = hits->end[t];
    }
    rows.end = end;
    return rows;
}

/* A hs_visit_fn of ordered walkers: whole rows, to their places by the offsets; or kept, one
 * behind another, and their lengths as offsets. HS_TRY_OTHER when more than MOST_KEPT are kept. */
static hs_status
put_rows(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    row_filler     *fill = context;
    hs_output      *to = fill->to;
    int64_t        *offsets = fill->all->offsets;
    int32_t         end[HS_GROUP_POINTS];
    const hs_hits   rows = hits_of_rows(scanner, first, hits, end);
    const int32_t   n = rows.end[rows.n - 1];
    const hs_status status = n > 0 ? hs_record_hits(&fill->recorder, scanner, first, &rows) : HS_OK;
    if (status != HS_OK) {
        return status;
    }
    if (to != &fill->visit) {
        for (int32_t t = 0, from = 0; t < rows.n; from = rows.end[t++]) {
            offsets[rows.point[t] + 1] = rows.end[t] - from;
        }
        return to->n_pairs * hs_output_bytes_per_pair(to) > MOST_KEPT ? HS_TRY_OTHER : HS_OK;
    }
    hs_output_place(fill->all->entries, offsets, to, rows.point, rows.n,
                    hs_search_asking(scanner->search)->n - first);
    to->n_pairs = 0;
    return HS_OK;
}

/* A hs_visitor's open. */
static hs_status
open_filler(void *context, void *filler, const hs_walker *walker)
{
    table           *all = context;
    row_filler      *fill = filler;
    const hs_output *entries = all->entries;
    fill->all = all;
    fill->to = all->kept.columns != 0 ? &all->kept : &fill->visit;
    hs_output_init(NULL, entries->ndim, entries->columns, entries->index_bytes, &fill->visit);
    return hs_recorder_init(&all->search->call->account, fill->to, walker->scanner.block.most_hits,
                            &fill->recorder);
}

/* A hs_visitor's close. */
static void
close_filler(void *all, void *filler)
{
    row_filler *fill = filler;
    hs_recorder_free(&((table *)all)->search->call->account, &fill->recorder);
    hs_output_free(&fill->visit);
}

/* The walk that finds all rows, which it keeps, or writes to their places. */
static hs_status
walk_rows(table *all, hs_failure *failure)
{
    const hs_visitor filler = {.use = hs_record_use(all->entries->columns),
                               .most = &all->most,
                               .visit = put_rows,
                               .shared = all,
                               .state_size = sizeof(row_filler),
                               .open = open_filler,
                               .close = close_filler};
    return hs_parallel_visit(all->search, &filler, NULL, failure);
}

#define MOST_EXPECTED_KEPT (4 << 20) /* bytes; rows are kept when no more than these are expected */

/* A hs_visit_fn; each point belongs to one thread. Listed hits with a higher number than the point
 * count twice, and so do those with its own: the point itself, and images of it on either side. */
static hs_status
count_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    int64_t   *counts = context;
    const bool is_listed = scanner->use != HS_BLOCK_COUNTS;
    (void)first;
    for (int32_t t = 0, begin = 0; t < hits->n; begin = hits->end[t++]) {
        const int32_t  point = hits->point[t], n = hits->end[t] - begin;
        const int32_t *of = hits->label + begin;
        int32_t        twice = 0;
        for (int32_t h = 0; h < n && is_listed; h++) {
            twice += (of[h] >= point) + (of[h] > point);
        }
        counts[point] += is_listed ? twice : n;
    }
    return HS_OK;
}

hs_status
hs_table_count(hs_search *search, int64_t *counts, hs_failure *failure)
{
    const int64_t    n = hs_search_asking(search)->n;
    const bool       halves = search->is_half;
    const hs_visitor visitor = {.use = halves ? HS_BLOCK_LISTS_IDS : HS_BLOCK_COUNTS,
                                .visit = count_hits,
                                .shared = counts};
    if (n > 0) { /* otherwise counts may be NULL */
        memset(counts, 0, (size_t)n * sizeof *counts);
    }
    const hs_status status = hs_parallel_visit(search, &visitor, NULL, failure);
    for (int64_t i = 0; !search->has_queries && i < n; i++) {
        counts[i] -= counts[i] > 0; /* the point itself, unless nothing is within */
        counts[i] /= halves ? 2 : 1;
    }
    return status;
}

/* Where the walks that prepare a table and count its entries end, as parts of the work. */
#define PREPARED 0.1
#define COUNTED  0.4

/* Whether one walk is to find all rows, which are kept until they have places. */
static bool
keeps_all(const table *all)
{
    hs_search   *search = all->search;
    const double expected = search->grid.expected_pairs * search->pairs_per_half;
    return search->call->team == NULL &&
           expected * (double)hs_output_bytes_per_pair(all->entries) < MOST_EXPECTED_KEPT &&
           hs_account_allows(&search->call->account, 2.0 * MOST_KEPT);
}

/* Sets the offsets. Where few entries are expected, one walk finds them, and keeps them. */
static hs_status
measure(table *all, hs_failure *failure)
{
    hs_search    *search = all->search;
    hs_call      *call = search->call;
    int64_t      *offsets = all->offsets;
    const int64_t n = hs_search_asking(search)->n;
    hs_status     status = HS_TRY_OTHER;
    hs_output_init(&call->account, all->entries->ndim, all->entries->columns,
                   all->entries->index_bytes, &all->kept);
    if (keeps_all(all)) {
        const hs_stretch whole = hs_call_begin_part(call, PREPARED, 1.0);
        memset(offsets, 0, (size_t)(n + 1) * sizeof *offsets);
        hs_output_reserve_hint(&all->kept, search->grid.expected_pairs * search->pairs_per_half);
        status = walk_rows(all, failure); /* HS_TRY_OTHER: there are too many entries */
        call->part = whole;
    }
    if (status == HS_TRY_OTHER) {
        const hs_stretch whole = hs_call_begin_part(call, PREPARED, COUNTED);
        hs_output_free(&all->kept);
        all->kept.columns = 0;
        status = hs_table_count(search, offsets + 1, failure);
        call->part = whole;
    }
    offsets[0] = 0;
    hs_starts_of_lengths(offsets, n + 1);
    return status;
}

/* Fills the entries. */
static hs_status
fill(table *all, hs_failure *failure)
{
    const hs_bins *asking = hs_search_asking(all->search);
    if (all->kept.columns != 0) {
        hs_output_place(all->entries, all->offsets, &all->kept, asking->order, asking->n,
                        asking->n);
        return HS_OK;
    }
    const hs_stretch whole = hs_call_begin_part(all->search->call, COUNTED, 1.0);
    const hs_status  status = walk_rows(all, failure);
    all->search->call->part = whole;
    return status;
}

/*
 * What either way costs for each asking point, in units of a candidate that is tested, about a
 * nanosecond. Fitted to 2 to 6 dimensions with 5 to 50 neighbours, within a third; so sorting must
 * seem clearly cheaper.
 */
#define COST_OF_ROW    8.0  /* a row of cells that a group looks through */
#define COST_OF_ORDER  3.0  /* a candidate that a group puts in order */
#define COST_OF_ENTRY  4.0  /* an entry that is sorted ... */
#define COST_OF_CACHED 0.2  /* ... and a byte of it and its measures, in the second-level cache */
#define COST_OF_BYTE   0.5  /* or beyond that */
#define COST_OF_PLACE  3.0  /* an entry that is copied to its place ... */
#define COST_OF_COPIED 0.15 /* ... and a byte of it */
#define KEPT_WALKS     1.5  /* walks over all neighbours in any order: one that orders and keeps, */
#define COUNTED_WALKS  2.0  /* or one that counts and one that orders */
#define CLEARLY        0.7

#define LEAST_SORTED 256       /* asking points: of fewer, walks over many entries cost little: */
#define FEW_ENTRIES  30.0      /* so these must have no more in a row */
#define CACHED       (1 << 20) /* bytes that the second-level cache holds */
#define SORTED_BYTES (6 << 20) /* most bytes for what is found and sorted, and so many ... */
#define SORTED_BY_N  8         /* ... for each asking point */

/* Whether pairs, each once, are found and sorted in less time, within these bytes. */
static bool
sorts(const table *all)
{
    const hs_search *search = all->search;
    const hs_call   *call = search->call;
    const hs_bins   *asking = hs_search_asking(search);
    const unsigned   columns = hs_sort_columns(search);
    const int        ndim = search->scene.ndim;
    const double     n = (double)asking->n;
    if (search->limits != NULL || call->choice != NULL || call->options.precision != HS_EXACT ||
        search->bins.n == 0 || asking->n == 0) {
        return false;
    }
    /* Entries of a row: as many as in an even scene, times what points are closer together. Sparse
     * cells do not tell: then the ball's part of three cells a side, each as wide as the cutoff. */
    const double crowd = hs_larger(hs_search_crowd(search), 1.0);
    double       entries = search->pairs_per_half * search->grid.expected_pairs / n * crowd;
    if (n < LEAST_SORTED && entries > FEW_ENTRIES) {
        return false;
    }
    const double candidates = hs_search_candidates(search) / n;
    if (search->is_sparse) {
        const double part = hs_ball_volume(ndim, 1.0) / pow(3.0, ndim);
        entries = search->pairs_per_half * part * candidates;
    }
    const double pairs = search->has_queries || search->is_half ? entries : 0.5 * entries;
    const double measures = (double)hs_want_bytes(columns & ~(HS_WANT_I | HS_WANT_J), ndim, 4);
    const double found = n * pairs * (double)hs_want_bytes(columns, ndim, 4);
    const double dealt = 2.0 * (double)sizeof(uint64_t); /* of an entry, by j and in its row */
    const double bytes = found + dealt * n * entries;
    const double in_group = asking->squares / n;
    const double walk =
        candidates + COST_OF_ROW * ((double)search->stencil.n_rows + 2.0) / in_group;
    const double once = search->has_queries ? walk : 0.5 * walk;
    const double rows = (keeps_all(all) ? KEPT_WALKS : COUNTED_WALKS) * walk +
                        COST_OF_ORDER * candidates / in_group +
                        entries * (COST_OF_PLACE + COST_OF_COPIED * measures);
    const double of_byte = bytes < CACHED ? COST_OF_CACHED : COST_OF_BYTE;
    const double sorting = entries * (COST_OF_ENTRY + of_byte * (measures + dealt));
    return sorting < CLEARLY * (rows - once) && bytes < SORTED_BYTES + SORTED_BY_N * n &&
           hs_account_allows(&search->call->account, 2.0 * bytes);
}

/* The table, from a list of pairs: each once, but for those of queries. */
static hs_status
sort_list(table *all, hs_failure *failure)
{
    hs_search    *search = all->search;
    hs_call      *call = search->call;
    hs_output    *entries = all->entries, *found = &all->kept;
    const int64_t n = hs_search_asking(search)->n;
    const bool    is_once = search->is_half, both_ways = !is_once && !search->has_queries;
    hs_output_init(&call->account, entries->ndim, hs_sort_columns(search), 4, found);
    hs_status status = search->has_queries ? HS_OK : hs_search_halve(search);
    if (status == HS_OK) {
        status = hs_parallel_record(search, NULL, found, failure);
    }
    if (status == HS_OK && both_ways && (entries->columns & HS_WANT_SHIFT)) {
        status = hs_output_check_opposites(found, failure);
    }
    if (status == HS_OK) {
        status = hs_sort_pairs(call, 0, n, found, both_ways, all->offsets, entries);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (both_ways ? 2.0 : 1.0) * (double)found->n_pairs;
    }
    return status;
}

hs_status
hs_table_find(hs_search *search, hs_output *entries, hs_output *offsets, hs_failure *failure)
{
    hs_call         *call = search->call;
    const hs_visitor sizes = {.use = HS_BLOCK_SIZES};
    table            all = {.search = search, .entries = entries};
    hs_status        status = hs_estimate_by_sample(search, failure);
    if (status == HS_OK) {
        status = hs_output_open_offsets(&call->account, hs_search_asking(search)->n + 1, offsets,
                                        &all.offsets);
    }
    if (status == HS_OK && sorts(&all)) {
        status = sort_list(&all, failure);
        hs_output_free(&all.kept);
        return status;
    }
    /* In a small scene a bound on the largest neighbourhood does, which is small as well. */
    if (status == HS_OK && !hs_walker_bound(search, &all.most)) {
        const hs_stretch whole = hs_call_begin_part(call, 0.0, PREPARED);
        status = hs_parallel_visit(search, &sizes, &all.most, failure);
        call->part = whole;
    }
    /* What each candidate of a neighbourhood takes at least, gathered and sorted. */
    const double each = (double)(sizeof(hs_unsure) + 2 * sizeof(uint64_t) + 4 * sizeof(int32_t)) +
                        (double)(search->scene.ndim + 1) * sizeof(float);
    const double needed = (double)all.most.candidates * each;
    if (status == HS_OK &&
        (all.most.candidates > HS_ORDER_CANDIDATES || !hs_account_allows(&call->account, needed))) {
        failure->search_bytes = needed;
        status = HS_ERR_MEMORY; /* refused before anything is counted */
    }
    if (status == HS_OK) {
        status = measure(&all, failure);
    }
    const int64_t n = status == HS_OK ? all.offsets[hs_search_asking(search)->n] : 0;
    if (status == HS_OK &&
        (entries->fixed ? n > entries->capacity : hs_output_reserve(entries, n, 0.0) != HS_OK)) {
        failure->expected_pairs = (double)n;
        failure->expected_bytes =
            entries->fixed ? 0.0 : (double)n * (double)hs_output_bytes_per_pair(entries);
        status = entries->fixed ? HS_ERR_CAPACITY : HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        entries->n_pairs = n;
        status = hs_touch_output(call->team, &call->options, entries);
    }
    if (status == HS_OK) {
        status = fill(&all, failure);
    }
    hs_output_free(&all.kept);
    return status;
}
