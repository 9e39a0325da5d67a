/* SPDX-License-Identifier: BSD-3-Clause */
#include "overlap.h"
#include "../base/sort.h"
#include "../base/os.h"
#include "../collect/parallel.h"
#include "../exact/metric.h"

#include <string.h>
#include <math.h>

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

static hs_status
allocate_shifts(hs_account *account, int64_t n, int ndim, hs_point_rows *rows)
{
    rows->ndim = ndim;
    rows->shift = hs_alloc(account, HS_FOR_SORTING, n * ndim, sizeof *rows->shift);
    return rows->shift != NULL ? HS_OK : HS_ERR_MEMORY;
}

/* Sign of S - T. */
static int
compare_shifts(const int32_t *s, const int32_t *t, int ndim)
{
    for (int k = 0; k < ndim; k++) {
        if (s[k] != t[k]) {
            return s[k] < t[k] ? -1 : 1;
        }
    }
    return 0;
}

/* The same of rows with shifts: the point itself, at S zero, comes first. */
static bool
copy_images(const hs_index_rows *given, int64_t from, int64_t length, int64_t i, int64_t at,
            hs_point_rows *rows)
{
    const int      d = given->ndim;
    int32_t *const own = rows->shift + at * d;
    memset(own, 0, (size_t)d * sizeof *own);
    rows->index[at] = (int32_t)i;
    for (int64_t e = 0; e < length; e++) {
        const int32_t  j = given->indices[from + e];
        const int32_t *shift = given->shift + (from + e) * d;
        const int32_t  before = e > 0 ? rows->index[at + e] : -1;
        if (j < before || j < 0 || j >= given->n ||
            (j == i && compare_shifts(shift, own, d) == 0) ||
            (j == before && compare_shifts(shift, rows->shift + (at + e) * d, d) <= 0)) {
            return false;
        }
        rows->index[at + e + 1] = j;
        memcpy(rows->shift + (at + e + 1) * d, shift, (size_t)d * sizeof *shift);
    }
    return true;
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
        (given->indices != NULL || given->n_indices == 0) &&
        (given->shift == NULL || (given->ndim >= 1 && given->ndim <= HS_MAX_DIM))) {
        status = allocate(account, given->n, rows);
    }
    if (status == HS_OK && !copy_offsets(given, rows)) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = allocate_index(account, rows->first[rows->n], rows);
    }
    if (status == HS_OK && given->shift != NULL) {
        status = allocate_shifts(account, rows->first[rows->n], given->ndim, rows);
    }
    for (int64_t i = 0; status == HS_OK && i < rows->n; i++) {
        const int64_t at = rows->first[i], length = rows->first[i + 1] - at - 1;
        if (!(rows->shift != NULL
                  ? copy_images(given, at - i, length, i, at, rows)
                  : copy_row(given->indices + (at - i), length, i, rows->n, rows->index + at))) {
            status = HS_ERR_ARGUMENT;
        }
    }
    if (status != HS_OK) {
        hs_point_rows_free(account, rows);
    }
    return status;
}

HS_ALWAYS_INLINE void
copy_shift(const hs_point_rows *from, int64_t e, const hs_point_rows *to, int64_t at)
{
    for (int k = 0; from->shift != NULL && k < from->ndim; k++) {
        to->shift[at * from->ndim + k] = from->shift[e * from->ndim + k];
    }
}

/* The opposite direction, with all points under other numbers: row place[j] has the places of all i
 * in whose rows j is, with the shifts that it has there; order[place[i]] is i. */
static hs_status
point_rows_turn(hs_account *account, const hs_point_rows *from, const int32_t *order,
                const int32_t *place, hs_point_rows *rows)
{
    const int64_t n_entries = from->first[from->n];
    hs_status     status = allocate(account, from->n, rows);
    if (status == HS_OK) {
        status = allocate_index(account, n_entries, rows);
    }
    if (status == HS_OK && from->shift != NULL) {
        status = allocate_shifts(account, n_entries, from->ndim, rows);
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
            const int64_t at = rows->first[place[from->index[e]]]++;
            rows->index[at] = (int32_t)p;
            copy_shift(from, e, rows, at);
        }
    }
    hs_starts_of_ends(rows->first, rows->n + 1);
    return HS_OK;
}

void
hs_point_rows_free(hs_account *account, hs_point_rows *rows)
{
    hs_free(account, rows->first);
    hs_free(account, rows->index);
    hs_free(account, rows->shift);
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
 * begins; those of the second that are marked are common. With shifts, a mark says that there is
 * some image, and the row of the first point which. Threads take ranges of pairs, whose entries are
 * written in the order of pairs; what they write beside that is how long entries are.
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
    const hs_metric   *images;
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
    int32_t       *shift;  /* owned; of each of them from i; NULL: none */
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

/* The columns of what is written. */
static unsigned
wanted_of(const hs_half_columns *half)
{
    return HS_WANT_J | (half->shift != NULL ? (unsigned)HS_WANT_SHIFT : 0u);
}

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
    hs_output_init(NULL, all->half.ndim, wanted_of(&all->half), 4, &me->pairs);
    me->common = hs_alloc(account, HS_FOR_SORTING, all->longest + 2, sizeof *me->common);
    me->next = hs_alloc(account, HS_FOR_SORTING, all->map->n_lists + 1, sizeof *me->next);
    if (all->half.shift != NULL) {
        me->shift = hs_alloc(account, HS_FOR_SORTING, (all->longest + 2) * all->half.ndim,
                             sizeof *me->shift);
    }
    return me->common != NULL && me->next != NULL &&
                   (me->shift != NULL) == (all->half.shift != NULL) &&
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
    hs_free(account, me->shift);
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

/* Whether the row of point i has k with this shift. */
static bool
has_image(const hs_point_rows *rows, int32_t i, int32_t k, const int64_t *shift)
{
    const int d = rows->ndim;
    int64_t   low = rows->first[i], high = rows->first[i + 1];
    while (low < high) {
        const int64_t  middle = low + (high - low) / 2;
        const int32_t *own = rows->shift + middle * d;
        int            side = (rows->index[middle] > k) - (rows->index[middle] < k);
        for (int l = 0; side == 0 && l < d; l++) {
            side = (own[l] > shift[l]) - (own[l] < shift[l]);
        }
        if (side == 0) {
            return true;
        }
        if (side < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return false;
}

/* Of images: whether neighbour e of j is at `shift` from i a neighbour of i, between i and the
 * image of j at `of_j`. Writes its shift. */
static bool
is_common_image(const intersection_worker *me, int32_t i, int32_t j, const int32_t *of_j, int64_t e,
                int32_t *shift)
{
    const merging *all = me->all;
    const int      d = all->half.ndim;
    const int32_t  k = all->rows.index[e];
    int64_t        of_x[HS_MAX_DIM], of_q[HS_MAX_DIM];
    for (int l = 0; l < d; l++) {
        of_q[l] = of_j[l];
        of_x[l] = (int64_t)all->rows.shift[e * d + l] + of_j[l];
        shift[l] = (int32_t)of_x[l]; /* where it does not fit, row i does not have it */
    }
    return has_image(&all->rows, i, k, of_x) &&
           hs_foot_is_between_images(all->images, all->points + (int64_t)k * d, of_x,
                                     all->points + (int64_t)i * d, all->points + (int64_t)j * d,
                                     of_q);
}

/* Writes the common neighbours of the marked row's point i and of j, the ends of pair number
 * `pair`, to me->common; returns how many there are. */
static int64_t
find_common(intersection_worker *me, int64_t pair)
{
    const merging *all = me->all;
    const int      d = all->images->ndim;
    const int32_t  i = all->half.i[pair], j = all->half.j[pair];
    const double  *p = all->points + (int64_t)i * d, *q = all->points + (int64_t)j * d;
    const int32_t *of_j = all->half.shift != NULL ? all->half.shift + pair * d : NULL;
    int64_t        n = 0;
    for (int64_t e = all->rows.first[j]; e < all->rows.first[j + 1]; e++) {
        const int32_t k = all->rows.index[e];
        if (hs_bit_set_has(&me->marked, k) &&
            (of_j == NULL ? hs_foot_is_between(all->points + (int64_t)k * d, p, q, d)
                          : is_common_image(me, i, j, of_j, e, me->shift + n * d))) {
            me->common[n++] = k;
        }
    }
    me->looked += all->rows.first[j + 1] - all->rows.first[j];
    return n;
}

/* Adds the ends of a pair, the first one first, to n common points; of images, all shifts are from
 * the first end. */
static int64_t
add_ends(intersection_worker *me, int64_t pair, bool turned, int64_t n)
{
    const hs_half_columns *half = &me->all->half;
    const int              d = half->ndim;
    me->common[n] = turned ? half->j[pair] : half->i[pair];
    me->common[n + 1] = turned ? half->i[pair] : half->j[pair];
    if (half->shift != NULL) {
        const int32_t *of_j = half->shift + pair * d;
        for (int64_t e = 0; turned && e < n * d; e++) {
            me->shift[e] = (int32_t)((uint32_t)me->shift[e] - (uint32_t)of_j[e % d]);
        }
        for (int k = 0; k < d; k++) {
            me->shift[n * d + k] = 0;
            me->shift[(n + 1) * d + k] = turned ? (int32_t)(0u - (uint32_t)of_j[k]) : of_j[k];
        }
    }
    return n + 2;
}

/* Puts n points, by their lists, behind what is written; their order in each list stays. length:
 * of the pair's lists. */
static void
put(intersection_worker *me, int64_t n, int64_t *length)
{
    const hs_node_map *map = me->all->map;
    const int          d = me->all->half.ndim;
    int32_t           *to = hs_output_next(&me->pairs, HS_WANT_J);
    int32_t           *shift = hs_output_next(&me->pairs, HS_WANT_SHIFT);
    memset(me->next, 0, (size_t)(map->n_lists + 1) * sizeof *me->next);
    for (int64_t e = 0; e < n; e++) {
        me->next[map->list[me->common[e]] + 1]++;
    }
    memcpy(length, me->next + 1, (size_t)map->n_lists * sizeof *length);
    hs_starts_of_lengths(me->next, (int64_t)map->n_lists + 1);
    for (int64_t e = 0; e < n; e++) {
        const int64_t at = me->next[map->list[me->common[e]]]++;
        to[at] = map->node[me->common[e]];
        if (shift != NULL) {
            memcpy(shift + at * d, me->shift + e * d, (size_t)d * sizeof *shift);
        }
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
        const int64_t n = add_ends(me, e, turned, find_common(me, e));
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
    hs_output     offsets = {.n_pairs = 0}, rows = {.n_pairs = 0};
    hs_status status = hs_half_list_rows(doing->call, half, doing->map->n, false, &offsets, &rows);
    if (status == HS_OK && !count_before(doing, n_ranges)) {
        status = HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        doing->rows = (hs_point_rows){.n = doing->map->n,
                                      .first = hs_output_column(&offsets, HS_WANT_I),
                                      .index = hs_output_column(&rows, HS_WANT_J),
                                      .shift = hs_output_column(&rows, HS_WANT_SHIFT),
                                      .ndim = rows.ndim};
        doing->longest = longest_row(&doing->rows);
        hs_call_gather(doing->call, doing->half.n); /* a pair is as much work as a point */
        status = hs_crew_run(&crew, failure);
    }
    hs_output_free(&offsets);
    hs_output_free(&rows);
    hs_free(&doing->call->account, doing->before);
    return status;
}

hs_status
hs_intersection_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs, const hs_output *half,
                     const double *points, const hs_metric *images, hs_pairs *result,
                     hs_failure *failure)
{
    merging       doing = {.call = call,
                           .map = map,
                           .points = points,
                           .images = images,
                           .ghost_pairs = ghost_pairs,
                           .half = hs_half_list_columns(half)};
    const int64_t n = hs_node_pairs_count(map, ghost_pairs, half) * map->n_lists + 1;
    hs_output_init(&call->account, doing.half.ndim, wanted_of(&doing.half), 4, &result->output);
    int64_t  *offsets = NULL;
    hs_status status = hs_output_open_offsets(&call->account, n, &result->offsets, &offsets);
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

/*
 * overlap.c: row i is the union, over all k that i gathers, of the points that gather k. Under the
 * numbers of the order of space these are few words of bits, which the union takes 64 points at a
 * time. Its points are then put in order under their own numbers. Images are no bits: there all
 * points that gather k are written down with their shifts, sorted, and looked through for those
 * that differ. Threads take ranges of the order of space, whose rows are written in this order.
 */

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
    hs_point_rows  images; /* of places, in place of `turned` */
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
    uint64_t    *met;     /* owned; point and number of each image that is met, and room for more */
    int32_t     *shift;   /* owned; of each of them, and of those of one point that differ */
    int64_t      room;
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
    hs_output_init(NULL, all->all.ndim, all->all.columns, 4, &me->pairs);
    if (all->gather.shift != NULL) {
        return HS_OK;
    }
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
    hs_free(account, me->met);
    hs_free(account, me->shift);
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

/* Room for n images that are met. */
static hs_status
make_room(overlap_worker *me, int64_t n)
{
    hs_account *account = &me->all->call->account;
    if (n > UINT32_MAX) {
        return HS_ERR_TOO_MANY;
    }
    if (n > me->room) {
        hs_free(account, me->met);
        hs_free(account, me->shift);
        me->room = 0;
        me->met = hs_alloc(account, HS_FOR_SORTING, n, 2 * sizeof *me->met);
        me->shift =
            hs_alloc(account, HS_FOR_SORTING, n * me->all->gather.ndim, 2 * sizeof *me->shift);
        if (me->met == NULL || me->shift == NULL) {
            return HS_ERR_MEMORY;
        }
        me->room = n;
    }
    return HS_OK;
}

/* Writes down all images that gather what i gathers. */
static hs_status
meet_images(overlap_worker *me, int32_t i, int64_t *n)
{
    const product       *all = me->all;
    const hs_point_rows *gather = &all->gather, *turned = &all->images;
    const int            d = gather->ndim;
    *n = 0;
    for (int64_t e = gather->first[i]; e < gather->first[i + 1]; e++) {
        const int32_t k = all->order.place[gather->index[e]];
        *n += turned->first[k + 1] - turned->first[k];
    }
    const hs_status status = make_room(me, *n);
    int64_t         at = 0;
    for (int64_t e = gather->first[i]; status == HS_OK && e < gather->first[i + 1]; e++) {
        const int32_t k = all->order.place[gather->index[e]];
        for (int64_t w = turned->first[k]; w < turned->first[k + 1]; w++, at++) {
            me->met[at] = (uint64_t)(uint32_t)all->order.order[turned->index[w]] << 32 |
                          (uint64_t)at;
            for (int l = 0; l < d; l++) {
                const int64_t shift = (int64_t)gather->shift[e * d + l] - turned->shift[w * d + l];
                me->shift[at * d + l] = (int32_t)shift;
                if (shift != me->shift[at * d + l]) {
                    return HS_ERR_SHIFT_RANGE;
                }
            }
        }
    }
    me->looked += *n;
    return status;
}

/* Puts a shift among n ascending ones, unless it is there; returns how many there are then. */
static int64_t
add_shift(const int32_t *shift, int ndim, int32_t *to, int64_t n)
{
    int64_t low = 0, high = n;
    while (low < high) {
        const int64_t middle = low + (high - low) / 2;
        const int     side = compare_shifts(to + middle * ndim, shift, ndim);
        if (side == 0) {
            return n;
        }
        if (side < 0) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    memmove(to + (low + 1) * ndim, to + low * ndim, (size_t)((n - low) * ndim) * sizeof *to);
    memcpy(to + low * ndim, shift, (size_t)ndim * sizeof *to);
    return n + 1;
}

/* The row of point i, of images. */
static hs_status
write_images(overlap_worker *me, int32_t i, int64_t *length)
{
    const int d = me->all->gather.ndim;
    int64_t   n;
    hs_status status = meet_images(me, i, &n);
    *length = 0;
    if (status == HS_OK) {
        hs_sort_numbers(me->met, n, me->met + me->room);
    }
    for (int64_t first = 0, end; status == HS_OK && first < n; first = end) {
        const int32_t  j = (int32_t)(me->met[first] >> 32);
        int32_t *const own = me->shift + me->room * d;
        int64_t        n_own = 0;
        for (end = first; end < n && (int32_t)(me->met[end] >> 32) == j; end++) {
            n_own = add_shift(me->shift + (int64_t)(me->met[end] & UINT32_MAX) * d, d, own, n_own);
        }
        status = hs_output_reserve(&me->pairs, n_own, 0.0);
        for (int64_t e = 0; status == HS_OK && e < n_own; e++) {
            const int32_t *shift = own + e * d;
            bool           is_self = j == i;
            for (int k = 0; is_self && k < d; k++) {
                is_self = shift[k] == 0;
            }
            if (!is_self) {
                *(int32_t *)hs_output_next(&me->pairs, HS_WANT_J) = j;
                memcpy(hs_output_next(&me->pairs, HS_WANT_SHIFT), shift, (size_t)d * sizeof *shift);
                me->pairs.n_pairs++;
                ++*length;
            }
        }
    }
    return status;
}

/* The row of point i, as bits. */
static hs_status
write_points(overlap_worker *me, int32_t i, int64_t *length)
{
    *length = meet(me, i);
    const hs_status status = hs_output_reserve(&me->pairs, *length, 0.0);
    if (status == HS_OK) {
        (void)hs_bit_set_drain(&me->found, hs_output_next(&me->pairs, HS_WANT_J));
        me->pairs.n_pairs += *length;
    }
    return status;
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
        hs_status     status = all->gather.shift != NULL ? write_images(me, i, &all->end[i])
                                                         : write_points(me, i, &all->end[i]);
        if (status == HS_OK && me->looked >= POLL_WORDS) {
            me->looked = 0;
            status = hs_poll(&me->options, (double)p / (double)n);
        }
        if (status != HS_OK) {
            return status;
        }
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
    hs_point_rows_free(account, &doing->images);
    hs_free(account, doing->first);
    hs_output_free(&doing->all);
}

static hs_status
prepare(hs_call *call, const hs_index_rows *gather, const double *points, int ndim, product *doing)
{
    hs_account *account = &call->account;
    hs_status   status = hs_point_rows_copy(account, gather, &doing->gather);
    if (status == HS_OK) {
        status = space_order_make(call, points, gather->n, ndim, &doing->order);
    }
    if (status == HS_OK) {
        status = point_rows_turn(account, &doing->gather, doing->order.order, doing->order.place,
                                 &doing->images);
    }
    if (status == HS_OK && gather->shift == NULL) {
        status = word_rows_make(account, &doing->images, &doing->turned);
        hs_point_rows_free(account, &doing->images);
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
    product        doing = {.call = call};
    const bool     has_shifts = gather->shift != NULL;
    const unsigned columns = HS_WANT_J | (has_shifts ? (unsigned)HS_WANT_SHIFT : 0u);
    hs_output_init(&call->account, has_shifts ? gather->ndim : 1, columns, 4, &doing.all);
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
                                    .shift = hs_output_column(&doing.all, HS_WANT_SHIFT),
                                    .ndim = doing.all.ndim};
        status = hs_row_split_fill(call, map, &found, rows);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)doing.all.n_pairs;
    }
    free_product(&call->account, &doing);
    return status;
}
