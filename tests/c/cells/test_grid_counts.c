/* SPDX-License-Identifier: BSD-3-Clause */
/* test_grid_counts.c: how many cells there are along each axis where there would be too many. */
#include "../../../csrc/core/cells/grid.h"
#include "../support/pair_checks.h"

#include <math.h>

#include "../support/grid_unit.h"

void test_grid_counts(void);

/* One factor for all axes, to whole numbers below; what is one cell stays one. */
static void
too_many_cells_are_lowered_by_one_factor(void)
{
    const double most = 2.0 * 40 + HS_GRID_SPARE_CELLS; /* 144 */
    double       few[2] = {12.0, 12.0}, many[2] = {240.0, 60.0}, flat[2] = {1.0, 1000.0};
    fill_square(1.0);
    open_scene(40, NULL, 0.01);
    CHECK(!hs_grid_cap_counts(&scene, few) && few[0] == 12.0 && few[1] == 12.0);
    few[0] = 13.0;
    CHECK(hs_grid_cap_counts(&scene, few) && few[0] == 12.0 && few[1] == 11.0);
    CHECK(hs_grid_cap_counts(&scene, many) && many[0] == 24.0 && many[1] == 6.0);
    CHECK(hs_grid_cap_counts(&scene, flat) && flat[0] == 1.0 && flat[1] == most);
    close_scene();
}

/* A scene of n points in the unit square, with cells that are `range` wide or more. */
static void
open_capped(int n, double range)
{
    fill_square(1.0);
    open_scene(n, NULL, range);
    scene.lower[0] = scene.lower[1] = 0.0;
    scene.upper[0] = scene.upper[1] = 1.0;
    grid.range[0] = grid.range[1] = range;
}

/* As many cells as before, or somewhat fewer, in fewer rows: up to 16 times shorter, no shorter than
 * the range, and ten rows or more. */
static void
capped_cells_are_shorter_in_fewer_rows(void)
{
    static const struct {
        int    n;
        double range, first, rows;
    } cases[] = {
        {18, 1e-6, 10.0, 10.0},    /* 100 cells: there are no more rows than ten */
        {1968, 1e-6, 400.0, 10.0}, /* 4000: 63 x 63 */
        {2968, 1e-6, 600.0, 10.0}, /* 6000: 77 x 77 */
        {2968, 0.0, 600.0, 10.0},  /* a cutoff of 0 */
        {2968, 1e-2, 99.0, 59.0},  /* which the range ends */
    };
    for (int c = 0; c < 5; c++) {
        double counts[2] = {1e6, 1e6};
        open_capped(cases[c].n, cases[c].range);
        CHECK(hs_grid_fit_counts(&scene, &grid, counts));
        CHECK(counts[0] * counts[1] <= hs_grid_most_cells(&scene));
        CHECK(counts[0] * counts[1] >= 0.9 * hs_grid_most_cells(&scene));
        CHECK(fabs(counts[0] / cases[c].first - 1.0) < 0.05);
        CHECK(fabs(counts[1] / cases[c].rows - 1.0) < 0.05);
        close_scene();
    }
}

/* Cells that are as narrow as wanted stay as they are; so do those of an axis alone. */
static void
other_cells_are_left_alone(void)
{
    double wanted[2] = {77.0, 77.0}, alone[2] = {1e6, 1.0};
    open_capped(3000, 1e-2);
    CHECK(!hs_grid_fit_counts(&scene, &grid, wanted) && wanted[0] == 77.0 && wanted[1] == 77.0);
    CHECK(hs_grid_fit_counts(&scene, &grid, alone) && alone[1] == 1.0);
    CHECK(alone[0] == hs_grid_most_cells(&scene));
    close_scene();
}

void
test_grid_counts(void)
{
    RUN(too_many_cells_are_lowered_by_one_factor);
    RUN(capped_cells_are_shorter_in_fewer_rows);
    RUN(other_cells_are_left_alone);
}
