/* SPDX-License-Identifier: BSD-3-Clause */
/* table.c: see table.h. */
#include "table.h"

#include "measures.h"
#include "parallel.h"
#include "record.h"

#include <string.h>

#define AHEAD         32   /* points, about two groups, between asking for a row and writing it */
#define MOST_EXPECTED 2048 /* bytes of it */
#define MEASURES (HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT)

/* A hs_visit_fn; each point belongs to one thread. */
static hs_status
count_hits(void *context, hs_walker *walker, int32_t first, const hs_hits *hits)
{
    int64_t *counts = context;
    (void)walker;
    (void)first;
    for (int32_t t = 0, begin = 0; t < hits->n; t++) {
        counts[hits->point[t]] += hits->end[t] - begin;
        begin = hits->end[t];
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

/* numbers[0 ... n - 1], or where that is NULL n times `same`, to every `step`-th entry from `at`
 * on. */
HS_ALWAYS_INLINE void
put_numbers(void *column, int index_bytes, int64_t at, const int32_t *numbers, int32_t same,
            int32_t n, const int step)
{
    int64_t *wide = (int64_t *)column + at;
    int32_t *narrow = (int32_t *)column + at;
    if (index_bytes == 8) {
        for (int64_t h = 0; h < n; h++) {
            wide[h * step] = numbers != NULL ? numbers[h] : same;
        }
    } else {
        for (int64_t h = 0; h < n; h++) {
            narrow[h * step] = numbers != NULL ? numbers[h] : same;
        }
    }
}

/* i, j, or both side by side. */
static void
put_ends(const hs_output *entries, const stretch *part)
{
    void     *i = hs_output_column(entries, HS_WANT_I), *j = hs_output_column(entries, HS_WANT_J);
    void     *both = hs_output_column(entries, HS_WANT_BOTH);
    const int bytes = entries->index_bytes;
    if (i != NULL) {
        put_numbers(i, bytes, part->at, NULL, part->point, part->n, 1);
    }
    if (j != NULL) {
        put_numbers(j, bytes, part->at, part->numbers, 0, part->n, 1);
    }
    if (both != NULL) {
        put_numbers(both, bytes, 2 * part->at, NULL, part->point, part->n, 2);
        put_numbers(both, bytes, 2 * part->at + 1, part->numbers, 0, part->n, 2);
    }
}

static void
put_stretch(const filler *fill, const stretch *part)
{
    const hs_output *entries = fill->table->entries;
    put_ends(entries, part);
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
fill_part(filler *fill, hs_walker *walker, int32_t first, const hs_hits *hits)
{
    fill->part.n_pairs = 0;
    const hs_status status = hs_output_reserve(&fill->part, hits->end[hits->n - 1], 0.0);
    return status == HS_OK ? hs_put_measures(&fill->recorder, walker, first, hits) : status;
}

/* Which of n ascending numbers is the first that is not below this one, or n. */
static int32_t
find_number(const int32_t *numbers, int32_t n, int32_t number)
{
    int32_t low = 0;
    for (int32_t left = n; left > 0; left /= 2) {
        const int32_t middle = low + left / 2;
        if (numbers[middle] < number) {
            low = middle + 1;
            left--;
        }
    }
    return low;
}

/* The numbers of a point's hits; returns which of these is the point itself, or n. own: its place,
 * if hits are places. */
static int32_t
find_numbers(filler *fill, const hs_walker *walker, const int32_t *hits, int32_t n, int32_t point,
             int32_t own)
{
    const bool has_self = !walker->search->has_queries;
    int32_t   *numbers = fill->numbers;
    if (walker->use == HS_BLOCK_LISTS_IDS) {
        memcpy(numbers, hits, (size_t)n * sizeof *hits);
        return has_self ? find_number(numbers, n, point) : n;
    }
    for (int32_t h = 0; h < n; h++) {
        numbers[h] = walker->block.id[hits[h]];
    }
    int32_t self = has_self ? find_number(numbers, n, point) : n;
    while (self < n && hits[self] != own) { /* images of the point come before it */
        self++;
    }
    return self;
}

/* Rows lie anywhere in the result: asks for the memory of one that is soon to be written. */
HS_ALWAYS_INLINE void
expect_row(const hs_table *table, int64_t si)
{
    const hs_bins   *asking = hs_search_asking(table->search);
    const hs_output *entries = table->entries;
    const size_t     width = hs_output_width(entries, HS_WANT_J);
    const char      *j = hs_output_column(entries, HS_WANT_J);
    if (j != NULL && si < asking->n) {
        const int64_t *row = table->offsets + asking->order[si];
        const char    *end = j + (size_t)row[1] * width;
        const char    *most = j + (size_t)row[0] * width + MOST_EXPECTED;
        for (j += (size_t)row[0] * width; j < end && j < most; j += HS_ALIGNMENT) {
            HS_PREFETCH_WRITE(j);
        }
    }
}

/* A hs_visit_fn of ordered walkers: whole rows. */
static hs_status
fill_rows(void *context, hs_walker *walker, int32_t first, const hs_hits *hits)
{
    filler       *fill = context;
    const bool    by_place = walker->use == HS_BLOCK_LISTS_PLACES;
    const int32_t own = by_place && !walker->search->has_queries ? own_place(walker) : 0;
    if (by_place) {
        const hs_status status = fill_part(fill, walker, first, hits);
        if (status != HS_OK) {
            return status;
        }
    }
    for (int32_t t = 0, hit = 0; t < hits->n; t++) {
        const int32_t point = hits->point[t], n = hits->end[t] - hit;
        const int32_t place = own + first + t - walker->group.first;
        expect_row(fill->table, (int64_t)first + t + AHEAD);
        put_row(fill, point, hit, n,
                find_numbers(fill, walker, hits->label + hit, n, point, place));
        hit = hits->end[t];
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
