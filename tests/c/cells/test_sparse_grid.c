/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_sparse_grid.c: sparse cells are as far apart as their reach says, at any magnitude of the
 * coordinates; they are narrow; and they are chosen where a dense grid would be crowded.
 */
#include "../../../csrc/core/cells/sparse_grid.h"
#include "../support/pair_checks.h"
#include "../support/sparse_scenes.h"

void test_sparse_grid(void);

static double many[3 * SPARSE_MANY];

/* A range of t along one open axis, as wide and as far out as float64 goes. */
static void
random_axis(harness_random *random, hs_scene *scene, hs_grid *dense)
{
    const double size = ldexp(1.0 + random_unit(random), random_below(random, 1000) - 100);
    const int    side = random_below(random, 4);
    memset(scene, 0, sizeof *scene);
    memset(dense, 0, sizeof *dense);
    scene->ndim = dense->ndim = 1 + random_below(random, 2);
    for (int k = 0; k < scene->ndim; k++) {
        scene->lattice.row_of_axis[k] = -1;
        scene->lower[k] = side == 0 ? -size : side == 1 ? size * random_unit(random) : 0.0;
        scene->upper[k] = size;
        if (side == 3) {
            scene->lower[k] = -size;
            scene->upper[k] = -size * random_unit(random);
        }
        dense->range[k] = ldexp(1.0 + random_unit(random), random_below(random, 70) - 20);
        if (random_below(random, 2)) /* where cells begin to widen */
            dense->range[k] = size * ldexp(random_unit(random), -47 - random_below(random, 8));
    }
}

/* A number in the range, of any magnitude, near a cell's face or anywhere. */
static double
random_coordinate(harness_random *random, const hs_scene *scene, const hs_grid *grid, int k)
{
    const double extent = scene->upper[k] - scene->lower[k];
    double       t = scene->lower[k] + extent * random_unit(random);
    if (random_below(random, 2))
        t = grid->lower[k] + ldexp(extent * (random_unit(random) - 0.5), -random_below(random, 80));
    if (random_below(random, 2))
        t = grid->lower[k] + rint((t - grid->lower[k]) / grid->cell_size[k]) * grid->cell_size[k];
    for (int steps = random_below(random, 3); steps > 0; steps--)
        t = nextafter(t, random_below(random, 2) ? INFINITY : -INFINITY);
    return fmin(fmax(t, scene->lower[k]), scene->upper[k]);
}

static void
indices_of_a_pair_are_within_reach(void)
{
    harness_random random = {31337};
    int            neighbours = 0, apart = 0, at_reach = 0, wide = 0;
    for (int trial = 0; trial < 4000; trial++) {
        hs_scene scene;
        hs_grid  dense, grid;
        random_axis(&random, &scene, &dense);
        const int    k = scene.ndim - 1;
        const double width = random_width(&random);
        hs_sparse_grid(&scene, &dense, width, &grid);
        for (int point = 0; point < 100; point++) {
            const double  t = random_coordinate(&random, &scene, &grid, k);
            const double  far = random_below(&random, 3) ? 1.0 : 4.0 * random_unit(&random);
            double        u = fmin(t + far * dense.range[k], scene.upper[k]);
            const int64_t from = hs_sparse_index(&grid, k, t);
            u = u - t > far * dense.range[k] && u > t ? nextafter(u, t) : u;
            const int64_t to = hs_sparse_index(&grid, k, u);
            const double  place = (t - grid.lower[k]) / grid.cell_size[k];
            CHECK(from >= 0 && from <= to && to < grid.shape[k]);
            if (u - t <= dense.range[k]) {
                CHECK(to - from <= grid.reach[k]);
                neighbours += u > t;
                at_reach += to - from == grid.reach[k];
            } else { /* not more cells than narrow ones would be */
                CHECK((double)(to - from) <= floor((u - t) / grid.cell_size[k] * 1.001 + 1.13));
                apart++;
            }
            wide += u > t && fabs(place) >= HS_SPARSE_LINEAR;
        }
    }
    CHECK(neighbours > 50000);
    CHECK(at_reach > 20000);
    CHECK(apart > 5000);
    CHECK(wide > 3000);
}

/* Where the range is narrow, places from 0 on would be rounded by more than cells are wider than
 * the range. */
static void
places_are_counted_from_what_is_nearest_to_zero(void)
{
    static const double ends[][3] = {
        {0.5, 0.5 + 0x1p-30, 0.5}, {-0.5 - 0x1p-30, -0.5, -0.5}, {-0x1p-30, 0x1p-30, 0.0}};
    harness_random random = {1618};
    for (int e = 0; e < 3; e++) {
        const double extent = ends[e][1] - ends[e][0], range = 0x1p-48;
        hs_scene     scene = {.ndim = 1};
        hs_grid      dense = {.ndim = 1, .range = {range}}, grid;
        scene.lattice.row_of_axis[0] = -1;
        scene.lower[0] = ends[e][0];
        scene.upper[0] = ends[e][1];
        hs_sparse_grid(&scene, &dense, 1.0, &grid);
        CHECK(grid.lower[0] == ends[e][2]);
        for (int trial = 0; trial < 1000; trial++) {
            const double t = ends[e][0] + (extent - range) * random_unit(&random);
            CHECK(hs_sparse_index(&grid, 0, t + range) - hs_sparse_index(&grid, 0, t) <=
                  grid.reach[0]);
        }
    }
}

static void
cells_hold_few_numbers_however_far_out(void)
{
    harness_random random = {27182};
    for (int trial = 0; trial < 4000; trial++) {
        hs_scene scene;
        hs_grid  dense, grid;
        random_axis(&random, &scene, &dense);
        const int    k = scene.ndim - 1;
        const double width = random_width(&random);
        hs_sparse_grid(&scene, &dense, width, &grid);
        const double t = random_coordinate(&random, &scene, &grid, k);
        double       u = t;
        for (int steps = 0; steps < 32; steps++)
            u = nextafter(u, INFINITY);
        u = fmax(u, t + 2.0 * width * dense.range[k]);
        if (u <= scene.upper[k] && dense.range[k] > 0x1p-90 * (scene.upper[k] - scene.lower[k]))
            CHECK(hs_sparse_index(&grid, k, t) < hs_sparse_index(&grid, k, u));
    }
}

/* Scenes that a dense grid serves well are left to it; those it fails are not. */
static void
sparse_pays_where_points_crowd(void)
{
    /* What reaches to 1e300 has been condensed before. */
    static const bool pays[SPARSE_MANY_KINDS] = {false, true, true, true, true, false, true, false};
    harness_random    random = {141};
    for (int kind = 0; kind < SPARSE_MANY_KINDS; kind++) {
        const brute_scene scene = {
            .ndim = 3, .n = SPARSE_MANY, .x = many, .cutoff = 1.0, .inclusive = true};
        const hs_options options = options_of(&scene);
        const hs_points  points = points_of(&scene);
        hs_account       account;
        hs_scene         read;
        hs_grid          dense;
        hs_failure       failure;
        many_points(&random, kind, many);
        hs_account_init(&account, &options);
        CHECK(hs_scene_init(&account, NULL, &points, NULL, &options, &read, &failure) == HS_OK);
        CHECK(hs_grid_init(&read, &dense, &failure) == HS_OK);
        CHECK((hs_sparse_choose(&read, &dense) > 0.0) == pays[kind]);
        hs_scene_free(&account, &read);
    }
}

void
test_sparse_grid(void)
{
    RUN(indices_of_a_pair_are_within_reach);
    RUN(places_are_counted_from_what_is_nearest_to_zero);
    RUN(cells_hold_few_numbers_however_far_out);
    RUN(sparse_pays_where_points_crowd);
}
