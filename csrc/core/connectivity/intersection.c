/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * intersection.c: the neighbours of the first point of a pair are marked once for all pairs that it
 * begins; those of the second that are marked are common. Threads take ranges of pairs, whose
 * entries are written in the order of pairs; what they write beside that is how long entries are.
 */
#include "intersection.h"

#include "../base/poll.h"
#include "../base/starts.h"
#include "../collect/crew.h"
#include "../exact/metric_foot.h"
#include "bit_set.h"
#include "node_pairs.h"
#include "point_rows.h"

#include <string.h>

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

typedef struct worker {
    hs_committer   committer;
    const merging *all;
    hs_options     options;
    hs_output      pairs;
    hs_bit_set     marked; /* as an array of bits, which are taken back one by one */
    int32_t       *common; /* owned; as many as the longest row has, and two */
    int64_t       *next;   /* owned; where each list goes on, and one more */
    int64_t        looked;
} worker;

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
open_worker(void *context, void *place)
{
    const merging *all = context;
    hs_account    *account = &all->call->account;
    worker        *me = place;
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
close_worker(void *context, void *place)
{
    const merging *all = context;
    hs_account    *account = &all->call->account;
    worker        *me = place;
    hs_bit_set_free(account, &me->marked);
    hs_free(account, me->common);
    hs_free(account, me->next);
    hs_output_free(&me->pairs);
}

/* Marks the neighbours of point i, or takes the marks back. */
static void
mark(worker *me, int64_t i, bool on)
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
find_common(worker *me, int32_t i, int32_t j)
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
put(worker *me, int64_t n, int64_t *length)
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
ask(worker *me, double fraction)
{
    if (me->looked < POLL_ENTRIES) {
        return HS_OK;
    }
    me->looked = 0;
    return hs_poll(&me->options, fraction);
}

/* Pairs [first, last) of the half list. */
static hs_status
merge_pairs(worker *me, int64_t first, int64_t last, int64_t *length)
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
    worker         *me = context;
    const merging  *all = me->all;
    const int64_t   first = range * RANGE_PAIRS, left = all->half.n - first;
    const int64_t   last = first + (left < RANGE_PAIRS ? left : RANGE_PAIRS);
    const hs_status status =
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
                          .worker_size = sizeof(worker),
                          .open = open_worker,
                          .close = close_worker,
                          .n_ranges = n_ranges,
                          .search = merge_range,
                          .output = output};
    hs_status status = hs_point_rows_of(&doing->call->account, half, doing->map->n, &doing->rows);
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
