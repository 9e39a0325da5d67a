/* SPDX-License-Identifier: BSD-3-Clause */
#include "table.h"
#include "../base/status.h"
#include "../collect/parallel.h"
#include "../memory/results.h"
#include "../base/os.h"
#include "../search/walk.h"

#include <string.h>

/* table.c: lengths of table rows by a counting walk, or by the one walk that keeps them; their sums
 * are the offsets. Hits come in the order of the table; the point itself is left out, the others
 * are recorded as those of any list, and each column of a row is copied to its place. */

/* Bytes of rows that wait for their places. */
#define MOST_KEPT (6 << 20)

/* What one thread fills rows with; the context of put_rows. */
typedef struct row_filler {
    hs_table   *table;
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

/* Which of a point's n hits, which are places, is the point itself. */
static int32_t
find_place(const int32_t *places, int32_t n, int32_t own)
{
    int32_t at = 0;
    for (int32_t h = 0; h < n; h++) { /* all of them: a branch costs more */
        at |= places[h] == own ? h : 0;
    }
    HS_ASSERT(at < n && places[at] == own);
    return at;
}

/* The same where hits are numbers, ascending: as many images of the point are before it as behind
 * it. */
static int32_t
find_number(const int32_t *numbers, int32_t n, int32_t point)
{
    int32_t below = 0, equal = 0;
    for (int32_t h = 0; h < n; h++) {
        below += numbers[h] < point;
        equal += numbers[h] == point;
    }
    HS_ASSERT(equal % 2 == 1);
    return below + equal / 2;
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
        const int32_t  at = by_place ? find_place(of, n, own + t)
                                     : find_number(of, n, hits->point[t]);
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

/* A hs_visit_fn of ordered walkers: whole rows, to their places by table->offsets; or kept, one
 * behind another, and their lengths as offsets. HS_TRY_OTHER when more than MOST_KEPT are kept. */
static hs_status
put_rows(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    row_filler     *fill = context;
    hs_output      *to = fill->to;
    int64_t        *offsets = fill->table->offsets;
    int32_t         end[HS_GROUP_POINTS];
    const hs_hits   rows = hits_of_rows(scanner, first, hits, end);
    const int32_t   n = rows.end[rows.n - 1];
    const hs_status status = n > 0 ? hs_record_hits(&fill->recorder, scanner, first, &rows) : HS_OK;
    if (status != HS_OK) {
        return status;
    }
    if (to != &fill->visit) {
        for (int32_t t = 0, from = 0; t < rows.n; from = rows.end[t++]) {
            offsets[rows.point[t]] = rows.end[t] - from;
        }
        return to->n_pairs * hs_output_bytes_per_pair(to) > MOST_KEPT ? HS_TRY_OTHER : HS_OK;
    }
    hs_output_place(fill->table->entries, offsets, to, rows.point, rows.n,
                    hs_search_asking(scanner->search)->n - first);
    to->n_pairs = 0;
    return HS_OK;
}

/* After hs_table_prepare. On failure filler_close. */
static hs_status
filler_open(hs_table *table, hs_output *to, row_filler *fill)
{
    const hs_output *entries = table->entries;
    const int32_t    most_hits = hs_block_most_hits((int32_t)table->most.candidates + 1);
    *fill = (row_filler){.table = table, .to = to != NULL ? to : &fill->visit};
    hs_output_init(NULL, entries->ndim, entries->columns, entries->index_bytes, &fill->visit);
    return hs_recorder_init(&table->search->call->account, fill->to, most_hits, &fill->recorder);
}

/* Idempotent, also of one that is all zeros. A hs_visitor's close. */
static void
filler_close(void *table, void *filler)
{
    row_filler *fill = filler;
    hs_recorder_free(&((hs_table *)table)->search->call->account, &fill->recorder);
    hs_output_free(&fill->visit);
}

#define MOST_EXPECTED_KEPT (4 << 20) /* bytes; rows are kept when no more than these are expected */

/* Of n hits, those with a higher number than the point, twice, and those with its own, which are
 * the point itself and images of it on either side. */
static int32_t
count_twice(const int32_t *numbers, int32_t n, int32_t point)
{
    int32_t twice = 0;
    for (int32_t h = 0; h < n; h++) {
        twice += (numbers[h] >= point) + (numbers[h] > point);
    }
    return twice;
}

/* A hs_visit_fn; each point belongs to one thread. */
static hs_status
count_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    int64_t *counts = context;
    (void)first;
    for (int32_t t = 0, begin = 0; t < hits->n; begin = hits->end[t++]) {
        const int32_t point = hits->point[t], n = hits->end[t] - begin;
        counts[point] +=
            scanner->use == HS_BLOCK_COUNTS ? n : count_twice(hits->label + begin, n, point);
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

/* In a small scene a bound on the largest neighbourhood does, which is small as well. */
/* Where the walks that prepare a table and count its entries end, as parts of the work. */
#define PREPARED 0.1
#define COUNTED  0.4

hs_status
hs_table_prepare(hs_table *table, hs_failure *failure)
{
    const hs_visitor sizes = {.use = HS_BLOCK_SIZES};
    hs_status        status = HS_OK;
    if (!hs_walker_bound(table->search, &table->most)) {
        const hs_stretch whole = hs_call_begin_part(table->search->call, 0.0, PREPARED);
        status = hs_parallel_visit(table->search, &sizes, &table->most, failure);
        hs_call_end_part(table->search->call, whole);
    }
    return status;
}

/* Offsets that hold the number of each row's entries: where it begins. */
static void
table_sum(hs_table *table)
{
    const int64_t n = hs_search_asking(table->search)->n;
    int64_t      *offsets = table->offsets, sum = 0;
    for (int64_t i = 0; i < n; i++) {
        const int64_t count = offsets[i];
        offsets[i] = sum;
        sum += count;
    }
    offsets[n] = sum;
}

/* Whether one walk, by this thread, shall do: its rows are kept for a while. */
static bool
will_keep(hs_table *table)
{
    hs_search       *search = table->search;
    const hs_output *entries = table->entries;
    const double     n = search->grid.expected_pairs * search->pairs_per_half;
    hs_output_init(&search->call->account, entries->ndim, entries->columns, entries->index_bytes,
                   &table->kept);
    const double bytes = n * (double)hs_output_bytes_per_pair(&table->kept);
    return search->call->team == NULL && bytes < MOST_EXPECTED_KEPT &&
           hs_account_allows(&search->call->account, 2.0 * MOST_KEPT);
}

/* HS_TRY_OTHER: there were too many entries, and none is kept. */
static hs_status
keep_all(hs_table *table, hs_failure *failure)
{
    hs_search    *search = table->search;
    const int64_t n = hs_search_asking(search)->n;
    hs_walker     walker;
    row_filler    fill;
    memset(table->offsets, 0, (size_t)n * sizeof *table->offsets);
    hs_output_reserve_hint(&table->kept, search->grid.expected_pairs * search->pairs_per_half);
    hs_status status = filler_open(table, &table->kept, &fill);
    if (status == HS_OK) {
        status = hs_walker_init_ordered(search, hs_record_use(table->kept.columns), &table->most,
                                        put_rows, &fill, &walker);
    }
    if (status == HS_OK) {
        status = hs_walk_or_tell(&walker, 0, (int32_t)n, failure);
        hs_walker_close(search, &walker);
    }
    filler_close(table, &fill);
    return status;
}

hs_status
hs_table_measure(hs_table *table, hs_failure *failure)
{
    hs_call   *call = table->search->call;
    hs_stretch whole = hs_call_begin_part(call, PREPARED, 1.0);
    hs_status  status = will_keep(table) ? keep_all(table, failure) : HS_TRY_OTHER;
    hs_call_end_part(call, whole);
    if (status == HS_TRY_OTHER) {
        hs_table_free(table);
        whole = hs_call_begin_part(call, PREPARED, COUNTED);
        status = hs_table_count(table->search, table->offsets, failure);
        hs_call_end_part(call, whole);
    }
    table_sum(table);
    return status;
}

static hs_status
open_filler(void *table, void *filler, const hs_walker *walker)
{
    (void)walker;
    return filler_open(table, NULL, filler);
}

hs_status
hs_table_fill(hs_table *table, hs_failure *failure)
{
    const hs_bins *asking = hs_search_asking(table->search);
    if (table->kept.columns != 0) {
        hs_output_place(table->entries, table->offsets, &table->kept, asking->order, asking->n,
                        asking->n);
        return HS_OK;
    }
    const hs_stretch whole = hs_call_begin_part(table->search->call, COUNTED, 1.0);
    const hs_visitor filler = {.use = hs_record_use(table->entries->columns),
                               .most = &table->most,
                               .visit = put_rows,
                               .shared = table,
                               .state_size = sizeof(row_filler),
                               .open = open_filler,
                               .close = filler_close};
    const hs_status  status = hs_parallel_visit(table->search, &filler, NULL, failure);
    hs_call_end_part(table->search->call, whole);
    return status;
}

void
hs_table_free(hs_table *table)
{
    hs_output_free(&table->kept);
    table->kept.columns = 0;
}
