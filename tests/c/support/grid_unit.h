/* SPDX-License-Identifier: BSD-3-Clause */
/* grid_unit.h: a scene in the plane and its grid, so that a test can take the steps of choosing
 * cells one by one. Its names are short: to be included behind all other headers. */
#ifndef HS_GRID_UNIT_H
#define HS_GRID_UNIT_H

#include "../../../csrc/core/cells/grid.h"
#include "harness.h"

enum { N = 3000 };

static double     x[2 * N];
static hs_account account;
static hs_scene   scene;
static hs_grid    grid;

static inline void
open_scene(int64_t n, const hs_box *box, double cutoff)
{
    const hs_points points = {x, n, 2, HS_FLOAT64, 16, 8};
    hs_options      options = hs_options_default();
    hs_failure      failure;
    options.cutoff = cutoff;
    hs_account_init(&account, &options);
    CHECK(hs_scene_init(&account, NULL, &points, box, &options, &scene, &failure) == HS_OK);
    CHECK(hs_grid_init(&scene, &grid, &failure) == HS_OK);
}

static inline void
close_scene(void)
{
    hs_scene_free(&account, &scene);
    CHECK(account.held == 0);
}

static inline void
fill_square(double side)
{
    harness_random random = {88};
    for (int e = 0; e < 2 * N; e++)
        x[e] = side * random_unit(&random);
}

#endif
