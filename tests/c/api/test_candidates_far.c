/* SPDX-License-Identifier: BSD-3-Clause */
/* test_candidates_far.c: candidates of queries that lie far from the points, and of points that no
 * cells hold. */
#include "../support/among.h"
#include "../support/harness.h"

#include <math.h>

void test_candidates_far(void);

/* Along open axes, around points at either end of the numbers. */
static void
queries_at_any_distance(void)
{
    const double places[] = {0.0, 1.0, -0x1p30, 0x1p200};
    for (int p = 0; p < 4; p++) {
        const double    unit = p == 3 ? 0x1p190 : 1.0;
        const double    x[2] = {places[p], places[p] + 0.125 * unit};
        const double    q[5] = {x[1], x[1] + 0.25 * unit, 0x1p800, -0x1p800, 0x1p-1074};
        const int       near = p == 0 ? 2 : 1; /* the last one is the first point, nearly */
        const hs_points points = {x, 2, 1, HS_FLOAT64, 8, 8};
        const hs_points asking = {q, 5, 1, HS_FLOAT64, 8, 8};
        hs_options      options = hs_options_default();
        hs_cells       *cells = NULL;
        hs_pairs       *ranges = NULL;
        options.cutoff = 0.125 * unit;
        CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
        CHECK(hs_cells_candidates(cells, &asking, &options, &ranges, NULL) == HS_OK);
        CHECK(hs_pairs_length(ranges) >= near);
        const int64_t *offsets = hs_pairs_offsets(ranges);
        CHECK(offsets[1] > 0 && offsets[4] == offsets[1]);
        CHECK((offsets[5] > offsets[4]) == (near == 2));
        hs_pairs_free(ranges);
        hs_cells_free(cells);
    }
}

/* Of which one is further outside than the cells know their error for. */
static void
queries_in_a_skewed_box(void)
{
    const double    x[2] = {0.1, 0.1}, q[6] = {0.0, 1000.0, 0.0, -9e6, 9e9, 0.0};
    const hs_points points = {x, 1, 2, HS_FLOAT64, 16, 8}, asking = {q, 3, 2, HS_FLOAT64, 16, 8};
    const hs_points near = {q, 1, 2, HS_FLOAT64, 16, 8};
    const hs_box    box = {2, {true, true}, {{1.0, 0.0}, {0.3, 1.0}}};
    hs_options      options = hs_options_default();
    hs_cells       *cells = NULL;
    hs_pairs       *ranges = NULL;
    hs_failure      failure;
    options.cutoff = 0.3;
    CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
    CHECK(hs_cells_candidates(cells, &asking, &options, &ranges, &failure) == HS_ERR_FAR);
    CHECK(failure.row == 1 && failure.column == 1 && failure.value == -9e6);
    CHECK(hs_cells_candidates(cells, &near, &options, &ranges, &failure) == HS_OK);
    hs_pairs_free(ranges);
    hs_cells_free(cells);
}

/* An open axis on which points lie far beyond what a skewed box beside it can be scaled with: all
 * are in one cell, with which no ranges can be told, wherever queries are. Searches in it are
 * right. */
static void
cells_with_everything_have_no_ranges(void)
{
    const double    x[6] = {0.0, 0.0, 1e300, 0.3, 0.0, 1e300}, q[3] = {0.0, 0.0, 0.0};
    const hs_points points = {x, 2, 3, HS_FLOAT64, 24, 8}, asking = {q, 1, 3, HS_FLOAT64, 24, 8};
    const hs_box    box = {3, {true, true, false}, {{1.0}, {0.5, 1.0}, {0.0, 0.0, 1.0}}};
    hs_options      options = hs_options_default();
    hs_cells       *cells = NULL;
    hs_pairs       *ranges = (hs_pairs *)&options;
    hs_layout       layout;
    hs_failure      failure;
    int64_t         count = 0, cell[2] = {-7, -7};
    options.cutoff = 0.4;
    CHECK(hs_cells_build(&points, &box, &options, &cells, NULL) == HS_OK);
    for (int with = 0; with < 2; with++) {
        const hs_points *queries = with ? &asking : NULL;
        memset(&failure, 0x5a, sizeof failure);
        CHECK(hs_cells_candidates(cells, queries, &options, &ranges, &failure) == HS_ERR_FAR);
        CHECK(ranges == NULL && failure.row == -1 && failure.column == -1);
        CHECK(!failure.in_queries && failure.limit_bytes == 0.0);
    }
    hs_cells_layout(cells, &layout);
    CHECK(layout.n_cells == 1 && !layout.occupied_only && layout.n_points == 2);
    for (int k = 0; k < 3; k++)
        CHECK(layout.shape[k] == 1 && layout.cell_size[k] == INFINITY);
    CHECK(hs_cells_find(cells, &points, cell, NULL) == HS_OK && cell[0] == 0 && cell[1] == 0);
    CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK && count == 1);
    options.cutoff = 0.2;
    CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == 0.2 && ranges == NULL);
    hs_cells_free(cells);
}

/* No distance is decided on: whatever precision is asked for, ranges are the same. */
static void
precisions_make_no_difference(void)
{
    const double    x[3] = {0.0, 1.0, 5.0};
    const hs_points points = {x, 3, 1, HS_FLOAT64, 8, 8};
    for (int built = HS_EXACT; built <= HS_SINGLE; built++) {
        for (int asked = HS_EXACT; asked <= HS_SINGLE; asked++) {
            hs_options options = hs_options_default();
            hs_cells  *cells = NULL;
            hs_pairs  *ranges = NULL;
            options.cutoff = 1.0;
            options.precision = (hs_precision)built;
            CHECK(hs_cells_build(&points, NULL, &options, &cells, NULL) == HS_OK);
            options.precision = (hs_precision)asked;
            CHECK(hs_cells_candidates(cells, &points, &options, &ranges, NULL) == HS_OK);
            CHECK(hs_pairs_rows(ranges) == 3 && hs_pairs_length(ranges) >= 3);
            hs_pairs_free(ranges);
            CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, NULL) == HS_OK);
            hs_pairs_free(ranges);
            hs_cells_free(cells);
        }
    }
}

void
test_candidates_far(void)
{
    RUN(cells_with_everything_have_no_ranges);
    RUN(precisions_make_no_difference);
    RUN(queries_at_any_distance);
    RUN(queries_in_a_skewed_box);
}
