/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_stencil.c: neighbourhoods of very many rows of cells: counted right, stopped, refused; and
 * cells that would have too many rows around them made wider.
 */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

#include "../../../csrc/core/memory/account.h"

void test_stencil(void);

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

/* Whole numbers x, y, z with x^2 + y^2 + z^2 <= R^2, but for 0, half of them. */
static int64_t
lattice_points(int64_t radius)
{
    int64_t found = 0;
    for (int64_t a = -radius; a <= radius; a++) {
        for (int64_t b = -radius; b <= radius; b++) {
            const int64_t left = radius * radius - a * a - b * b;
            int64_t       root = left < 0 ? -1 : (int64_t)sqrt((double)left);
            found += left < 0 ? 0 : 2 * root + 1;
        }
    }
    return (found - 1) / 2;
}

static void
images_far_away_are_counted(void)
{
    hs_options options = hs_options_default();
    int64_t    count;
    CHECK(count_images(0.0, 30.0, &options, &count) == HS_OK && count == lattice_points(30));
    CHECK(count_images(1.0, 30.0, &options, &count) == HS_OK && count == lattice_points(30));
    CHECK(count_images(0.0, 150.0, &options, &count) == HS_OK && count == lattice_points(150));
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

static hs_status
count_some_images(void *context)
{
    int64_t count;
    return count_images(0.375, 40.0, context, &count);
}

static void
whichever_allocation_fails_nothing_is_left(void)
{
    hs_options options = hs_options_default();
    CHECK(fail_each_allocation(count_some_images, &options, 100) > 5);
}

/* Narrow cells in many dimensions, or around a short box: as wide as there are rows for. */
static void
narrow_cells_are_widened(void)
{
    enum { N = 300 };
    static double  x[8 * N];
    harness_random random = {6};
    for (int e = 0; e < 8 * N; e++)
        x[e] = random_unit(&random);
    for (int trial = 0; trial < 60; trial++) {
        const int   ndim = 1 + trial % 8;
        hs_box      box = {.ndim = ndim};
        brute_scene scene = {.ndim = ndim, .n = N, .x = x, .inclusive = true};
        scene.n = trial % 3 == 2 ? 2 : N;
        scene.box = trial % 3 ? &box : NULL;
        scene.cutoff = trial % 3 == 2 ? (ndim <= 2   ? 90.0
                                         : ndim == 3 ? 20.0
                                                     : 2.1)
                                      : 0.4 + 0.1 * (trial / 8 % 4);
        scene.cutoff = trial % 3 == 1 && ndim > 4 ? 0.45 : scene.cutoff;
        for (int k = 0; k < ndim; k++) {
            box.periodic[k] = true;
            box.rows[k][k] = 1.0;
        }
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        hs_cells       *cells = NULL;
        int64_t         count = -1, expected = -2;
        CHECK(hs_pairs_count(AMONG(&points, scene.box), &options, &expected, NULL) == HS_OK);
        options.cell_size = ldexp(1.0, -trial % 9);
        CHECK(hs_cells_build(&points, scene.box, &options, &cells, NULL) == HS_OK);
        CHECK(hs_pairs_count(IN_CELLS(cells), &options, &count, NULL) == HS_OK &&
              count == expected);
        hs_cells_free(cells);
    }
}

/* A cutoff beyond all distances, of points at the end of the range. */
static void
cutoffs_beyond_everything(void)
{
    const double    x[4] = {0x1.8p1016, -0x1p1016, 0x1p1016, 0.0};
    const hs_points points = {x, 4, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    int64_t         count = -1;
    for (int exponent = 1017; exponent <= 1023; exponent++) {
        options.cutoff = ldexp(1.5, exponent);
        CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_OK && count == 6);
    }
}

void
test_stencil(void)
{
    RUN(images_far_away_are_counted);
    RUN(long_lists_of_rows_can_be_stopped);
    RUN(too_many_rows_are_refused);
    RUN(whichever_allocation_fails_nothing_is_left);
    RUN(narrow_cells_are_widened);
    RUN(cutoffs_beyond_everything);
}
