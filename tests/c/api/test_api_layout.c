/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_layout.c: every cell has indices of its own, and each point is found in the cell that
 * has it, stored densely or not; points beyond an open face count as on it. */
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

#include <math.h>

void test_api_layout(void);

enum { N = 2400, MOST_CELLS = 4 * N + 64 };

static double  x[3 * N];
static int64_t cell[3 * N + 1], indices[3 * MOST_CELLS + 1];

/* Points in [0, side)^d; `apart`: in two crowds that far from each other. */
static hs_cells *
cells_of(int d, double side, double apart, const hs_box *box, hs_layout *layout)
{
    harness_random  random = {17};
    const hs_points points = {x, N, d, HS_FLOAT64, 8 * d, 8};
    hs_options      options = hs_options_default();
    hs_cells       *cells = NULL;
    for (int e = 0; e < d * N; e++)
        x[e] = side * random_unit(&random) + (e / d % 2 ? apart : 0.0);
    options.cutoff = 0.5;
    CHECK(hs_cells_build(&points, box, &options, &cells, NULL) == HS_OK);
    hs_cells_layout(cells, layout);
    CHECK(layout->ndim == d && layout->n_points == N && layout->n_cells <= MOST_CELLS);
    return cells;
}

/* All indices, and nothing behind them. */
static void
write_indices(const hs_cells *cells, const hs_layout *layout)
{
    indices[layout->n_cells * layout->ndim] = -77;
    hs_cells_indices(cells, indices);
    CHECK(indices[layout->n_cells * layout->ndim] == -77);
}

static hs_status
find(const hs_cells *cells, const double *from, int64_t n, int d)
{
    const hs_points points = {from, n, d, HS_FLOAT64, 8 * d, 8};
    cell[n] = -77;
    const hs_status status = hs_cells_find(cells, &points, cell, NULL);
    CHECK(cell[n] == -77);
    return status;
}

/* Cells ascend by their last index, and among those with the same one by that before; with the
 * first of all running fastest. */
static int64_t
wrong_indices(const hs_layout *layout)
{
    const int d = layout->ndim;
    int64_t   wrong = 0;
    for (int64_t c = 0; c < layout->n_cells; c++) {
        bool above = c == 0;
        for (int k = d - 1; k >= 0; k--) {
            const int64_t here = indices[c * d + k];
            wrong += here < 0 || here >= layout->shape[k];
            if (!above && here != indices[(c - 1) * d + k]) {
                wrong += here < indices[(c - 1) * d + k] && !layout->occupied_only;
                above = true;
            }
        }
        wrong += !above; /* the same cell twice */
    }
    return wrong;
}

/* Where a dense grid says that a point is, computed from the lowest point and the cells' widths. */
static int64_t
wrong_places(const hs_layout *layout)
{
    const int d = layout->ndim;
    double    lowest[3] = {INFINITY, INFINITY, INFINITY};
    int64_t   wrong = 0;
    for (int e = 0; e < d * N; e++)
        lowest[e % d] = fmin(lowest[e % d], x[e]);
    for (int i = 0; i < N; i++) {
        for (int k = 0; k < d; k++) {
            const double place = (x[i * d + k] - lowest[k]) / layout->cell_size[k];
            wrong += fabs((double)indices[cell[i] * d + k] + 0.5 - place) > 0.5 + 1e-9;
        }
    }
    return wrong;
}

static void
dense_cells_are_numbered_by_their_indices(void)
{
    for (int d = 1; d <= 3; d++) {
        double    beyond[6];
        int64_t   product = 1;
        hs_layout layout;
        hs_cells *cells = cells_of(d, d == 1 ? 160.0 : 8.0, 0.0, NULL, &layout);
        CHECK(!layout.occupied_only);
        for (int k = 0; k < d; k++) {
            product *= layout.shape[k];
            CHECK(layout.shape[k] > 2 && layout.cell_size[k] >= 0.25);
        }
        CHECK(product == layout.n_cells);
        write_indices(cells, &layout);
        CHECK(wrong_indices(&layout) == 0);
        CHECK(find(cells, x, N, d) == HS_OK && wrong_places(&layout) == 0);
        for (int e = 0; e < 2 * d; e++)
            beyond[e] = e < d ? -1e6 : 1e6;
        CHECK(find(cells, beyond, 2, d) == HS_OK);
        CHECK(cell[0] == 0 && cell[1] == layout.n_cells - 1);
        CHECK(find(cells, beyond, 0, d) == HS_OK);
        hs_cells_free(cells);
    }
}

/* Points that are whole boxes away are in the same cell. */
static void
points_are_found_wrapped(void)
{
    const hs_box  box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.0, 4.0}}};
    static double away[2 * N];
    int64_t       home[N];
    hs_layout     layout;
    hs_cells     *cells = cells_of(2, 4.0, 0.0, &box, &layout);
    CHECK(find(cells, x, N, 2) == HS_OK);
    memcpy(home, cell, sizeof home);
    for (int e = 0; e < 2 * N; e++)
        away[e] = floor(x[e] * 0x1p40) * 0x1p-40 + 4.0 * (e % 5 - 2);
    CHECK(find(cells, away, N, 2) == HS_OK);
    int64_t others = 0;
    for (int i = 0; i < N; i++)
        others += cell[i] != home[i];
    CHECK(others == 0);
    hs_cells_free(cells);
}

/* Of cells that are far apart only those with points have numbers. */
static void
only_occupied_cells_are_found_where_no_others_are_stored(void)
{
    for (int d = 2; d <= 3; d++) {
        double    empty[9];
        hs_layout layout;
        hs_cells *cells = cells_of(d, 4.0, 1e9, NULL, &layout);
        CHECK(layout.occupied_only && layout.start[layout.n_cells] == N);
        write_indices(cells, &layout);
        CHECK(wrong_indices(&layout) == 0);
        CHECK(find(cells, x, N, d) == HS_OK);
        int64_t wrong = 0;
        for (int64_t c = 0; c < layout.n_cells; c++) {
            wrong += layout.start[c + 1] <= layout.start[c]; /* none is empty */
            for (int32_t s = layout.start[c]; s < layout.start[c + 1]; s++)
                wrong += cell[layout.order[s]] != c;
        }
        CHECK(wrong == 0);
        for (int e = 0; e < 3 * d; e++) /* between both; in a row that has points; at the first */
            empty[e] = e < d ? 5e6 : e == d ? 5e6 : x[e % d];
        CHECK(find(cells, empty, 3, d) == HS_OK);
        CHECK(cell[0] == -1 && cell[1] == -1);
        CHECK(find(cells, x, 1, d) == HS_OK && cell[0] >= 0);
        hs_cells_free(cells);
    }
}

static void
nothing_is_said_of_no_cells(void)
{
    const double    one[1] = {0.25}, bad[2] = {0.25, NAN};
    const hs_points points = {one, 1, 1, HS_FLOAT64, 8, 8};
    hs_layout       layout = {.ndim = 7, .n_cells = 7, .order = (const int32_t *)one};
    const hs_layout zeros = {.ndim = 0};
    hs_failure      failure;
    hs_cells_layout(NULL, &layout);
    CHECK(layout.ndim == 0 && layout.n_cells == 0 && layout.n_points == 0);
    CHECK(layout.start == zeros.start && layout.order == zeros.order);
    hs_cells *cells = cells_of(1, 4.0, 0.0, NULL, &layout);
    hs_cells_layout(cells, NULL);
    indices[0] = -77;
    hs_cells_indices(NULL, indices);
    hs_cells_indices(cells, NULL);
    CHECK(indices[0] == -77);
    cell[0] = -77;
    CHECK(hs_cells_find(NULL, &points, cell, &failure) == HS_ERR_ARGUMENT);
    CHECK(hs_cells_find(cells, NULL, cell, &failure) == HS_ERR_ARGUMENT);
    CHECK(hs_cells_find(cells, &points, NULL, &failure) == HS_ERR_ARGUMENT && cell[0] == -77);
    const hs_points plane = {x, 1, 2, HS_FLOAT64, 16, 8}, odd = {bad, 2, 1, HS_FLOAT64, 8, 8};
    CHECK(hs_cells_find(cells, &plane, cell, &failure) != HS_OK && cell[0] == -77);
    CHECK(hs_cells_find(cells, &odd, cell, &failure) == HS_ERR_NOT_FINITE && failure.row == 1);
    CHECK(cell[0] == -77);
    const int64_t before = hs_test_live_blocks();
    hs_test_fail_allocation(1);
    CHECK(hs_cells_find(cells, &points, cell, &failure) == HS_ERR_MEMORY && cell[0] == -77);
    hs_test_fail_allocation(0);
    CHECK(hs_cells_find(cells, &points, cell, &failure) == HS_OK && cell[0] >= 0);
    CHECK(hs_test_live_blocks() == before);
    hs_cells_free(cells);
}

/* Whichever allocation fails, and for points too far away: nothing is held. */
static void
points_that_cannot_be_found_leave_nothing_behind(void)
{
    const hs_box    box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.5, 4.0}}};
    const double    far[2] = {0.25, 0x1p900};
    const hs_points points = {x, N, 2, HS_FLOAT64, 16, 8};
    const hs_points beyond = {far, 1, 2, HS_FLOAT64, 16, 8};
    hs_layout       layout;
    hs_cells       *cells = cells_of(2, 4.0, 0.0, &box, &layout);
    hs_failure      failure;
    const int64_t   before = hs_test_live_blocks();
    hs_status       status = HS_ERR_MEMORY;
    int             nth = 0;
    while (status == HS_ERR_MEMORY && nth < 20) {
        hs_test_fail_allocation(++nth);
        status = hs_cells_find(cells, &points, cell, &failure);
        hs_test_fail_allocation(0);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(status == HS_OK && nth > 1);
    CHECK(hs_cells_find(cells, &beyond, cell, &failure) != HS_OK);
    CHECK(failure.row == 0 && hs_test_live_blocks() == before);
    hs_cells_free(cells);
}

void
test_api_layout(void)
{
    RUN(dense_cells_are_numbered_by_their_indices);
    RUN(points_are_found_wrapped);
    RUN(only_occupied_cells_are_found_where_no_others_are_stored);
    RUN(nothing_is_said_of_no_cells);
    RUN(points_that_cannot_be_found_leave_nothing_behind);
}
