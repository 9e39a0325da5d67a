/* SPDX-License-Identifier: BSD-3-Clause */
/* test_candidates_failures.c: what hs_cells_candidates says of failures, and leaves behind. */
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_candidates_failures(void);

static random_scene shared;

/* Points in two places far apart where `few`: then only occupied cells are stored. */
static hs_cells *
build(bool few, hs_points *points, hs_options *options)
{
    harness_random random = {4};
    hs_cells      *cells = NULL;
    make_scene(&random, SCENE_OPEN, 3, 120, 4.0, 0, &shared);
    for (int e = 0; few && e < 180; e++)
        shared.x[e] += 1e9;
    shared.scene.cutoff = 0.5;
    *points = points_of(&shared.scene);
    *options = options_of(&shared.scene);
    CHECK(hs_cells_build(points, NULL, options, &cells, NULL) == HS_OK);
    return cells;
}

/* Whatever the caller's struct held before. */
static void
failures_are_told_afresh(void)
{
    hs_points  points;
    hs_options options;
    hs_cells  *cells = build(false, &points, &options);
    hs_pairs  *ranges = NULL;
    hs_failure failure;
    memset(&failure, 0x5a, sizeof failure);
    CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, &failure) == HS_OK);
    CHECK(failure.row == -1 && failure.column == -1 && failure.system == -1);
    CHECK(!failure.in_queries && failure.value == 0.0 && failure.expected_pairs == 0.0);
    CHECK(failure.expected_bytes == 0.0);
    hs_pairs_free(ranges);
    memset(&failure, 0x5a, sizeof failure);
    options.memory_limit = 100.0;
    CHECK(hs_cells_candidates(cells, NULL, &options, &ranges, &failure) == HS_ERR_MEMORY);
    CHECK(failure.row == -1 && failure.column == -1 && failure.system == -1);
    CHECK(!failure.in_queries && failure.expected_pairs == 0.0);
    CHECK(failure.limit_bytes == 100.0);
    hs_cells_free(cells);
}

static void
whichever_allocation_of_candidates_fails_nothing_is_left(void)
{
    for (int few = 0; few < 2; few++) {
        hs_points     points;
        hs_options    options;
        hs_cells     *cells = build(few, &points, &options);
        const int64_t before = hs_test_live_blocks();
        bool          ended = false;
        int           nth = 0, n_failed = 0;
        while (!ended && nth < 100) {
            hs_pairs *ranges = (hs_pairs *)&points;
            hs_test_fail_allocation(++nth);
            const hs_status status = hs_cells_candidates(cells, &points, &options, &ranges, NULL);
            ended = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK ? ranges != NULL : status == HS_ERR_MEMORY && ranges == NULL);
            n_failed += status != HS_OK;
            hs_pairs_free(ranges);
            CHECK(hs_test_live_blocks() == before);
        }
        CHECK(ended && n_failed > 5);
        hs_cells_free(cells);
    }
}

void
test_candidates_failures(void)
{
    RUN(failures_are_told_afresh);
    RUN(whichever_allocation_of_candidates_fails_nothing_is_left);
}
