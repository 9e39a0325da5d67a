/* SPDX-License-Identifier: BSD-3-Clause */
/* table.c: see table.h. */
#include "table.h"

#include "measures.h"
#include "parallel.h"
#include "record.h"

#include <string.h>

#define MEASURES (HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT)

/* A hs_visit_fn; each point belongs to one thread. */
static hs_status
count_hits(void *context, hs_walker *walker, int32_t first, const hs_rows *rows)
{
    int64_t *counts = context;
    (void)walker;
    (void)first;
    for (int32_t t = 0, begin = 0; t < rows->n; t++) {
        counts[rows->point[t]] += rows->end[t] - begin;
        begin = rows->end[t];
    }
    return HS_OK;
}

hs_status
hs_table_count(hs_search *search, int64_t *counts, hs_neighbourhood *most, hs_failure *failure)
{
    const int64_t     n = hs_search_asking(search)->n;
    const hs_visitors visitors = {
        .use = HS_BLOCK_LISTS_IDS, .visit = count_hits, .contexts = counts};
    memset(counts, 0, (size_t)n * sizeof *counts);
    const hs_status status = hs_parallel_visit(search, &visitors, most, failure);
    for (int64_t i = 0; !search->has_queries && i < n; i++) {
        counts[i] -= counts[i] > 0; /* the point itself; none at all below a cutoff of zero */
    }
    return status;
}

hs_status
hs_table_measure(hs_table *table, hs_failure *failure)
{
    const int64_t   n = hs_search_asking(table->search)->n;
    int64_t        *offsets = table->offsets;
    const hs_status status = hs_table_count(table->search, offsets, &table->most, failure);
    int64_t         sum = 0;
    for (int64_t i = 0; i < n; i++) {
        const int64_t count = offsets[i];
        offsets[i] = sum;
        sum += count;
    }
    offsets[n] = sum;
    return status;
}

/* What one thread fills rows with. */
typedef struct filler {
    const hs_table *table;
    hs_output       part;     /* owned; measures of the hits of one visit */
    hs_recorder     recorder; /* owned; of the part */
    int32_t        *numbers;  /* owned; of the hits of one point */
} filler;

/* Entries [at, at + n) of the table, a row or a part of it. */
typedef struct stretch {
    int64_t        at;
    int32_t        n;
    int32_t        point;
    int32_t        hit;     /* the first one, among those of the visit */
    const int32_t *numbers; /* of the hits, from that one on */
} stretch;

static void
put_number(void *column, int index_bytes, int64_t at, int32_t number)
{
    if (index_bytes == 8) {
        ((int64_t *)column)[at] = number;
    } else {
        ((int32_t *)column)[at] = number;
    }
}

/* i, j, or both side by side. */
static void
put_numbers(const hs_output *entries, const stretch *part)
{
    void     *i = hs_output_column(entries, HS_WANT_I), *j = hs_output_column(entries, HS_WANT_J);
    void     *both = hs_output_column(entries, HS_WANT_BOTH);
    const int bytes = entries->index_bytes;
    for (int32_t h = 0; i != NULL && h < part->n; h++) {
        put_number(i, bytes, part->at + h, part->point);
    }
    for (int32_t h = 0; j != NULL && h < part->n; h++) {
        put_number(j, bytes, part->at + h, part->numbers[h]);
    }
    for (int32_t h = 0; both != NULL && h < part->n; h++) {
        put_number(both, bytes, 2 * (part->at + h), part->point);
        put_number(both, bytes, 2 * (part->at + h) + 1, part->numbers[h]);
    }
}

static void
put_stretch(const filler *fill, const stretch *part)
{
    const hs_output *entries = fill->table->entries;
    put_numbers(entries, part);
    for (unsigned bit = HS_WANT_DISTANCE; bit <= HS_WANT_SHIFT; bit <<= 1) {
        char *to = hs_output_column(entries, bit);
        if (to != NULL) {
            const size_t width = hs_output_width(entries, bit);
            const char  *from = hs_output_column(&fill->part, bit);
            memcpy(to + (size_t)part->at * width, from + (size_t)part->hit * width,
                   (size_t)part->n * width);
        }
    }
}

/* Where the group's first point itself is among the candidates, in the places they were gathered
 * to; the others follow it. */
static int32_t
own_place(const hs_walker *walker)
{
    const hs_block *block = &walker->block;
    const int       m = walker->search->bins.n_periodic;
    for (const hs_run *run = block->runs; run < block->runs + block->n_runs; run++) {
        bool is_home = true;
        for (int r = 0; r < m; r++) {
            is_home = is_home && run->image[r] == 0;
        }
        const int32_t place = run->at + walker->group.first - run->si;
        if (is_home && place >= run->at && place < run[1].at) {
            return place;
        }
    }
    return -1;
}

/* The row of one point, which has n hits from number `hit` of the visit on; the one at `own` is the
 * point itself, unless there is none. */
static void
put_row(const filler *fill, int32_t point, int32_t hit, int32_t n, int32_t own)
{
    stretch part = {.at = fill->table->offsets[point], .n = own, .point = point, .hit = hit};
    part.numbers = fill->numbers;
    put_stretch(fill, &part);
    if (own < n) {
        part.at += own;
        part.n = n - own - 1;
        part.hit += own + 1;
        part.numbers += own + 1;
        put_stretch(fill, &part);
    }
}

/* Measures of all hits of a visit, as the part. */
static hs_status
fill_part(filler *fill, hs_walker *walker, int32_t first, const hs_rows *rows)
{
    fill->part.n_pairs = 0;
    const hs_status status = hs_output_reserve(&fill->part, rows->end[rows->n - 1], 0.0);
    return status == HS_OK ? hs_put_measures(&fill->recorder, walker, first, rows) : status;
}

/* Numbers of n hits; returns which of them is `self`, a hit as it is listed, or n. */
static int32_t
find_numbers(const hs_walker *walker, const int32_t *hits, int32_t n, int32_t self,
             int32_t *numbers)
{
    int32_t own = n;
    if (walker->use == HS_BLOCK_LISTS_IDS) {
        memcpy(numbers, hits, (size_t)n * sizeof *hits);
    }
    for (int32_t h = 0; walker->use == HS_BLOCK_LISTS_PLACES && h < n; h++) {
        numbers[h] = walker->block.id[hits[h]];
    }
    if (!walker->search->has_queries) {
        for (own = 0; own < n && hits[own] != self; own++) {
        }
    }
    return own;
}

/* A hs_visit_fn of ordered walkers: whole rows. */
static hs_status
fill_rows(void *context, hs_walker *walker, int32_t first, const hs_rows *rows)
{
    filler       *fill = context;
    const bool    by_place = walker->use == HS_BLOCK_LISTS_PLACES;
    const int32_t own = by_place && !walker->search->has_queries ? own_place(walker) : 0;
    if (by_place) {
        const hs_status status = fill_part(fill, walker, first, rows);
        if (status != HS_OK) {
            return status;
        }
    }
    for (int32_t t = 0, hit = 0; t < rows->n; t++) {
        const int32_t point = rows->point[t], n = rows->end[t] - hit;
        const int32_t self = by_place ? own + first + t - walker->group.first : point;
        put_row(fill, point, hit, n,
                find_numbers(walker, rows->hits + hit, n, self, fill->numbers));
        hit = rows->end[t];
    }
    return HS_OK;
}

static hs_status
open_filler(hs_table *table, filler *fill)
{
    hs_account      *account = &table->search->account;
    const hs_output *entries = table->entries;
    *fill = (filler){.table = table};
    hs_output_init(NULL, entries->ndim, entries->columns & MEASURES, entries->index_bytes,
                   &fill->part);
    fill->numbers = hs_alloc(account, HS_FOR_CANDIDATES, table->most.candidates + 1,
                             sizeof *fill->numbers);
    /* It keeps no numbers of hits: there are none to be turned round. */
    const hs_status status = hs_recorder_init(account, &fill->part, 0, &fill->recorder);
    return fill->numbers == NULL ? HS_ERR_MEMORY : status;
}

static void
close_filler(hs_table *table, filler *fill)
{
    hs_recorder_free(&table->search->account, &fill->recorder);
    hs_free(&table->search->account, fill->numbers);
    hs_output_free(&fill->part);
}

hs_status
hs_table_fill(hs_table *table, hs_failure *failure)
{
    hs_account *account = &table->search->account;
    const int   n_fillers = hs_team_size(table->search->team);
    hs_status   status = HS_OK;
    int         opened = 0;
    filler     *fillers = hs_alloc(account, HS_FOR_CANDIDATES, n_fillers, sizeof *fillers);
    if (fillers == NULL) {
        return HS_ERR_MEMORY;
    }
    while (opened < n_fillers && status == HS_OK) {
        status = open_filler(table, &fillers[opened++]);
    }
    if (status == HS_OK) {
        const hs_visitors visitors = {.use = hs_record_use(table->entries->columns),
                                      .most = &table->most,
                                      .visit = fill_rows,
                                      .contexts = fillers,
                                      .context_size = sizeof *fillers};
        status = hs_parallel_visit(table->search, &visitors, NULL, failure);
    }
    while (opened > 0) {
        close_filler(table, &fillers[--opened]);
    }
    hs_free(account, fillers);
    return status;
}
