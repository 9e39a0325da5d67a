/* SPDX-License-Identifier: BSD-3-Clause */
/* once.c: the walk keeps table rows as it finds them; then two passes in the order of the table
 * write j, then i. */
#include "once.h"

#include "table.h"
#include "../base/outcome.h"
#include "../base/poll.h"
#include "../search/walk.h"
#include "put_column.h"

#include <string.h>

#define AHEAD         24        /* rows between prefetching one and reading it */
#define MOST_EXPECTED 1024      /* bytes of a row to prefetch; the hardware takes the rest */
#define LEAST_ENTRIES (1 << 20) /* with fewer, all rows stay in a cache (table.c) */
#define POLL_ENTRIES  (1 << 20) /* written between two polls: some milliseconds */

/* The walk and what it leaves. */
typedef struct once {
    hs_table *table;
    hs_filler fill;  /* not opened: hs_keep_numbers needs no more than table and to */
    hs_output kept;  /* its numbers j lie in the entries' column i */
    int64_t  *where; /* owned; for each asking point: where in `kept` its row begins */
} once;

bool
hs_once_applies(const hs_table *table)
{
    const hs_search *search = table->search;
    const hs_output *entries = table->entries;
    return entries->columns == (HS_WANT_I | HS_WANT_J) && !entries->fixed &&
           search->call->team == NULL &&
           search->grid.expected_pairs * search->pairs_per_half > LEAST_ENTRIES;
}

/* A hs_visit_fn. */
static hs_status
keep_hits(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    once         *doing = context;
    hs_output    *entries = doing->table->entries;
    const int32_t n = hits->end[hits->n - 1];
    (void)first;
    const hs_status status = hs_output_reserve(entries, n, hs_scanner_fraction(scanner));
    if (status != HS_OK) {
        return status;
    }
    doing->kept.column[1].data = hs_output_column(entries, HS_WANT_I); /* it may have moved */
    hs_keep_numbers(&doing->fill, scanner, hits, doing->where);
    entries->n_pairs = doing->kept.n_pairs;
    return HS_OK;
}

static hs_status
walk_once(once *doing, hs_failure *failure)
{
    hs_table     *table = doing->table;
    hs_search    *search = table->search;
    const int64_t n = hs_search_asking(search)->n;
    hs_walker     walker;
    memset(table->offsets, 0, (size_t)n * sizeof *table->offsets);
    hs_output_expect(table->entries, search->grid.expected_pairs * search->pairs_per_half);
    hs_status status =
        hs_walker_init_ordered(search, HS_BLOCK_LISTS_IDS, &table->most, keep_hits, doing, &walker);
    if (status == HS_OK) {
        status = hs_walk_or_tell(&walker, 0, (int32_t)n, failure);
        hs_walker_close(search, &walker);
    }
    return status;
}

/* Prefetches the row that is AHEAD rows ahead. */
static void
ask_ahead(const once *doing, const int32_t *kept, int64_t row)
{
    const int64_t *offsets = doing->table->offsets;
    const char    *from = (const char *)(kept + doing->where[row]);
    int64_t        bytes = 4 * (offsets[row + 1] - offsets[row]);
    bytes = bytes < MOST_EXPECTED ? bytes : MOST_EXPECTED;
    for (int64_t at = 0; at < bytes; at += HS_ALIGNMENT) {
        HS_PREFETCH(from + at);
    }
}

/* Column i or j, row after row; j first, because its rows wait in the memory of i. */
static hs_status
write_column(const once *doing, unsigned bit, const hs_options *options)
{
    const hs_output *entries = doing->table->entries;
    const int64_t   *offsets = doing->table->offsets;
    const int64_t    n = hs_search_asking(doing->table->search)->n;
    const int32_t   *kept = hs_output_column(&doing->kept, HS_WANT_J);
    hs_put_column    out;
    hs_status        status = HS_OK;
    hs_put_open(hs_output_column(entries, bit), entries->index_bytes, &out);
    for (int64_t row = 0, next = POLL_ENTRIES; row < n && status == HS_OK; row++) {
        const int64_t length = offsets[row + 1] - offsets[row];
        if (bit == HS_WANT_I) {
            hs_put_repeat(&out, (int32_t)row, length);
        } else {
            if (row + AHEAD < n) {
                ask_ahead(doing, kept, row + AHEAD);
            }
            hs_put_numbers(&out, kept + doing->where[row], length);
        }
        if (offsets[row] >= next) {
            status = hs_poll(options, 1.0);
            next = offsets[row] + POLL_ENTRIES;
        }
    }
    hs_put_close(&out);
    return status;
}

/* The entries are empty again. */
static void
give_up(hs_output *entries)
{
    hs_account    *account = entries->account;
    const unsigned columns = entries->columns;
    const int      ndim = entries->ndim, index_bytes = entries->index_bytes;
    hs_output_free(entries);
    hs_output_init(account, ndim, columns, index_bytes, entries);
}

hs_status
hs_once_find(hs_table *table, hs_failure *failure)
{
    hs_search    *search = table->search;
    const int64_t n = hs_search_asking(search)->n;
    once          doing = {.table = table, .fill.table = table, .fill.to = &doing.kept};
    hs_output_init(NULL, search->scene.ndim, HS_WANT_J, 4, &doing.kept);
    doing.where = hs_alloc(&search->call->account, HS_FOR_CANDIDATES, n + 1, sizeof *doing.where);
    hs_status status = doing.where != NULL ? HS_OK : HS_ERR_MEMORY;
    if (status == HS_OK) {
        memset(doing.where, 0, (size_t)n * sizeof *doing.where);
        status = walk_once(&doing, failure);
    }
    if (status == HS_OK) {
        hs_table_sum(table);
        status = write_column(&doing, HS_WANT_J, &search->call->options);
    }
    if (status == HS_OK) {
        status = write_column(&doing, HS_WANT_I, &search->call->options);
    }
    hs_free(&search->call->account, doing.where);
    if (status == HS_ERR_MEMORY) {
        give_up(table->entries);
        return HS_TOO_MUCH;
    }
    return status;
}
