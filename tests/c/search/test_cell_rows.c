/* SPDX-License-Identifier: BSD-3-Clause */
/* test_cell_rows.c: the points of a row that a window of cells holds, wherever the window lies. */
#include "../../../csrc/core/search/cell_rows.h"
#include "../support/harness.h"

void test_cell_rows(void);

enum { CELLS = 4 };

static void
windows_are_cut_to_the_row(void)
{
    int32_t   start[2 * CELLS + 1] = {0, 1, 2, 3, 10, 12, 12, 17, 20};
    hs_search search = {.grid = {.shape = {CELLS}}, .bins = {.start = start}};
    hs_link   link = {.base = CELLS}; /* the second row: 2, 0, 5 and 3 points from 10 on */
    for (int low = -3; low < CELLS + 3; low++) {
        for (int high = low; high < CELLS + 3; high++) {
            int32_t first = -1, end = -1, least = 20, most = 10;
            for (int cell = 0; cell < CELLS; cell++) {
                if (cell >= low && cell <= high) {
                    least = start[CELLS + cell] < least ? start[CELLS + cell] : least;
                    most = start[CELLS + cell + 1];
                }
            }
            hs_link_window(&search, &link, low, high, &first, &end);
            CHECK(least < most ? first == least && end == most : first >= end);
            CHECK(first >= 10 && end >= 10 && first <= 20 && end <= 20);
        }
    }
}

void
test_cell_rows(void)
{
    RUN(windows_are_cut_to_the_row);
}
