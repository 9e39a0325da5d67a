/* SPDX-License-Identifier: BSD-3-Clause */
/* test_sort_entries.c: entries tell their pair and its other end, and rows are in the order of j and
 * of S, whether entries have their j or not. */
#include "../../../csrc/core/collect/sort_entries.h"
#include "../support/harness.h"

#include <string.h>

void test_sort_entries(void);

enum { MOST = 400, D = 3 };

static int32_t i[MOST], j[MOST], shift[MOST * D];

/* The order of two entries, from the pairs themselves. */
static bool
is_ascending(const hs_sorting *all, uint64_t a, uint64_t b)
{
    const int64_t p = hs_pair_of(all, a), q = hs_pair_of(all, b);
    const int32_t ja = hs_is_turned(all, a) ? i[p] : j[p], jb = hs_is_turned(all, b) ? i[q] : j[q];
    if (ja != jb)
        return ja < jb;
    for (int k = 0; k < D; k++) {
        const int64_t sa = hs_is_turned(all, a) ? -(int64_t)shift[p * D + k] : shift[p * D + k];
        const int64_t sb = hs_is_turned(all, b) ? -(int64_t)shift[q * D + k] : shift[q * D + k];
        if (sa != sb)
            return sa < sb;
    }
    return true;
}

static void
rows_are_put_in_order(void)
{
    static uint64_t row[MOST], spare[MOST];
    harness_random  random = {81};
    hs_output       found = {.ndim = D};
    for (int trial = 0; trial < 200; trial++) {
        const int64_t n = trial < 20 ? trial : (int64_t)(random_bits(&random) % (MOST / 2));
        const int32_t of_j = trial % 3 ? 1000 : 3, far = trial % 5 ? 3 : INT32_MAX;
        bool          seen[MOST] = {false}, right = true;
        hs_sorting    all = {.found = &found,
                             .i = i,
                             .j = j,
                             .shift = shift,
                             .both_ways = trial & 1,
                             .has_j = trial & 2,
                             .place_bits = 40};
        for (int64_t p = 0; p < n; p++) {
            i[p] = (int32_t)(random_bits(&random) % (uint64_t)of_j);
            j[p] = (int32_t)(random_bits(&random) % (uint64_t)of_j);
            for (int k = 0; k < D; k++)
                shift[p * D + k] = (int32_t)(random_bits(&random) % (uint64_t)far);
        }
        const int64_t entries = all.both_ways ? 2 * n : n;
        for (int64_t e = 0; e < entries; e++) {
            const int64_t p = all.both_ways ? e / 2 : e;
            const int32_t end = all.both_ways && e % 2 ? i[p] : j[p];
            row[e] = hs_entry_of(&all, end, e);
            right = right && hs_pair_of(&all, row[e]) == p && hs_second_of(&all, row[e]) == end;
            right = right && hs_place_of(&all, row[e]) == (uint64_t)e;
        }
        hs_sort_row(&all, row, entries, spare);
        for (int64_t e = 0; e < entries; e++) {
            const uint64_t place = hs_place_of(&all, row[e]);
            right = right && place < (uint64_t)entries && !seen[place];
            seen[place] = true;
            right = right && (e == 0 || is_ascending(&all, row[e - 1], row[e]));
        }
        CHECK(right);
    }
}

void
test_sort_entries(void)
{
    RUN(rows_are_put_in_order);
}
