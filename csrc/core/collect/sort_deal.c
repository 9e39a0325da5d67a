/* SPDX-License-Identifier: BSD-3-Clause */
/* sort_deal.c: two passes over the pairs. Threads count strips of them, each strip the pairs of
 * every row; the sums say where those of each strip go, and then they are dealt out at once. */
#include "sort_deal.h"

#include "../base/sort_numbers.h"
#include "../threads/passes.h"

#include <string.h>

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
            all->entries[next[i - all->first_point]++] = hs_entry_of(all, j, 2 * p);
            all->entries[next[j - all->first_point]++] = hs_entry_of(all, i, 2 * p + 1);
        } else {
            all->entries[next[i - all->first_point]++] = hs_entry_of(all, j, p);
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

hs_status
hs_deal_out(hs_sorting *all)
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
