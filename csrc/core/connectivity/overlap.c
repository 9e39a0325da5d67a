/* SPDX-License-Identifier: BSD-3-Clause */
#include "overlap.h"
#include "../base/sort.h"
#include "../base/os.h"
#include "../collect/parallel.h"
#include "../exact/metric.h"

#include <string.h>
#include <math.h>

/*
 * overlap.c: row i is the union, over all k that i gathers, of the points that gather k. Under the
 * numbers of the order of space these are few words of bits, which the union takes 64 points at a
 * time. Its points are then put in order under their own numbers. Threads take ranges of the order
 * of space, whose rows are written in this order.
 */

/*
 * A set of numbers that is filled in any order and emptied in ascending order, again and
 * again. A bit for each number, and two levels above that tell which words have any: emptying takes
 * time by the words that were touched, and a little by the size of the set.
 */

#define HS_BIT_LEVELS 3

typedef struct hs_bit_set {
    uint64_t *word[HS_BIT_LEVELS]; /* parts of one block, owned by word[0] */
    int64_t   n_words[HS_BIT_LEVELS];
} hs_bit_set;

/* An empty set of numbers below n. False when memory is short. */
HS_ALWAYS_INLINE bool
hs_bit_set_make(hs_account *account, int64_t n, hs_bit_set *set)
{
    int64_t all = 0, words = n;
    for (int l = 0; l < HS_BIT_LEVELS; l++) {
        words = (words + 63) / 64;
        set->n_words[l] = words;
        all += words;
    }
    set->word[0] = hs_alloc(account, HS_FOR_SORTING, all, sizeof(uint64_t));
    if (set->word[0] == NULL) {
        return false;
    }
    memset(set->word[0], 0, (size_t)all * sizeof(uint64_t));
    for (int l = 1; l < HS_BIT_LEVELS; l++) {
        set->word[l] = set->word[l - 1] + set->n_words[l - 1];
    }
    return true;
}

HS_ALWAYS_INLINE void
hs_bit_set_free(hs_account *account, hs_bit_set *set)
{
    hs_free(account, set->word[0]);
    set->word[0] = NULL;
}

/* Adds numbers from 64 * word on, one for each bit. */
HS_ALWAYS_INLINE void
hs_bit_set_add_word(hs_bit_set *set, int32_t word, uint64_t bits)
{
    const uint64_t before = set->word[0][word];
    set->word[0][word] = before | bits;
    if (before == 0) {
        set->word[1][word >> 6] |= UINT64_C(1) << (word & 63);
        set->word[2][word >> 12] |= UINT64_C(1) << (word >> 6 & 63);
    }
}

HS_ALWAYS_INLINE void
hs_bit_set_add(hs_bit_set *set, int32_t number)
{
    hs_bit_set_add_word(set, number >> 6, UINT64_C(1) << (number & 63));
}

HS_ALWAYS_INLINE bool
hs_bit_set_has(const hs_bit_set *set, int32_t number)
{
    return set->word[0][number >> 6] >> (number & 63) & 1u;
}

/* Writes all numbers, ascending, and forgets them; returns how many there were. */
HS_ALWAYS_INLINE int64_t
hs_bit_set_drain(hs_bit_set *set, int32_t *to)
{
    const int32_t *const first = to;
    for (int64_t high = 0; high < set->n_words[2]; high++) {
        for (uint64_t top = set->word[2][high]; top != 0; top &= top - 1) {
            const int64_t middle = high * 64 + hs_trailing_zeros(top);
            for (uint64_t mid = set->word[1][middle]; mid != 0; mid &= mid - 1) {
                const int64_t low = middle * 64 + hs_trailing_zeros(mid);
                for (uint64_t bits = set->word[0][low]; bits != 0; bits &= bits - 1) {
                    *to++ = (int32_t)(low * 64 + hs_trailing_zeros(bits));
                }
                set->word[0][low] = 0;
            }
            set->word[1][middle] = 0;
        }
        set->word[2][high] = 0;
    }
    return to - first;
}

/* Lengths are counted and added up; entries then come in ascending order. */

static hs_status
allocate(hs_account *account, int64_t n, hs_point_rows *rows)
{
    *rows = (hs_point_rows){.n = n};
    rows->first = hs_alloc(account, HS_FOR_SORTING, n + 1, sizeof *rows->first);
    if (rows->first == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(rows->first, 0, (size_t)(n + 1) * sizeof *rows->first);
    return HS_OK;
}

static hs_status
allocate_index(hs_account *account, int64_t n, hs_point_rows *rows)
{
    rows->index = hs_alloc(account, HS_FOR_SORTING, n, sizeof *rows->index);
    return rows->index != NULL ? HS_OK : HS_ERR_MEMORY;
}

/* Copies the row of point i, which has `length` entries, and adds i; false where it is no row. */
static bool
copy_row(const int32_t *from, int64_t length, int64_t i, int64_t n, int32_t *to)
{
    int32_t before = -1;
    bool    has_own = false;
    for (int64_t e = 0; e < length; e++) {
        const int32_t j = from[e];
        if (j <= before || j == i || j >= n) {
            return false;
        }
        if (!has_own && j > i) {
            *to++ = (int32_t)i;
            has_own = true;
        }
        *to++ = before = j;
    }
    if (!has_own) {
        *to = (int32_t)i;
    }
    return true;
}

/* Copies offsets, with room for one number more in each row. */
static bool
copy_offsets(const hs_index_rows *given, hs_point_rows *rows)
{
    int64_t before = 0;
    for (int64_t i = 0; i <= given->n; i++) {
        const int64_t first = given->offsets[i];
        if (first < before || (i == 0 && first != 0)) {
            return false;
        }
        rows->first[i] = first + i;
        before = first;
    }
    return before == given->n_indices;
}

hs_status
hs_point_rows_copy(hs_account *account, const hs_index_rows *given, hs_point_rows *rows)
{
    hs_status status = HS_ERR_ARGUMENT;
    *rows = (hs_point_rows){.n = 0};
    if (given->n >= 0 && given->n <= INT32_MAX && given->offsets != NULL &&
        (given->indices != NULL || given->n_indices == 0)) {
        status = allocate(account, given->n, rows);
    }
    if (status == HS_OK && !copy_offsets(given, rows)) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = allocate_index(account, rows->first[rows->n], rows);
    }
    for (int64_t i = 0; status == HS_OK && i < rows->n; i++) {
        const int64_t at = rows->first[i], length = rows->first[i + 1] - at - 1;
        if (!copy_row(given->indices + (at - i), length, i, rows->n, rows->index + at)) {
            status = HS_ERR_ARGUMENT;
        }
    }
    if (status != HS_OK) {
        hs_point_rows_free(account, rows);
    }
    return status;
}

/* The opposite direction, with all points under other numbers: row place[j] has the places of all i
 * in whose rows j is; order[place[i]] is i. */
static hs_status
point_rows_turn(hs_account *account, const hs_point_rows *from, const int32_t *order,
                const int32_t *place, hs_point_rows *rows)
{
    const int64_t n_entries = from->first[from->n];
    hs_status     status = allocate(account, from->n, rows);
    if (status == HS_OK) {
        status = allocate_index(account, n_entries, rows);
    }
    if (status != HS_OK) {
        hs_point_rows_free(account, rows);
        return status;
    }
    for (int64_t e = 0; e < n_entries; e++) {
        rows->first[place[from->index[e]] + 1]++;
    }
    hs_starts_of_lengths(rows->first, rows->n + 1);
    for (int64_t p = 0; p < from->n; p++) {
        const int32_t i = order[p];
        for (int64_t e = from->first[i]; e < from->first[i + 1]; e++) {
            rows->index[rows->first[place[from->index[e]]]++] = (int32_t)p;
        }
    }
    hs_starts_of_ends(rows->first, rows->n + 1);
    return HS_OK;
}

/* All neighbours of each of n points. */
static hs_status
point_rows_of(hs_account *account, const hs_output *half, int64_t n, hs_point_rows *rows)
{
    const hs_half_columns pairs = hs_half_list_columns(half);
    hs_status             status = allocate(account, n, rows);
    if (status == HS_OK) {
        status = allocate_index(account, 2 * pairs.n, rows);
    }
    if (status != HS_OK) {
        hs_point_rows_free(account, rows);
        return status;
    }
    for (int64_t e = 0; e < pairs.n; e++) {
        rows->first[pairs.i[e] + 1]++;
        rows->first[pairs.j[e] + 1]++;
    }
    hs_starts_of_lengths(rows->first, rows->n + 1);
    for (int64_t e = 0; e < pairs.n; e++) {
        rows->index[rows->first[pairs.i[e]]++] = pairs.j[e];
        rows->index[rows->first[pairs.j[e]]++] = pairs.i[e];
    }
    hs_starts_of_ends(rows->first, rows->n + 1);
    return HS_OK;
}

void
hs_point_rows_free(hs_account *account, hs_point_rows *rows)
{
    hs_free(account, rows->first);
    hs_free(account, rows->index);
    *rows = (hs_point_rows){.n = 0};
}

/* A word begins wherever the next number is not of the present one. */

/* Where each row begins; returns how many words there are. */
static int64_t
count_words(const hs_point_rows *from, int64_t *first)
{
    int64_t n = 0;
    for (int64_t k = 0; k < from->n; k++) {
        int32_t word = -1;
        first[k] = n;
        for (int64_t e = from->first[k]; e < from->first[k + 1]; e++) {
            const int32_t own = from->index[e] >> 6;
            n += own != word;
            word = own;
        }
    }
    first[from->n] = n;
    return n;
}

static void
fill_words(const hs_point_rows *from, hs_word_rows *rows)
{
    int64_t at = -1;
    for (int64_t k = 0; k < from->n; k++) {
        int32_t word = -1;
        for (int64_t e = from->first[k]; e < from->first[k + 1]; e++) {
            const int32_t own = from->index[e] >> 6;
            if (own != word) {
                rows->word[++at] = word = own;
                rows->bits[at] = 0;
            }
            rows->bits[at] |= UINT64_C(1) << (from->index[e] & 63);
        }
    }
}

/* Idempotent. */
static void
word_rows_free(hs_account *account, hs_word_rows *rows)
{
    hs_free(account, rows->first);
    hs_free(account, rows->word);
    hs_free(account, rows->bits);
    *rows = (hs_word_rows){.first = NULL};
}

/* Of rows that ascend. On failure holds nothing. */
static hs_status
word_rows_make(hs_account *account, const hs_point_rows *from, hs_word_rows *rows)
{
    *rows = (hs_word_rows){.first = NULL};
    rows->first = hs_alloc(account, HS_FOR_SORTING, from->n + 1, sizeof *rows->first);
    if (rows->first == NULL) {
        return HS_ERR_MEMORY;
    }
    const int64_t n = count_words(from, rows->first);
    rows->word = hs_alloc(account, HS_FOR_SORTING, n, sizeof *rows->word);
    rows->bits = hs_alloc(account, HS_FOR_SORTING, n, sizeof *rows->bits);
    if (rows->word == NULL || rows->bits == NULL) {
        word_rows_free(account, rows);
        return HS_ERR_MEMORY;
    }
    fill_words(from, rows);
    return HS_OK;
}

/*
 * The neighbours of the first point of a pair are marked once for all pairs that it
 * begins; those of the second that are marked are common. Threads take ranges of pairs, whose
 * entries are written in the order of pairs; what they write beside that is how long entries are.
 */

/* Neighbours that are looked at between two calls of poll(). */
#define POLL_ENTRIES (INT64_C(1) << 20)
/* Pairs of a range: some HS_RANGE_BYTES, and a millisecond. */
#define RANGE_PAIRS 1024

/* What the threads share. */
typedef struct merging {
    hs_call           *call;
    const hs_node_map *map;
    const double      *points;
    int                ndim;
    bool               ghost_pairs;
    hs_half_columns    half;
    hs_point_rows      rows;
    int64_t            longest; /* row */
    int64_t           *length;  /* of each pair and list, in the order of the table */
    int64_t           *before;  /* owned; of each range how many pairs of the table come before */
} merging;

typedef struct intersection_worker {
    hs_committer   committer;
    const merging *all;
    hs_options     options;
    hs_output      pairs;
    hs_bit_set     marked; /* as an array of bits, which are taken back one by one */
    int32_t       *common; /* owned; as many as the longest row has, and two */
    int64_t       *next;   /* owned; where each list goes on, and one more */
    int64_t        looked;
} intersection_worker;

static int64_t
longest_row(const hs_point_rows *rows)
{
    int64_t longest = 0;
    for (int64_t i = 0; i < rows->n; i++) {
        const int64_t length = rows->first[i + 1] - rows->first[i];
        longest = length > longest ? length : longest;
    }
    return longest;
}

/* ---- a worker -------------------------------------------------------------------------------- */

static hs_status
open_intersection_worker(void *context, void *place)
{
    const merging       *all = context;
    hs_account          *account = &all->call->account;
    intersection_worker *me = place;
    me->all = all;
    me->options = all->call->options;
    me->committer.options = &me->options;
    me->committer.pairs = &me->pairs;
    hs_output_init(NULL, 1, HS_WANT_J, 4, &me->pairs);
    me->common = hs_alloc(account, HS_FOR_SORTING, all->longest + 2, sizeof *me->common);
    me->next = hs_alloc(account, HS_FOR_SORTING, all->map->n_lists + 1, sizeof *me->next);
    return me->common != NULL && me->next != NULL &&
                   hs_bit_set_make(account, all->map->n, &me->marked)
               ? HS_OK
               : HS_ERR_MEMORY;
}

static void
close_intersection_worker(void *context, void *place)
{
    const merging       *all = context;
    hs_account          *account = &all->call->account;
    intersection_worker *me = place;
    hs_bit_set_free(account, &me->marked);
    hs_free(account, me->common);
    hs_free(account, me->next);
    hs_output_free(&me->pairs);
}

/* Marks the neighbours of point i, or takes the marks back. */
static void
mark(intersection_worker *me, int64_t i, bool on)
{
    const hs_point_rows *rows = &me->all->rows;
    for (int64_t e = rows->first[i]; e < rows->first[i + 1]; e++) {
        const int32_t  k = rows->index[e];
        uint64_t      *word = &me->marked.word[0][k >> 6];
        const uint64_t bit = UINT64_C(1) << (k & 63);
        *word = on ? *word | bit : *word & ~bit;
    }
}

/* Writes the common neighbours of the marked row's point i and of j to me->common; returns how many
 * there are. */
static int64_t
find_common(intersection_worker *me, int32_t i, int32_t j)
{
    const merging *all = me->all;
    const int      d = all->ndim;
    const double  *p = all->points + (int64_t)i * d, *q = all->points + (int64_t)j * d;
    int64_t        n = 0;
    for (int64_t e = all->rows.first[j]; e < all->rows.first[j + 1]; e++) {
        const int32_t k = all->rows.index[e];
        if (hs_bit_set_has(&me->marked, k) &&
            hs_foot_is_between(all->points + (int64_t)k * d, p, q, d)) {
            me->common[n++] = k;
        }
    }
    me->looked += all->rows.first[j + 1] - all->rows.first[j];
    return n;
}

/* Puts n points, by their lists, behind what is written; their order in each list stays. length:
 * of the pair's lists. */
static void
put(intersection_worker *me, int64_t n, int64_t *length)
{
    const hs_node_map *map = me->all->map;
    int32_t           *to = hs_output_next(&me->pairs, HS_WANT_J);
    memset(me->next, 0, (size_t)(map->n_lists + 1) * sizeof *me->next);
    for (int64_t e = 0; e < n; e++) {
        me->next[map->list[me->common[e]] + 1]++;
    }
    memcpy(length, me->next + 1, (size_t)map->n_lists * sizeof *length);
    hs_starts_of_lengths(me->next, (int64_t)map->n_lists + 1);
    for (int64_t e = 0; e < n; e++) {
        to[me->next[map->list[me->common[e]]]++] = map->node[me->common[e]];
    }
    me->pairs.n_pairs += n;
}

/* Polls once in a while. */
static hs_status
ask(intersection_worker *me, double fraction)
{
    if (me->looked < POLL_ENTRIES) {
        return HS_OK;
    }
    me->looked = 0;
    return hs_poll(&me->options, fraction);
}

/* Pairs [first, last) of the half list. */
static hs_status
merge_pairs(intersection_worker *me, int64_t first, int64_t last, int64_t *length)
{
    const merging *all = me->all;
    int32_t        marked = -1;
    hs_status      status = HS_OK;
    for (int64_t e = first; e < last && status == HS_OK; e++) {
        const int32_t i = all->half.i[e], j = all->half.j[e];
        bool          turned;
        if (!hs_node_pair_counts(all->map, all->ghost_pairs, i, j, &turned)) {
            continue;
        }
        if (i != marked) {
            if (marked >= 0) {
                mark(me, marked, false);
            }
            mark(me, i, true);
            marked = i;
        }
        int64_t n = find_common(me, i, j);
        me->common[n++] = turned ? j : i;
        me->common[n++] = turned ? i : j;
        status = hs_output_reserve(&me->pairs, n, 0.0);
        if (status == HS_OK) {
            put(me, n, length);
            length += all->map->n_lists;
            status = ask(me, (double)e / (double)all->half.n);
        }
    }
    if (marked >= 0) {
        mark(me, marked, false);
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
merge_range(void *context, int64_t range)
{
    intersection_worker *me = context;
    const merging       *all = me->all;
    const int64_t        first = range * RANGE_PAIRS, left = all->half.n - first;
    const int64_t        last = first + (left < RANGE_PAIRS ? left : RANGE_PAIRS);
    const hs_status      status =
        merge_pairs(me, first, last, all->length + all->before[range] * all->map->n_lists);
    return status == HS_OK ? hs_commit(&me->committer, (double)last / (double)all->half.n, true)
                           : status;
}

/* ---- all of them ----------------------------------------------------------------------------- */

/* How many pairs of the table come before each range. */
static bool
count_before(merging *doing, int64_t n_ranges)
{
    int64_t n = 0;
    doing->before =
        hs_alloc(&doing->call->account, HS_FOR_SORTING, n_ranges, sizeof *doing->before);
    for (int64_t e = 0; doing->before != NULL && e < doing->half.n; e++) {
        bool turned;
        if (e % RANGE_PAIRS == 0) {
            doing->before[e / RANGE_PAIRS] = n;
        }
        n += hs_node_pair_counts(doing->map, doing->ghost_pairs, doing->half.i[e], doing->half.j[e],
                                 &turned);
    }
    return doing->before != NULL;
}

/* Has all lengths and entries written. */
static hs_status
merge_all(merging *doing, const hs_output *half, hs_output *output, hs_failure *failure)
{
    const int64_t n_ranges = (doing->half.n + RANGE_PAIRS - 1) / RANGE_PAIRS;
    hs_crew       crew = {.call = doing->call,
                          .job = doing,
                          .worker_size = sizeof(intersection_worker),
                          .open = open_intersection_worker,
                          .close = close_intersection_worker,
                          .n_ranges = n_ranges,
                          .search = merge_range,
                          .output = output};
    hs_status     status = point_rows_of(&doing->call->account, half, doing->map->n, &doing->rows);
    if (status == HS_OK && !count_before(doing, n_ranges)) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        doing->longest = longest_row(&doing->rows);
        hs_call_gather(doing->call, doing->half.n); /* a pair is as much work as a point */
        status = hs_crew_run(&crew, failure);
    }
    hs_point_rows_free(&doing->call->account, &doing->rows);
    hs_free(&doing->call->account, doing->before);
    return status;
}

hs_status
hs_intersection_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs, const hs_output *half,
                     const double *points, int ndim, hs_pairs *result, hs_failure *failure)
{
    merging       doing = {.call = call,
                           .map = map,
                           .points = points,
                           .ndim = ndim,
                           .ghost_pairs = ghost_pairs,
                           .half = hs_half_list_columns(half)};
    const int64_t n = hs_node_pairs_count(map, ghost_pairs, half) * map->n_lists + 1;
    hs_output_init(&call->account, 1, HS_WANT_J, 4, &result->output);
    int64_t  *offsets = NULL;
    hs_status status = hs_pairs_open_offsets(&call->account, n, result, &offsets);
    if (status == HS_OK) {
        status = hs_output_reserve(&result->output, 0, 0.0);
    }
    if (status == HS_OK) {
        memset(offsets, 0, (size_t)n * sizeof *offsets);
        doing.length = offsets + 1;
        status = merge_all(&doing, half, &result->output, failure);
    }
    if (status == HS_OK) {
        hs_starts_of_lengths(offsets, n);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)result->output.n_pairs;
    }
    return status;
}

/* A slice is found by one division and one multiplication by a power of two. Rounding
 * keeps the order of numbers in both, so that a larger coordinate never has a lower slice. */

uint64_t
hs_morton_slice(double x, double low, double high, int bits)
{
    double above = x - low, width = high - low;
    if (!(width <= 0x1.fffffffffffffp1023)) { /* the difference of two large numbers */
        above = 0.5 * x - 0.5 * low;
        width = 0.5 * high - 0.5 * low;
    }
    if (!(width > 0.0)) {
        return 0;
    }
    const double   slice = ldexp(above / width, bits); /* a quotient of at most 1 */
    const uint64_t last = (UINT64_C(1) << bits) - 1;
    return slice >= ldexp(1.0, bits) ? last : (uint64_t)slice;
}

uint64_t
hs_morton_interleave(const uint64_t *slices, int ndim)
{
    const int bits = hs_morton_bits(ndim);
    uint64_t  key = 0;
    for (int k = 0; k < ndim; k++) {
        for (int b = 0; b < bits; b++) {
            key |= (slices[k] >> b & 1u) << (b * ndim + k);
        }
    }
    return key;
}

/* A key for each point, and a radix sort of the keys. */

/* The bounding box of the points that are finite. */
static void
find_box(const double *points, int64_t n, int ndim, double *low, double *high)
{
    for (int k = 0; k < ndim; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
    }
    for (int64_t i = 0; i < n; i++) {
        for (int k = 0; k < ndim; k++) {
            const double x = points[i * ndim + k];
            low[k] = isfinite(x) && x < low[k] ? x : low[k];
            high[k] = isfinite(x) && x > high[k] ? x : high[k];
        }
    }
}

static void
find_keys(const double *points, int64_t n, int ndim, hs_keys *sort)
{
    double low[HS_MAX_DIM], high[HS_MAX_DIM];
    find_box(points, n, ndim, low, high);
    for (int64_t i = 0; i < n; i++) {
        uint64_t slices[HS_MAX_DIM] = {0};
        for (int k = 0; k < ndim; k++) {
            const double x = points[i * ndim + k];
            slices[k] = isfinite(x) ? hs_morton_slice(x, low[k], high[k], hs_morton_bits(ndim)) : 0;
        }
        sort->keys[i] = (int64_t)hs_morton_interleave(slices, ndim);
        sort->ids[i] = (int32_t)i;
    }
}

/* Idempotent. */
static void
space_order_free(hs_account *account, hs_space_order *order)
{
    hs_free(account, order->order);
    *order = (hs_space_order){NULL, NULL};
}

/* points: row after row; those that are not finite come anywhere. On failure holds nothing. */
static hs_status
space_order_make(hs_call *call, const double *points, int64_t n, int ndim, hs_space_order *order)
{
    hs_account *account = &call->account;
    int64_t    *keys = hs_alloc(account, HS_FOR_SORTING, n, 2 * sizeof *keys);
    int32_t    *spare = hs_alloc(account, HS_FOR_SORTING, n, sizeof *spare);
    hs_status   status = HS_ERR_MEMORY;
    order->order = hs_alloc(account, HS_FOR_SORTING, n, 2 * sizeof *order->order);
    if (order->order != NULL && keys != NULL && spare != NULL) {
        hs_keys sort = {.keys = keys,
                        .ids = order->order,
                        .spare_keys = keys + n,
                        .spare_ids = spare,
                        .options = &call->options};
        find_keys(points, n, ndim, &sort);
        status = hs_keys_sort(&sort, 0, n);
    }
    hs_free(account, keys);
    hs_free(account, spare);
    if (status != HS_OK) {
        space_order_free(account, order);
        return status;
    }
    order->place = order->order + n;
    for (int64_t p = 0; p < n; p++) {
        order->place[order->order[p]] = (int32_t)p;
    }
    return HS_OK;
}

/* Words that are looked at between two calls of poll(). */
#define POLL_WORDS (INT64_C(1) << 22)
/* Points of a range: some HS_RANGE_BYTES, and half a millisecond. */
#define RANGE_POINTS 64

/* What the threads share. */
typedef struct product {
    hs_call       *call;
    hs_point_rows  gather; /* of the points' own numbers */
    hs_space_order order;
    hs_word_rows   turned; /* of places, as `near` */
    int64_t       *first;  /* owned; where the row of each point begins in `all` */
    int64_t       *end;    /* part of first; how long it is, meanwhile */
    hs_output      all;    /* J: all rows, in the order of space */
} product;

typedef struct overlap_worker {
    hs_committer committer;
    product     *all;
    hs_options   options;
    hs_output    pairs;
    hs_bit_set   near, found;
    int32_t     *scratch; /* owned; a row */
    int64_t      looked;
} overlap_worker;

/* ---- a worker -------------------------------------------------------------------------------- */

static hs_status
open_overlap_worker(void *context, void *place)
{
    product        *all = context;
    hs_account     *account = &all->call->account;
    const int64_t   n = all->gather.n;
    overlap_worker *me = place;
    me->all = all;
    me->options = all->call->options;
    me->committer.options = &me->options;
    me->committer.pairs = &me->pairs;
    hs_output_init(NULL, 1, HS_WANT_J, 4, &me->pairs);
    me->scratch = hs_alloc(account, HS_FOR_SORTING, n, sizeof *me->scratch);
    const bool has_all = me->scratch != NULL && hs_bit_set_make(account, n, &me->near) &&
                         hs_bit_set_make(account, n, &me->found);
    return has_all ? HS_OK : HS_ERR_MEMORY;
}

static void
close_overlap_worker(void *context, void *place)
{
    const product  *all = context;
    hs_account     *account = &all->call->account;
    overlap_worker *me = place;
    hs_bit_set_free(account, &me->near);
    hs_bit_set_free(account, &me->found);
    hs_free(account, me->scratch);
    hs_output_free(&me->pairs);
}

/* Puts all points that gather what i gathers into `found`, but for i. Returns how many. */
static int64_t
meet(overlap_worker *me, int32_t i)
{
    const product       *all = me->all;
    const hs_point_rows *gather = &all->gather;
    const hs_word_rows  *turned = &all->turned;
    for (int64_t e = gather->first[i]; e < gather->first[i + 1]; e++) {
        const int32_t k = all->order.place[gather->index[e]];
        const int64_t end = turned->first[k + 1];
        for (int64_t w = turned->first[k]; w < end; w++) {
            hs_bit_set_add_word(&me->near, turned->word[w], turned->bits[w]);
        }
        me->looked += end - turned->first[k];
    }
    const int64_t n = hs_bit_set_drain(&me->near, me->scratch);
    for (int64_t e = 0; e < n; e++) {
        const int32_t j = all->order.order[me->scratch[e]];
        if (j != i) {
            hs_bit_set_add(&me->found, j);
        }
    }
    return n - 1; /* i itself was among them */
}

/* A hs_range_fn. */
static hs_status
multiply_range(void *context, int64_t range)
{
    overlap_worker *me = context;
    product        *all = me->all;
    const int64_t   n = all->gather.n, first = range * RANGE_POINTS;
    const int64_t   last = first + RANGE_POINTS < n ? first + RANGE_POINTS : n;
    for (int64_t p = first; p < last; p++) {
        const int32_t i = all->order.order[p];
        const int64_t length = meet(me, i);
        hs_status     status = hs_output_reserve(&me->pairs, length, 0.0);
        if (status == HS_OK && me->looked >= POLL_WORDS) {
            me->looked = 0;
            status = hs_poll(&me->options, (double)p / (double)n);
        }
        if (status != HS_OK) {
            return status;
        }
        (void)hs_bit_set_drain(&me->found, hs_output_next(&me->pairs, HS_WANT_J));
        me->pairs.n_pairs += length;
        all->end[i] = length;
    }
    return hs_commit(&me->committer, (double)last / (double)n, true);
}

/* ---- all of them ----------------------------------------------------------------------------- */

static void
free_product(hs_account *account, product *doing)
{
    hs_point_rows_free(account, &doing->gather);
    space_order_free(account, &doing->order);
    word_rows_free(account, &doing->turned);
    hs_free(account, doing->first);
    hs_output_free(&doing->all);
}

static hs_status
prepare(hs_call *call, const hs_index_rows *gather, const double *points, int ndim, product *doing)
{
    hs_account   *account = &call->account;
    hs_point_rows turned;
    hs_status     status = hs_point_rows_copy(account, gather, &doing->gather);
    if (status == HS_OK) {
        status = space_order_make(call, points, gather->n, ndim, &doing->order);
    }
    if (status == HS_OK) {
        status = point_rows_turn(account, &doing->gather, doing->order.order, doing->order.place,
                                 &turned);
    }
    if (status == HS_OK) {
        status = word_rows_make(account, &turned, &doing->turned);
        hs_point_rows_free(account, &turned);
    }
    if (status == HS_OK) {
        doing->first = hs_alloc(account, HS_FOR_SORTING, gather->n, 2 * sizeof *doing->first);
        doing->end = doing->first != NULL ? doing->first + gather->n : NULL;
        status = doing->first != NULL ? hs_output_reserve(&doing->all, 0, 0.0) : HS_ERR_MEMORY;
    }
    return status;
}

static hs_status
multiply(product *doing, hs_failure *failure)
{
    const int64_t n = doing->gather.n;
    hs_crew       crew = {.call = doing->call,
                          .job = doing,
                          .worker_size = sizeof(overlap_worker),
                          .open = open_overlap_worker,
                          .close = close_overlap_worker,
                          .n_ranges = (n + RANGE_POINTS - 1) / RANGE_POINTS,
                          .search = multiply_range,
                          .output = &doing->all};
    hs_call_gather(doing->call, n);
    const hs_status status = hs_crew_run(&crew, failure);
    int64_t         at = 0;
    for (int64_t p = 0; status == HS_OK && p < n; p++) {
        const int32_t i = doing->order.order[p];
        doing->first[i] = at;
        at += doing->end[i];
        doing->end[i] = at;
    }
    return status;
}

hs_status
hs_overlap_fill(hs_call *call, const hs_node_map *map, const hs_index_rows *gather,
                const double *points, int ndim, hs_pairs *rows, hs_failure *failure)
{
    product doing = {.call = call};
    hs_output_init(&call->account, 1, HS_WANT_J, 4, &doing.all);
    hs_status status = gather->n == map->n ? HS_OK : HS_ERR_ARGUMENT;
    HS_ASSERT(map->n_rows == map->n);
    if (status == HS_OK) {
        status = prepare(call, gather, points, ndim, &doing);
    }
    if (status == HS_OK) {
        status = multiply(&doing, failure);
    }
    if (status == HS_OK) {
        const hs_rows_view found = {.first = doing.first,
                                    .end = doing.end,
                                    .index = hs_output_column(&doing.all, HS_WANT_J),
                                    .ndim = 1};
        status = hs_row_split_fill(call, map, &found, rows);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)doing.all.n_pairs;
    }
    free_product(&call->account, &doing);
    return status;
}
