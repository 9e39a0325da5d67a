/* SPDX-License-Identifier: BSD-3-Clause */
#include "overlap.h"
#include "../base/sort.h"
#include "../base/os.h"
#include "../collect/parallel.h"
#include "../exact/metric.h"
#include "../scene/points.h"

#include <string.h>
#include <math.h>

/* overlap.c: the Z curve through a box; what is between the two of a pair, from marks on
 * neighbours; and points that gather a common point, from sets of bits, or of images from lists. */

/* ---- the Z curve ----------------------------------------------------------------------------- */

/* The number of the slice that x is in, of 2^bits equal ones from low to high. It is found by one
 * division and one multiplication by a power of two. Rounding keeps the order of numbers in both,
 * so that a larger coordinate never has a lower slice. */
static uint64_t
slice_of(double x, double low, double high, int bits)
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
hs_morton_key(const double *x, const double *low, const double *high, int ndim)
{
    const int bits = 63 / ndim;
    uint64_t  key = 0;
    for (int k = 0; k < ndim; k++) {
        const uint64_t slice = slice_of(x[k], low[k], high[k], bits);
        for (int b = 0; b < bits; b++) {
            key |= (slice >> b & 1u) << (b * ndim + k);
        }
    }
    return key;
}

/* ---- sets of numbers ------------------------------------------------------------------------- */

/*
 * A set of numbers that is filled in any order and emptied in ascending order, again and again. A
 * bit for each number, and two levels above that tell which words have any: emptying takes time by
 * the words that were touched, and a little by the size of the set.
 */
#define BIT_LEVELS 3

typedef struct bit_set {
    uint64_t *word[BIT_LEVELS]; /* parts of one block, owned by word[0] */
    int64_t   n_words[BIT_LEVELS];
} bit_set;

/* An empty set of numbers below n. False when memory is short. */
static bool
bit_set_make(hs_account *account, int64_t n, bit_set *set)
{
    int64_t all = 0, words = n;
    for (int l = 0; l < BIT_LEVELS; l++) {
        words = (words + 63) / 64;
        set->n_words[l] = words;
        all += words;
    }
    set->word[0] = hs_alloc(account, HS_FOR_SORTING, all, sizeof(uint64_t));
    if (set->word[0] == NULL) {
        return false;
    }
    memset(set->word[0], 0, (size_t)all * sizeof(uint64_t));
    for (int l = 1; l < BIT_LEVELS; l++) {
        set->word[l] = set->word[l - 1] + set->n_words[l - 1];
    }
    return true;
}

/* Adds numbers from 64 * word on, one for each bit. */
HS_ALWAYS_INLINE void
bit_set_add(bit_set *set, int32_t word, uint64_t bits)
{
    const uint64_t before = set->word[0][word];
    set->word[0][word] = before | bits;
    if (before == 0) {
        set->word[1][word >> 6] |= UINT64_C(1) << (word & 63);
        set->word[2][word >> 12] |= UINT64_C(1) << (word >> 6 & 63);
    }
}

/* Writes all numbers, ascending, and forgets them; returns how many there were. */
HS_ALWAYS_INLINE int64_t
bit_set_drain(bit_set *set, int32_t *to)
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

/* ---- between the two of a pair --------------------------------------------------------------- */

/*
 * The neighbours of the first point of a pair are marked once for all pairs that it begins; those
 * of the second that are marked are common. With shifts, a mark says that there is some image, and
 * the row of the first point which. Threads take ranges of pairs, whose entries are written in the
 * order of pairs; what they write beside that is how long entries are.
 */

/* Neighbours that are looked at between two calls of poll(). */
#define POLL_ENTRIES (INT64_C(1) << 20)
/* Pairs of a range: some HS_RANGE_BYTES, and a millisecond. */
#define RANGE_PAIRS 1024

/* What the threads share. */
typedef struct merging {
    hs_call         *call;
    hs_node_map      map;
    double          *points; /* owned */
    const hs_metric *images;
    bool             ghost_pairs;
    hs_half_list     half;
    hs_list_rows     rows;
    int64_t          longest; /* row */
    int64_t         *length;  /* of each pair and list, in the order of the table */
    int64_t         *before;  /* owned; of each range how many pairs of the table come before */
} merging;

typedef struct intersection_worker {
    hs_committer   committer;
    const merging *all;
    uint64_t      *marked; /* owned; a bit for each point */
    int32_t       *common; /* owned; as many as the longest row has, and two */
    int32_t       *shift;  /* owned; of each of them from i, if there are any */
    int64_t       *next;   /* owned; where each list goes on, and one more */
    int64_t        looked;
} intersection_worker;

/* The columns of what is written. */
static unsigned
wanted_of(const int32_t *shift)
{
    return HS_WANT_J | (shift != NULL ? (unsigned)HS_WANT_SHIFT : 0u);
}

static hs_status
open_intersection_worker(void *context, void *place)
{
    const merging       *all = context;
    hs_account          *account = &all->call->account;
    intersection_worker *me = place;
    const int64_t        n = all->longest + 2, n_words = all->map.n / 64 + 1;
    me->all = all;
    me->common = hs_alloc(account, HS_FOR_SORTING, n, sizeof *me->common);
    me->shift = hs_alloc(account, HS_FOR_SORTING, all->half.shift != NULL ? n * all->half.ndim : 0,
                         sizeof *me->shift);
    me->next = hs_alloc(account, HS_FOR_SORTING, all->map.n_lists + 1, sizeof *me->next);
    me->marked = hs_alloc(account, HS_FOR_SORTING, n_words, sizeof *me->marked);
    if (me->common == NULL || me->shift == NULL || me->next == NULL || me->marked == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(me->marked, 0, (size_t)n_words * sizeof *me->marked);
    return HS_OK;
}

static void
close_intersection_worker(void *context, void *place)
{
    const merging       *all = context;
    hs_account          *account = &all->call->account;
    intersection_worker *me = place;
    hs_free(account, me->marked);
    hs_free(account, me->common);
    hs_free(account, me->shift);
    hs_free(account, me->next);
}

/* Marks the neighbours of point i, or takes the marks back. */
static void
mark(intersection_worker *me, int64_t i, bool on)
{
    const hs_list_rows *rows = &me->all->rows;
    for (int64_t e = rows->offsets[i]; e < rows->offsets[i + 1]; e++) {
        const int32_t  k = rows->indices[e];
        const uint64_t bit = UINT64_C(1) << (k & 63), word = me->marked[k >> 6];
        me->marked[k >> 6] = on ? word | bit : word & ~bit;
    }
}

/* Whether the row of point i has k with this shift. */
static bool
has_image(const hs_list_rows *rows, int32_t i, int32_t k, const int64_t *shift)
{
    const int d = rows->ndim;
    int64_t   low = rows->offsets[i], high = rows->offsets[i + 1];
    while (low < high) {
        const int64_t  middle = low + (high - low) / 2;
        const int32_t *own = rows->shift + middle * d;
        int            side = (rows->indices[middle] > k) - (rows->indices[middle] < k);
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
    const int32_t  k = all->rows.indices[e];
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
 * `pair`, to me->common, and then the ends, the first one first; of images, all shifts are from the
 * first end. Returns how many there are. */
static int64_t
find_common(intersection_worker *me, int64_t pair, bool turned)
{
    const merging *all = me->all;
    const int      d = all->images->ndim;
    const int32_t  i = all->half.i[pair], j = all->half.j[pair];
    const double  *p = all->points + (int64_t)i * d, *q = all->points + (int64_t)j * d;
    const int32_t *of_j = all->half.shift != NULL ? all->half.shift + pair * d : NULL;
    int64_t        n = 0;
    for (int64_t e = all->rows.offsets[j]; e < all->rows.offsets[j + 1]; e++) {
        const int32_t k = all->rows.indices[e];
        if ((me->marked[k >> 6] >> (k & 63) & 1u) != 0 &&
            (of_j == NULL ? hs_foot_is_between(all->points + (int64_t)k * d, p, q, d)
                          : is_common_image(me, i, j, of_j, e, me->shift + n * d))) {
            me->common[n++] = k;
        }
    }
    me->looked += all->rows.offsets[j + 1] - all->rows.offsets[j];
    me->common[n] = turned ? j : i;
    me->common[n + 1] = turned ? i : j;
    if (of_j != NULL) {
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
put_common(intersection_worker *me, int64_t n, int64_t *length)
{
    const hs_node_map *map = &me->all->map;
    const int          d = me->all->half.ndim;
    int32_t           *to = hs_output_next(me->committer.pairs, HS_WANT_J);
    int32_t           *shift = hs_output_next(me->committer.pairs, HS_WANT_SHIFT);
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
    me->committer.pairs->n_pairs += n;
}

/* A hs_range_fn: some pairs of the half list. */
static hs_status
merge_range(void *context, int64_t range)
{
    intersection_worker *me = context;
    const merging       *all = me->all;
    const int64_t        first = range * RANGE_PAIRS, left = all->half.n - first;
    const int64_t        last = first + (left < RANGE_PAIRS ? left : RANGE_PAIRS);
    int64_t             *length = all->length + all->before[range] * all->map.n_lists;
    int32_t              marked = -1;
    hs_status            status = HS_OK;
    for (int64_t e = first; e < last && status == HS_OK; e++) {
        const int32_t i = all->half.i[e], j = all->half.j[e];
        bool          turned;
        if (!hs_node_pair_counts(&all->map, all->ghost_pairs, i, j, &turned)) {
            continue;
        }
        if (i != marked) {
            if (marked >= 0) {
                mark(me, marked, false);
            }
            mark(me, i, true);
            marked = i;
        }
        const int64_t n = find_common(me, e, turned);
        status = hs_output_reserve(me->committer.pairs, n, 0.0);
        if (status == HS_OK) {
            put_common(me, n, length);
            length += all->map.n_lists;
        }
        if (status == HS_OK && me->looked >= POLL_ENTRIES) {
            me->looked = 0;
            status = hs_poll(me->committer.options, (double)e / (double)all->half.n);
        }
    }
    if (marked >= 0) {
        mark(me, marked, false);
    }
    return status == HS_OK ? hs_commit(&me->committer, (double)last / (double)all->half.n, true)
                           : status;
}

/* Has all lengths and entries written. */
static hs_status
merge_all(merging *doing, const hs_output *half, hs_pairs *result, hs_failure *failure)
{
    hs_call      *call = doing->call;
    const int64_t n_ranges = (doing->half.n + RANGE_PAIRS - 1) / RANGE_PAIRS;
    hs_output     offsets = {.n_pairs = 0}, rows = {.n_pairs = 0};
    int64_t      *first, n = 0;
    hs_status     status = HS_ERR_MEMORY;
    doing->before = hs_alloc(&call->account, HS_FOR_SORTING, n_ranges, sizeof *doing->before);
    for (int64_t e = 0; doing->before != NULL && e < doing->half.n; e++) {
        bool turned;
        if (e % RANGE_PAIRS == 0) {
            doing->before[e / RANGE_PAIRS] = n;
        }
        n += hs_node_pair_counts(&doing->map, doing->ghost_pairs, doing->half.i[e],
                                 doing->half.j[e], &turned);
    }
    if (doing->before != NULL) {
        n = n * doing->map.n_lists + 1;
        status = hs_output_open_offsets(&call->account, n, &result->offsets, &first);
    }
    if (status == HS_OK) {
        memset(first, 0, (size_t)n * sizeof *first);
        doing->length = first + 1;
        status = hs_output_reserve(&result->output, 0, 0.0);
    }
    if (status == HS_OK) {
        status = hs_half_list_rows(call, half, doing->map.n, false, &offsets, &rows);
    }
    if (status == HS_OK) {
        hs_crew crew = {.call = call,
                        .job = doing,
                        .worker_size = sizeof(intersection_worker),
                        .open = open_intersection_worker,
                        .close = close_intersection_worker,
                        .n_ranges = n_ranges,
                        .search = merge_range,
                        .output = &result->output};
        doing->rows = hs_rows_of(&offsets, &rows, 1);
        for (int64_t i = 0; i < doing->rows.n; i++) {
            const int64_t length = doing->rows.offsets[i + 1] - doing->rows.offsets[i];
            doing->longest = length > doing->longest ? length : doing->longest;
        }
        hs_call_gather(call, doing->half.n); /* a pair is as much work as a point */
        status = hs_crew_run(&crew, failure);
    }
    if (status == HS_OK) {
        hs_starts_of_lengths(first, n);
    }
    hs_output_free(&offsets);
    hs_output_free(&rows);
    hs_free(&call->account, doing->before);
    return status;
}

hs_status
hs_intersection_fill(hs_call *call, const hs_points *points, const hs_metric *images,
                     const hs_node_lists *lists, const hs_output *half, hs_pairs *result,
                     hs_failure *failure)
{
    hs_account *account = &call->account;
    merging     doing = {.call = call,
                         .images = images,
                         .ghost_pairs = lists->ghost_pairs,
                         .half = hs_half_list_columns(half)};
    hs_output_init(account, doing.half.ndim, wanted_of(doing.half.shift), 4, &result->output);
    hs_status status = hs_node_map_make(account, lists, points->n, &doing.map);
    if (status == HS_OK) {
        doing.points =
            hs_alloc(account, HS_FOR_POINTS, points->n * points->ndim, sizeof *doing.points);
        status = doing.points != NULL ? hs_points_copy_finite(points, doing.points, failure)
                                      : HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        status = merge_all(&doing, half, result, failure);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)result->output.n_pairs;
    }
    hs_free(account, doing.points);
    hs_node_map_free(account, &doing.map);
    return status;
}

/* ---- points that gather a common point ------------------------------------------------------- */

/*
 * Row i is the union, over all k that i gathers, of the points that gather k. Under the numbers of
 * the order of space, that of the Z curve through the points, these are few words of bits, 64
 * numbers each, which the union takes at a time; and work on points that follow each other finds in
 * the caches what the last ones needed. Its points are then put in order under their own numbers.
 * Images are no bits: there all points that gather k are written down with their shifts, sorted,
 * and looked through for those that differ. Threads take ranges of the order of space, whose rows
 * are written in this order.
 */

/* Words that are looked at between two calls of poll(). */
#define POLL_WORDS (INT64_C(1) << 22)
/* Points of a range: some HS_RANGE_BYTES, and half a millisecond. */
#define RANGE_POINTS 64

/* What the threads share. */
typedef struct product {
    hs_call *call;
    int64_t  n;
    int      ndim; /* of shifts; 0: there are none */
    /* What each point gathers, itself first. Owned, as all arrays. */
    int64_t *first;
    int32_t *index;
    int32_t *shift;
    int32_t *order; /* the points, in the order of space */
    int32_t *place; /* part of order; where each of them is in it */
    /* By which points each one is gathered, all by their places: words [first_word[p],
     * first_word[p + 1]), ascending, of which `bits` are the points from 64 * word on; or, with
     * shifts, points themselves. */
    int64_t  *first_word;
    int32_t  *word;
    uint64_t *bits;
    int32_t  *of_word;      /* the shift that this point gathers the other with */
    int64_t  *length;       /* of the row of each place; then where the next one begins */
    hs_output offsets, all; /* these, and J and S: all rows, in the order of space */
} product;

typedef struct overlap_worker {
    hs_committer committer;
    product     *all;
    bit_set      found;
    int32_t     *scratch; /* owned; a row */
    uint64_t    *met;     /* owned; point and number of each image that is met, and room for more */
    int32_t     *shift;   /* owned; of each of them, and of those of one point that differ */
    int64_t      room;
    int64_t      looked;
} overlap_worker;

static hs_status
open_overlap_worker(void *context, void *place)
{
    product        *all = context;
    hs_account     *account = &all->call->account;
    overlap_worker *me = place;
    me->all = all;
    if (all->ndim > 0) {
        return HS_OK;
    }
    me->scratch = hs_alloc(account, HS_FOR_SORTING, all->n, sizeof *me->scratch);
    return me->scratch != NULL && bit_set_make(account, all->n, &me->found) ? HS_OK : HS_ERR_MEMORY;
}

static void
close_overlap_worker(void *context, void *place)
{
    const product  *all = context;
    hs_account     *account = &all->call->account;
    overlap_worker *me = place;
    hs_free(account, me->found.word[0]);
    hs_free(account, me->scratch);
    hs_free(account, me->met);
    hs_free(account, me->shift);
}

/* The row of point i, as bits: all points that gather what i gathers, but for i. */
static hs_status
write_points(overlap_worker *me, int32_t i, int64_t *length)
{
    const product *all = me->all;
    for (int64_t e = all->first[i]; e < all->first[i + 1]; e++) {
        const int32_t k = all->place[all->index[e]];
        const int64_t end = all->first_word[k + 1];
        for (int64_t w = all->first_word[k]; w < end; w++) {
            bit_set_add(&me->found, all->word[w], all->bits[w]);
        }
        me->looked += end - all->first_word[k];
    }
    const int64_t n = bit_set_drain(&me->found, me->scratch);
    *length = n - 1; /* i itself is among them */
    const hs_status status = hs_output_reserve(me->committer.pairs, *length, 0.0);
    if (status != HS_OK) {
        return status;
    }
    for (int64_t e = 0; e < n; e++) {
        const int32_t j = all->order[me->scratch[e]];
        if (j != i) {
            bit_set_add(&me->found, j >> 6, UINT64_C(1) << (j & 63));
        }
    }
    me->committer.pairs->n_pairs +=
        bit_set_drain(&me->found, hs_output_next(me->committer.pairs, HS_WANT_J));
    return HS_OK;
}

/* Writes down all images that gather what i gathers. */
static hs_status
meet_images(overlap_worker *me, int32_t i, int64_t *n)
{
    const product *all = me->all;
    hs_account    *account = &all->call->account;
    const int      d = all->ndim;
    int64_t        at = 0;
    *n = 0;
    for (int64_t e = all->first[i]; e < all->first[i + 1]; e++) {
        const int32_t k = all->place[all->index[e]];
        *n += all->first_word[k + 1] - all->first_word[k];
    }
    if (*n > UINT32_MAX) {
        return HS_ERR_TOO_MANY;
    }
    if (*n > me->room) {
        hs_free(account, me->met);
        hs_free(account, me->shift);
        me->room = 0;
        me->met = hs_alloc(account, HS_FOR_SORTING, *n, 2 * sizeof *me->met);
        me->shift = hs_alloc(account, HS_FOR_SORTING, *n * d, 2 * sizeof *me->shift);
        if (me->met == NULL || me->shift == NULL) {
            return HS_ERR_MEMORY;
        }
        me->room = *n;
    }
    for (int64_t e = all->first[i]; e < all->first[i + 1]; e++) {
        const int32_t k = all->place[all->index[e]];
        for (int64_t w = all->first_word[k]; w < all->first_word[k + 1]; w++, at++) {
            me->met[at] = (uint64_t)(uint32_t)all->order[all->word[w]] << 32 | (uint64_t)at;
            for (int l = 0; l < d; l++) {
                const int64_t shift = (int64_t)all->shift[e * d + l] - all->of_word[w * d + l];
                me->shift[at * d + l] = (int32_t)shift;
                if (shift != me->shift[at * d + l]) {
                    return HS_ERR_SHIFT_RANGE;
                }
            }
        }
    }
    me->looked += *n;
    return HS_OK;
}

/* Puts a shift among n ascending ones, unless it is there; returns how many there are then. */
static int64_t
add_shift(const int32_t *shift, int ndim, int32_t *to, int64_t n)
{
    int64_t low = 0, high = n;
    while (low < high) {
        const int64_t middle = low + (high - low) / 2;
        const int     side = hs_compare_shifts(to + middle * ndim, shift, ndim);
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
    const int d = me->all->ndim;
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
        status = hs_output_reserve(me->committer.pairs, n_own, 0.0);
        for (int64_t e = 0; status == HS_OK && e < n_own; e++) {
            const int32_t *shift = own + e * d;
            if (j != i || hs_compare_shifts(shift, NULL, d) != 0) {
                *(int32_t *)hs_output_next(me->committer.pairs, HS_WANT_J) = j;
                memcpy(hs_output_next(me->committer.pairs, HS_WANT_SHIFT), shift,
                       (size_t)d * sizeof *shift);
                me->committer.pairs->n_pairs++;
                ++*length;
            }
        }
    }
    return status;
}

/* A hs_range_fn. */
static hs_status
multiply_range(void *context, int64_t range)
{
    overlap_worker *me = context;
    product        *all = me->all;
    const int64_t   n = all->n, first = range * RANGE_POINTS;
    const int64_t   last = first + RANGE_POINTS < n ? first + RANGE_POINTS : n;
    for (int64_t p = first; p < last; p++) {
        hs_status status =
            (all->ndim > 0 ? write_images : write_points)(me, all->order[p], &all->length[p]);
        if (status == HS_OK && me->looked >= POLL_WORDS) {
            me->looked = 0;
            status = hs_poll(me->committer.options, (double)p / (double)n);
        }
        if (status != HS_OK) {
            return status;
        }
    }
    return hs_commit(&me->committer, (double)last / (double)n, true);
}

/* Copies the entries of point i, and puts i itself first, with a shift of zero. False where these
 * are no row. */
static bool
copy_row(const hs_index_rows *given, int64_t i, product *doing)
{
    const int64_t at = doing->first[i], length = doing->first[i + 1] - at - 1;
    const int     d = doing->ndim;
    int32_t      *index = doing->index + at, *own = doing->shift + at * d;
    memset(own, 0, (size_t)d * sizeof *own);
    index[0] = (int32_t)i;
    for (int64_t e = 0; e < length; e++) {
        const int32_t j = given->indices[at - i + e], before = e > 0 ? index[e] : -1;
        int32_t      *shift = own + (e + 1) * d;
        for (int k = 0; k < d; k++) {
            shift[k] = given->shift[(at - i + e) * d + k];
        }
        if (j < before || j < 0 || j >= given->n ||
            (j == i && hs_compare_shifts(shift, NULL, d) == 0) ||
            (j == before && hs_compare_shifts(shift, shift - d, d) <= 0)) {
            return false;
        }
        index[e + 1] = j;
    }
    return true;
}

/* Copies what each point gathers. */
static hs_status
copy_rows(hs_account *account, const hs_index_rows *given, product *doing)
{
    int64_t before = 0;
    doing->first = hs_alloc(account, HS_FOR_SORTING, doing->n + 1, sizeof *doing->first);
    if (doing->first == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t i = 0; i <= given->n; i++) {
        const int64_t first = given->offsets[i];
        if (first < before || (i == 0 && first != 0)) {
            return HS_ERR_ARGUMENT;
        }
        doing->first[i] = first + i;
        before = first;
    }
    if (before != given->n_indices) {
        return HS_ERR_ARGUMENT;
    }
    const int64_t n = doing->first[doing->n];
    doing->index = hs_alloc(account, HS_FOR_SORTING, n, sizeof *doing->index);
    doing->shift = hs_alloc(account, HS_FOR_SORTING, n * doing->ndim, sizeof *doing->shift);
    hs_status status = doing->index != NULL && doing->shift != NULL ? HS_OK : HS_ERR_MEMORY;
    for (int64_t i = 0; status == HS_OK && i < doing->n; i++) {
        status = copy_row(given, i, doing) ? HS_OK : HS_ERR_ARGUMENT;
    }
    return status;
}

/* Keys of points on the Z curve through the box of those that are finite; the others are anywhere.
 * x: row after row. */
static void
find_keys(const double *x, int64_t n, int ndim, hs_keys *sort)
{
    double low[HS_MAX_DIM], high[HS_MAX_DIM], own[HS_MAX_DIM];
    for (int k = 0; k < ndim; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        for (int64_t i = 0; i < n; i++) {
            const double at = x[i * ndim + k];
            low[k] = isfinite(at) && at < low[k] ? at : low[k];
            high[k] = isfinite(at) && at > high[k] ? at : high[k];
        }
    }
    for (int64_t i = 0; i < n; i++) {
        for (int k = 0; k < ndim; k++) {
            own[k] = isfinite(x[i * ndim + k]) ? x[i * ndim + k] : low[k];
        }
        sort->keys[i] = (int64_t)hs_morton_key(own, low, high, ndim);
        sort->ids[i] = (int32_t)i;
    }
}

/* Puts the points in the order of space. */
static hs_status
put_in_order(hs_account *account, const hs_points *points, product *doing)
{
    const int64_t n = doing->n;
    double       *x = hs_alloc(account, HS_FOR_POINTS, n * points->ndim, sizeof *x);
    int64_t      *keys = hs_alloc(account, HS_FOR_SORTING, n, 2 * sizeof *keys);
    int32_t      *spare = hs_alloc(account, HS_FOR_SORTING, n, sizeof *spare);
    hs_status     status = HS_ERR_MEMORY;
    doing->order = hs_alloc(account, HS_FOR_SORTING, n, 2 * sizeof *doing->order);
    if (doing->order != NULL && x != NULL && keys != NULL && spare != NULL) {
        hs_keys sort = {.keys = keys,
                        .ids = doing->order,
                        .spare_keys = keys + n,
                        .spare_ids = spare,
                        .options = &doing->call->options};
        hs_points_copy(points, x);
        find_keys(x, n, points->ndim, &sort);
        status = hs_keys_sort(&sort, 0, n);
        doing->place = doing->order + n;
        for (int64_t p = 0; p < n; p++) {
            doing->place[doing->order[p]] = (int32_t)p;
        }
    }
    hs_free(account, x);
    hs_free(account, keys);
    hs_free(account, spare);
    return status;
}

/* Finds the words of all points: counts them, or, once there is room, fills them. last: the word
 * that each point has had last. */
HS_ALWAYS_INLINE void
put_words(product *doing, const bool fills, int32_t *last)
{
    const int d = doing->ndim;
    memset(last, -1, (size_t)doing->n * sizeof *last);
    for (int32_t p = 0; p < doing->n; p++) {
        const int32_t i = doing->order[p], word = d > 0 ? p : p >> 6;
        for (int64_t e = doing->first[i]; e < doing->first[i + 1]; e++) {
            const int32_t k = doing->place[doing->index[e]];
            const bool    begins = d > 0 || last[k] != word;
            last[k] = word;
            if (!fills) {
                doing->first_word[k + 1] += begins;
                continue;
            }
            const int64_t at = (doing->first_word[k] += begins) - 1;
            doing->word[at] = word;
            if (d == 0) {
                doing->bits[at] = (begins ? 0 : doing->bits[at]) | UINT64_C(1) << (p & 63);
            }
            for (int l = 0; l < d; l++) {
                doing->of_word[at * d + l] = doing->shift[e * d + l];
            }
        }
    }
}

/* Finds by which points each one is gathered. */
static hs_status
turn_rows(hs_account *account, product *doing)
{
    const int64_t n = doing->n;
    int32_t      *last = hs_alloc(account, HS_FOR_SORTING, n, sizeof *last);
    hs_status     status = HS_ERR_MEMORY;
    doing->first_word = hs_alloc(account, HS_FOR_SORTING, n + 1, sizeof *doing->first_word);
    if (last != NULL && doing->first_word != NULL) {
        memset(doing->first_word, 0, (size_t)(n + 1) * sizeof *doing->first_word);
        put_words(doing, false, last);
        hs_starts_of_lengths(doing->first_word, n + 1);
        const int64_t n_words = doing->first_word[n], n_bits = doing->ndim > 0 ? 0 : n_words;
        doing->word = hs_alloc(account, HS_FOR_SORTING, n_words, sizeof *doing->word);
        doing->bits = hs_alloc(account, HS_FOR_SORTING, n_bits, sizeof *doing->bits);
        doing->of_word =
            hs_alloc(account, HS_FOR_SORTING, n_words * doing->ndim, sizeof *doing->of_word);
        if (doing->word != NULL && doing->bits != NULL && doing->of_word != NULL) {
            put_words(doing, true, last);
            hs_starts_of_ends(doing->first_word, n + 1);
            status = HS_OK;
        }
    }
    hs_free(account, last);
    return status;
}

static hs_status
multiply(product *doing, hs_failure *failure)
{
    const int64_t n = doing->n;
    int64_t      *offsets;
    hs_crew       crew = {.call = doing->call,
                          .job = doing,
                          .worker_size = sizeof(overlap_worker),
                          .open = open_overlap_worker,
                          .close = close_overlap_worker,
                          .n_ranges = (n + RANGE_POINTS - 1) / RANGE_POINTS,
                          .search = multiply_range,
                          .output = &doing->all};
    if (hs_output_open_offsets(&doing->call->account, n + 1, &doing->offsets, &offsets) != HS_OK ||
        hs_output_reserve(&doing->all, 0, 0.0) != HS_OK) {
        return HS_ERR_MEMORY;
    }
    offsets[0] = 0;
    doing->length = offsets + 1;
    hs_call_gather(doing->call, n);
    const hs_status status = hs_crew_run(&crew, failure);
    if (status == HS_OK) {
        hs_starts_of_lengths(offsets, n + 1);
    }
    return status;
}

hs_status
hs_overlap_fill(hs_call *call, const hs_points *points, const hs_index_rows *gather,
                const hs_node_lists *lists, hs_pairs *rows, hs_failure *failure)
{
    hs_account   *account = &call->account;
    product       doing = {.call = call, .n = gather->n};
    hs_node_lists of_all = *lists;
    hs_node_map   map;
    if (gather->n != points->n || gather->offsets == NULL ||
        (gather->indices == NULL && gather->n_indices != 0) ||
        (gather->shift != NULL && (gather->ndim < 1 || gather->ndim > HS_MAX_DIM))) {
        return HS_ERR_ARGUMENT;
    }
    of_all.ghost_rows = true;
    doing.ndim = gather->shift != NULL ? gather->ndim : 0;
    hs_output_init(account, doing.ndim > 0 ? doing.ndim : 1, wanted_of(gather->shift), 4,
                   &doing.all);
    hs_status status = hs_node_map_make(account, &of_all, points->n, &map);
    if (status == HS_OK) {
        status = copy_rows(account, gather, &doing);
    }
    if (status == HS_OK) {
        status = put_in_order(account, points, &doing);
    }
    if (status == HS_OK) {
        status = turn_rows(account, &doing);
    }
    if (status == HS_OK) {
        status = multiply(&doing, failure);
    }
    if (status == HS_OK) {
        const hs_list_rows found = hs_rows_of(&doing.offsets, &doing.all, 1);
        status = hs_row_split_fill(call, &map, &found, doing.place, rows);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)doing.all.n_pairs;
    }
    void *const owned[] = {doing.first,      doing.index, doing.shift, doing.order,
                           doing.first_word, doing.word,  doing.bits,  doing.of_word};
    for (size_t k = 0; k < sizeof owned / sizeof owned[0]; k++) {
        hs_free(account, owned[k]);
    }
    hs_output_free(&doing.offsets);
    hs_output_free(&doing.all);
    hs_node_map_free(account, &map);
    return status;
}
