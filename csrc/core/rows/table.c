/* SPDX-License-Identifier: BSD-3-Clause */
#include "table.h"
#include "../base/status.h"
#include "../collect/parallel.h"
#include "../memory/results.h"
#include "../base/os.h"
#include "../search/walk.h"

#include <string.h>

/* table.c: lengths of table rows by a counting walk, or by the one walk that keeps them; their sums
 * are the offsets. Hits come in the order of the table; the point itself is left out, and each
 * column is copied. */

/* Columns of a table that are measured, not numbers. */
#define MEASURES (HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT | HS_WANT_SHELL)

/* Bytes of rows that wait for their places. */
#define MOST_KEPT (6 << 20)

/* What one thread fills rows with; the context of the visits below. */
typedef struct row_filler {
    hs_table   *table;
    hs_output  *to;       /* borrowed; where the rows go */
    hs_output   part;     /* owned; measures of the hits of one visit */
    hs_recorder recorder; /* owned; of the part */
    int32_t    *numbers;  /* owned; of the hits of one point, where hits are places */
} row_filler;

#define ROWS_AHEAD         32        /* points from prefetch to writing; twice that for offsets */
#define MOST_EXPECTED_ROWS 2048      /* bytes of a table row to prefetch */
#define NO_POINT           INT32_MAX /* more than any point's number */

/* The row of one point. */
typedef struct table_row {
    int64_t        at; /* entries [at, at + n) of the table */
    int32_t        n;
    int32_t        point;
    int32_t        itself;  /* what is left out once: the point's number, or NO_POINT */
    const int32_t *numbers; /* of the hits, ascending; n + 1 may be read */
} table_row;

/* Every `step`-th entry of a column from `at` on: the row's numbers, or n times the point. What
 * follows the point itself moves up by one. */
HS_ALWAYS_INLINE void
put_numbers(void *column, int index_bytes, int64_t at, const table_row *of, const bool is_j,
            const int step)
{
    const int32_t *HS_RESTRICT numbers = of->numbers;
    const int32_t              n = of->n, point = of->point, itself = of->itself;
    if (index_bytes == 8) {
        int64_t *HS_RESTRICT wide = (int64_t *)column + at;
        for (int32_t h = 0; h < n; h++) {
            const int32_t here = is_j ? numbers[h] : 0, next = is_j ? numbers[h + 1] : 0;
            wide[h * (int64_t)step] = !is_j ? point : here < itself ? here : next;
        }
    } else {
        int32_t *HS_RESTRICT narrow = (int32_t *)column + at;
        for (int32_t h = 0; h < n; h++) {
            const int32_t here = is_j ? numbers[h] : 0, next = is_j ? numbers[h + 1] : 0;
            narrow[h * (int64_t)step] = !is_j ? point : here < itself ? here : next;
        }
    }
}

/* i, j, or both side by side. */
static void
put_ends(const hs_output *entries, const table_row *of)
{
    void     *i = hs_output_column(entries, HS_WANT_I), *j = hs_output_column(entries, HS_WANT_J);
    void     *both = hs_output_column(entries, HS_WANT_BOTH);
    const int bytes = entries->index_bytes;
    if (i != NULL) {
        put_numbers(i, bytes, of->at, of, false, 1);
    }
    if (j != NULL) {
        put_numbers(j, bytes, of->at, of, true, 1);
    }
    if (both != NULL) {
        put_numbers(both, bytes, 2 * of->at, of, false, 2);
        put_numbers(both, bytes, 2 * of->at + 1, of, true, 2);
    }
}

/* Measures of hits [hit, hit + n) of the visit, as entries from `at` on. */
static void
put_measures(const row_filler *fill, int64_t at, int64_t hit, int32_t n)
{
    const hs_output *entries = fill->to;
    for (unsigned bit = HS_WANT_DISTANCE; bit <= HS_WANT_SHELL && n > 0; bit <<= 1) {
        char *to = bit & MEASURES ? hs_output_column(entries, bit) : NULL;
        if (to != NULL) {
            const size_t width = hs_output_width(entries, bit);
            const char  *from = hs_output_column(&fill->part, bit);
            memcpy(to + (size_t)at * width, from + (size_t)hit * width, (size_t)n * width);
        }
    }
}

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

/* Measures of all hits of a visit, as the part. */
static hs_status
fill_part(row_filler *fill, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    fill->part.n_pairs = 0;
    const hs_status status = hs_output_reserve(&fill->part, hits->end[hits->n - 1], 0.0);
    return status == HS_OK ? hs_record_places(&fill->recorder, scanner, first, hits) : status;
}

/* How many of n numbers are below this one. Not by halving, though they ascend: its branches cost
 * more than looking at all the numbers of a row, which are to be copied anyway. */
static int32_t
count_below(const int32_t *numbers, int32_t n, int32_t number)
{
    int32_t below = 0;
    for (int32_t h = 0; h < n; h++) {
        below += numbers[h] < number;
    }
    return below;
}

/* Which of a point's hits is the point itself, or n. place: its own. */
static int32_t
find_self(const row_filler *fill, const hs_scanner *scanner, const int32_t *hits, int32_t n,
          int32_t point, int32_t place)
{
    int32_t self = scanner->search->has_queries ? n : count_below(fill->numbers, n, point);
    while (self < n && hits[self] != place) { /* images of the point come before it */
        self++;
    }
    return self;
}

/* The row of a point whose n hits, from number `hit` of the visit on, are places. */
static void
put_places(const row_filler *fill, const hs_scanner *scanner, const hs_hits *hits, int32_t hit,
           int32_t n, int32_t place, table_row *of)
{
    const int32_t *places = hits->label + hit;
    for (int32_t h = 0; h < n; h++) {
        fill->numbers[h] = scanner->block.id[places[h]];
    }
    const int32_t self = find_self(fill, scanner, places, n, of->point, place);
    of->numbers = fill->numbers;
    put_ends(fill->to, of);
    put_measures(fill, of->at, hit, self);
    if (self < n) {
        put_measures(fill, of->at + self, hit + self + 1, n - self - 1);
    }
}

/* Table rows lie anywhere in the result: prefetches the memory of one that is soon to be written,
 * and the offset of a later one. */
HS_ALWAYS_INLINE void
expect_rows(const row_filler *fill, const hs_bins *asking, int64_t si)
{
    const int64_t *offsets = fill->table->offsets;
    char          *j = hs_output_column(fill->table->entries, HS_WANT_J);
    if (si + 2 * ROWS_AHEAD < asking->n) {
        HS_PREFETCH(offsets + asking->order[si + 2 * ROWS_AHEAD]);
    }
    if (j != NULL && si + ROWS_AHEAD < asking->n) {
        const size_t   width = (size_t)fill->table->entries->index_bytes;
        const int64_t *place = offsets + asking->order[si + ROWS_AHEAD];
        const char    *end = j + (size_t)place[1] * width;
        const char    *most = j + (size_t)place[0] * width + MOST_EXPECTED_ROWS;
        for (j += (size_t)place[0] * width; j < end && j < most; j += HS_ALIGNMENT) {
            HS_PREFETCH_WRITE(j);
        }
    }
}

/* What is needed before the rows of a visit: measures, and the place of the group's first point. */
static hs_status
begin_visit(row_filler *fill, hs_scanner *scanner, int32_t first, const hs_hits *hits, int32_t *own)
{
    *own = 0;
    if (scanner->use != HS_BLOCK_LISTS_PLACES) {
        return HS_OK;
    }
    *own = scanner->search->has_queries ? 0 : own_place(scanner);
    *own += first - scanner->group.first;
    return fill_part(fill, scanner, first, hits);
}

/* The row of point t of a visit, whose n hits begin at number `hit`. */
HS_ALWAYS_INLINE void
put_row(const row_filler *fill, const hs_scanner *scanner, const hs_hits *hits, int32_t hit,
        int32_t n, int32_t place, table_row *of)
{
    const bool has_self = !scanner->search->has_queries;
    HS_ASSERT(!has_self || n > 0);
    of->n = n - has_self;
    of->itself = has_self ? of->point : NO_POINT;
    of->numbers = hits->label + hit;
    if (scanner->use == HS_BLOCK_LISTS_PLACES) {
        put_places(fill, scanner, hits, hit, n, place, of);
    } else {
        put_ends(fill->to, of);
    }
}

/* A hs_visit_fn of ordered walkers: whole rows, to their places by table->offsets. */
static hs_status
fill_rows(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    row_filler     *fill = context;
    const hs_bins  *asking = hs_search_asking(scanner->search);
    int32_t         own;
    const hs_status status = begin_visit(fill, scanner, first, hits, &own);
    for (int32_t t = 0, hit = 0; t < hits->n && status == HS_OK; t++) {
        const int32_t point = hits->point[t];
        table_row     of = {.at = fill->table->offsets[point], .point = point};
        expect_rows(fill, asking, (int64_t)first + t);
        put_row(fill, scanner, hits, hit, hits->end[t] - hit, own + t, &of);
        hit = hits->end[t];
    }
    return status;
}

/* The rows of a visit, behind those that `fill->to` has already. */
HS_ALWAYS_INLINE void
keep_visit(row_filler *fill, const hs_scanner *scanner, const hs_hits *hits, int32_t own,
           int64_t *where)
{
    hs_output *kept = fill->to;
    for (int32_t t = 0, hit = 0; t < hits->n; t++) {
        table_row of = {.at = kept->n_pairs, .point = hits->point[t]};
        put_row(fill, scanner, hits, hit, hits->end[t] - hit, own + t, &of);
        fill->table->offsets[of.point] = of.n;
        if (where != NULL) {
            where[of.point] = of.at;
        }
        kept->n_pairs += of.n;
        hit = hits->end[t];
    }
}

/* The rows of a visit with HS_BLOCK_LISTS_IDS, one behind another, in fill->to, which has room for
 * them: to table->offsets the lengths, and to `where` the entry that each begins with. Of `fill`
 * only table and to are looked at. */
static void
keep_numbers(row_filler *fill, const hs_scanner *scanner, const hs_hits *hits, int64_t *where)
{
    HS_ASSERT(scanner->use == HS_BLOCK_LISTS_IDS);
    keep_visit(fill, scanner, hits, 0, where);
}

/* A hs_visit_fn of ordered walkers: whole rows, one behind another, and their lengths as offsets.
 * HS_TRY_OTHER when they are more than MOST_KEPT. */
static hs_status
keep_rows(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    row_filler   *fill = context;
    hs_output    *kept = fill->to;
    const int32_t n = hits->end[hits->n - 1];
    int32_t       own;
    hs_status     status = hs_output_reserve(kept, n, 0.0);
    if (status == HS_OK) {
        status = begin_visit(fill, scanner, first, hits, &own);
    }
    if (status != HS_OK) {
        return status;
    }
    keep_visit(fill, scanner, hits, own, NULL);
    const bool is_much = kept->n_pairs * hs_output_bytes_per_pair(kept) > MOST_KEPT;
    return is_much ? HS_TRY_OTHER : HS_OK;
}

/* After hs_table_prepare. On failure filler_close. */
static hs_status
filler_open(hs_table *table, hs_output *to, row_filler *fill)
{
    hs_account *account = &table->search->call->account;
    unsigned    columns = to->columns & MEASURES;
    columns |= columns & HS_WANT_SHELL ? HS_WANT_DISTANCE : 0; /* by which shells are told */
    *fill = (row_filler){.table = table, .to = to};
    hs_output_init(NULL, to->ndim, columns, to->index_bytes, &fill->part);
    fill->numbers =
        hs_alloc(account, HS_FOR_CANDIDATES, table->most.candidates + 1, sizeof *fill->numbers);
    /* It keeps no numbers of hits: no pair must be turned round. */
    const hs_status status = hs_recorder_init(account, &fill->part, 0, &fill->recorder);
    return fill->numbers == NULL ? HS_ERR_MEMORY : status;
}

static void
filler_close(row_filler *fill)
{
    hs_recorder_free(&fill->table->search->call->account, &fill->recorder);
    hs_free(&fill->table->search->call->account, fill->numbers);
    hs_output_free(&fill->part);
}

/* The rows that were kept, to their places. */
static void
move_rows(hs_table *table)
{
    const hs_bins   *asking = hs_search_asking(table->search);
    const int32_t   *numbers = hs_output_column(&table->kept, HS_WANT_J);
    const row_filler fill = {.table = table, .to = table->entries, .part = table->kept};
    int64_t          from = 0;
    for (int64_t si = 0; si < asking->n; si++) {
        const int64_t *place = table->offsets + asking->order[si];
        table_row      of = {.at = place[0], .n = (int32_t)(place[1] - place[0])};
        of.point = asking->order[si];
        of.itself = NO_POINT;
        of.numbers = numbers != NULL ? numbers + from : NULL; /* none: an empty table */
        expect_rows(&fill, asking, si);
        put_ends(fill.to, &of);
        put_measures(&fill, of.at, from, of.n);
        from += of.n;
    }
}

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
/* Where the walks that prepare a table and count its entries end, as parts of the work. */
#define PREPARED 0.1
#define COUNTED  0.4

hs_status
hs_table_prepare(hs_table *table, hs_failure *failure)
{
    const hs_visitors sizes = {.use = HS_BLOCK_SIZES, .contexts = table};
    hs_status         status = HS_OK;
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
    hs_output_init(&search->call->account, entries->ndim, (entries->columns & MEASURES) | HS_WANT_J,
                   4, &table->kept);
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
    hs_status status = filler_open(table, &table->kept, &fill);
    if (status == HS_OK) {
        status = hs_walker_init_ordered(search, hs_record_use(table->kept.columns), &table->most,
                                        keep_rows, &fill, &walker);
    }
    if (status == HS_OK) {
        status = hs_walk_or_tell(&walker, 0, (int32_t)n, failure);
        hs_walker_close(search, &walker);
    }
    filler_close(&fill);
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
open_filler(void *table, void *filler)
{
    return filler_open(table, ((hs_table *)table)->entries, filler);
}

static void
close_filler(void *table, void *filler)
{
    (void)table;
    filler_close(filler);
}

static hs_status
fill_all(hs_table *table, hs_failure *failure)
{
    hs_crew   crew = {.call = table->search->call,
                      .job = table,
                      .worker_size = sizeof(row_filler),
                      .open = open_filler,
                      .close = close_filler};
    hs_status status = hs_crew_open(&crew);
    if (status == HS_OK) {
        const hs_visitors visitors = {.use = hs_record_use(table->entries->columns),
                                      .most = &table->most,
                                      .visit = fill_rows,
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
    if (table->kept.columns != 0) {
        move_rows(table);
        return HS_OK;
    }
    const hs_stretch whole = hs_call_begin_part(table->search->call, COUNTED, 1.0);
    const hs_status  status = fill_all(table, failure);
    hs_call_end_part(table->search->call, whole);
    return status;
}

void
hs_table_free(hs_table *table)
{
    hs_output_free(&table->kept);
    table->kept.columns = 0;
}

/*
 * A large column of point numbers that is written from its first entry to its last,
 * past the caches: it does not fit them, and what a store misses there would first be read.
 *
 * Collected in a small buffer, whole cache lines are written by streaming stores.
 *
 * Usage: put_column_open(column, index_bytes, &out); put_column_numbers or put_column_repeat any
 * number of times; put_column_close(&out), before which part of it is not there.
 */

#define PUT_BYTES 4096 /* collected before they are written: well inside the first-level cache */

/* Numbers of 4 or 8 bytes on their way to memory. */
typedef struct put_column {
    char  *to; /* where the collected bytes will go */
    size_t n;  /* of them */
    int    index_bytes;
    union {
        char    bytes[PUT_BYTES + HS_ALIGNMENT];
        int32_t narrow[(PUT_BYTES + HS_ALIGNMENT) / sizeof(int32_t)];
        int64_t wide[(PUT_BYTES + HS_ALIGNMENT) / sizeof(int64_t)];
    } part;
} put_column;

/* column: aligned to HS_ALIGNMENT; borrowed. */
static void
put_column_open(void *column, int index_bytes, put_column *out)
{
    out->to = column;
    out->n = 0;
    out->index_bytes = index_bytes;
}

/* The first collected bytes, as far as they fill whole lines. */
static void
write_lines(put_column *out)
{
    const size_t n_bytes = out->n / HS_ALIGNMENT * HS_ALIGNMENT;
    hs_bypass_lines(out->to, out->part.bytes, n_bytes);
    memcpy(out->part.bytes, out->part.bytes + n_bytes, HS_ALIGNMENT);
    out->to += n_bytes;
    out->n -= n_bytes;
}

/* How many of n numbers there is room for. */
static int64_t
make_room(put_column *out, int64_t n)
{
    if (out->n >= PUT_BYTES) {
        write_lines(out);
    }
    const int64_t room = (int64_t)(PUT_BYTES - out->n) / out->index_bytes;
    return n < room ? n : room;
}

/* These n numbers, none of which is negative. */
static void
put_column_numbers(put_column *out, const int32_t *numbers, int64_t n)
{
    while (n > 0) {
        const int64_t part = make_room(out, n);
        if (out->index_bytes == 8) {
            int64_t *wide = out->part.wide + out->n / sizeof *out->part.wide;
            for (int64_t k = 0; k < part; k++) {
                wide[k] = (int64_t)(uint32_t)numbers[k]; /* cheaper than a sign */
            }
        } else {
            memcpy(out->part.bytes + out->n, numbers, (size_t)part * sizeof *numbers);
        }
        out->n += (size_t)part * (size_t)out->index_bytes;
        numbers += part;
        n -= part;
    }
}

/* n times this number. */
static void
put_column_repeat(put_column *out, int32_t number, int64_t n)
{
    while (n > 0) {
        const int64_t part = make_room(out, n);
        if (out->index_bytes == 8) {
            int64_t *wide = out->part.wide + out->n / sizeof *out->part.wide;
            for (int64_t k = 0; k < part; k++) {
                wide[k] = number;
            }
        } else {
            int32_t *narrow = out->part.narrow + out->n / sizeof *out->part.narrow;
            for (int64_t k = 0; k < part; k++) {
                narrow[k] = number;
            }
        }
        out->n += (size_t)part * (size_t)out->index_bytes;
        n -= part;
    }
}

static void
put_column_close(put_column *out)
{
    write_lines(out);
    memcpy(out->to, out->part.bytes, out->n);
    hs_bypass_end();
}

/* The walk keeps table rows as it finds them; then two passes in the order of the table
 * write j, then i. */

#define ONCE_AHEAD            24   /* rows between prefetching one and reading it */
#define MOST_EXPECTED_ENTRIES 1024 /* bytes of a row to prefetch; the hardware takes the rest */
#define LEAST_ENTRIES         (1 << 20) /* with fewer, all rows stay in a cache */
#define POLL_ENTRIES          (1 << 20) /* written between two polls: some milliseconds */

/* The walk and what it leaves. */
typedef struct once {
    hs_table  *table;
    row_filler fill;  /* not opened: keep_numbers needs no more than table and to */
    hs_output  kept;  /* its numbers j lie in the entries' column i */
    int64_t   *where; /* owned; for each asking point: where in `kept` its row begins */
} once;

bool
hs_table_takes_one_walk(const hs_table *table)
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
    keep_numbers(&doing->fill, scanner, hits, doing->where);
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
    hs_output_reserve_hint(table->entries, search->grid.expected_pairs * search->pairs_per_half);
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
    bytes = bytes < MOST_EXPECTED_ENTRIES ? bytes : MOST_EXPECTED_ENTRIES;
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
    put_column       out;
    hs_status        status = HS_OK;
    put_column_open(hs_output_column(entries, bit), entries->index_bytes, &out);
    for (int64_t row = 0, next = POLL_ENTRIES; row < n && status == HS_OK; row++) {
        const int64_t length = offsets[row + 1] - offsets[row];
        if (bit == HS_WANT_I) {
            put_column_repeat(&out, (int32_t)row, length);
        } else {
            if (row + ONCE_AHEAD < n) {
                ask_ahead(doing, kept, row + ONCE_AHEAD);
            }
            put_column_numbers(&out, kept + doing->where[row], length);
        }
        if (offsets[row] >= next) {
            status = hs_poll(options, 1.0);
            next = offsets[row] + POLL_ENTRIES;
        }
    }
    put_column_close(&out);
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
hs_table_find_in_one_walk(hs_table *table, hs_failure *failure)
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
        table_sum(table);
        status = write_column(&doing, HS_WANT_J, &search->call->options);
    }
    if (status == HS_OK) {
        status = write_column(&doing, HS_WANT_I, &search->call->options);
    }
    hs_free(&search->call->account, doing.where);
    if (status == HS_ERR_MEMORY) {
        give_up(table->entries);
        return HS_TRY_OTHER;
    }
    return status;
}
