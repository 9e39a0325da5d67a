/* SPDX-License-Identifier: BSD-3-Clause */
#include "connectivity.h"
#include "../api/query.h"
#include "../base/sort.h"
#include "../base/os.h"
#include "../collect/parallel.h"
#include "../scene/points.h"

#include <string.h>
#include <math.h>

/* overlap.c: the Z curve through a box, and feet on a line; what is between the two of a pair, from
 * marks on neighbours; and points that gather a common point, from sets of bits. */

/* ---- the Z curve ----------------------------------------------------------------------------- */

/* Each coordinate is in a slice of 2^bits equal ones, which is found by one division and one
 * multiplication by a power of two. Rounding keeps the order of numbers in both, so that a larger
 * coordinate never has a lower slice. */
uint64_t
hs_morton_key(const double *x, const double *low, const double *high, int ndim)
{
    const int      bits = 63 / ndim;
    const uint64_t last = (UINT64_C(1) << bits) - 1;
    uint64_t       key = 0;
    for (int k = 0; k < ndim; k++) {
        double above = x[k] - low[k], width = high[k] - low[k];
        if (!(width <= 0x1.fffffffffffffp1023)) { /* the difference of two large numbers */
            above = 0.5 * x[k] - 0.5 * low[k];
            width = 0.5 * high[k] - 0.5 * low[k];
        }
        const double   place = width > 0.0 ? ldexp(above / width, bits) : 0.0;
        const uint64_t slice = place >= ldexp(1.0, bits) ? last : (uint64_t)place;
        for (int b = 0; b < bits; b++) {
            key |= (slice >> b & 1u) << (b * ndim + k);
        }
    }
    return key;
}

/* ---- points that are looked at one by one; nothing is allocated ------------------------------ */

/* hs_morton_keys, or hs_feet_between with p and q in place of low and high: both are copied, and
 * nothing can change them then. */
static hs_status
of_each_point(const hs_points *points, const double *p, const double *q, uint64_t *keys,
              bool *between, bool finds_keys, hs_failure *failure)
{
    const void *entries = finds_keys ? (const void *)keys : between;
    hs_metric   plain = {.n_rows = 0};
    hs_entry    entry;
    double      two[2][HS_MAX_DIM] = {{0.0}}, x[HS_MAX_DIM];
    failure = hs_enter(failure, &entry);
    hs_status status = hs_check_points(points, failure);
    if (status == HS_OK && (p == NULL || q == NULL || !hs_has_entries(entries, points))) {
        status = HS_ERR_ARGUMENT;
    }
    for (int k = 0; status == HS_OK && k < points->ndim; k++) {
        two[0][k] = p[k];
        two[1][k] = q[k];
        if (!isfinite(two[0][k]) || !isfinite(two[1][k]) || (finds_keys && two[0][k] > two[1][k])) {
            failure->column = k;
            status = finds_keys ? HS_ERR_BOX_FINITE : HS_ERR_ARGUMENT;
        }
    }
    plain.ndim = status == HS_OK ? points->ndim : 0;
    for (int64_t i = 0; status == HS_OK && i < points->n; i++) {
        hs_points one = *points;
        one.data = (const char *)points->data + i * points->row_stride;
        one.n = 1;
        status = hs_points_copy_finite(&one, x, failure);
        for (int k = 0; finds_keys && status == HS_OK && k < points->ndim; k++) {
            status = x[k] < two[0][k] || x[k] > two[1][k] ? HS_ERR_FAR : HS_OK;
        }
        failure->row = status != HS_OK ? i : failure->row;
        if (status == HS_OK && finds_keys) {
            keys[i] = hs_morton_key(x, two[0], two[1], points->ndim);
        } else if (status == HS_OK) {
            between[i] = hs_foot_is_between(&plain, x, NULL, two[0], two[1], NULL);
        }
    }
    hs_leave(&entry);
    return status;
}

hs_status
hs_feet_between(const hs_points *points, const double *p, const double *q, bool *between,
                hs_failure *failure)
{
    return of_each_point(points, p, q, NULL, between, false, failure);
}

hs_status
hs_morton_keys(const hs_points *points, const double *low, const double *high, uint64_t *keys,
               hs_failure *failure)
{
    return of_each_point(points, low, high, keys, NULL, true, failure);
}

/* ---- between the two of a pair --------------------------------------------------------------- */

/*
 * The points that are neighbours of both ends of a pair and whose foot on the line through them
 * lies between them, and the ends. They are in the order of the points, and then the first and the
 * second end, each in its list; S is that of each from the first end.
 *
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
    hs_call     *call;
    hs_node_map  map;
    double      *points; /* owned */
    hs_metric    images; /* what shifts multiply; axes that do not repeat have rows of zeros */
    hs_half_list half;
    hs_list_rows rows;
    int64_t      longest; /* row */
    int64_t     *length;  /* of each pair and list, in the order of the table */
    int64_t     *before;  /* owned; of each range how many pairs of the table come before */
} merging;

typedef struct intersection_worker {
    hs_committer   committer;
    const merging *all;
    void          *memory; /* owned: of all arrays */
    uint64_t      *marked; /* a bit for each point */
    int32_t       *common; /* as many as the longest row has, and two */
    int32_t       *shift;  /* of each of them from i, if there are any */
    int64_t       *next;   /* where each list goes on, and one more */
    int64_t        looked;
} intersection_worker;

static hs_status
open_intersection_worker(void *context, void *place)
{
    const merging       *all = context;
    intersection_worker *me = place;
    const int64_t        n = all->longest + 2, n_words = all->map.n / 64 + 1;
    const int64_t        n_shifts = all->half.shift != NULL ? n * all->half.ndim : 0;
    hs_parts             parts;
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&me->common, n, sizeof *me->common);
    hs_parts_add(&parts, (void **)&me->shift, n_shifts, sizeof *me->shift);
    hs_parts_add(&parts, (void **)&me->next, all->map.n_lists + 1, sizeof *me->next);
    hs_parts_add(&parts, (void **)&me->marked, n_words, sizeof *me->marked);
    me->all = all;
    me->memory = hs_parts_alloc(&all->call->account, HS_FOR_SORTING, &parts);
    if (me->memory == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(me->marked, 0, (size_t)n_words * sizeof *me->marked);
    return HS_OK;
}

static void
close_intersection_worker(void *context, void *place)
{
    hs_free(&((const merging *)context)->call->account, ((intersection_worker *)place)->memory);
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

/* Writes the common neighbours of the marked row's point i and of j, the ends of pair number
 * `pair`, to me->common, and then the ends, the first one first; of images, all shifts are from the
 * first end. Returns how many there are. */
static int64_t
find_common(intersection_worker *me, int64_t pair, bool turned)
{
    const merging *all = me->all;
    const int      d = all->images.ndim;
    const int32_t  i = all->half.i[pair], j = all->half.j[pair];
    const double  *p = all->points + (int64_t)i * d, *q = all->points + (int64_t)j * d;
    const int32_t *of_j = all->half.shift != NULL ? all->half.shift + pair * d : NULL;
    int64_t        of_x[HS_MAX_DIM] = {0}, of_q[HS_MAX_DIM] = {0}, n = 0;
    for (int l = 0; of_j != NULL && l < d; l++) {
        of_q[l] = of_j[l];
    }
    for (int64_t e = all->rows.offsets[j]; e < all->rows.offsets[j + 1]; e++) {
        const int32_t k = all->rows.indices[e];
        if ((me->marked[k >> 6] >> (k & 63) & 1u) == 0) {
            continue;
        }
        for (int l = 0; of_j != NULL && l < d; l++) {
            of_x[l] = (int64_t)all->rows.shift[e * d + l] + of_j[l];
            me->shift[n * d + l] = (int32_t)of_x[l]; /* row i does not have what does not fit */
        }
        if ((of_j == NULL || has_image(&all->rows, i, k, of_x)) &&
            hs_foot_is_between(&all->images, all->points + (int64_t)k * d, of_x, p, q, of_q)) {
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
        if (!hs_node_pair_counts(&all->map, i, j, &turned)) {
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
        n += hs_node_pair_counts(&doing->map, doing->half.i[e], doing->half.j[e], &turned);
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
        doing->rows = hs_rows_of(&offsets, &rows);
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
hs_connectivity_intersect(const hs_points *points, const hs_box *box, const hs_half_list *pairs,
                          const hs_node_lists *lists, const hs_options *options, hs_pairs **result,
                          hs_failure *failure)
{
    hs_status  status;
    hs_output  half = {.n_pairs = 0};
    const bool has_input = points != NULL && pairs != NULL && lists != NULL && !lists->directed &&
                           (box == NULL) == (pairs->shift == NULL);
    hs_pairs *made = hs_rows_begin(has_input, points, options, result, &failure, &status);
    if (made == NULL) {
        return status;
    }
    const int   d = points->ndim;
    hs_account *account = &made->call.account;
    merging     doing = {.call = &made->call, .images = {.ndim = d, .n_rows = box != NULL ? d : 0}};
    if (status == HS_OK && box != NULL) {
        status = hs_check_box(box, d) == HS_OK && pairs->ndim == d && d <= HS_MAX_DIM - 2
                     ? hs_box_check(box, failure)
                     : HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = hs_half_list_copy(account, pairs, points->n, false, &half, failure);
    }
    if (status == HS_OK) {
        for (int e = 0; e < doing.images.n_rows * d; e++) {
            doing.images.rows[e / d][e % d] = box->periodic[e / d] ? box->rows[e / d][e % d] : 0.0;
        }
        doing.half = hs_half_list_columns(&half);
        hs_links_init(account, HS_WANT_J, doing.half.shift != NULL, half.ndim, &made->output);
        status = hs_node_map_make(account, lists, points->n, &doing.map);
    }
    if (status == HS_OK) {
        doing.points = hs_alloc(account, HS_FOR_POINTS, points->n * d, sizeof *doing.points);
        status = doing.points != NULL ? hs_points_copy_finite(points, doing.points, failure)
                                      : HS_ERR_MEMORY;
    }
    if (status == HS_OK) {
        status = merge_all(&doing, &half, made, failure);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)made->output.n_pairs;
    }
    hs_free(account, doing.points);
    hs_node_map_free(account, &doing.map);
    hs_output_free(&half);
    return hs_result_end(made, status, result, failure);
}

/* ---- points that gather a common point ------------------------------------------------------- */

/*
 * With G the matrix of these rows and of the diagonal, for each point is in its own support, row i
 * of the pattern of G G^T has the points that gather a point that i gathers: neighbours, where this
 * is one of the two, and those further apart. With shifts, entry (k, T) of row i and (k, U) of row
 * j give (j, T - U). Coordinates only say what is near, and need not be finite.
 *
 * Row i is the union, over all k that i gathers, of the points that gather k. All these are met in
 * turn, and each sets a bit, so that they come out in order. Without shifts bits are of places in
 * the order of space, that of the Z curve through the points: few words, which are met as a whole,
 * and what comes out is put in order under its own numbers. Of images what was met last of a point
 * says whether it is met again, which leaves out nearly all that comes twice; the others are
 * compared when the point comes out. Threads take ranges of the order of space, whose rows are
 * written in this order: work on points that follow each other finds in the caches what the last
 * ones needed.
 */

/* Points that are met between two calls of poll(). */
#define POLL_MET (INT64_C(1) << 22)
/* Entries whose arrays have sizes that integers hold; more fit no memory. */
#define MOST_ENTRIES (INT64_C(1) << 50)
/* Points of a range: some HS_RANGE_BYTES, and half a millisecond. */
#define RANGE_POINTS 64

/* What the threads share. */
typedef struct product {
    hs_call *call;
    int64_t  n;
    int      ndim;   /* of shifts; 0: there are none */
    int64_t  most;   /* points, or images, that one meets */
    void    *memory; /* owned: of all arrays but the last */
    /* What each point gathers, itself first. */
    int64_t *first;
    int32_t *index, *shift;
    int32_t *order, *place; /* the points along the Z curve through them, and where each is on it */
    /* By which points each one is gathered: [by_first[k], by_end[k]). With shifts these are points;
     * else bits, of the places from 64 times the index on. */
    int64_t  *by_first, *by_end;
    int32_t  *by, *by_shift;
    uint64_t *by_bits;
    int64_t  *length;       /* of each row; then where the next one begins */
    hs_output offsets, all; /* these, and J and S of all rows, in the order of space */
} product;

typedef struct overlap_worker {
    hs_committer committer;
    product     *all;
    void        *memory;  /* owned: of all arrays */
    uint64_t    *bits;    /* of points that are met, and of their words that have any */
    int32_t     *last;    /* of images: the number of what was met last of each point, */
    int32_t     *met;     /* and of what was met of it before each of these; -1: nothing */
    int32_t     *shift;   /* of each of them, and of those of one point that differ */
    int32_t     *scratch; /* all points */
    int64_t      looked;
} overlap_worker;

static hs_status
open_overlap_worker(void *context, void *place)
{
    product        *all = context;
    overlap_worker *me = place;
    const int64_t   n_bits = all->n / 64 + all->n / 4096 + 2, d = all->ndim;
    const int64_t   n_last = d > 0 ? all->n : 0, n_met = d > 0 ? all->most : 0;
    hs_parts        parts;
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&me->bits, n_bits, sizeof *me->bits);
    hs_parts_add(&parts, (void **)&me->last, n_last, sizeof *me->last);
    hs_parts_add(&parts, (void **)&me->met, n_met, sizeof *me->met);
    hs_parts_add(&parts, (void **)&me->shift, 2 * n_met * d, sizeof *me->shift);
    hs_parts_add(&parts, (void **)&me->scratch, all->n, sizeof *me->scratch);
    me->all = all;
    me->memory = hs_parts_alloc(&all->call->account, HS_FOR_SORTING, &parts);
    if (me->memory == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(me->bits, 0, (size_t)n_bits * sizeof *me->bits);
    return HS_OK;
}

static void
close_overlap_worker(void *context, void *place)
{
    hs_free(&((product *)context)->call->account, ((overlap_worker *)place)->memory);
}

/* Sets bits of one word; returns what it was. */
HS_ALWAYS_INLINE uint64_t
set_bits(const overlap_worker *me, int32_t word, uint64_t bits)
{
    uint64_t *const words = me->bits + me->all->n / 64 + 1;
    const uint64_t  before = me->bits[word];
    me->bits[word] = before | bits;
    words[word >> 6] |= UINT64_C(1) << (word & 63);
    return before;
}

/* Writes the numbers of all bits, ascending, and clears them; returns how many there were. */
HS_ALWAYS_INLINE int64_t
clear_bits(const overlap_worker *me, int32_t *to)
{
    const int64_t   n_words = me->all->n / 64 + 1;
    uint64_t *const words = me->bits + n_words;
    int64_t         n = 0;
    for (int64_t high = 0; high * 64 < n_words; high++) {
        for (uint64_t some = words[high]; some != 0; some &= some - 1) {
            const int64_t word = high * 64 + hs_trailing_zeros(some);
            for (uint64_t bits = me->bits[word]; bits != 0; bits &= bits - 1) {
                to[n++] = (int32_t)(word * 64 + hs_trailing_zeros(bits));
            }
            me->bits[word] = 0;
        }
        words[high] = 0;
    }
    return n;
}

/* Sets the bits of what gathers what i gathers; writes down *n images, each at least once. */
HS_ALWAYS_INLINE hs_status
meet(overlap_worker *me, int32_t i, const int d, int64_t *n)
{
    const product *all = me->all;
    int64_t        at = 0;
    for (int64_t e = all->first[i]; e < all->first[i + 1]; e++) {
        const int32_t k = all->index[e];
        me->looked += all->by_end[k] - all->by_first[k];
        for (int64_t b = all->by_first[k]; b < all->by_end[k]; b++) {
            const int32_t  j = all->by[b], w = d > 0 ? j >> 6 : j;
            const uint64_t bit = d > 0 ? UINT64_C(1) << (j & 63) : all->by_bits[b];
            int32_t       *own = me->shift + at * d;
            for (int l = 0; l < d; l++) {
                const int64_t shift = (int64_t)all->shift[e * d + l] - all->by_shift[b * d + l];
                own[l] = (int32_t)shift;
                if (shift != own[l]) {
                    return HS_ERR_SHIFT_RANGE;
                }
            }
            const uint64_t before = set_bits(me, w, bit);
            if (d > 0 && ((before & bit) == 0 ||
                          hs_compare_shifts(me->shift + (int64_t)me->last[j] * d, own, d) != 0)) {
                me->met[at] = (before & bit) != 0 ? me->last[j] : -1;
                me->last[j] = (int32_t)at++;
            }
        }
    }
    *n = at;
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

HS_ALWAYS_INLINE hs_status
write_row(overlap_worker *me, int32_t i, const int d, int64_t *length)
{
    hs_output    *pairs = me->committer.pairs;
    int64_t       n, at = 0;
    hs_status     status = meet(me, i, d, &n);
    const int64_t n_met = status == HS_OK ? clear_bits(me, me->scratch) : 0;
    if (status == HS_OK) {
        status = hs_output_reserve(pairs, d > 0 ? n : n_met, 0.0);
    }
    if (status != HS_OK) {
        return status;
    }
    int32_t *to = hs_output_next(pairs, HS_WANT_J),
            *to_shift = hs_output_next(pairs, HS_WANT_SHIFT);
    for (int64_t e = 0; e < n_met; e++) {
        const int32_t j = d > 0 ? me->scratch[e] : me->all->order[me->scratch[e]];
        int32_t      *own = me->shift + me->all->most * d;
        int64_t       n_own = 0;
        if (d == 0 && j != i) {
            (void)set_bits(me, j >> 6, UINT64_C(1) << (j & 63));
        }
        for (int32_t m = d > 0 ? me->last[j] : -1; m >= 0; m = me->met[m]) {
            n_own = add_shift(me->shift + (int64_t)m * d, d, own, n_own);
        }
        for (; n_own > 0; n_own--, own += d) {
            if (j != i || hs_compare_shifts(own, NULL, d) != 0) {
                to[at] = j;
                memcpy(to_shift + at++ * d, own, (size_t)d * sizeof *own);
            }
        }
    }
    *length = d > 0 ? at : clear_bits(me, to);
    pairs->n_pairs += *length;
    return HS_OK;
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
        const int32_t i = all->order[p];
        hs_status     status;
        switch (all->ndim) {
        case 0: status = write_row(me, i, 0, &all->length[p]); break;
        case 3: status = write_row(me, i, 3, &all->length[p]); break;
        default: status = write_row(me, i, all->ndim, &all->length[p]);
        }
        if (status == HS_OK && me->looked >= POLL_MET) {
            me->looked = 0;
            status = hs_poll(me->committer.options, (double)p / (double)n);
        }
        if (status != HS_OK) {
            return status;
        }
    }
    return hs_commit(&me->committer, (double)last / (double)n, true);
}

/* Room for all arrays. Copies what each point gathers, and puts the point itself first, with a
 * shift of zero. HS_ERR_ARGUMENT where these are no rows. */
static hs_status
copy_rows(hs_account *account, const hs_index_rows *given, product *doing)
{
    const int     d = doing->ndim;
    const int64_t n = given->n + given->n_indices; /* entries */
    int64_t       at = 0;
    hs_parts      parts;
    hs_parts_begin(&parts);
    hs_parts_add(&parts, (void **)&doing->first, doing->n + 1, sizeof *doing->first);
    hs_parts_add(&parts, (void **)&doing->index, n, sizeof *doing->index);
    hs_parts_add(&parts, (void **)&doing->shift, n * d, sizeof *doing->shift);
    hs_parts_add(&parts, (void **)&doing->order, doing->n, sizeof *doing->order);
    hs_parts_add(&parts, (void **)&doing->place, doing->n, sizeof *doing->place);
    hs_parts_add(&parts, (void **)&doing->by_first, doing->n + 1, sizeof *doing->by_first);
    hs_parts_add(&parts, (void **)&doing->by_end, doing->n + 1, sizeof *doing->by_end);
    hs_parts_add(&parts, (void **)&doing->by, n, sizeof *doing->by);
    hs_parts_add(&parts, (void **)&doing->by_shift, n * d, sizeof *doing->by_shift);
    hs_parts_add(&parts, (void **)&doing->by_bits, d > 0 ? 0 : n, sizeof *doing->by_bits);
    doing->memory = n < MOST_ENTRIES ? hs_parts_alloc(account, HS_FOR_SORTING, &parts) : NULL;
    if (doing->memory == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t i = 0; i < given->n; i++) {
        const int64_t first = given->offsets[i], last = given->offsets[i + 1];
        if (first != at - i || last < first || last > given->n_indices) {
            return HS_ERR_ARGUMENT;
        }
        doing->first[i] = at;
        doing->index[at] = (int32_t)i;
        memset(doing->shift + at * d, 0, (size_t)d * sizeof *doing->shift);
        at++;
        for (int64_t e = first; e < last; e++, at++) {
            const int32_t j = given->indices[e], before = e > first ? doing->index[at - 1] : -1;
            int32_t      *shift = doing->shift + at * d;
            for (int k = 0; k < d; k++) {
                shift[k] = given->shift[e * d + k];
            }
            if (j < before || j < 0 || j >= given->n ||
                (j == i && hs_compare_shifts(shift, NULL, d) == 0) ||
                (j == before && hs_compare_shifts(shift, shift - d, d) <= 0)) {
                return HS_ERR_ARGUMENT;
            }
            doing->index[at] = j;
        }
    }
    doing->first[given->n] = at;
    return at == n && given->offsets[given->n] == given->n_indices ? HS_OK : HS_ERR_ARGUMENT;
}

/* Puts the points in the order of space, that of the Z curve through the box of those that are
 * finite; the others are anywhere. */
static hs_status
put_in_order(hs_account *account, const hs_points *points, product *doing)
{
    const int64_t n = doing->n;
    const int     d = points->ndim;
    double       *x = hs_alloc(account, HS_FOR_POINTS, n * d, sizeof *x);
    int64_t      *keys = hs_alloc(account, HS_FOR_SORTING, n, 2 * sizeof *keys);
    int32_t      *spare = hs_alloc(account, HS_FOR_SORTING, n, sizeof *spare);
    double        low[HS_MAX_DIM], high[HS_MAX_DIM];
    hs_status     status = HS_ERR_MEMORY;
    if (x != NULL && keys != NULL && spare != NULL) {
        hs_keys sort = {.keys = keys,
                        .ids = doing->order,
                        .spare_keys = keys + n,
                        .spare_ids = spare,
                        .options = &doing->call->options};
        hs_points_copy(points, x);
        for (int k = 0; k < d; k++) {
            low[k] = INFINITY;
            high[k] = -INFINITY;
            for (int64_t e = k; e < n * d; e += d) {
                low[k] = isfinite(x[e]) && x[e] < low[k] ? x[e] : low[k];
                high[k] = isfinite(x[e]) && x[e] > high[k] ? x[e] : high[k];
            }
        }
        for (int64_t i = 0; i < n; i++) {
            for (int k = 0; k < d; k++) {
                x[i * d + k] = isfinite(x[i * d + k]) ? x[i * d + k] : low[k];
            }
            keys[i] = (int64_t)hs_morton_key(x + i * d, low, high, d);
            doing->order[i] = (int32_t)i;
        }
        status = hs_keys_sort(&sort, 0, n);
        for (int64_t p = 0; p < n; p++) {
            doing->place[doing->order[p]] = (int32_t)p;
        }
    }
    hs_free(account, x);
    hs_free(account, keys);
    hs_free(account, spare);
    return status;
}

/* Finds by which points each one is gathered, and how many one meets. */
static hs_status
turn_rows(product *doing)
{
    const int64_t n = doing->n, n_entries = doing->first[n];
    const int     d = doing->ndim;
    memset(doing->by_first, 0, (size_t)(n + 1) * sizeof *doing->by_first);
    for (int64_t e = 0; e < n_entries; e++) {
        doing->by_first[doing->index[e] + 1]++;
    }
    hs_starts_of_lengths(doing->by_first, n + 1);
    memcpy(doing->by_end, doing->by_first, (size_t)(n + 1) * sizeof *doing->by_end);
    for (int32_t p = 0; p < n; p++) {
        const int32_t i = doing->order[p];
        for (int64_t e = doing->first[i]; e < doing->first[i + 1]; e++) {
            const int32_t k = doing->index[e];
            int64_t       at = doing->by_end[k];
            if (d == 0) {
                at -= at > doing->by_first[k] && doing->by[at - 1] == p >> 6;
                const uint64_t before = at < doing->by_end[k] ? doing->by_bits[at] : 0;
                doing->by_bits[at] = before | UINT64_C(1) << (p & 63);
            }
            for (int l = 0; l < d; l++) {
                doing->by_shift[at * d + l] = doing->shift[e * d + l];
            }
            doing->by[at] = d > 0 ? i : p >> 6;
            doing->by_end[k] = at + 1;
        }
    }
    for (int64_t i = 0; i < n; i++) {
        int64_t met = 0;
        for (int64_t e = doing->first[i]; e < doing->first[i + 1]; e++) {
            met += doing->by_end[doing->index[e]] - doing->by_first[doing->index[e]];
        }
        doing->most = met > doing->most ? met : doing->most;
    }
    return doing->most > INT32_MAX ? HS_ERR_TOO_MANY : HS_OK;
}

hs_status
hs_connectivity_overlap(const hs_points *points, const hs_index_rows *gather,
                        const hs_node_lists *lists, const hs_options *options, hs_pairs **rows,
                        hs_failure *failure)
{
    hs_node_map map = {.n = 0};
    int64_t    *offsets;
    hs_status   status;
    const bool  has_input = points != NULL && gather != NULL && lists != NULL;
    hs_pairs   *made = hs_rows_begin(has_input, points, options, rows, &failure, &status);
    if (made == NULL) {
        return status;
    }
    hs_call      *call = &made->call;
    hs_account   *account = &call->account;
    product       doing = {.call = call, .n = gather->n};
    hs_node_lists of_all = *lists;
    of_all.ghost_rows = true;
    doing.ndim = gather->shift != NULL ? gather->ndim : 0;
    hs_links_init(account, HS_WANT_J, doing.ndim > 0, doing.ndim, &doing.all);
    if (status == HS_OK &&
        (gather->n != points->n || gather->offsets == NULL || gather->n_indices < 0 ||
         (gather->indices == NULL && gather->n_indices > 0) ||
         (gather->shift != NULL && (gather->ndim < 1 || gather->ndim > HS_MAX_DIM)))) {
        status = HS_ERR_ARGUMENT;
    }
    if (status == HS_OK) {
        status = hs_node_map_make(account, &of_all, points->n, &map);
    }
    if (status == HS_OK) {
        status = copy_rows(account, gather, &doing);
    }
    if (status == HS_OK) {
        status = put_in_order(account, points, &doing);
    }
    if (status == HS_OK) {
        status = turn_rows(&doing);
    }
    if (status == HS_OK) {
        status = hs_output_open_offsets(account, doing.n + 1, &doing.offsets, &offsets);
    }
    if (status == HS_OK) {
        status = hs_output_reserve(&doing.all, 0, 0.0);
    }
    if (status == HS_OK) {
        hs_crew crew = {.call = call,
                        .job = &doing,
                        .worker_size = sizeof(overlap_worker),
                        .open = open_overlap_worker,
                        .close = close_overlap_worker,
                        .n_ranges = (doing.n + RANGE_POINTS - 1) / RANGE_POINTS,
                        .search = multiply_range,
                        .output = &doing.all};
        offsets[0] = 0;
        doing.length = offsets + 1;
        hs_call_gather(call, doing.n);
        status = hs_crew_run(&crew, failure);
    }
    if (status == HS_OK) {
        hs_starts_of_lengths(offsets, doing.n + 1);
        const hs_list_rows found = hs_rows_of(&doing.offsets, &doing.all);
        status = hs_row_split_fill(call, &map, &found, doing.place, made);
    }
    if (status == HS_ERR_MEMORY) {
        failure->expected_pairs = (double)doing.all.n_pairs;
    }
    hs_free(account, doing.memory);
    hs_output_free(&doing.offsets);
    hs_output_free(&doing.all);
    hs_node_map_free(account, &map);
    return hs_result_end(made, status, rows, failure);
}
