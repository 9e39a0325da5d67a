/* SPDX-License-Identifier: BSD-3-Clause */
/* table_rows.c: hits come in the order of the table; the point itself is left out, and each column
 * is copied. */
#include "table_rows.h"

#include "../base/outcome.h"
#include "../collect/record.h"

#include <string.h>

#define AHEAD         32        /* points from prefetch to writing; twice that for offsets */
#define MOST_EXPECTED 2048      /* bytes of a table row to prefetch */
#define NO_POINT      INT32_MAX /* more than any point's number */

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
put_measures(const hs_filler *fill, int64_t at, int64_t hit, int32_t n)
{
    const hs_output *entries = fill->to;
    for (unsigned bit = HS_WANT_DISTANCE; bit <= HS_WANT_SHIFT && n > 0; bit <<= 1) {
        char *to = hs_output_column(entries, bit);
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
fill_part(hs_filler *fill, hs_scanner *scanner, int32_t first, const hs_hits *hits)
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
find_self(const hs_filler *fill, const hs_scanner *scanner, const int32_t *hits, int32_t n,
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
put_places(const hs_filler *fill, const hs_scanner *scanner, const hs_hits *hits, int32_t hit,
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
expect_rows(const hs_filler *fill, const hs_bins *asking, int64_t si)
{
    const int64_t *offsets = fill->table->offsets;
    char          *j = hs_output_column(fill->table->entries, HS_WANT_J);
    if (si + 2 * AHEAD < asking->n) {
        HS_PREFETCH(offsets + asking->order[si + 2 * AHEAD]);
    }
    if (j != NULL && si + AHEAD < asking->n) {
        const size_t   width = (size_t)fill->table->entries->index_bytes;
        const int64_t *place = offsets + asking->order[si + AHEAD];
        const char    *end = j + (size_t)place[1] * width;
        const char    *most = j + (size_t)place[0] * width + MOST_EXPECTED;
        for (j += (size_t)place[0] * width; j < end && j < most; j += HS_ALIGNMENT) {
            HS_PREFETCH_WRITE(j);
        }
    }
}

/* What is needed before the rows of a visit: measures, and the place of the group's first point. */
static hs_status
begin_visit(hs_filler *fill, hs_scanner *scanner, int32_t first, const hs_hits *hits, int32_t *own)
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
put_row(const hs_filler *fill, const hs_scanner *scanner, const hs_hits *hits, int32_t hit,
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

hs_status
hs_fill_rows(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_filler      *fill = context;
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
keep_visit(hs_filler *fill, const hs_scanner *scanner, const hs_hits *hits, int32_t own,
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

void
hs_keep_numbers(hs_filler *fill, const hs_scanner *scanner, const hs_hits *hits, int64_t *where)
{
    HS_ASSERT(scanner->use == HS_BLOCK_LISTS_IDS);
    keep_visit(fill, scanner, hits, 0, where);
}

hs_status
hs_keep_rows(void *context, hs_scanner *scanner, int32_t first, const hs_hits *hits)
{
    hs_filler    *fill = context;
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
    const bool is_much = kept->n_pairs * hs_output_bytes_per_pair(kept) > HS_MOST_KEPT;
    return is_much ? HS_TOO_MUCH : HS_OK;
}

hs_status
hs_filler_open(hs_table *table, hs_output *to, hs_filler *fill)
{
    hs_account *account = &table->search->call->account;
    *fill = (hs_filler){.table = table, .to = to};
    hs_output_init(NULL, to->ndim, to->columns & HS_MEASURES, to->index_bytes, &fill->part);
    fill->numbers =
        hs_alloc(account, HS_FOR_CANDIDATES, table->most.candidates + 1, sizeof *fill->numbers);
    /* It keeps no numbers of hits: no pair must be turned round. */
    const hs_status status = hs_recorder_init(account, &fill->part, 0, &fill->recorder);
    return fill->numbers == NULL ? HS_ERR_MEMORY : status;
}

void
hs_filler_close(hs_filler *fill)
{
    hs_recorder_free(&fill->table->search->call->account, &fill->recorder);
    hs_free(&fill->table->search->call->account, fill->numbers);
    hs_output_free(&fill->part);
}

void
hs_move_rows(hs_table *table)
{
    const hs_bins  *asking = hs_search_asking(table->search);
    const int32_t  *numbers = hs_output_column(&table->kept, HS_WANT_J);
    const hs_filler fill = {.table = table, .to = table->entries, .part = table->kept};
    int64_t         from = 0;
    for (int64_t si = 0; si < asking->n; si++) {
        const int64_t *place = table->offsets + asking->order[si];
        table_row      of = {.at = place[0], .n = (int32_t)(place[1] - place[0])};
        of.point = asking->order[si];
        of.itself = NO_POINT;
        of.numbers = numbers + from;
        expect_rows(&fill, asking, si);
        put_ends(fill.to, &of);
        put_measures(&fill, of.at, from, of.n);
        from += of.n;
    }
}
