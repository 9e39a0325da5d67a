/* SPDX-License-Identifier: BSD-3-Clause */
#include "sort_pairs.h"
#include "../base/sort.h"
#include "../base/os.h"
#include "parallel.h"

#include <string.h>

/*
 * sort_pairs.c: a counting sort by i, then each point's few pairs by (j, S). A pair is one number
 * while it is sorted, j before its place, so that nothing is looked up but the S of images of one
 * pair, which is one number too as a rule. deal_out is the counting sort; then threads put rows in
 * order and write them.
 */

HS_ALWAYS_INLINE uint64_t
place_of(const hs_sorting *all, uint64_t entry)
{
    return all->has_j ? entry & ((UINT64_C(1) << all->place_bits) - 1) : entry;
}

HS_ALWAYS_INLINE bool
is_turned(const hs_sorting *all, uint64_t entry)
{
    return all->both_ways && entry % 2 != 0;
}

/* The pair of an entry, among those found. */
HS_ALWAYS_INLINE int64_t
pair_of(const hs_sorting *all, uint64_t entry)
{
    return (int64_t)(place_of(all, entry) >> all->both_ways);
}

HS_ALWAYS_INLINE int32_t
second_of(const hs_sorting *all, uint64_t entry)
{
    if (all->has_j) {
        return (int32_t)(entry >> all->place_bits);
    }
    return is_turned(all, entry) ? all->i[pair_of(all, entry)] : all->j[pair_of(all, entry)];
}

/* Component k of S; -S wraps around, which orders images no less. */
HS_ALWAYS_INLINE int32_t
shift_of(const hs_sorting *all, uint64_t entry, int k)
{
    const int32_t shift = all->shift[pair_of(all, entry) * all->found->ndim + k];
    return is_turned(all, entry) ? (int32_t)(0u - (uint32_t)shift) : shift;
}

HS_ALWAYS_INLINE uint64_t
entry_of(const hs_sorting *all, int32_t j, int64_t place)
{
    return all->has_j ? (uint64_t)j << all->place_bits | (uint64_t)place : (uint64_t)place;
}

/* The entry that a row begins at. */
HS_ALWAYS_INLINE int64_t
row_begin(const hs_sorting *all, int64_t row)
{
    return row > 0 ? all->end[row - 1] : 0;
}

/* Pairs of two points that insertion sorts in less time than a heap. */
#define FEW 48

static bool
is_before(const hs_sorting *all, uint64_t a, uint64_t b)
{
    const int32_t ja = second_of(all, a), jb = second_of(all, b);
    if (ja != jb) {
        return ja < jb;
    }
    for (int k = 0; all->shift != NULL && k < all->found->ndim; k++) {
        const int32_t sa = shift_of(all, a, k), sb = shift_of(all, b, k);
        if (sa != sb) {
            return sa < sb;
        }
    }
    return false;
}

static void
sift_down(const hs_sorting *all, uint64_t *heap, int64_t root, int64_t n)
{
    const uint64_t moving = heap[root];
    for (int64_t child; (child = 2 * root + 1) < n; root = child) {
        if (child + 1 < n && is_before(all, heap[child], heap[child + 1])) {
            child++;
        }
        if (!is_before(all, moving, heap[child])) {
            break;
        }
        heap[root] = heap[child];
    }
    heap[root] = moving;
}

/* Sorts by (j, S), whatever these are: insertion sort for a few, heap sort for a crowd. */
static void
sort_any(const hs_sorting *all, uint64_t *row, int64_t n)
{
    if (n <= FEW) {
        for (int64_t e = 1; e < n; e++) {
            const uint64_t moving = row[e];
            int64_t        at = e;
            for (; at > 0 && is_before(all, moving, row[at - 1]); at--) {
                row[at] = row[at - 1];
            }
            row[at] = moving;
        }
        return;
    }
    for (int64_t root = n / 2; root-- > 0;) {
        sift_down(all, row, root, n);
    }
    for (int64_t end = n - 1; end > 0; end--) {
        const uint64_t largest = row[0];
        row[0] = row[end];
        row[end] = largest;
        sift_down(all, row, 0, end);
    }
}

/* S as one number that orders images; false where it does not fit. */
static bool
image_key(const hs_sorting *all, uint64_t entry, uint64_t *key)
{
    const int     d = all->found->ndim, width = d > 1 ? 64 / d : 32;
    const int64_t middle = INT64_C(1) << (width - 1);
    *key = 0;
    for (int k = 0; k < d; k++) {
        const int64_t shift = shift_of(all, entry, k) + middle;
        if (shift < 0 || shift >> width != 0) {
            return false;
        }
        *key = *key << width | (uint64_t)shift;
    }
    return true;
}

/* Sorts pairs of two points by S. */
static void
sort_images(const hs_sorting *all, uint64_t *row, int64_t n, uint64_t *keys)
{
    bool fit = n <= FEW;
    for (int64_t e = 0; e < n && fit; e++) {
        fit = image_key(all, row[e], &keys[e]);
    }
    for (int64_t e = 1; e < n && fit; e++) {
        const uint64_t moving = row[e], key = keys[e];
        int64_t        at = e;
        for (; at > 0 && keys[at - 1] > key; at--) {
            row[at] = row[at - 1];
            keys[at] = keys[at - 1];
        }
        row[at] = moving;
        keys[at] = key;
    }
    if (!fit) {
        sort_any(all, row, n);
    }
}

/* Puts n entries of one row in the order of (j, S). spare: room for as many. */
static void
hs_sort_row(const hs_sorting *all, uint64_t *row, int64_t n, uint64_t *spare)
{
    if (!all->has_j) {
        sort_any(all, row, n);
        return;
    }
    hs_sort_numbers(row, n, all->place_bits, spare);
    for (int64_t first = 0, end; all->shift != NULL && first < n; first = end) {
        const uint64_t j = row[first] >> all->place_bits;
        for (end = first + 1; end < n && row[end] >> all->place_bits == j;) {
            end++;
        }
        if (end - first > 1) {
            sort_images(all, row + first, end - first, spare);
        }
    }
}

/* The first row that begins at this entry or behind it. */
static int64_t
row_from(const hs_sorting *all, int64_t entry)
{
    int64_t first = 0, end = all->n_points;
    while (first < end) {
        const int64_t middle = first + (end - first) / 2;
        if (row_begin(all, middle) < entry) {
            first = middle + 1;
        } else {
            end = middle;
        }
    }
    return first;
}

/* Two passes over the pairs. Threads count strips of them, each strip the pairs of
 * every row; the sums say where those of each strip go, and then they are dealt out at once. */

#define STRIP_PAIRS (INT64_C(1) << 15) /* of a strip, at least: fewer are no work for a thread */

#ifdef HS_TESTING
static int most_place_bits = 63;

int
hs_test_sort_place_bits(int bits)
{
    const int before = most_place_bits;
    most_place_bits = bits;
    return before;
}
#else
enum { most_place_bits = 63 };
#endif

/* Two passes over the pairs, by strips that each have numbers of their own for each row. */
typedef struct strips {
    hs_sorting *all;
    int         n;
    int64_t    *next[HS_SLABS]; /* how many, then the place of the next; the last are all->end */
    int32_t     any[HS_SLABS];  /* the bits of all numbers j */
} strips;

/* A hs_slab_fn. */
static hs_status
count_strip(void *context, int strip, int64_t first, int64_t last)
{
    strips           *doing = context;
    const hs_sorting *all = doing->all;
    int64_t          *counts = doing->next[strip];
    int32_t           any = 0;
    for (int64_t p = first; p < last; p++) {
        counts[all->i[p] - all->first_point]++;
        any |= all->j[p];
        if (all->both_ways) {
            counts[all->j[p] - all->first_point]++;
            any |= all->i[p];
        }
    }
    doing->any[strip] |= any;
    return HS_OK;
}

/* From numbers of pairs to places: row by row, and in each row strip by strip. */
static void
accumulate(const strips *doing)
{
    hs_sorting *all = doing->all;
    int64_t     place = 0;
    int32_t     any = 0;
    for (int64_t row = 0; row < all->n_points; row++) {
        const int64_t begin = place;
        for (int strip = 0; strip < doing->n; strip++) {
            const int64_t count = doing->next[strip][row];
            doing->next[strip][row] = place;
            place += count;
        }
        all->longest = place - begin > all->longest ? place - begin : all->longest;
    }
    for (int strip = 0; strip < doing->n; strip++) {
        any |= doing->any[strip];
    }
    HS_ASSERT(place == all->n);
    all->place_bits = 64 - hs_count_bits((uint64_t)any | 1);
    all->has_j =
        all->n >> (all->place_bits < most_place_bits ? all->place_bits : most_place_bits) == 0;
}

/* A hs_slab_fn: puts the entries in rows. */
static hs_status
deal_strip(void *context, int strip, int64_t first, int64_t last)
{
    const strips     *doing = context;
    const hs_sorting *all = doing->all;
    int64_t          *next = doing->next[strip];
    for (int64_t p = first; p < last; p++) {
        const int32_t i = all->i[p], j = all->j[p];
        if (all->both_ways) {
            all->entries[next[i - all->first_point]++] = entry_of(all, j, 2 * p);
            all->entries[next[j - all->first_point]++] = entry_of(all, i, 2 * p + 1);
        } else {
            all->entries[next[i - all->first_point]++] = entry_of(all, j, p);
        }
    }
    return HS_OK;
}

/* Strips for this team: each with pairs enough, and no more further numbers than pairs. */
static int
choose_strips(const hs_sorting *all)
{
    const int64_t n_pairs = all->found->n_pairs;
    const int     size = hs_team_size(all->call->team);
    int           n = size < HS_SLABS ? size : HS_SLABS;
    while (n > 1 && (n_pairs < n * STRIP_PAIRS || (n - 1) * all->n_points > n_pairs)) {
        n--;
    }
    return n;
}

/* Sets end, n, longest, has_j, place_bits and entries, which the caller frees, also on failure: the
 * entries of each row together, in no order yet. i, j and what describes the pairs are there
 * already. */
static hs_status
deal_out(hs_sorting *all)
{
    hs_call      *call = all->call;
    const int64_t n_pairs = all->found->n_pairs;
    const size_t  size = (size_t)all->n_points * sizeof *all->end;
    strips        doing = {.all = all, .n = choose_strips(all)};
    int64_t      *others = NULL;
    all->n = all->both_ways ? 2 * n_pairs : n_pairs;
    all->entries = hs_alloc(&call->account, HS_FOR_SORTING, all->n, sizeof *all->entries);
    if (all->entries == NULL) {
        return HS_ERR_MEMORY;
    }
    if (doing.n > 1) { /* last: without memory for these there is one strip */
        others =
            hs_alloc(&call->account, HS_FOR_SORTING, (doing.n - 1) * all->n_points, sizeof *others);
        doing.n = others == NULL ? 1 : doing.n;
    }
    for (int strip = 0; strip < doing.n; strip++) {
        doing.next[strip] = strip == doing.n - 1 ? all->end : others + strip * all->n_points;
        memset(doing.next[strip], 0, size);
    }
    hs_status status =
        hs_walk_strips(call->team, &call->options, n_pairs, doing.n, count_strip, &doing);
    if (status == HS_OK) {
        accumulate(&doing);
        status = hs_walk_strips(call->team, &call->options, n_pairs, doing.n, deal_strip, &doing);
    }
    hs_free(&call->account, others);
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

/* The other quantities of n entries, at most PUT. */
static void
put_measures(const hs_sorting *all, const uint64_t *entries, int64_t n, hs_output *sorted)
{
    const int      d = all->found->ndim;
    const double  *distances = hs_output_column(all->found, HS_WANT_DISTANCE);
    const double  *vectors = hs_output_column(all->found, HS_WANT_VECTOR);
    double        *distance = hs_output_next(sorted, HS_WANT_DISTANCE);
    double        *vector = hs_output_next(sorted, HS_WANT_VECTOR);
    int32_t       *shift = hs_output_next(sorted, HS_WANT_SHIFT);
    int32_t       *shell = hs_output_next(sorted, HS_WANT_SHELL);
    const int32_t *shells = hs_output_column(all->found, HS_WANT_SHELL);
    for (int64_t e = 0; e < n && distance != NULL; e++) {
        distance[e] = distances[pair_of(all, entries[e])];
    }
    for (int64_t e = 0; e < n && shell != NULL; e++) {
        shell[e] = shells[pair_of(all, entries[e])];
    }
    for (int64_t e = 0; e < n && vector != NULL; e++) {
        const double *from = vectors + pair_of(all, entries[e]) * d;
        const bool    turned = is_turned(all, entries[e]);
        for (int k = 0; k < d; k++) {
            *vector++ = turned ? -from[k] + 0.0 : from[k]; /* a zero has no sign */
        }
    }
    for (int64_t e = 0; e < n && shift != NULL; e++) {
        for (int k = 0; k < d; k++) {
            *shift++ = shift_of(all, entries[e], k);
        }
    }
}

/* The next n entries, of row *row and those behind it. */
static void
put_some(const hs_sorting *all, int64_t first, int64_t n, int64_t *row, hs_output *sorted)
{
    const uint64_t *entries = all->entries + first;
    const int       bytes = sorted->index_bytes;
    char           *both = hs_output_next(sorted, HS_WANT_BOTH);
    int32_t         i[PUT], j[PUT];
    for (int64_t e = 0; e < n; e++) {
        while (all->end[*row] <= first + e) {
            ++*row;
        }
        i[e] = all->first_point + (int32_t)*row;
        j[e] = second_of(all, entries[e]);
    }
    hs_put_indices(hs_output_next(sorted, HS_WANT_I), bytes, 1, i, 1, n);
    hs_put_indices(hs_output_next(sorted, HS_WANT_J), bytes, 1, j, 1, n);
    hs_put_indices(both, bytes, 2, i, 1, n);
    hs_put_indices(both == NULL ? NULL : both + bytes, bytes, 2, j, 1, n);
    put_measures(all, entries, n, sorted);
    sorted->n_pairs += n;
}

/* Rows are put in order and written. */
typedef struct row_job {
    const hs_sorting *all;
    hs_output        *sorted;
    int64_t           before; /* pairs that it has already */
    int64_t           n_ranges;
} row_job;

/* What one thread works with. */
typedef struct worker {
    hs_committer committer;
    row_job     *job;
    hs_output    sorted; /* the job's; where this thread writes next */
    uint64_t    *spare;  /* owned */
    int64_t      work;   /* since the last poll */
} worker;

static hs_status
note_work(worker *me, int64_t entries)
{
    me->work += entries;
    if (me->work <= POLL_ENTRIES) {
        return HS_OK;
    }
    me->work = 0;
    return hs_poll(me->committer.options, 1.0);
}

/* A hs_range_fn: the rows that begin in a range of entries, as a few rows may have most of them. */
static hs_status
do_range(void *context, int64_t range)
{
    worker           *me = context;
    const hs_sorting *all = me->job->all;
    const int64_t     first_row = row_from(all, range * RANGE_ENTRIES);
    const int64_t     end_row = row_from(all, (range + 1) * RANGE_ENTRIES);
    const int64_t     begin = row_begin(all, first_row);
    const int64_t     end = row_begin(all, end_row);
    hs_status         status = HS_OK;
    me->sorted.n_pairs = me->job->before + begin;
    if (all->call->team != NULL) { /* before the ranges behind this one write to its last pages */
        hs_output_touch(&me->sorted, me->sorted.n_pairs, end - begin);
    }
    for (int64_t row = first_row; row < end_row && status == HS_OK; row++) {
        const int64_t first = row_begin(all, row), n = all->end[row] - first;
        hs_sort_row(all, all->entries + first, n, me->spare);
        status = note_work(me, n);
    }
    for (int64_t first = begin, row = first_row; first < end && status == HS_OK; first += PUT) {
        const int64_t n = end - first < PUT ? end - first : PUT;
        put_some(all, first, n, &row, &me->sorted);
        status = note_work(me, n);
    }
    return status;
}

static hs_status
open_worker(void *context, void *place)
{
    row_job *job = context;
    worker  *me = place;
    hs_call *call = job->all->call;
    me->job = job;
    me->sorted = *job->sorted;
    me->spare = hs_alloc(&call->account, HS_FOR_SORTING, job->all->longest, sizeof *me->spare);
    return me->spare != NULL ? HS_OK : HS_ERR_MEMORY;
}

static void
close_worker(void *context, void *place)
{
    const row_job *job = context;
    hs_free(&job->all->call->account, ((worker *)place)->spare);
}

static hs_status
do_ranges(row_job *job)
{
    hs_call *call = job->all->call;
    /* Each thread has room for the longest row: where that is much of all, one thread sorts. */
    if (call->team != NULL && job->n_ranges > 1 &&
        job->all->longest <= job->all->n / hs_team_size(call->team)) {
        hs_failure ignored;
        hs_crew    crew = {.call = call,
                           .job = job,
                           .worker_size = sizeof(worker),
                           .open = open_worker,
                           .close = close_worker,
                           .n_ranges = job->n_ranges,
                           .search = do_range};
        return hs_crew_run(&crew, &ignored);
    }
    worker    me = {.committer = {.options = &call->options}};
    hs_status status = open_worker(job, &me);
    for (int64_t range = 0; range < job->n_ranges && status == HS_OK; range++) {
        status = do_range(&me, range);
    }
    close_worker(job, &me);
    return status;
}

/* Once all entries are in their rows. */
static hs_status
put_all(const hs_sorting *all, hs_output *sorted)
{
    if (sorted->fixed && all->n > sorted->capacity) {
        sorted->n_pairs = all->n; /* tells hs_pairs_conclude that they do not fit */
        return HS_OK;
    }
    row_job   job = {.all = all,
                     .sorted = sorted,
                     .before = sorted->n_pairs,
                     .n_ranges = (all->n + RANGE_ENTRIES - 1) / RANGE_ENTRIES};
    hs_status status = sorted->fixed ? HS_OK : hs_output_reserve(sorted, all->n, 1.0);
    if (status == HS_OK) {
        status = do_ranges(&job);
        sorted->n_pairs += status == HS_OK ? all->n : 0;
    }
    return status;
}

/* A hs_poll_fn: the caller's, by its options, who is told that all pairs are found. */
static bool
poll_when_found(void *context, double fraction)
{
    const hs_options *callers = context;
    (void)fraction;
    return callers->poll(callers->poll_context, 1.0);
}

hs_status
hs_sort_pairs(hs_call *call, int32_t first_point, int64_t n_rows, const hs_output *found,
              bool both_ways, int64_t *offsets, hs_output *sorted)
{
    hs_options *options = &call->options, callers = *options;
    hs_sorting  all = {.call = call,
                       .first_point = first_point,
                       .n_points = n_rows,
                       .found = found,
                       .i = hs_output_column(found, HS_WANT_I),
                       .j = hs_output_column(found, HS_WANT_J),
                       .shift = hs_output_column(found, HS_WANT_SHIFT),
                       .both_ways = both_ways,
                       .end = offsets};
    hs_status   status = HS_OK;
    if (callers.poll != NULL) {
        options->poll = poll_when_found;
        options->poll_context = &callers;
    }
    if (offsets == NULL) {
        all.end = hs_alloc(&call->account, HS_FOR_SORTING, n_rows, sizeof *all.end);
        status = all.end != NULL ? HS_OK : HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        status = deal_out(&all);
    }
    if (status == HS_OK) {
        status = put_all(&all, sorted);
    }
    hs_free(&call->account, all.entries);
    if (offsets != NULL) {
        hs_starts_of_ends(offsets, n_rows + 1);
    } else {
        hs_free(&call->account, all.end);
    }
    *options = callers;
    return status;
}
