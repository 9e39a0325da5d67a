/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * overlap.c: row i is the union, over all k that i gathers, of the points that gather k. Under the
 * numbers of the order of space these are few words of bits, which the union takes 64 points at a
 * time. Its points are then put in order under their own numbers. Threads take ranges of the order
 * of space, whose rows are written in this order.
 */
#include "overlap.h"

#include "../base/poll.h"
#include "../collect/crew.h"
#include "bit_set.h"
#include "row_split.h"
#include "space_order.h"
#include "word_rows.h"

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

typedef struct worker {
    hs_committer committer;
    product     *all;
    hs_options   options;
    hs_output    pairs;
    hs_bit_set   near, found;
    int32_t     *scratch; /* owned; a row */
    int64_t      looked;
} worker;

/* ---- a worker -------------------------------------------------------------------------------- */

static hs_status
open_worker(void *context, void *place)
{
    product      *all = context;
    hs_account   *account = &all->call->account;
    const int64_t n = all->gather.n;
    worker       *me = place;
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
close_worker(void *context, void *place)
{
    const product *all = context;
    hs_account    *account = &all->call->account;
    worker        *me = place;
    hs_bit_set_free(account, &me->near);
    hs_bit_set_free(account, &me->found);
    hs_free(account, me->scratch);
    hs_output_free(&me->pairs);
}

/* Puts all points that gather what i gathers into `found`, but for i. Returns how many. */
static int64_t
meet(worker *me, int32_t i)
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
    worker       *me = context;
    product      *all = me->all;
    const int64_t n = all->gather.n, first = range * RANGE_POINTS;
    const int64_t last = first + RANGE_POINTS < n ? first + RANGE_POINTS : n;
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
    hs_space_order_free(account, &doing->order);
    hs_word_rows_free(account, &doing->turned);
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
        status = hs_space_order_make(call, points, gather->n, ndim, &doing->order);
    }
    if (status == HS_OK) {
        status = hs_point_rows_turn(account, &doing->gather, doing->order.order, doing->order.place,
                                    &turned);
    }
    if (status == HS_OK) {
        status = hs_word_rows_make(account, &turned, &doing->turned);
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
                          .worker_size = sizeof(worker),
                          .open = open_worker,
                          .close = close_worker,
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
