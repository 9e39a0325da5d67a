/* SPDX-License-Identifier: BSD-3-Clause */
/* test_rows.c: rows of columns are placed as points are; the first that cannot be had is named; dense
 * cells reach all of them or stay as they are. */
#include "../../../csrc/core/base/fpenv.h"
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/dynamic/new_list.h"
#include "../../../csrc/core/dynamic/rows.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

void test_rows(void);

enum { N = 50 };

static hs_dynamic *
list_of(const hs_box *box, hs_storage storage, double grid_bytes)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    options.ndim = 2;
    options.box = box;
    options.storage = storage;
    options.grid_bytes = grid_bytes;
    CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
    return list;
}

static void
fill_columns(double columns[2][N], double **x)
{
    harness_random random = {17};
    for (int k = 0; k < 2; k++) {
        x[k] = columns[k];
        for (int i = 0; i < N; i++)
            columns[k][i] = 40.0 * random_unit(&random) - 20.0;
    }
}

static void
rows_are_placed_as_points_are(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{7.0, 0.0}, {2.0, 6.0}}};
    hs_dynamic  *list = list_of(&box, HS_STORE_HASH, 1e6);
    double       columns[2][N], *x[2], given[2];
    fill_columns(columns, x);
    for (int64_t i = 0; i < N; i++) {
        const double point[2] = {x[0][i], x[1][i]};
        hs_failure   failure = HS_NO_FAILURE;
        hs_placed    row, alone;
        CHECK(hs_rows_place(list, x, i, given, &row, &failure) == HS_OK && failure.row == -1);
        CHECK(hs_dynamic_place(list, point, &alone, &failure) == HS_OK);
        CHECK(memcmp(given, point, sizeof point) == 0 && row.given == given);
        CHECK(memcmp(row.x, alone.x, sizeof point) == 0);
        CHECK(memcmp(row.index, alone.index, 2 * sizeof *row.index) == 0);
    }
    hs_list_free(list);
}

static void
rows_that_cannot_be_had_are_named(void)
{
    const hs_box boxes[] = {
        {.ndim = 2, .periodic = {true, true}, .rows = {{7.0, 0.0}, {0.0, 6.0}}},
        {.ndim = 2, .periodic = {true, true}, .rows = {{7.0, 0.0}, {2.0, 6.0}}}};
    for (int b = 0; b < 2; b++) {
        for (int storage = 0; storage < 2; storage++) {
            hs_dynamic *list = list_of(&boxes[b], (hs_storage)storage, 1e6);
            hs_failure  failure = HS_NO_FAILURE;
            double      columns[2][N], *x[2];
            fill_columns(columns, x);
            columns[1][30] = 1e100;
            columns[0][41] = 1e100;
            CHECK(hs_rows_reach(list, N, x, &failure) == HS_ERR_SHIFT_RANGE && failure.row == 30);
            CHECK(list->cells.n == 0);
            hs_list_free(list);
        }
    }
}

static void
dense_cells_reach_all_rows(void)
{
    hs_dynamic *list = list_of(NULL, HS_STORE_DENSE, 40.0 * 40.0 * HS_DENSE_CELL_BYTES);
    hs_failure  failure = HS_NO_FAILURE;
    double      columns[2][N], *x[2];
    fill_columns(columns, x);
    hs_test_fail_allocation(1);
    CHECK(hs_rows_reach(list, N, x, &failure) == HS_ERR_MEMORY && list->cells.n == 0);
    hs_test_fail_allocation(0);
    CHECK(hs_rows_reach(list, N, x, &failure) == HS_OK);
    for (int64_t i = 0; i < N; i++) {
        double    given[2];
        hs_placed row;
        CHECK(hs_rows_place(list, x, i, given, &row, &failure) == HS_OK);
        CHECK(hs_cell_table_find(&list->cells, row.index) != HS_NO_CELL);
    }
    const int64_t n = list->cells.n;
    columns[0][3] = 30.0;
    CHECK(hs_rows_reach(list, N, x, &failure) == HS_ERR_CAPACITY && list->cells.n == n);
    CHECK(failure.expected_bytes > failure.limit_bytes &&
          failure.limit_bytes == 40.0 * 40.0 * HS_DENSE_CELL_BYTES);
    hs_list_free(list);
}

static void
hashed_cells_need_no_room_yet(void)
{
    hs_dynamic *list = list_of(NULL, HS_STORE_HASH, 0.0);
    hs_failure  failure = HS_NO_FAILURE;
    double      columns[2][N], *x[2];
    fill_columns(columns, x);
    CHECK(hs_rows_reach(list, N, x, &failure) == HS_OK && list->cells.n == 0);
    hs_list_free(list);
}

void
test_rows(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(rows_are_placed_as_points_are);
    RUN(rows_that_cannot_be_had_are_named);
    RUN(dense_cells_reach_all_rows);
    RUN(hashed_cells_need_no_room_yet);
    hs_fpenv_leave(env);
}
