/* SPDX-License-Identifier: BSD-3-Clause */
#include "sort_pairs.h"
#include "../base/sort.h"
#include "parallel.h"

#include <string.h>

/*
 * sort_pairs.c: a counting sort by j, then one by i, which keeps that order; where few pairs have
 * numbers j far apart, the sort by i alone, then each row by itself. Images of one pair are sorted
 * by S. A pair is one number meanwhile, its place behind j or i, so that nothing is looked up but
 * the S of images. deal_out makes the rows; then threads write them.
 */

/*
 * What is put in order. An entry is the place of a pair among those found and, where both fit into
 * 64 bits, as they do up to 2^33 entries, a number in front of that. With both ways, a place is
 * twice that, and one more for (j, i, -S).
 */
typedef struct sorting {
    hs_call         *call;
    const hs_output *found;
    hs_output       *sorted; /* entries are written behind its pairs, which are counted last */
    const int32_t   *i, *j, *shift; /* its columns; shift NULL where it is not kept */
    int32_t          first_point;
    int64_t          n_rows;
    int              both_ways;  /* 0 or 1 */
    bool             has_number; /* in front of the place */
    int              place_bits;
    uint64_t         place_mask;
    bool             ascends;   /* rows were dealt in the order of j */
    int64_t          n_entries; /* of all rows */
    int64_t          longest;   /* row that is still to be sorted, or whose images are */
    int64_t         *end;       /* n_rows; end[i - first_point]: where row i ends */
    uint64_t        *entries;   /* of each row together, j in front; ascending in the end */
} sorting;

/* The pair of an entry, among those found. */
HS_ALWAYS_INLINE int64_t
pair_of(const sorting *all, uint64_t entry)
{
    return (int64_t)((entry & all->place_mask) >> all->both_ways);
}

/* 1 if it is (j, i, -S), else 0. */
HS_ALWAYS_INLINE int
is_turned(const sorting *all, uint64_t entry)
{
    return (int)entry & all->both_ways;
}

/* The number in front of the place of an entry: j; or i, where that is looked for. */
HS_ALWAYS_INLINE int32_t
number_of(const sorting *all, uint64_t entry, bool is_i)
{
    if (all->has_number) {
        return (int32_t)(entry >> all->place_bits);
    }
    return (is_turned(all, entry) != is_i ? all->i : all->j)[pair_of(all, entry)];
}

HS_ALWAYS_INLINE uint64_t
entry_of(const sorting *all, int32_t number, uint64_t place)
{
    return all->has_number ? (uint64_t)number << all->place_bits | place : place;
}

/* The entry that a row begins at. */
HS_ALWAYS_INLINE int64_t
row_begin(const sorting *all, int64_t row)
{
    return row > 0 ? all->end[row - 1] : 0;
}

/* A component of S of an entry; of -S the least int32 stays what it is. */
HS_ALWAYS_INLINE int32_t
shift_of(const sorting *all, uint64_t entry, int k)
{
    const uint32_t shift = (uint32_t)all->shift[pair_of(all, entry) * all->found->ndim + k];
    return (int32_t)(is_turned(all, entry) ? 0u - shift : shift);
}

/* Whether S of one entry is less than that of another image of its pair. */
HS_ALWAYS_INLINE bool
is_before(const sorting *all, uint64_t one, uint64_t other)
{
    const int d = all->found->ndim;
    int       k = 0;
    while (k < d && shift_of(all, one, k) == shift_of(all, other, k)) {
        k++;
    }
    return k < d && shift_of(all, one, k) < shift_of(all, other, k);
}

/* Sorts n images of one pair by S. spare: room for n numbers. */
static void
sort_images(const sorting *all, uint64_t *row, int64_t n, uint64_t *spare)
{
    for (int64_t length = 1; length < n; length *= 2) { /* of runs in order, merged in twos */
        int64_t first = 0, middle, end, a, b;
        for (; first < n; first = end) {
            middle = n - first < length ? n : first + length;
            end = n - middle < length ? n : middle + length;
            a = first;
            b = middle;
            for (int64_t to = first; to < end; to++) {
                const bool takes_b = a == middle || (b < end && is_before(all, row[b], row[a]));
                spare[to] = takes_b ? row[b++] : row[a++];
            }
        }
        memcpy(row, spare, (size_t)n * sizeof *row);
    }
}

/* Puts n entries of one row in the order of (j, S). spare: room for as many. */
static void
sort_row(const sorting *all, uint64_t *row, int64_t n, uint64_t *spare)
{
    if (!all->ascends) {
        hs_sort_numbers(row, n, all->place_bits, spare);
    }
    for (int64_t first = 0, end; all->shift != NULL && first < n; first = end) {
        const int32_t j = number_of(all, row[first], false);
        for (end = first + 1; end < n && number_of(all, row[end], false) == j;) {
            end++;
        }
        if (end - first > 1) {
            sort_images(all, row + first, end - first, spare);
        }
    }
}

/* The first of n rows, which end there, that begins at this entry or behind it. */
static int64_t
row_from(const int64_t *ends, int64_t n, int64_t entry)
{
    int64_t first = 0, end = n;
    while (first < end) {
        const int64_t middle = first + (end - first) / 2;
        if ((middle > 0 ? ends[middle - 1] : 0) < entry) {
            first = middle + 1;
        } else {
            end = middle;
        }
    }
    return first;
}

/* Threads count strips of what is dealt, each strip the entries of every row; the sums say where
 * those of each strip go, and then they are dealt out at once. */

/* Pairs of a strip, at least: fewer are no work for a thread. */
#define STRIP_PAIRS (INT64_C(1) << 15)

/* Numbers j for each entry, and so many more, beyond which pairs are not dealt by j. */
#define MOST_APART 4
#define ALSO_APART 64

#ifdef HS_TESTING
int hs_test_place_bits = 63;
#define MOST_PLACE_BITS hs_test_place_bits
#else
#define MOST_PLACE_BITS 63
#endif

/* A counting sort of pairs, by one of their two numbers, from `least` on; or of entries that have
 * been sorted by j before, by i. */
typedef struct dealing {
    const sorting  *all;
    const int32_t  *key, *other; /* of pairs; the other is put in front of their places */
    const uint64_t *from;        /* NULL, or the entries by j ... */
    const int64_t  *from_end;    /* ... from its least on, where those of each end */
    uint64_t       *to;          /* the rows */
    int32_t         least, from_least;
    int64_t         n_from; /* numbers from from_least on */
    int64_t         n_rows;
    int             n_strips;
    int64_t        *next[HS_SLABS]; /* how many, then the place of the next */
} dealing;

/* A hs_slab_fn. */
static hs_status
count_strip(void *context, int strip, int64_t first, int64_t last)
{
    const dealing  *deal = context;
    const sorting   all = *deal->all;
    const int32_t  *key = deal->key, *other = deal->other;
    const uint64_t *from = deal->from;
    const int32_t   least = deal->least;
    int64_t        *counts = deal->next[strip];
    for (int64_t e = first; from != NULL && e < last; e++) {
        counts[number_of(&all, from[e], true) - least]++;
    }
    for (int64_t p = first; from == NULL && p < last; p++) {
        counts[key[p] - least]++;
        if (all.both_ways) {
            counts[other[p] - least]++;
        }
    }
    return HS_OK;
}

/* A hs_slab_fn: puts entries in rows. */
static hs_status
deal_strip(void *context, int strip, int64_t first, int64_t last)
{
    const dealing  *deal = context;
    const sorting   all = *deal->all;
    const int32_t  *key = deal->key, *other = deal->other;
    const uint64_t *from = deal->from;
    const int32_t   least = deal->least;
    int64_t        *next = deal->next[strip];
    uint64_t       *to = deal->to;
    if (from != NULL) {
        int64_t row = row_from(deal->from_end, deal->n_from, first + 1) - 1;
        for (int64_t e = first; e < last; row++) {
            const int32_t j = deal->from_least + (int32_t)row;
            const int64_t end = deal->from_end[row] < last ? deal->from_end[row] : last;
            for (; e < end; e++) {
                const uint64_t entry = from[e];
                to[next[number_of(&all, entry, true) - least]++] =
                    entry_of(&all, j, entry & all.place_mask);
            }
        }
        return HS_OK;
    }
    for (int64_t p = first; all.both_ways && p < last; p++) {
        const int32_t a = key[p], b = other[p];
        to[next[a - least]++] = entry_of(&all, b, (uint64_t)p * 2);
        to[next[b - least]++] = entry_of(&all, a, (uint64_t)p * 2 + 1);
    }
    for (int64_t p = first; !all.both_ways && p < last; p++) {
        to[next[key[p] - least]++] = entry_of(&all, other[p], (uint64_t)p);
    }
    return HS_OK;
}

/* Sorts n_items. end: receives where each row ends. */
static hs_status
deal_rows(dealing *deal, int64_t n_items, int64_t *end)
{
    hs_call  *call = deal->all->call;
    int64_t  *others = NULL, place = 0;
    hs_status status = HS_OK;
    deal->n_strips = hs_strips_for(call->team, n_items, STRIP_PAIRS, deal->n_rows);
    if (deal->n_strips > 1) { /* without memory for these there is one strip */
        others = hs_alloc(&call->account, HS_FOR_SORTING, (deal->n_strips - 1) * deal->n_rows,
                          sizeof *others);
        deal->n_strips = others == NULL ? 1 : deal->n_strips;
    }
    for (int strip = 0; strip < deal->n_strips; strip++) {
        deal->next[strip] = strip == deal->n_strips - 1 ? end : others + strip * deal->n_rows;
        memset(deal->next[strip], 0, (size_t)deal->n_rows * sizeof *end);
    }
    /* With both ways there are as many by i as by j. */
    if (deal->from != NULL && deal->all->both_ways && deal->n_strips == 1) {
        for (int64_t row = 0; row < deal->n_rows; row++) {
            end[row] = deal->from_end[row] - (row > 0 ? deal->from_end[row - 1] : 0);
        }
    } else {
        status =
            hs_walk_points(call->team, &call->options, n_items, deal->n_strips, count_strip, deal);
    }
    for (int64_t row = 0; row < deal->n_rows; row++) { /* from counts to places, row by row */
        for (int strip = 0; strip < deal->n_strips; strip++) {
            const int64_t count = deal->next[strip][row];
            deal->next[strip][row] = place;
            place += count;
        }
    }
    if (status == HS_OK) {
        status =
            hs_walk_points(call->team, &call->options, n_items, deal->n_strips, deal_strip, deal);
    }
    hs_free(&call->account, others);
    return status;
}

/* Finds the entries of each row, which the caller frees, also on failure; sets all members but
 * those of the pairs found and of the rows. */
static hs_status
deal_out(sorting *all)
{
    hs_account   *account = &all->call->account;
    const int64_t n_pairs = all->found->n_pairs;
    const bool    by_rows = all->both_ways || n_pairs == 0;                    /* so are all j */
    int32_t       least = by_rows ? all->first_point : INT32_MAX, largest = 0; /* j */
    for (int64_t p = 0; !by_rows && p < n_pairs; p++) {
        least = all->j[p] < least ? all->j[p] : least;
        largest = all->j[p] > largest ? all->j[p] : largest;
    }
    const int64_t n_seconds = by_rows ? all->n_rows : (int64_t)largest - least + 1;
    const int64_t most_i = all->first_point + all->n_rows;
    const int64_t most = least + n_seconds > most_i ? least + n_seconds : most_i;
    dealing       by_i = {.all = all,
                          .key = all->i,
                          .other = all->j,
                          .least = all->first_point,
                          .n_rows = all->n_rows};
    dealing       by_j = {
              .all = all, .key = all->j, .other = all->i, .least = least, .n_rows = n_seconds};
    int64_t  *end = NULL;
    hs_status status = HS_OK;
    all->n_entries = n_pairs << all->both_ways;
    all->place_bits = 64 - hs_count_bits((uint64_t)most | 1);
    const int bits = all->place_bits < MOST_PLACE_BITS ? all->place_bits : MOST_PLACE_BITS;
    all->has_number = all->n_entries >> bits == 0;
    all->place_mask = all->has_number ? (UINT64_C(1) << all->place_bits) - 1 : UINT64_MAX;
    all->entries = hs_alloc(account, HS_FOR_SORTING, all->n_entries, sizeof *all->entries);
    if (all->entries == NULL) {
        return HS_ERR_MEMORY;
    }
    by_i.to = all->entries;
    if (n_seconds <= MOST_APART * all->n_entries + ALSO_APART || !all->has_number) {
        by_j.to = hs_alloc(account, HS_FOR_SORTING, all->n_entries, sizeof *by_j.to);
        end = hs_alloc(account, HS_FOR_SORTING, n_seconds, sizeof *end);
        all->ascends = by_j.to != NULL && end != NULL;
    }
    if (!all->ascends && !all->has_number) { /* otherwise it is done row by row */
        status = HS_ERR_MEMORY;
    } else if (all->ascends) {
        status = deal_rows(&by_j, n_pairs, end);
        by_i.from = by_j.to;
        by_i.from_end = end;
        by_i.from_least = least;
        by_i.n_from = n_seconds;
    }
    if (status == HS_OK) {
        status = deal_rows(&by_i, all->ascends ? all->n_entries : n_pairs, all->end);
    }
    const bool is_done = status != HS_OK || (all->ascends && all->shift == NULL);
    for (int64_t row = 0; !is_done && row < all->n_rows; row++) {
        const int64_t n = all->end[row] - row_begin(all, row);
        all->longest = n > all->longest ? n : all->longest;
    }
    hs_free(account, by_j.to);
    hs_free(account, end);
    return status;
}

#define POLL_ENTRIES  (INT64_C(1) << 17) /* sorted and written between two calls of poll() */
#define RANGE_ENTRIES 8192 /* of a range, about: with what is written of them they fit a cache */
#define PUT           256  /* entries that are written at a time */

unsigned
hs_sort_columns(const hs_search *search)
{
    const unsigned wanted = search->call->options.want & ~(unsigned)HS_WANT_BOTH;
    return wanted | HS_WANT_I | HS_WANT_J | (hs_search_repeats_images(search) ? HS_WANT_SHIFT : 0);
}

/* S and D of n entries, of d components each; turned: 1 or 0. Inlined with a constant for d. */
HS_ALWAYS_INLINE void
put_components(const sorting *all, const int64_t *pair, const int32_t *turned, int64_t n, int d,
               hs_output *sorted)
{
    const double        *vectors = hs_output_column(all->found, HS_WANT_VECTOR);
    const int32_t       *shifts = all->shift;
    double *HS_RESTRICT  vector = hs_output_next(sorted, HS_WANT_VECTOR);
    int32_t *HS_RESTRICT shift = hs_output_next(sorted, HS_WANT_SHIFT);
    for (int64_t e = 0; e < n && vector != NULL; e++) {
        for (int k = 0; k < d; k++) {
            const double component = vectors[pair[e] * d + k];
            vector[e * d + k] = (turned[e] ? -component : component) + 0.0; /* no -0.0 */
        }
    }
    for (int64_t e = 0; e < n && shift != NULL; e++) {
        for (int k = 0; k < d; k++) {
            const uint32_t minus = 0u - (uint32_t)turned[e];
            shift[e * d + k] = (int32_t)(((uint32_t)shifts[pair[e] * d + k] ^ minus) - minus);
        }
    }
}

/* The next n entries, at most PUT, of row *row and those behind it. */
static void
put_some(const sorting *rows, int64_t first, int64_t n, int64_t *row, hs_output *sorted)
{
    const sorting        all = *rows;
    const uint64_t      *entries = all.entries + first;
    const int            bytes = sorted->index_bytes, d = all.found->ndim;
    const double        *distances = hs_output_column(all.found, HS_WANT_DISTANCE);
    const int32_t       *shells = hs_output_column(all.found, HS_WANT_SHELL);
    char                *both = hs_output_next(sorted, HS_WANT_BOTH);
    double *HS_RESTRICT  distance = hs_output_next(sorted, HS_WANT_DISTANCE);
    int32_t *HS_RESTRICT shell = hs_output_next(sorted, HS_WANT_SHELL);
    const bool           has_i = sorted->columns & (HS_WANT_I | HS_WANT_BOTH);
    int32_t              i[PUT], j[PUT], turned[PUT];
    int64_t              pair[PUT];
    for (int64_t e = 0; has_i && e < n;) { /* rows may be empty */
        while (all.end[*row] <= first + e) {
            ++*row;
        }
        const int64_t left = all.end[*row] - first;
        for (const int64_t end = left < n ? left : n; e < end; e++) {
            i[e] = all.first_point + (int32_t)*row;
        }
    }
    for (int64_t e = 0; e < n; e++) {
        pair[e] = pair_of(&all, entries[e]);
        turned[e] = is_turned(&all, entries[e]);
        j[e] = number_of(&all, entries[e], false);
    }
    hs_put_indices(hs_output_next(sorted, HS_WANT_I), bytes, 1, i, 1, n);
    hs_put_indices(hs_output_next(sorted, HS_WANT_J), bytes, 1, j, 1, n);
    hs_put_indices(both, bytes, 2, i, 1, n);
    hs_put_indices(both == NULL ? NULL : both + bytes, bytes, 2, j, 1, n);
    for (int64_t e = 0; e < n && distance != NULL; e++) {
        distance[e] = distances[pair[e]];
    }
    for (int64_t e = 0; e < n && shell != NULL; e++) {
        shell[e] = shells[pair[e]];
    }
    if (d == 3) {
        put_components(rows, pair, turned, n, 3, sorted);
    } else {
        put_components(rows, pair, turned, n, d, sorted);
    }
    sorted->n_pairs += n;
}

/* What one thread works with that puts rows in order and writes them. */
typedef struct worker {
    hs_committer committer;
    hs_output    sorted; /* that of all; where this thread writes next */
    uint64_t    *spare;  /* owned */
} worker;

/* A hs_range_fn: the rows that begin in a range of entries, as a few rows may have most of them. */
static hs_status
do_range(void *context, int64_t range)
{
    worker        *me = context;
    const sorting *all = me->committer.job;
    const int64_t  first_row = row_from(all->end, all->n_rows, range * RANGE_ENTRIES);
    const int64_t  end_row = row_from(all->end, all->n_rows, (range + 1) * RANGE_ENTRIES);
    const int64_t  begin = row_begin(all, first_row);
    const int64_t  end = row_begin(all, end_row);
    hs_status      status = HS_OK;
    me->sorted.n_pairs = all->sorted->n_pairs + begin;
    if (all->call->team != NULL) { /* before the ranges behind this one write to its last pages */
        hs_output_touch(&me->sorted, me->sorted.n_pairs, end - begin);
    }
    for (int64_t row = first_row; row < end_row && status == HS_OK; row++) {
        const int64_t first = row_begin(all, row), n = all->end[row] - first;
        sort_row(all, all->entries + first, n, me->spare);
        status = hs_note_work(&me->committer, n, POLL_ENTRIES, 1.0);
    }
    for (int64_t first = begin, row = first_row; first < end && status == HS_OK; first += PUT) {
        const int64_t n = end - first < PUT ? end - first : PUT;
        put_some(all, first, n, &row, &me->sorted);
        status = hs_note_work(&me->committer, n, POLL_ENTRIES, 1.0);
    }
    return status;
}

static hs_status
open_worker(void *context, void *place)
{
    const sorting *all = context;
    worker        *me = place;
    me->sorted = *all->sorted;
    me->spare = hs_alloc(&all->call->account, HS_FOR_SORTING, all->longest, sizeof *me->spare);
    return me->spare != NULL ? HS_OK : HS_ERR_MEMORY;
}

static void
close_worker(void *context, void *place)
{
    hs_free(&((const sorting *)context)->call->account, ((worker *)place)->spare);
}

/* Once all entries are in their rows. */
static hs_status
put_all(sorting *all)
{
    hs_call      *call = all->call;
    hs_output    *sorted = all->sorted;
    const int64_t n_ranges = (all->n_entries + RANGE_ENTRIES - 1) / RANGE_ENTRIES;
    if (sorted->fixed && all->n_entries > sorted->capacity) {
        sorted->n_pairs = all->n_entries; /* tells hs_pairs_conclude that they do not fit */
        return HS_OK;
    }
    hs_status status = sorted->fixed ? HS_OK : hs_output_reserve(sorted, all->n_entries, 1.0);
    if (status != HS_OK) {
        return status;
    }
    /* Each thread has room for the longest row: where that is much of all, one thread sorts. */
    if (call->team != NULL && n_ranges > 1 &&
        all->longest <= all->n_entries / hs_team_size(call->team)) {
        hs_failure ignored;
        hs_crew    crew = {.call = call,
                           .job = all,
                           .worker_size = sizeof(worker),
                           .open = open_worker,
                           .close = close_worker,
                           .n_ranges = n_ranges,
                           .search = do_range};
        status = hs_crew_run(&crew, &ignored);
    } else {
        worker me = {.committer = {.options = &call->options, .job = all}};
        status = open_worker(all, &me);
        for (int64_t range = 0; range < n_ranges && status == HS_OK; range++) {
            status = do_range(&me, range);
        }
        close_worker(all, &me);
    }
    sorted->n_pairs += status == HS_OK ? all->n_entries : 0;
    return status;
}

hs_status
hs_sort_pairs(hs_call *call, int32_t first_point, int64_t n_rows, const hs_output *found,
              bool both_ways, int64_t *offsets, hs_output *sorted)
{
    sorting   all = {.call = call,
                     .first_point = first_point,
                     .n_rows = n_rows,
                     .found = found,
                     .sorted = sorted,
                     .i = hs_output_column(found, HS_WANT_I),
                     .j = hs_output_column(found, HS_WANT_J),
                     .shift = hs_output_column(found, HS_WANT_SHIFT),
                     .both_ways = both_ways ? 1 : 0,
                     .end = offsets};
    hs_status status = HS_OK;
    if (offsets == NULL) {
        all.end = hs_alloc(&call->account, HS_FOR_SORTING, n_rows, sizeof *all.end);
        status = all.end != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        status = deal_out(&all);
    }
    if (status == HS_OK) {
        status = put_all(&all);
    }
    hs_free(&call->account, all.entries);
    if (offsets != NULL) {
        hs_starts_of_ends(offsets, n_rows + 1);
    } else {
        hs_free(&call->account, all.end);
    }
    return status;
}
