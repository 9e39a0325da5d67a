/* SPDX-License-Identifier: BSD-3-Clause */
/* test_once.c: a table by one walk is the table by two, and where memory is short there is none and
 * nothing is kept. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/rows/once.h"
#include "../../../csrc/core/rows/table.h"
#include "../support/search_unit.h"

void test_once(void);

enum { N = 300 };

static search_unit unit;
static int64_t     offsets[N + 1], expected[N + 1];

static void
open_table(int index_bytes, int64_t *to, hs_output *entries, hs_table *table)
{
    hs_failure failure = HS_NO_FAILURE;
    hs_output_init(&unit.call.account, 2, HS_WANT_I | HS_WANT_J, index_bytes, entries);
    *table = (hs_table){.search = &unit.search, .offsets = to, .entries = entries};
    CHECK(hs_table_prepare(table, &failure) == HS_OK);
}

/* By a walk that counts and one that writes, or by one whose rows are moved. */
static void
find_by_steps(int index_bytes, hs_output *entries)
{
    hs_failure failure = HS_NO_FAILURE;
    hs_table   table;
    open_table(index_bytes, expected, entries, &table);
    CHECK(hs_table_measure(&table, &failure) == HS_OK);
    CHECK(hs_output_reserve(entries, expected[N], 0.0) == HS_OK);
    entries->n_pairs = expected[N];
    CHECK(hs_table_fill(&table, &failure) == HS_OK);
    hs_table_free(&table);
    hs_table_free(&table);
}

static void
one_walk_finds_the_same_table(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.25, 1.0}}};
    search_unit_points(515, N, 2, 1.0, &unit);
    search_unit_open(&box, 0.3, true, HS_WANT_I | HS_WANT_J, &unit);
    for (int index_bytes = 4; index_bytes <= 8; index_bytes += 4) {
        hs_output  entries, others;
        hs_table   table;
        hs_failure failure = HS_NO_FAILURE;
        find_by_steps(index_bytes, &others);
        open_table(index_bytes, offsets, &entries, &table);
        CHECK(!hs_once_applies(&table)); /* so few are kept as they are */
        unit.search.grid.expected_pairs = 1e7;
        CHECK(hs_once_applies(&table));
        unit.search.grid.expected_pairs = 1e4;
        CHECK(hs_once_find(&table, &failure) == HS_OK);
        CHECK(entries.n_pairs == expected[N] && expected[N] > 10 * N);
        CHECK(memcmp(offsets, expected, sizeof offsets) == 0);
        for (unsigned bit = HS_WANT_I; bit <= HS_WANT_J; bit *= 2) {
            CHECK(memcmp(hs_output_column(&entries, bit), hs_output_column(&others, bit),
                         (size_t)(expected[N] * index_bytes)) == 0);
        }
        hs_table_free(&table);
        hs_output_free(&entries);
        hs_output_free(&others);
    }
    search_unit_close(&unit);
}

/* No distance is below the cutoff. */
static void
rows_are_empty_where_nothing_is_near(void)
{
    hs_output  entries;
    hs_table   table;
    hs_failure failure = HS_NO_FAILURE;
    search_unit_points(517, N, 2, 1.0, &unit);
    search_unit_open(NULL, 0.0, true, HS_WANT_I | HS_WANT_J, &unit);
    unit.call.options.inclusive = false;
    memset(offsets, 1, sizeof offsets);
    memset(expected, 0, sizeof expected);
    open_table(8, offsets, &entries, &table);
    CHECK(hs_once_find(&table, &failure) == HS_OK);
    CHECK(entries.n_pairs == 0 && memcmp(offsets, expected, sizeof offsets) == 0);
    hs_table_free(&table);
    hs_output_free(&entries);
    search_unit_close(&unit);
}

/* Two walks can do with less. */
static void
without_memory_there_is_no_table(void)
{
    int n_failed = 0;
    search_unit_points(516, N, 2, 1.0, &unit);
    search_unit_open(NULL, 0.2, true, HS_WANT_I | HS_WANT_J, &unit);
    const int64_t blocks = hs_test_live_blocks();
    bool          ended = false;
    for (int64_t nth = 1; !ended && nth < 200; nth++) {
        hs_output  entries;
        hs_table   table;
        hs_failure failure = HS_NO_FAILURE;
        open_table(8, offsets, &entries, &table);
        hs_test_fail_allocation(nth);
        const hs_status status = hs_once_find(&table, &failure);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || (status == HS_TOO_MUCH && entries.n_pairs == 0 && !ended));
        CHECK(entries.columns == (HS_WANT_I | HS_WANT_J));
        n_failed += status != HS_OK;
        hs_output_free(&entries);
        CHECK(hs_test_live_blocks() == blocks);
    }
    CHECK(ended && n_failed > 5);
    search_unit_close(&unit);
}

void
test_once(void)
{
    RUN(one_walk_finds_the_same_table);
    RUN(rows_are_empty_where_nothing_is_near);
    RUN(without_memory_there_is_no_table);
}
