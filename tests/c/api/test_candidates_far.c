/* SPDX-License-Identifier: BSD-3-Clause */
/* test_candidates_far.c: candidates of queries that lie far from the points. */
#include "../../../csrc/halfshell.h"
#include "../support/harness.h"

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

void
test_candidates_far(void)
{
    RUN(queries_at_any_distance);
    RUN(queries_in_a_skewed_box);
}
