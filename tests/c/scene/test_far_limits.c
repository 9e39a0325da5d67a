/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_far_limits.c: where numbers of very different size meet, what a search costs follows its
 * points, and a refusal says why.
 */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/among.h"

#include <math.h>

void test_far_limits(void);

enum { N = 4, K = 2 };

/* Two points at each end of a long open axis over a tilted box, their two nearest within 2. */
static hs_status
search_ends(double z, bool keeps_tree, hs_counters *counters, int64_t *j, double *d)
{
    const double    x[3 * N] = {0.1, 0.2, z, 0.4, 0.5, z, 0.7, 0.1, -z, 0.2, 0.8, -z};
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    const hs_box    box = {.ndim = 3,
                           .periodic = {true, true, false},
                           .rows = {{1.0, 0.3, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
    hs_options      options = hs_options_default();
    hs_cells       *cells = NULL;
    hs_pairs       *rows = NULL;
    hs_status       status = HS_OK;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    options.cutoff = 2.0;
    if (keeps_tree)
        status = hs_cells_build(&points, &box, &options, &cells, NULL);
    options.counters = counters;
    if (status == HS_OK)
        status = keeps_tree ? hs_nearest_find(IN_CELLS(cells), K, &options, &rows, NULL)
                            : hs_nearest_find(AMONG(&points, &box), K, &options, &rows, NULL);
    if (status == HS_OK) {
        memcpy(j, hs_pairs_array(rows, HS_WANT_J), N * K * sizeof *j);
        memcpy(d, hs_pairs_array(rows, HS_WANT_DISTANCE), N * K * sizeof *d);
    }
    hs_pairs_free(rows);
    hs_cells_free(cells);
    return status;
}

/* From 2^4 to the largest numbers: the same neighbours, for as few candidates. */
static void
a_bounded_search_costs_the_same_at_any_distance(void)
{
    int64_t     near_j[N * K], j[N * K];
    double      near_d[N * K], d[N * K];
    hs_counters counters;
    CHECK(search_ends(16.0, false, &counters, near_j, near_d) == HS_OK);
    for (int exponent = 4; exponent <= 1023; exponent += exponent < 100 ? 1 : 37) {
        for (int keeps_tree = 0; keeps_tree < 2; keeps_tree++) {
            CHECK(search_ends(ldexp(1.5, exponent), keeps_tree, &counters, j, d) == HS_OK);
            CHECK(memcmp(j, near_j, sizeof j) == 0 && memcmp(d, near_d, sizeof d) == 0);
            CHECK(counters.candidates < 4000);
        }
    }
}

/* One point above a box of one short period: its images are its neighbours, the point is not. */
static void
images_of_one_point_are_found_on_a_long_axis(void)
{
    const int scenes[][2] = {{-900, 300}, {-800, 300}, {-1000, 100}};
    for (int s = 0; s < 3; s++) {
        const double    period = ldexp(1.0, scenes[s][0]);
        const double    x[2] = {0.0, ldexp(1.0, scenes[s][1])};
        const hs_points points = {x, 1, 2, HS_FLOAT64, 16, 8};
        const hs_box    box = {.ndim = 2, .periodic = {true, false}, .rows = {{period, 0.0}}};
        hs_options      options = hs_options_default();
        hs_pairs       *rows = NULL;
        options.cutoff = 2.0 * period;
        options.want = HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT;
        CHECK(hs_neighbors_find(AMONG(&points, &box), &options, &rows, NULL) == HS_OK);
        CHECK(hs_pairs_length(rows) == 4);
        hs_pairs_free(rows);
        CHECK(hs_nearest_find(AMONG(&points, &box), 3, &options, &rows, NULL) == HS_OK);
        const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
        const double  *d = hs_pairs_array(rows, HS_WANT_DISTANCE);
        const int32_t *shift = hs_pairs_array(rows, HS_WANT_SHIFT);
        for (int e = 0; e < 3; e++)
            CHECK(j[e] == 0 && d[e] == (e < 2 ? period : 2.0 * period) && shift[2 * e + 1] == 0);
        CHECK(shift[0] == -1 && shift[2] == 1 && shift[4] == -2);
        hs_pairs_free(rows);
    }
}

/* However many boxes a cutoff spans, it is the images that are too many, not the box too skewed. */
static void
endless_images_are_refused_as_such(void)
{
    const double    x[6] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
    const hs_points points = {x, 2, 3, HS_FLOAT64, 24, 8};
    hs_box          box = {.ndim = 3,
                           .periodic = {true, true, true},
                           .rows = {{1.0, 0.0, 0.0}, {0.375, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
    for (int tilted = 0; tilted < 2; tilted++) {
        box.rows[1][0] = 0.375 * tilted;
        for (int exponent = 60; exponent <= 1020; exponent += 5) {
            hs_options options = hs_options_default();
            hs_pairs  *pairs = NULL;
            hs_failure failure;
            options.cutoff = ldexp(1.0, exponent);
            CHECK(hs_pairs_find(AMONG(&points, &box), &options, &pairs, &failure) == HS_ERR_MEMORY);
            CHECK(failure.expected_pairs > 1e50);
        }
    }
}

/* Numbers that no scale holds: one cell with everything, which says so, and has no candidates. */
static void
one_cell_with_everything_says_so(void)
{
    const double    x[4] = {0.0, 0x1p1000, 0.0, -0x1p1000};
    const hs_points points = {x, 2, 2, HS_FLOAT64, 16, 8};
    const hs_box    box = {
           .ndim = 2, .periodic = {true, false}, .rows = {{0x1p-900, 0.0}, {0.0, 1.0}}};
    hs_options options = hs_options_default();
    hs_cells  *cells = NULL;
    hs_pairs  *ranges = NULL;
    hs_failure failure;
    hs_layout  layout;
    int64_t    count = -1, cell[2] = {-1, -1};
    options.cutoff = 0x1p-899;
    CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
    hs_cells_layout(cells, &layout);
    CHECK(layout.n_cells == 1 && layout.shape[0] == 1 && layout.shape[1] == 1);
    CHECK(layout.cell_size[0] == INFINITY && layout.cell_size[1] == INFINITY);
    CHECK(layout.start[1] == 2 && layout.order[0] == 0 && layout.order[1] == 1);
    CHECK(hs_cells_find(cells, &points, cell, NULL) == HS_OK && cell[0] == 0 && cell[1] == 0);
    CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, &failure) == HS_ERR_FAR);
    CHECK(!failure.in_queries && ranges == NULL);
    CHECK(hs_cells_candidates(cells, &points, &options, &ranges, &failure) == HS_ERR_FAR);
    CHECK(!failure.in_queries && ranges == NULL);
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 4);
    hs_cells_free(cells);
}

void
test_far_limits(void)
{
    RUN(a_bounded_search_costs_the_same_at_any_distance);
    RUN(images_of_one_point_are_found_on_a_long_axis);
    RUN(endless_images_are_refused_as_such);
    RUN(one_cell_with_everything_says_so);
}
