/* SPDX-License-Identifier: BSD-3-Clause */
/* test_grid_ranges.c: how far apart the cells of a pair can be, in lattices that are worse than any
 * box gives; what cannot be counted is refused, what cannot be told is left alone. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/box/lattice.h"
#include "../../../csrc/core/cells/sparse_grid.h"
#include "../../../csrc/core/cells/stencil.h"
#include "../support/pair_checks.h"

#include <math.h>

#include "../support/grid_unit.h"

void test_grid_ranges(void);

/* Normals that miss the periods by 0.3 of one: ranges grow with the number of images, which grows
 * with the ranges. */
static void
endless_ranges_are_refused(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    double       density;
    hs_failure   failure = HS_NO_FAILURE;
    bool         is_wider;
    fill_square(1.0);
    open_scene(4, &box, 1.0);
    scene.lattice.aligned = false;
    scene.lattice.normal[0][0] = 0.7;
    scene.lattice.normal[0][1] = scene.lattice.normal[1][0] = 0.0;
    scene.lattice.normal[1][1] = 1.0;
    scene.radius = 100.0;
    CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs == INFINITY && failure.expected_bytes == INFINITY);
    failure = HS_NO_FAILURE;
    CHECK(hs_grid_init(&scene, &grid, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs == INFINITY);
    CHECK(hs_grid_init_wide(&scene, 1.0, &grid, &is_wider, &failure) == HS_ERR_MEMORY);
    const hs_grid before = grid;
    CHECK(hs_grid_narrow(&scene, false, 2.0, &grid) == HS_ERR_MEMORY);
    CHECK(grid.reach[0] == before.reach[0] && grid.expected_pairs == before.expected_pairs);
    scene.lattice.U[1][0] = INT64_C(1) << 32; /* a row that no S counts */
    CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_ERR_BOX_SKEWED);
    CHECK(hs_grid_init_wide(&scene, 1.0, &grid, &is_wider, &failure) == HS_ERR_BOX_SKEWED);
    scene.lattice.U[1][0] = 0;
    scene.radius = 0.25; /* then it is rounding alone that moves points across the box */
    scene.t_error[0] = 0.3;
    CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_ERR_BOX_SKEWED);
    scene.t_error[0] = 0.0;
    scene.lattice.normal[0][0] = 1.0;
    CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_OK);
    CHECK(grid.range[0] >= 0.25 && grid.range[0] < 0.2500001);
    close_scene();
}

/* A product of two terms, its sum and the period are rounded for each of three images: a pair may
 * be as much further apart. */
static void
ranges_have_room_for_roundings(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    double       density;
    hs_failure   failure;
    fill_square(1.0);
    open_scene(4, &box, 1.0);
    scene.lattice.aligned = false;
    for (int k = 0; k < 2; k++) {
        scene.lattice.normal[k][k] = 1.0;
        scene.lattice.normal[k][1 - k] = 0.0;
    }
    scene.radius = 0x1p-30;
    CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_OK);
    for (int k = 0; k < 2; k++) {
        const double room = grid.range[k] - scene.radius;
        CHECK(room >= 3.0 * 4.9 * 0x1p-53 && room <= 3.0 * 10.0 * 0x1p-53);
    }
    scene.t_error[0] = 0x1p-40;
    CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_OK);
    CHECK(grid.range[0] - scene.radius >= 0x1p-39 && grid.range[1] - scene.radius < 0x1p-45);
    close_scene();
}

static void
rows_that_no_shift_counts_mean_a_skewed_box(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.5, 1.0}}};
    fill_square(1.0);
    open_scene(4, &box, 0.25);
    hs_lattice *lattice = &scene.lattice;
    CHECK(!lattice->aligned && hs_skew_or_memory(lattice) == HS_ERR_MEMORY);
    lattice->U[1][0] = (INT64_C(1) << 32) - 1;
    CHECK(hs_skew_or_memory(lattice) == HS_ERR_MEMORY);
    lattice->U[1][0] = -(INT64_C(1) << 32);
    CHECK(hs_skew_or_memory(lattice) == HS_ERR_BOX_SKEWED);
    lattice->aligned = true;
    CHECK(hs_skew_or_memory(lattice) == HS_ERR_MEMORY);
    lattice->aligned = false;
    lattice->U[1][0] = 0;
    lattice->period[1] = 0x1p-20;
    CHECK(hs_skew_or_memory(lattice) == HS_ERR_MEMORY);
    lattice->period[1] = 0x1p-21;
    CHECK(hs_skew_or_memory(lattice) == HS_ERR_BOX_SKEWED);
    close_scene();
}

/* Cells of a row that a point may be near to: those that the circle around its cell meets. */
static void
rows_are_as_long_as_the_circle_is_wide(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0}, {0.0, 8.0}}};
    const double counts[2] = {64.0, 64.0}, cell = 0.125;
    hs_stencil   whole, half;
    fill_square(8.0);
    open_scene(N, &box, 1.0);
    const hs_options options = hs_options_default();
    CHECK(hs_grid_set_shape(&scene, counts, &grid) == HS_OK && grid.reach[1] >= 8);
    CHECK(hs_stencil_build(&account, &options, &scene, &grid, true, &whole) == HS_OK);
    CHECK(hs_stencil_build(&account, &options, &scene, &grid, false, &half) == HS_OK);
    CHECK(whole.n_rows == 19 && half.n_rows == 10);
    for (int64_t r = 0; r < whole.n_rows; r++) {
        const hs_stencil_row *row = &whole.rows[r];
        const double          gap = cell * fmax(abs(row->offset[1]) - 1.0, 0.0);
        const double          most = floor(sqrt(1.0 - gap * gap) / cell + 1.0 + 2e-5);
        CHECK(row->offset[1] == r - 9 && row->first == -row->last);
        CHECK(row->last == fmin(most, (double)grid.reach[0]));
        const hs_stencil_row *forward = &half.rows[r < 9 ? 0 : r - 9];
        CHECK(r < 9 || (forward->offset[1] == row->offset[1] && forward->last == row->last));
        CHECK(r < 9 || forward->first == (r == 9 ? 0 : row->first));
    }
    hs_stencil_free(&account, &whole);
    hs_stencil_free(&account, &half);
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
    CHECK(!scene.lattice.aligned && grid.n_cells == 1);
    CHECK(hs_stencil_build(&account, &options, &scene, &grid, true, &pruned) == HS_OK);
    hs_lattice  *lattice = &scene.lattice;
    const double normal[2][2] = {{1.0, -1e4}, {0.0, 1e4}}, direction[2][2] = {{1.0}, {1.0, 1e-4}};
    for (int k = 0; k < 2; k++) {
        memcpy(lattice->normal[k], normal[k], sizeof normal[k]);
        memcpy(lattice->direction[k], direction[k], sizeof direction[k]);
    }
    CHECK(hs_stencil_build(&account, &options, &scene, &grid, true, &whole) == HS_OK);
    CHECK(whole.n_rows == 2 * grid.reach[1] + 1);
    const int64_t n_rows = whole.n_rows;
    hs_stencil_free(&account, &whole);
    lattice->direction[1][1] = 1.0; /* nor do directions that are not those of the normals */
    CHECK(hs_stencil_build(&account, &options, &scene, &grid, true, &whole) == HS_OK);
    CHECK(whole.n_rows == n_rows);
    int64_t narrower = 0;
    for (int64_t r = 0; r < whole.n_rows; r++) {
        CHECK(whole.rows[r].offset[1] == r - grid.reach[1]);
        CHECK(whole.rows[r].first == -grid.reach[0] && whole.rows[r].last == grid.reach[0]);
    }
    for (int64_t r = 0; r < pruned.n_rows; r++)
        narrower += pruned.rows[r].last - pruned.rows[r].first < 2 * grid.reach[0];
    CHECK(pruned.n_rows == whole.n_rows ? narrower > 0 : pruned.n_rows < whole.n_rows);
    hs_stencil_free(&account, &pruned);
    hs_stencil_free(&account, &whole);
    close_scene();
}

/* A crowd in which no two points share a cell, however wide, and one point far away from it: the
 * narrowest cells do. */
static void
lonely_points_get_narrow_cells(void)
{
    for (int i = 0; i < N; i++) {
        x[2 * i] = 1000.0 * (i % 60);
        x[2 * i + 1] = 1000.0 * (i / 60);
    }
    x[0] = 1e12;
    open_scene(N, NULL, 1.0);
    CHECK(hs_sparse_choose(&scene, &grid) == 1.0);
    close_scene();
}

/* Where nothing but points on one spot is near, cells are narrow, and can be counted. */
static void
cells_without_a_range_can_be_counted(void)
{
    for (int exponent = -100; exponent <= 800; exponent += 100) {
        const double extent = ldexp(1.0, exponent);
        hs_scene     open;
        hs_grid      dense, sparse;
        memset(&open, 0, sizeof open);
        memset(&dense, 0, sizeof dense);
        open.ndim = dense.ndim = open.lattice.ndim = 1;
        open.lattice.row_of_axis[0] = -1;
        open.upper[0] = extent;
        hs_sparse_grid(&open, &dense, 1.0, &sparse);
        CHECK(extent * sparse.cells_per_length[0] <= 0x1p1000);
        CHECK(sparse.cell_size[0] > 0.0 && sparse.cell_size[0] <= fmax(extent, 1.0) * 0x1p-900);
        CHECK(sparse.shape[0] > 1000 && sparse.reach[0] < sparse.shape[0]);
    }
}

/* Images of rows that are rounded err by as much for each; every row counts. */
static void
images_err_with_their_rows(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 2.0}}};
    hs_failure   failure = HS_NO_FAILURE;
    fill_square(1.0);
    open_scene(40, &box, 1.0);
    const double exact = grid.shift_error;
    double       density;
    CHECK(exact > 2.0 * 0x1p-53 && exact < 0x1p-45);
    for (int r = 0; r < 2; r++) {
        scene.lattice.row_error[r] = 0x1p-20;
        scene.lattice.row_error[1 - r] = 0.0;
        CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_OK);
        CHECK(grid.shift_error >= 3.0 * 0x1p-20 && grid.shift_error < 8.0 * 0x1p-20);
    }
    /* The larger of both columns: of images along the axis that is longer, too. */
    scene.lattice.row_error[0] = scene.lattice.row_error[1] = 0.0;
    scene.lattice.rows[0][0] = 0x1p30;
    CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_OK);
    CHECK(grid.shift_error > 0x1p-23 && grid.shift_error < 0x1p-15);
    scene.lattice.rows[0][0] = 1.0;
    scene.lattice.rows[1][1] = -0x1p30;
    CHECK(hs_grid_begin(&scene, &density, &grid, &failure) == HS_OK);
    CHECK(grid.shift_error > 0x1p-23 && grid.shift_error < 0x1p-15);
    close_scene();
}

void
test_grid_ranges(void)
{
    RUN(images_err_with_their_rows);
    RUN(cells_without_a_range_can_be_counted);
    RUN(endless_ranges_are_refused);
    RUN(ranges_have_room_for_roundings);
    RUN(rows_that_no_shift_counts_mean_a_skewed_box);
    RUN(rows_are_as_long_as_the_circle_is_wide);
    RUN(flat_frames_prune_nothing);
    RUN(lonely_points_get_narrow_cells);
}
