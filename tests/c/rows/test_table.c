/* SPDX-License-Identifier: BSD-3-Clause */
/* test_table.c: rows have the lengths that a count gives, whether one walk or two make them. */
#include "../../../csrc/core/rows/table.h"
#include "../support/search_unit.h"

#include <math.h>

void test_table(void);

enum { N = 200 };

static search_unit unit;
static int64_t     offsets[N + 1], counts[N];

static int64_t
neighbours_of(int i, double cutoff)
{
    int64_t n = 0;
    for (int j = 0; j < N; j++)
        n += j != i &&
             hypot(unit.x[2 * i] - unit.x[2 * j], unit.x[2 * i + 1] - unit.x[2 * j + 1]) <= cutoff;
    return n;
}

/* Not counting the point itself; with a cutoff of 0 only what coincides. */
static void
points_do_not_count_themselves(void)
{
    hs_failure failure;
    search_unit_points(131, N, 2, 4.0, &unit);
    unit.x[2] = unit.x[0];
    unit.x[3] = unit.x[1];
    for (int c = 0; c < 3; c++) {
        const double cutoff = 0.5 * c;
        search_unit_open(NULL, cutoff, true, HS_WANT_J, &unit);
        memset(counts, 0x5a, sizeof counts);
        CHECK(hs_table_count(&unit.search, counts, &failure) == HS_OK);
        int64_t wrong = 0;
        for (int i = 0; i < N; i++)
            wrong += counts[i] != neighbours_of(i, cutoff);
        CHECK(wrong == 0 && counts[0] >= 1);
        search_unit_close(&unit);
    }
}

static void
sums_are_where_rows_begin(void)
{
    hs_table table = {.search = &unit.search, .offsets = offsets};
    search_unit_points(132, N, 2, 4.0, &unit);
    search_unit_open(NULL, 0.5, true, HS_WANT_J, &unit);
    for (int i = 0; i < N; i++)
        offsets[i] = i % 5;
    offsets[N] = -1;
    hs_table_sum(&table);
    CHECK(offsets[0] == 0 && offsets[1] == 0 && offsets[2] == 1 && offsets[5] == 10);
    CHECK(offsets[N] == 2 * N);
    search_unit_close(&unit);
}

/* Small tables are kept by the walk that finds them, unless the account has no room for that. */
static void
tables_are_the_same_by_one_walk_and_two(void)
{
    static int64_t first[N * N];
    int64_t        n_first = 0;
    for (int two = 0; two < 2; two++) {
        hs_output  entries;
        hs_failure failure;
        hs_table   table = {.search = &unit.search, .offsets = offsets, .entries = &entries};
        search_unit_points(133, N, 2, 4.0, &unit);
        search_unit_open(NULL, 0.75, true, HS_WANT_J | HS_WANT_DISTANCE, &unit);
        hs_output_init(&unit.call.account, 2, HS_WANT_J | HS_WANT_DISTANCE, 8, &entries);
        CHECK(hs_table_prepare(&table, &failure) == HS_OK && table.most.candidates > 0);
        if (two)
            unit.call.account.limit = 2.0 * HS_MOST_KEPT;
        CHECK(hs_table_measure(&table, &failure) == HS_OK);
        CHECK((table.kept.columns == 0) == two);
        for (int i = 0; i < N; i++)
            CHECK(offsets[i + 1] - offsets[i] == neighbours_of(i, 0.75));
        CHECK(hs_output_reserve(&entries, offsets[N], 0.0) == HS_OK);
        CHECK(hs_table_fill(&table, &failure) == HS_OK);
        const int64_t *j = hs_output_column(&entries, HS_WANT_J);
        const double  *d = hs_output_column(&entries, HS_WANT_DISTANCE);
        int64_t        wrong = 0;
        for (int i = 0; i < N; i++) {
            for (int64_t e = offsets[i]; e < offsets[i + 1]; e++) {
                wrong += e > offsets[i] && j[e] <= j[e - 1];
                wrong += fabs(hypot(unit.x[2 * i] - unit.x[2 * j[e]],
                                    unit.x[2 * i + 1] - unit.x[2 * j[e] + 1]) -
                              d[e]) > 1e-14;
                wrong += two && first[e] != j[e];
                first[e] = j[e];
            }
        }
        CHECK(wrong == 0 && (!two || n_first == offsets[N]));
        n_first = offsets[N];
        hs_table_free(&table);
        hs_table_free(&table);
        hs_output_free(&entries);
        search_unit_close(&unit);
    }
}

void
test_table(void)
{
    RUN(points_do_not_count_themselves);
    RUN(sums_are_where_rows_begin);
    RUN(tables_are_the_same_by_one_walk_and_two);
}
