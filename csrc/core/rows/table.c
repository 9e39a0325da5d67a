/* SPDX-License-Identifier: BSD-3-Clause */
/* table.c: lengths of table rows by a counting walk, or by the one walk that keeps them; their sums
 * are the offsets. */
#include "table.h"

#include "../base/outcome.h"
#include "../collect/crew.h"
#include "../collect/parallel.h"

#include <string.h>

#define MOST_EXPECTED_KEPT (4 << 20) /* bytes; rows are kept when no more than these are expected */

/* A hs_visit_fn; each point belongs to one thread. */
static hs_status
count_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    int64_t *counts = context;
    (void)scanner;
    (void)first;
    for (int32_t t = 0, begin = 0; t < hits->n; t++) {
        counts[hits->point[t]] += hits->end[t] - begin;
        begin = hits->end[t];
    }
    return HS_OK;
}

hs_status
hs_table_count(hs_search *search, int64_t *counts, hs_failure *failure)
{
    const int64_t     n = hs_search_asking(search)->n;
    const hs_visitors visitors = {.use = HS_BLOCK_COUNTS, .visit = count_hits, .contexts = counts};
    if (n > 0) { /* otherwise counts may be NULL */
        memset(counts, 0, (size_t)n * sizeof *counts);
    }
    const hs_status status = hs_parallel_visit(search, &visitors, NULL, failure);
    for (int64_t i = 0; !search->has_queries && i < n; i++) {
        counts[i] -= counts[i] > 0; /* the point itself, unless nothing is within */
    }
    return status;
}

/* In a small scene a bound on the largest neighbourhood does, which is small as well. */
hs_status
hs_table_prepare(hs_table *table, hs_failure *failure)
{
    const hs_visitors sizes = {.use = HS_BLOCK_SIZES, .contexts = table};
    return hs_walker_bound(table->search, &table->most)
               ? HS_OK
               : hs_parallel_visit(table->search, &sizes, &table->most, failure);
}

void
hs_table_sum(hs_table *table)
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
    hs_output_init(&search->call->account, entries->ndim,
                   (entries->columns & HS_MEASURES) | HS_WANT_J, 4, &table->kept);
    const double bytes = n * (double)hs_output_bytes_per_pair(&table->kept);
    return search->call->team == NULL && bytes < MOST_EXPECTED_KEPT &&
           hs_account_allows(&search->call->account, 2.0 * HS_MOST_KEPT);
}

/* HS_TOO_MUCH: there were too many entries, and none is kept. */
static hs_status
keep_all(hs_table *table, hs_failure *failure)
{
    hs_search    *search = table->search;
    const int64_t n = hs_search_asking(search)->n;
    hs_walker     walker;
    hs_filler     fill;
    memset(table->offsets, 0, (size_t)n * sizeof *table->offsets);
    hs_status status = hs_filler_open(table, &table->kept, &fill);
    if (status == HS_OK) {
        status = hs_walker_init_ordered(search, hs_record_use(table->kept.columns), &table->most,
                                        hs_keep_rows, &fill, &walker);
    }
    if (status == HS_OK) {
        status = hs_walk_or_tell(&walker, 0, (int32_t)n, failure);
        hs_walker_close(search, &walker);
    }
    hs_filler_close(&fill);
    return status;
}

hs_status
hs_table_measure(hs_table *table, hs_failure *failure)
{
    hs_status status = will_keep(table) ? keep_all(table, failure) : HS_TOO_MUCH;
    if (status == HS_TOO_MUCH) {
        hs_table_free(table);
        status = hs_table_count(table->search, table->offsets, failure);
    }
    hs_table_sum(table);
    return status;
}

static hs_status
open_filler(void *table, void *filler)
{
    return hs_filler_open(table, ((hs_table *)table)->entries, filler);
}

static void
close_filler(void *table, void *filler)
{
    (void)table;
    hs_filler_close(filler);
}

static hs_status
fill_all(hs_table *table, hs_failure *failure)
{
    hs_crew   crew = {.call = table->search->call,
                      .job = table,
                      .worker_size = sizeof(hs_filler),
                      .open = open_filler,
                      .close = close_filler};
    hs_status status = hs_crew_open(&crew);
    if (status == HS_OK) {
        const hs_visitors visitors = {.use = hs_record_use(table->entries->columns),
                                      .most = &table->most,
                                      .visit = hs_fill_rows,
                                      .contexts = crew.workers,
                                      .context_size = crew.worker_size};
        status = hs_parallel_visit(table->search, &visitors, NULL, failure);
    }
    hs_crew_close(&crew);
    return status;
}

hs_status
hs_table_fill(hs_table *table, hs_failure *failure)
{
    if (table->kept.columns == 0) {
        return fill_all(table, failure);
    }
    hs_move_rows(table);
    return HS_OK;
}

void
hs_table_free(hs_table *table)
{
    hs_output_free(&table->kept);
    table->kept.columns = 0;
}
