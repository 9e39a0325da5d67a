/* SPDX-License-Identifier: BSD-3-Clause */
/* test_cell_table.c: cells are found under their indices, in either kind of table, after any growth;
 * empty ones are used again. */
#include "../../../csrc/core/dynamic/cell_table.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

#include <math.h>
#include <stdlib.h>

void test_cell_table(void);

static void
start(hs_cell_table *table, hs_entries *entries, bool dense)
{
    hs_axes axes = {.ndim = 2};
    axes.axis[1].n = 5; /* the second axis repeats */
    hs_cell_table_init(table, &axes, dense);
    hs_entries_init(entries, 2, false);
}

/* Gives a cell one entry. */
static void
occupy(hs_cell_table *table, hs_entries *entries, uint32_t cell, int64_t id)
{
    table->cell[cell].start = hs_entries_take(entries, 0);
    table->size[cell] = 0;
    table->cell[cell].count = 1;
    table->n_empty--;
    hs_entry_tail_at(entries, table->cell[cell].start)->id = id;
    hs_entry_tail_at(entries, table->cell[cell].start)->cell = cell;
}

static void
cells_keep_their_entries(bool dense)
{
    hs_cell_table table;
    hs_entries    entries;
    double        bytes;
    start(&table, &entries, dense);
    for (int64_t k = 0; k < 60; k++) {
        const int64_t index[2] = {(k % 2 == 0 ? k : -k) * (dense ? 3 : INT64_C(1) << 20), k % 5};
        CHECK(dense || hs_cell_table_find(&table, index) == HS_NO_CELL);
        if (dense)
            CHECK(hs_cell_table_extend(&table, &entries, index, index, 1e6, &bytes) == HS_OK);
        const uint32_t cell = hs_cell_table_add(&table, &entries, index);
        CHECK(cell != HS_NO_CELL && table.cell[cell].count == 0);
        occupy(&table, &entries, cell, k);
    }
    for (int64_t k = 0; k < 60; k++) {
        const int64_t  index[2] = {(k % 2 == 0 ? k : -k) * (dense ? 3 : INT64_C(1) << 20), k % 5};
        const uint32_t cell = hs_cell_table_find(&table, index);
        CHECK(cell != HS_NO_CELL && table.cell[cell].count == 1);
        const hs_entry_tail *tail = hs_entry_tail_at(&entries, table.cell[cell].start);
        CHECK(tail->id == k && tail->cell == cell);
    }
    const int64_t sparse = table.capacity * 2 * (int64_t)sizeof *table.index +
                           table.n_rows * (int64_t)sizeof *table.rows;
    CHECK(hs_cell_table_bytes(&table) ==
          table.capacity * (int64_t)HS_DENSE_CELL_BYTES + (dense ? 0 : sparse));
    CHECK(table.capacity >= 60 && (dense || table.n_rows >= 64));
    hs_cell_table_free(&table);
    hs_entries_free(&entries);
}

static void
sparse_cells_are_found(void)
{
    cells_keep_their_entries(false);
}

static void
dense_cells_are_found(void)
{
    cells_keep_their_entries(true);
}

/* Points that wander leave cells behind, which are dropped instead of growing for ever; others take
 * the blocks of these. */
static void
empty_cells_are_dropped(void)
{
    hs_cell_table table;
    hs_entries    entries;
    start(&table, &entries, false);
    for (int64_t k = 0; k < 100000; k++) {
        const int64_t  index[2] = {k, 0};
        const uint32_t cell = hs_cell_table_add(&table, &entries, index);
        CHECK(cell != HS_NO_CELL);
        if (k % 2 == 0) {
            occupy(&table, &entries, cell, k);
            table.cell[cell].count = 0;
            table.n_empty++;
        }
    }
    CHECK(table.capacity < 100 && table.n_empty == table.n && entries.n_used < 100);
    hs_cell_table_free(&table);
    hs_entries_free(&entries);
}

static void
refused_memory_changes_nothing(void)
{
    const int64_t origin[2] = {0, 0};
    double        bytes;
    for (int dense = 0; dense <= 1; dense++) {
        for (int nth = 1; nth <= (dense == 1 ? 2 : 4); nth++) {
            hs_cell_table table;
            hs_entries    entries;
            start(&table, &entries, dense == 1);
            hs_test_fail_allocation(nth);
            CHECK(dense == 1 ? hs_cell_table_extend(&table, &entries, origin, origin, 1e6,
                                                    &bytes) == HS_ERR_MEMORY
                             : hs_cell_table_add(&table, &entries, origin) == HS_NO_CELL);
            hs_test_fail_allocation(0);
            CHECK(table.n == 0 && hs_cell_table_find(&table, origin) == HS_NO_CELL);
            hs_cell_table_free(&table);
        }
    }
}

/* An eager extension that would not fit is made as small as it can be; if that does not fit either,
 * its bytes are told. */
static void
dense_tables_have_a_limit(void)
{
    const int64_t first[2] = {0, 0}, last[2] = {99, 4}, more[2] = {104, 4}, far[2] = {200, 0};
    hs_cell_table table;
    hs_entries    entries;
    double        bytes = 0.0;
    start(&table, &entries, true);
    CHECK(hs_cell_table_extend(&table, &entries, first, last, 5000.0, &bytes) == HS_OK);
    CHECK(table.n == 500);
    CHECK(hs_cell_table_extend(&table, &entries, more, more, 5000.0, &bytes) == HS_OK);
    CHECK(table.n == 525);
    CHECK(hs_cell_table_extend(&table, &entries, far, far, 5000.0, &bytes) == HS_ERR_CAPACITY);
    CHECK(table.n == 525 && bytes == 201 * 5 * 9);
    const int64_t farthest[2] = {INT64_C(1) << 52, 0};
    CHECK(hs_cell_table_extend(&table, &entries, farthest, farthest, INFINITY, &bytes) ==
          HS_ERR_CAPACITY);
    hs_cell_table_free(&table);
}

static void
cells_outside_are_none(void)
{
    const int64_t first[2] = {3, 0}, last[2] = {9, 4};
    const int64_t outside[][2] = {{2, 1}, {10, 1}, {4, -1}, {4, 5}};
    hs_cell_table table;
    hs_entries    entries;
    double        bytes;
    hs_axes       both = {.ndim = 2};
    start(&table, &entries, true);
    CHECK(hs_cell_table_extend(&table, &entries, first, last, 1e6, &bytes) == HS_OK);
    for (int o = 0; o < 4; o++) {
        CHECK(hs_cell_table_find(&table, outside[o]) == HS_NO_CELL);
        CHECK(hs_cell_table_add(&table, &entries, outside[o]) == HS_NO_CELL);
    }
    CHECK(hs_cell_table_find(&table, first) == 0 && hs_cell_table_find(&table, last) == 34);
    hs_cell_table_free(&table);
    both.axis[0].n = both.axis[1].n = 5; /* known from the beginning, but not there yet */
    hs_cell_table_init(&table, &both, true);
    CHECK(hs_cell_table_find(&table, (const int64_t[2]){1, 1}) == HS_NO_CELL);
}

/* Cells may be empty and have blocks while many points come at once. */
static void
dropped_cells_give_their_blocks_back(void)
{
    const int64_t index[2] = {7, 2};
    hs_cell_table table;
    hs_entries    entries;
    start(&table, &entries, false);
    const uint32_t cell = hs_cell_table_add(&table, &entries, index);
    table.cell[cell].start = hs_entries_take(&entries, 3);
    table.size[cell] = 3;
    CHECK(hs_cell_table_reserve(&table, &entries, table.capacity));
    CHECK(table.n == 0 && hs_cell_table_find(&table, index) == HS_NO_CELL);
    CHECK(entries.spare[3] == 0);
    hs_cell_table_free(&table);
    hs_entries_free(&entries);
}

/* More than there are numbers for: what is empty is dropped before it is refused. */
static void
too_many_cells_are_refused(void)
{
    hs_cell_table table;
    hs_entries    entries;
    start(&table, &entries, false);
    for (int64_t k = 0; k < 9; k++) {
        const int64_t  index[2] = {k, 0};
        const uint32_t cell = hs_cell_table_add(&table, &entries, index);
        if (k < 8)
            occupy(&table, &entries, cell, k);
    }
    CHECK(table.n_empty == 1 && table.n == 9);
    CHECK(!hs_cell_table_reserve(&table, &entries, INT64_C(1) << 33));
    CHECK(table.n == 8 && table.n_empty == 0);
    CHECK(!hs_cell_table_reserve(&table, &entries, INT64_C(1) << 33));
    for (int64_t k = 0; k < 9; k++) {
        const int64_t index[2] = {k, 0};
        CHECK((hs_cell_table_find(&table, index) != HS_NO_CELL) == (k < 8));
    }
    hs_cell_table_free(&table);
    hs_entries_free(&entries);
}

static int
compare_marks(const void *one, const void *other)
{
    const uint64_t a = *(const uint64_t *)one, b = *(const uint64_t *)other;
    return (a > b) - (a < b);
}

/* Of 2^18 cells some have the same 32 bits of their hash: they are told by their indices. */
static void
cells_of_equal_marks_are_told_apart(void)
{
    enum { MANY = 1 << 18 };
    static uint64_t marks[MANY];
    int             met = 0;
    for (uint64_t x = 0; x < MANY; x++)
        marks[x] = (uint64_t)hs_cell_mark(hs_cell_part(0, (int64_t)x)) << 32 | x;
    qsort(marks, MANY, sizeof *marks, compare_marks);
    for (int m = 1; m < MANY; m++) {
        if (marks[m] >> 32 == marks[m - 1] >> 32) {
            const int64_t one[2] = {(int64_t)(marks[m] & UINT32_MAX), 0};
            const int64_t other[2] = {(int64_t)(marks[m - 1] & UINT32_MAX), 0};
            hs_cell_table table;
            hs_entries    entries;
            start(&table, &entries, false);
            const uint32_t first = hs_cell_table_add(&table, &entries, one);
            CHECK(hs_cell_table_find(&table, other) == HS_NO_CELL);
            CHECK(hs_cell_table_add(&table, &entries, other) != first);
            CHECK(hs_cell_table_find(&table, one) == first);
            hs_cell_table_free(&table);
            met++;
        }
    }
    CHECK(met > 0);
}

/* Each growth is by half: points that march along an axis do not move all cells at each step. */
static void
dense_tables_grow_by_more_than_they_need(void)
{
    hs_cell_table table;
    hs_entries    entries;
    double        bytes;
    int           n_growths = 0;
    start(&table, &entries, true);
    for (int64_t k = 0; k < 1000; k++) {
        const int64_t index[2] = {k, 0}, before = table.shape[0];
        CHECK(hs_cell_table_extend(&table, &entries, index, index, 1e6, &bytes) == HS_OK);
        CHECK(k >= table.lowest[0] && k < table.lowest[0] + table.shape[0]);
        n_growths += table.shape[0] > before;
    }
    CHECK(n_growths <= 20);
    hs_cell_table_free(&table);
    hs_entries_free(&entries);
}

void
test_cell_table(void)
{
    RUN(dense_tables_grow_by_more_than_they_need);
    RUN(sparse_cells_are_found);
    RUN(dense_cells_are_found);
    RUN(empty_cells_are_dropped);
    RUN(refused_memory_changes_nothing);
    RUN(dense_tables_have_a_limit);
    RUN(cells_outside_are_none);
    RUN(dropped_cells_give_their_blocks_back);
    RUN(too_many_cells_are_refused);
    RUN(cells_of_equal_marks_are_told_apart);
}
