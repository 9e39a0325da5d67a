/* SPDX-License-Identifier: BSD-3-Clause */
/* test_search_build.c: a search is built of points and queries, with cells of the caller's width or
 * of its own choice, and says what it lacks. */
#include "../../../csrc/core/search/search_open.h"
#include "../support/poll_checks.h"
#include "../support/search_unit.h"

#include <math.h>

void test_search_build(void);

enum { N = 1000, CROWD = 2000 };

static search_unit unit;

/* Builds, of the points of the unit; the search is to be closed. */
static hs_status
build(const hs_points *queries, const hs_box *box, const hs_options *options, hs_failure *failure)
{
    const hs_sets sets = {.points = &unit.points, .queries = queries, .is_full = queries != NULL};
    *failure = HS_NO_FAILURE;
    hs_call_begin(options, &unit.call);
    hs_search_begin(&unit.call, &unit.search);
    return hs_search_build(&sets, box, &unit.search, failure);
}

static hs_options
options_for(double cutoff)
{
    hs_options options = hs_options_default();
    options.cutoff = cutoff;
    options.threads = 1;
    return options;
}

/* Points in two crowds far apart are in occupied cells only, unless cells have the caller's
 * width. */
static void
crowds_are_in_occupied_cells_only(void)
{
    hs_options options = options_for(0.01);
    hs_failure failure;
    search_unit_points(81, CROWD, 3, 1.0, &unit);
    CHECK(build(NULL, NULL, &options, &failure) == HS_OK && !unit.search.is_sparse);
    CHECK(unit.search.grid.n_cells > 1 && unit.search.stencil.n_rows > 0);
    CHECK(unit.search.filter_error == unit.search.scene.x_error + unit.search.grid.shift_error);
    search_unit_close(&unit);
    for (int i = 0; i < CROWD; i++) {
        for (int k = 0; k < 3; k++)
            unit.x[3 * i + k] = 0.1 * unit.x[3 * i + k] + (i % 2 ? 1e4 : 0.0);
    }
    const hs_sets sets = {.points = &unit.points};
    CHECK(build(NULL, NULL, &options, &failure) == HS_OK && unit.search.is_sparse);
    CHECK(unit.search.grid.n_cells <= CROWD);
    hs_search_close(&unit.search);
    unit.search.is_sparse = true; /* as another system left it */
    unit.call.options.cell_size = 2000.0;
    CHECK(hs_search_build(&sets, NULL, &unit.search, &failure) == HS_OK && !unit.search.is_sparse);
    CHECK(unit.search.grid.cell_size[0] >= 2000.0);
    search_unit_close(&unit);
}

/* Cells that are at least as wide as the caller says; wider where there would be too many. */
static void
cells_have_the_width_that_is_wanted(void)
{
    hs_options options = options_for(0.125);
    hs_failure failure;
    search_unit_points(82, N, 2, 1.0, &unit);
    options.cell_size = 0.25;
    CHECK(build(NULL, NULL, &options, &failure) == HS_OK);
    CHECK(unit.search.grid.cell_size[0] >= 0.25 && unit.search.grid.cell_size[0] < 0.34);
    CHECK(unit.search.grid.shape[1] == 3);
    search_unit_close(&unit);
    options.cell_size = 1e-9;
    CHECK(build(NULL, NULL, &options, &failure) == HS_OK);
    CHECK(unit.search.grid.cell_size[0] > 1e-4);
    search_unit_close(&unit);
}

/* An algorithm of the caller's choice, where another one would have been chosen; one cell may be all
 * that there is of each. */
static void
the_algorithm_is_the_callers(void)
{
    static const struct {
        hs_algorithm algorithm;
        bool         is_sparse;
    } cases[] = {{HS_ALL_PAIRS, false}, {HS_GRID, false}, {HS_HASH, true}};
    hs_options options = options_for(0.1);
    hs_failure failure;
    for (int n = 0; n <= N; n = n < 3 ? n + 1 : n == 3 ? 30 : n == 30 ? N : N + 1) {
        for (int c = 0; c < 3; c++) {
            search_unit_points(86, n, 2, 1.0, &unit);
            options.algorithm = cases[c].algorithm;
            CHECK(build(NULL, NULL, &options, &failure) == HS_OK);
            const hs_grid *grid = &unit.search.grid;
            CHECK(unit.search.is_sparse == cases[c].is_sparse && unit.search.bins.n == n);
            CHECK(c != 0 || (grid->n_cells == 1 && grid->shape[0] == 1 && grid->shape[1] == 1));
            CHECK(c != 1 || n < N || grid->n_cells > 20);
            CHECK(c != 1 || n != 30 || grid->n_cells > 1); /* no quicker than all pairs */
            CHECK(c != 2 || grid->n_cells <= n);
            search_unit_close(&unit);
        }
    }
    options.cell_size = 0.5;
    options.algorithm = HS_GRID;
    CHECK(build(NULL, NULL, &options, &failure) == HS_OK && unit.search.grid.cell_size[0] >= 0.4);
    search_unit_close(&unit);
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{0x1p-40}, {0.0, 1.0}}};
    for (int c = 0; c < 3; c++) {
        options.algorithm = cases[c].algorithm;
        options.want = 0;
        CHECK(build(NULL, &box, &options, &failure) == HS_ERR_MEMORY); /* of images */
        search_unit_close(&unit);
    }
}

/* Points first, then queries, in cells of their own of one grid. */
static void
queries_are_in_the_cells_of_the_points(void)
{
    const double     q[6] = {0.5, 0.5, -3.0, 0.25, 7.0, 0.75};
    const hs_points  queries = {q, 3, 2, HS_FLOAT64, 16, 8};
    const hs_options options = options_for(0.125);
    hs_failure       failure;
    search_unit_points(83, N, 2, 1.0, &unit);
    CHECK(build(&queries, NULL, &options, &failure) == HS_OK && unit.search.has_queries);
    CHECK(unit.search.bins.n == N && unit.search.query_bins.n == 3 && unit.search.is_full);
    CHECK(hs_search_asking(&unit.search) == &unit.search.query_bins);
    search_unit_close(&unit);
}

static void
what_cannot_be_built_is_told(void)
{
    const hs_box flat = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {2.0}}};
    hs_options   options = options_for(0.125);
    hs_failure   failure;
    search_unit_points(84, N, 2, 1.0, &unit);
    CHECK(build(NULL, &flat, &options, &failure) == HS_ERR_BOX_DEPENDENT);
    search_unit_close(&unit);
    options.kernel = "none of that name";
    CHECK(build(NULL, NULL, &options, &failure) == HS_ERR_KERNEL);
    search_unit_close(&unit);
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    options = options_for(4000.0); /* of more pairs than the limit holds, by their density */
    options.memory_limit = 1e6;
    CHECK(build(NULL, &box, &options, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs > 1e12 && failure.expected_bytes > 1e13);
    search_unit_close(&unit);
    options.memory_limit = 100e3; /* points fit, the rows of the stencil do not */
    options.cutoff = 0x1p20;
    options.want = 0;
    CHECK(build(NULL, &box, &options, &failure) == HS_ERR_MEMORY);
    CHECK(failure.search_bytes > 1e6);
    search_unit_close(&unit);
}

static hs_status
build_and_close(void *context)
{
    const hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.5, 1.0}}};
    const hs_options options = options_for(0.125);
    hs_failure       failure;
    const hs_status  status = build(context, &box, &options, &failure);
    search_unit_close(&unit);
    return status;
}

static void
any_allocation_may_be_refused(void)
{
    const double q[4] = {0.5, 0.5, 0.25, 0.75};
    hs_points    queries = {q, 2, 2, HS_FLOAT64, 16, 8};
    search_unit_points(85, N, 2, 1.0, &unit);
    CHECK(fail_each_allocation(build_and_close, NULL, 100) > 4);
    CHECK(fail_each_allocation(build_and_close, &queries, 100) > 6);
}

/* Cells cost what sorting and visiting rows of them take: a few points are in one. Half as many
 * again or less decide, the more of them the more rows there are. */
static void
a_few_points_are_in_one_cell(void)
{
    static const struct {
        int     d, repeats;
        double  cutoff;
        int64_t one, several; /* points that are in one cell, and in several */
    } cases[] = {{1, 0, 0.05, 80, 120},  {1, 0, 0.15, 135, 190}, {1, 1, 0.05, 27, 40},
                 {1, 1, 0.3, 33, 50},    {2, 0, 0.05, 100, 150}, {2, 0, 0.15, 100, 150},
                 {2, 0, 0.3, 300, 450},  {2, 1, 0.15, 11, 17},   {3, 0, 0.05, 150, 220},
                 {3, 0, 0.15, 155, 230}, {3, 0, 0.3, 440, 660},  {3, 1, 0.15, 4, 8}};
    for (int c = 0; c < 12; c++) {
        const int d = cases[c].d;
        hs_box    box = {.ndim = d};
        for (int k = 0; k < d; k++) {
            box.periodic[k] = true;
            box.rows[k][k] = 1.0;
        }
        for (int several = 0; several < 2; several++) {
            const int64_t n = several ? cases[c].several : cases[c].one;
            search_unit_points(7, n, d, 1.0, &unit);
            search_unit_open(cases[c].repeats ? &box : NULL, cases[c].cutoff, false, HS_WANT_I,
                             &unit);
            CHECK((unit.search.grid.n_cells > 1) == several);
            search_unit_close(&unit);
        }
    }
}

void
test_search_build(void)
{
    RUN(crowds_are_in_occupied_cells_only);
    RUN(cells_have_the_width_that_is_wanted);
    RUN(the_algorithm_is_the_callers);
    RUN(queries_are_in_the_cells_of_the_points);
    RUN(what_cannot_be_built_is_told);
    RUN(any_allocation_may_be_refused);
    RUN(a_few_points_are_in_one_cell);
}
