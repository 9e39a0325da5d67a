/* SPDX-License-Identifier: BSD-3-Clause */
/* test_sort_deal.c: pairs come to their rows in the order in which they were found, with any number
 * of threads, and a caller that wants to stop is heard. */
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/collect/sort_deal.h"
#include "../../../csrc/core/threads/passes.h"
#include "../support/poll_checks.h"
#include "../support/search_unit.h"

#include <string.h>

void test_sort_deal(void);

enum { ROWS = 40, FIRST = 7, PAIRS = 2 * HS_POLL_POINTS + 9 };
enum { STRIP = 1 << 15, MOST = (HS_SLABS + 1) * STRIP }; /* pairs that a strip has at least */

static int32_t     i[MOST], j[MOST];
static search_unit unit;

static void
make_pairs(void)
{
    harness_random random = {17};
    for (int p = 0; p < MOST; p++) {
        i[p] = FIRST + (int32_t)(random_bits(&random) % (ROWS - 1)); /* the last row stays empty */
        j[p] = FIRST + (int32_t)(random_bits(&random) % (ROWS - 1));
    }
}

/* Deals n pairs out to so many rows, by this many threads; `all` gets new arrays. */
static hs_status
deal_to(int64_t rows, int64_t n, bool both_ways, int threads, hs_output *found, hs_sorting *all)
{
    *found = (hs_output){.ndim = 2, .n_pairs = n};
    *all = (hs_sorting){.call = &unit.call,
                        .found = found,
                        .i = i,
                        .j = j,
                        .first_point = FIRST,
                        .n_points = rows,
                        .both_ways = both_ways};
    all->end = hs_alloc(&unit.call.account, HS_FOR_SORTING, rows + 1, sizeof *all->end);
    if (all->end == NULL)
        return HS_ERR_MEMORY;
    unit.call.team = hs_team_create(threads);
    const hs_status status = hs_deal_out(all);
    hs_team_free(unit.call.team);
    unit.call.team = NULL;
    return status;
}

static hs_status
deal(int64_t n, bool both_ways, int threads, hs_output *found, hs_sorting *all)
{
    return deal_to(ROWS, n, both_ways, threads, found, all);
}

static void
free_dealt(hs_sorting *all)
{
    hs_free(&unit.call.account, all->entries);
    hs_free(&unit.call.account, all->end);
}

/* Whether each entry is of its row, and those of a row are as they were found. */
static bool
rows_are_right(const hs_sorting *all)
{
    int64_t longest = 0, place = 0;
    for (int64_t row = 0; row < all->n_points; row++) {
        const int64_t begin = place;
        uint64_t      last = 0;
        for (; place < all->end[row]; place++) {
            const uint64_t at = hs_place_of(all, all->entries[place]);
            const int64_t  p = hs_pair_of(all, all->entries[place]);
            const bool     turned = hs_is_turned(all, all->entries[place]);
            if ((place > begin && at <= last) || (turned ? j[p] : i[p]) != FIRST + row ||
                hs_second_of(all, all->entries[place]) != (turned ? i[p] : j[p]))
                return false;
            last = at;
        }
        longest = place - begin > longest ? place - begin : longest;
    }
    return place == all->n && all->longest == longest;
}

static void
rows_have_their_pairs_in_order(void)
{
    const int64_t numbers[] = {0, 1, 1000, PAIRS};
    make_pairs();
    search_unit_points(6, ROWS, 2, 1.0, &unit);
    search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
    const int64_t held = unit.call.account.held;
    for (int c = 0; c < 16; c++) {
        const int64_t n = numbers[c / 4];
        const bool    both_ways = c % 2;
        const int     bits = hs_test_sort_place_bits(c % 4 < 2 ? 63 : 3); /* too few for j */
        hs_output     found;
        hs_sorting    one, many;
        CHECK(deal(n, both_ways, 1, &found, &one) == HS_OK && one.n == (both_ways ? 2 * n : n));
        CHECK(rows_are_right(&one) && one.has_j == (one.n < 8 || c % 4 < 2));
        for (int threads = 2; threads <= 4; threads++) {
            CHECK(deal(n, both_ways, threads, &found, &many) == HS_OK && many.n == one.n);
            CHECK(memcmp(many.end, one.end, ROWS * sizeof *one.end) == 0);
            CHECK(one.n == 0 ||
                  memcmp(many.entries, one.entries, (size_t)one.n * sizeof *one.entries) == 0);
            free_dealt(&many);
        }
        free_dealt(&one);
        hs_test_sort_place_bits(bits);
    }
    CHECK(unit.call.account.held == held);
    search_unit_close(&unit);
}

/* How many strips count: all but one have memory of their own for it, a number for each row. */
static int64_t
strips_of(int64_t rows, int64_t n, int threads)
{
    hs_output  found;
    hs_sorting all;
    search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
    const int64_t held = unit.call.account.held;
    CHECK(deal_to(rows, n, false, threads, &found, &all) == HS_OK && rows_are_right(&all));
    const int64_t further = unit.call.account.total.bytes_peak - unit.call.account.held;
    free_dealt(&all);
    CHECK(unit.call.account.held == held);
    search_unit_close(&unit);
    CHECK(further % (rows * (int64_t)sizeof(int64_t)) == 0);
    return 1 + further / (rows * (int64_t)sizeof(int64_t));
}

/* One for each thread as long as there is room for them, each has pairs enough, and there are no
 * more further numbers than pairs. */
static void
strips_are_as_many_as_are_worth_it(void)
{
    make_pairs();
    search_unit_points(6, ROWS, 2, 1.0, &unit);
    CHECK(strips_of(ROWS, MOST, 5) == 5);
    CHECK(strips_of(ROWS, MOST, HS_SLABS) == HS_SLABS);
    CHECK(strips_of(ROWS, MOST, HS_SLABS + 1) == HS_SLABS);
    CHECK(strips_of(ROWS, 3 * STRIP, 4) == 3 && strips_of(ROWS, 3 * STRIP - 1, 4) == 2);
    CHECK(strips_of(2 * STRIP, 4 * STRIP, 3) == 3);
    CHECK(strips_of(2 * STRIP + 1, 4 * STRIP, 3) == 2);
    CHECK(strips_of(4 * STRIP, 4 * STRIP, 3) == 2);
    CHECK(strips_of(4 * STRIP + 1, 4 * STRIP, 3) == 1);
}

/* Two polls of each of the two passes. */
static void
a_caller_can_stop_each_pass(void)
{
    make_pairs();
    search_unit_points(6, ROWS, 2, 1.0, &unit);
    search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
    const int64_t held = unit.call.account.held;
    for (int threads = 1; threads <= 3; threads++) {
        for (int64_t nth = 0; nth <= 4; nth++) {
            refusal    once = {.nth = nth};
            hs_output  found;
            hs_sorting all;
            hs_call_set_poll(refuse_once, &once, &unit.call);
            CHECK(deal(PAIRS, true, threads, &found, &all) ==
                  (nth > 0 ? HS_ERR_INTERRUPTED : HS_OK));
            CHECK(once.n == (nth > 0 ? nth : 4));
            free_dealt(&all);
            CHECK(unit.call.account.held == held);
        }
    }
    hs_call_set_poll(NULL, NULL, &unit.call);
    search_unit_close(&unit);
}

/* Without memory for the numbers of other strips there is one strip; without memory for the entries
 * there is no result. */
static void
refused_memory_leaves_nothing_behind(void)
{
    make_pairs();
    search_unit_points(6, ROWS, 2, 1.0, &unit);
    search_unit_open(NULL, 0.5, false, HS_WANT_I, &unit);
    const int64_t held = unit.call.account.held;
    int           n_dealt = 0, n_refused = 0;
    for (int64_t nth = 1; nth <= 8; nth++) {
        hs_output  found;
        hs_sorting all = {.call = NULL};
        hs_test_fail_allocation(nth);
        const hs_status status = deal(PAIRS, false, 3, &found, &all);
        hs_test_fail_allocation(0);
        n_dealt += status == HS_OK && rows_are_right(&all);
        n_refused += status == HS_ERR_MEMORY;
        free_dealt(&all);
        CHECK(unit.call.account.held == held);
    }
    CHECK(n_refused == 2 && n_dealt == 6); /* where rows end, and the entries */
    search_unit_close(&unit);
}

void
test_sort_deal(void)
{
    RUN(rows_have_their_pairs_in_order);
    RUN(strips_are_as_many_as_are_worth_it);
    RUN(a_caller_can_stop_each_pass);
    RUN(refused_memory_leaves_nothing_behind);
}
