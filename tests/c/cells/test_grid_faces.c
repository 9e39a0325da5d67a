/* SPDX-License-Identifier: BSD-3-Clause */
/* test_grid_faces.c: axes are cut at the numbers that cells begin at where these are as wide as the
 * cutoff, or a part of it, and no rounding can move a point over them. */
#include <math.h>

#include "../support/grid_unit.h"

void test_grid_faces(void);

/* Boxes that are whole multiples of the cutoff get as many cells, unless the cutoff is 0. */
static void
faces_need_a_cutoff(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0}, {0.0, 8.0}}};
    const double counts[2] = {7.0, 7.0}, parts[2] = {1.0, 1.0};
    fill_square(8.0);
    open_scene(N, &box, 1.0);
    for (int with = 0; with < 2; with++) {
        scene.radius = with ? 1.0 : 0.0;
        CHECK(hs_grid_set_shape(&scene, counts, &grid) == HS_OK);
        hs_grid_cut_by_faces(&scene, parts, 1000.0, &grid);
        CHECK(grid.by_faces[0] == with && grid.by_faces[1] == with);
        CHECK(grid.shape[0] == 7 + with && grid.n_cells == (7 + with) * (7 + with));
    }
    CHECK(hs_grid_set_shape(&scene, counts, &grid) == HS_OK);
    const hs_grid seven = grid;
    scene.upper[0] = -(scene.lower[0] = -0x1p31); /* more cells than can be told apart */
    grid.shape[0] = INT64_C(1) << 31;
    hs_grid_cut_by_faces(&scene, parts, 0x1p60, &grid);
    CHECK(!grid.by_faces[0] && grid.shape[0] == INT64_C(1) << 31);
    scene.upper[0] = -(scene.lower[0] = -4.0);
    grid = seven;
    hs_grid_cut_by_faces(&scene, parts, 56.0, &grid); /* room for a row more, not for two */
    CHECK(grid.by_faces[0] && !grid.by_faces[1] && grid.n_cells == 56);
    close_scene();
}

/* Whether the second axis is cut into 8 cells, if the first has 7 and the second might have one
 * more. */
static bool
is_cut(double part)
{
    const double counts[2] = {7.0, 7.0}, parts[2] = {1.0, part};
    CHECK(hs_grid_set_shape(&scene, counts, &grid) == HS_OK);
    hs_grid_cut_by_faces(&scene, parts, 1000.0, &grid);
    CHECK(grid.by_faces[1] == (grid.shape[1] == 8));
    CHECK(!grid.by_faces[1] ||
          (grid.cell_size[1] * 8.0 == scene.upper[1] - scene.lower[1] &&
           grid.cells_per_length[1] == 1.0 / grid.cell_size[1] && (double)grid.reach[1] == part));
    CHECK(grid.stride[0] == 1 && grid.stride[1] == grid.shape[0]);
    CHECK(grid.n_cells == grid.shape[0] * grid.shape[1]);
    return grid.by_faces[1];
}

/* Cells must be as wide as the radius, or a half or a quarter of it; a third is no double, so that
 * they must be wider than that. */
static void
cells_are_whole_parts_of_the_radius(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0}, {0.0, 8.0}}};
    fill_square(8.0);
    open_scene(N, &box, 1.0);
    CHECK(is_cut(1.0));
    scene.radius = nextafter(1.0, 2.0);
    CHECK(!is_cut(1.0));
    scene.radius = 0.75;
    CHECK(is_cut(1.0));
    scene.radius = 2.0;
    CHECK(!is_cut(1.0) && is_cut(2.0) && is_cut(4.0));
    scene.radius = 3.0;
    CHECK(!is_cut(3.0)); /* no wider than a third */
    scene.radius = nextafter(3.0, 0.0);
    CHECK(is_cut(3.0));
    close_scene();
}

/* Points that err, a range far from zero, and a point on the far face of a period: no faces. Open
 * axes are closed at their end. */
static void
faces_are_for_numbers_that_do_not_err(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0}, {0.0, 8.0}}};
    fill_square(8.0);
    open_scene(N, &box, 1.0);
    scene.t_error[1] = 0x1p-1074;
    CHECK(!is_cut(1.0));
    scene.t_error[1] = 0.0;
    double *at = &scene.cloud.x[1][N - 1];
    *at = nextafter(4.0, 0.0);
    CHECK(is_cut(1.0));
    *at = 4.0;
    CHECK(!is_cut(1.0));
    scene.lattice.row_of_axis[1] = -1;
    CHECK(is_cut(1.0));
    for (int far = 0; far < 2; far++) { /* sixteen times its width away, and a little more */
        scene.lower[1] = 120.0 + far;
        scene.upper[1] = 128.0 + far;
        CHECK(is_cut(1.0) == !far);
        scene.lower[1] = -128.0 - far;
        scene.upper[1] = -120.0 - far;
        CHECK(is_cut(1.0) == !far);
    }
    close_scene();
}

/* From four cells on. */
static void
few_cells_are_not_worth_it(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0}, {0.0, 8.0}}};
    const double parts[2] = {1.0, 1.0};
    fill_square(8.0);
    open_scene(N, &box, 1.0);
    for (int count = 2; count <= 3; count++) {
        const double counts[2] = {7.0, count};
        CHECK(hs_grid_set_shape(&scene, counts, &grid) == HS_OK);
        hs_grid_cut_by_faces(&scene, parts, 1000.0, &grid);
        CHECK(grid.by_faces[1] == (count == 3) && grid.by_faces[0]);
        CHECK(grid.shape[1] == (count == 3 ? 4 : 2));
    }
    close_scene();
}

void
test_grid_faces(void)
{
    RUN(faces_need_a_cutoff);
    RUN(cells_are_whole_parts_of_the_radius);
    RUN(faces_are_for_numbers_that_do_not_err);
    RUN(few_cells_are_not_worth_it);
}
