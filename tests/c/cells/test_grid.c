/* SPDX-License-Identifier: BSD-3-Clause */
/* test_grid.c: cells are as wide as the search needs, and their stencils miss no neighbour. */
#include "../../../csrc/core/base/status.h"
#include "../../../csrc/core/box/lattice.h"
#include "../../../csrc/core/cells/grid.h"
#include "../../../csrc/core/memory/memory.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_grid(void);

/* ---- how wide cells are, and where their faces lie, changes no answer ---- */

/* Boxes so short that a cutoff passes more images than are counted are refused with any cells. */
static void
endless_images_are_refused_with_any_cells(void)
{
    static const double lengths[] = {1e-9, 1e-11, 1e-30, 0x1p-1000};
    double              x[4] = {0.0, 0.0, 0.1, 0.1};
    for (int l = 0; l < 4; l++) {
        hs_box      box = {.ndim = 2, .periodic = {true, false}, .rows = {{lengths[l], 0.0}}};
        brute_scene scene = {.ndim = 2, .n = 2, .x = x, .box = &box, .cutoff = 10.0};
        for (double size = 1.0; size > 1e-40; size *= 1e-8) {
            const hs_points points = points_of(&scene);
            hs_options      options = options_of(&scene);
            hs_plan         plan;
            options.cell_size = 0.0;
            const hs_status without = hs_plan_make(AMONG(&points, &box), &options, &plan, NULL);
            options.cell_size = size;
            CHECK(hs_plan_make(AMONG(&points, &box), &options, &plan, NULL) == without);
            CHECK(without == HS_OK || without == HS_ERR_MEMORY);
            CHECK(l == 0 || without == HS_ERR_MEMORY);
        }
    }
}

/*
 * ---- grid unit ----
 *
 * A scene in the plane and its grid, so that a test can take the steps of choosing cells one by
 * one.
 */

enum { N = 3000 };

static double     grid_x[2 * N];
static hs_account account;
static hs_scene   grid_scene;
static hs_grid    grid;

static void
open_scene(int64_t n, const hs_box *box, double cutoff)
{
    const hs_points points = {grid_x, n, 2, HS_FLOAT64, 16, 8};
    hs_options      options = hs_options_default();
    hs_failure      failure;
    options.cutoff = cutoff;
    hs_account_init(&account, &options);
    CHECK(hs_scene_make(&account, NULL, &(hs_sets){.points = &points}, box, &options, &grid_scene,
                        NULL, &failure) == HS_OK);
    CHECK(hs_grid_init(&grid_scene, HS_GRID_ANY, &grid, &failure) == HS_OK);
}

static void
close_scene(void)
{
    hs_scene_free(&account, &grid_scene);
    CHECK(account.held == 0);
}

static void
fill_square(double side)
{
    harness_random random = {88};
    for (int e = 0; e < 2 * N; e++)
        grid_x[e] = side * random_unit(&random);
}

/*
 * ---- grid ranges ----
 *
 * How far apart the cells of a pair can be, in lattices that are worse than any box gives.
 */

/* Normals that miss the periods by 0.3 of one: ranges grow with the number of images, which grows
 * with the ranges. */
static void
endless_ranges_are_refused(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    hs_failure   failure = HS_NO_FAILURE;
    bool         is_wider;
    fill_square(1.0);
    open_scene(4, &box, 1.0);
    grid_scene.lattice.aligned = false;
    grid_scene.lattice.normal[0][0] = 0.7;
    grid_scene.lattice.normal[0][1] = grid_scene.lattice.normal[1][0] = 0.0;
    grid_scene.lattice.normal[1][1] = 1.0;
    grid_scene.radius = 100.0;
    CHECK(hs_grid_init(&grid_scene, HS_GRID_ANY, &grid, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs == INFINITY && failure.expected_bytes == INFINITY);
    CHECK(hs_grid_init_wide(&grid_scene, 1.0, &grid, &is_wider, &failure) == HS_ERR_MEMORY);
    const hs_grid before = grid;
    CHECK(hs_grid_narrow(&grid_scene, false, 2.0, &grid) == HS_ERR_MEMORY);
    CHECK(grid.reach[0] == before.reach[0] && grid.expected_pairs == before.expected_pairs);
    grid_scene.lattice.U[1][0] = INT64_C(1) << 32; /* a row that no S counts */
    CHECK(hs_grid_init(&grid_scene, HS_GRID_ANY, &grid, &failure) == HS_ERR_BOX_SKEWED);
    CHECK(hs_grid_init_wide(&grid_scene, 1.0, &grid, &is_wider, &failure) == HS_ERR_BOX_SKEWED);
    grid_scene.lattice.U[1][0] = 0;
    grid_scene.radius = 0.25; /* then it is rounding alone that moves points across the box */
    grid_scene.t_error[0] = 0.3;
    CHECK(hs_grid_init(&grid_scene, HS_GRID_ANY, &grid, &failure) == HS_ERR_BOX_SKEWED);
    grid_scene.t_error[0] = 0.0;
    grid_scene.lattice.normal[0][0] = 1.0;
    CHECK(hs_grid_init(&grid_scene, HS_GRID_ANY, &grid, &failure) == HS_OK);
    CHECK(grid.range[0] >= 0.25 && grid.range[0] < 0.2500001);
    grid_scene.lattice.row_error[0] = 0x1p-20; /* of each image that a pair may be away */
    CHECK(hs_grid_init(&grid_scene, HS_GRID_ANY, &grid, &failure) == HS_OK);
    CHECK(grid.range[0] > 0.25 + 0x1p-20 && grid.range[0] < 0.2501);
    close_scene();
}

/* Where pairs are narrower along some axes, fewer are expected, in proportion. */
static void
narrow_pairs_are_fewer(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    hs_failure   failure = HS_NO_FAILURE;
    fill_square(1.0);
    open_scene(N, &box, 0.25);
    const double expected = grid.expected_pairs;
    grid_scene.less[0] = 0.125;
    grid_scene.less[1] = 0.0625;
    CHECK(hs_grid_init(&grid_scene, HS_GRID_ANY, &grid, &failure) == HS_OK);
    CHECK(fabs(grid.expected_pairs / expected - 0.5 * 0.75) < 1e-15);
    close_scene();
}

/* Directions within 1e-4 of each other say nothing about which rows are out of reach. */
static void
flat_frames_prune_nothing(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.25}, {0.0, 1.0}}};
    hs_stencil   pruned, whole;
    fill_square(1.0);
    open_scene(4, &box, 6.0);
    const hs_options options = hs_options_default();
    CHECK(!grid_scene.lattice.aligned && grid.n_cells == 1);
    CHECK(hs_stencil_build(&account, &options, &grid_scene, &grid, true, &pruned) == HS_OK);
    hs_lattice  *lattice = &grid_scene.lattice;
    const double normal[2][2] = {{1.0, -1e4}, {0.0, 1e4}}, direction[2][2] = {{1.0}, {1.0, 1e-4}};
    for (int k = 0; k < 2; k++) {
        memcpy(lattice->normal[k], normal[k], sizeof normal[k]);
        memcpy(lattice->direction[k], direction[k], sizeof direction[k]);
    }
    CHECK(hs_stencil_build(&account, &options, &grid_scene, &grid, true, &whole) == HS_OK);
    CHECK(whole.n_rows == 2 * grid.reach[1] + 1);
    const int64_t n_rows = whole.n_rows;
    hs_free(&account, whole.rows);
    lattice->direction[1][1] = 1.0; /* nor do directions that are not those of the normals */
    CHECK(hs_stencil_build(&account, &options, &grid_scene, &grid, true, &whole) == HS_OK);
    CHECK(whole.n_rows == n_rows);
    int64_t narrower = 0;
    for (int64_t r = 0; r < whole.n_rows; r++) {
        CHECK(whole.rows[r].offset[1] == r - grid.reach[1]);
        CHECK(whole.rows[r].first == -grid.reach[0] && whole.rows[r].last == grid.reach[0]);
    }
    for (int64_t r = 0; r < pruned.n_rows; r++)
        narrower += pruned.rows[r].last - pruned.rows[r].first < 2 * grid.reach[0];
    CHECK(pruned.n_rows == whole.n_rows ? narrower > 0 : pruned.n_rows < whole.n_rows);
    hs_free(&account, pruned.rows);
    hs_free(&account, whole.rows);
    close_scene();
}

/* ---- neighbourhoods of very many rows of cells: counted right, stopped, refused ---- */

static const double one_point[3] = {0.125, 0.25, 0.5};

static hs_status
count_images(double tilt, double cutoff, hs_options *options, int64_t *count)
{
    const hs_box    box = {.ndim = 3,
                           .periodic = {true, true, true},
                           .rows = {{1.0, 0.0, 0.0}, {tilt, 1.0, 0.0}, {0.0, tilt, 1.0}}};
    const hs_points points = {one_point, 1, 3, HS_FLOAT64, 24, 8};
    *count = -1;
    options->cutoff = cutoff;
    return hs_pairs_count(AMONG(&points, &box), options, count, NULL);
}

static void
long_lists_of_rows_can_be_stopped(void)
{
    hs_options options = hs_options_default();
    int64_t    count, polls;
    options.poll = stop_after;
    options.poll_context = &polls;
    for (int n = 0; n < 3; n++) {
        polls = n;
        CHECK(count_images(0.0, 200.0, &options, &count) == HS_ERR_INTERRUPTED && count == -1);
    }
}

static void
too_many_rows_are_refused(void)
{
    hs_options options = hs_options_default();
    int64_t    count;
    CHECK(count_images(0.0, 1e5, &options, &count) == HS_ERR_MEMORY);
    CHECK(count_images(0.375, 1e5, &options, &count) == HS_ERR_MEMORY);
    CHECK(count_images(0.0, 1e300, &options, &count) == HS_ERR_MEMORY);
    for (int exponent = 25; exponent < 900; exponent += 25) {
        const hs_status expected = exponent == 25 ? HS_ERR_TOO_MANY : HS_ERR_MEMORY;
        CHECK(count_images(0.0, ldexp(1.0, exponent), &options, &count) == expected);
        CHECK(count_images(0.375, ldexp(1.0, exponent), &options, &count) == expected);
    }
    options.memory_limit = 2e5;
    CHECK(count_images(0.0, 200.0, &options, &count) == HS_ERR_MEMORY);
    CHECK(count_images(0.375, 200.0, &options, &count) == HS_ERR_MEMORY);
}

void
test_grid(void)
{
    RUN(endless_images_are_refused_with_any_cells);
    RUN(endless_ranges_are_refused);
    RUN(narrow_pairs_are_fewer);
    RUN(flat_frames_prune_nothing);
    RUN(long_lists_of_rows_can_be_stopped);
    RUN(too_many_rows_are_refused);
}
