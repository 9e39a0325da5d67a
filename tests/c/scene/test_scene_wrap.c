/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scene_wrap.c: points are wrapped axis by axis where that will do, their turns counted, and
 * those that are too far away wrapped before they are scaled. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/scene/scene.h"
#include "../../../csrc/core/threads/passes.h"
#include "../support/harness.h"

#include <math.h>

void test_scene_wrap(void);

/* Points in several passes, one box away along one axis and inside along the other: turns of each
 * axis are those of its own points. */
static void
turns_of_an_axis_without_any_are_cleared_in_place(void)
{
    enum { MANY = 3 * HS_SLAB_POINTS + 5 };
    double         *x = malloc(2 * MANY * sizeof *x);
    harness_random  random = {73};
    const hs_points points = {x, MANY, 2, HS_FLOAT64, 16, 8};
    const hs_box    box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0, 0.0}, {0.0, 8.0}}};
    hs_options      options = hs_options_default();
    hs_account      account;
    hs_scene        scene;
    hs_failure      failure;
    int64_t         wrong = 0;
    options.want = HS_WANT_SHIFT;
    options.cutoff = 1.0;
    for (int i = 0; i < MANY; i++) {
        x[2 * i] = 6.0 + random_unit(&random);
        x[2 * i + 1] = random_unit(&random);
    }
    hs_account_init(&account, &options);
    CHECK(hs_scene_init(&account, NULL, &points, &box, &options, &scene, &failure) == HS_OK);
    for (int i = 0; i < MANY; i++)
        wrong += hs_turns_get(&scene.turns, scene.lattice.row_of_axis[0], i) != 1 ||
                 hs_turns_get(&scene.turns, scene.lattice.row_of_axis[1], i) != 0;
    CHECK(wrong == 0);
    hs_scene_free(&account, &scene);
    hs_account_close(&account);
    free(x);
}

/* Numbers that overflow when they are scaled, on columns of which the lattice knows the period
 * though rows have several entries there; and on one that nothing repeats. */
static void
columns_are_wrapped_where_their_period_is_known(void)
{
    enum { N = 3 };
    double   x[3][N] = {{0x1p1000, 0.25, -0x1p1000}, {0x1p1000, 2.5, 0.5}, {0x1p1000, 0.5, 0.0}};
    hs_scene scene;
    memset(&scene, 0, sizeof scene);
    scene.ndim = scene.cloud.ndim = scene.lattice.ndim = 3;
    scene.n = scene.cloud.n = N;
    scene.pending = scene.scale = hs_scale_of(-100);
    scene.unscale = hs_scale_of(100);
    scene.lattice.n_periodic = 2;
    scene.lattice.aligned = true;
    scene.lattice.given[0][0] = 1.0; /* the second column has two entries */
    scene.lattice.given[1][0] = scene.lattice.given[1][1] = 1.0;
    for (int k = 0; k < 3; k++) {
        scene.cloud.x[k] = x[k];
        scene.cloud.lower[k] = k == 0 ? -0x1p1000 : 0.0;
        scene.cloud.upper[k] = 0x1p1000;
        scene.lattice.row_of_axis[k] = k < 2 ? k : -1;
        scene.lattice.period[k] = k < 2 ? 0x1p100 : 0.0;
    }
    hs_scene_fold_far(&scene);
    for (int k = 0; k < 2; k++) {
        CHECK(scene.cloud.lower[k] == -0.5 && scene.cloud.upper[k] == 0.5);
        CHECK(x[k][0] == 0.0 && x[k][1] == (k == 0 ? 0.25 : 0.5));
        CHECK(x[k][2] == (k == 0 ? 0.0 : 0.5));
    }
    CHECK(x[2][0] == 0x1p1000 && scene.cloud.upper[2] == 0x1p1000);
    /* Where scaling loses digits only what is given counts: nothing tells. */
    x[0][0] = scene.cloud.upper[0] = 0x1p1000;
    scene.extreme = true;
    hs_scene_fold_far(&scene);
    CHECK(x[0][0] == 0x1p1000 && scene.cloud.upper[0] == 0x1p1000);
}

/* Originals are wrapped from where their turns cannot be counted, and no sooner. */
static void
originals_too_far_to_count_are_wrapped(void)
{
    double   x[1] = {0x1p50 + 0.25};
    hs_scene scene;
    memset(&scene, 0, sizeof scene);
    scene.ndim = scene.cloud.ndim = scene.lattice.ndim = scene.lattice.n_periodic = 1;
    scene.n = scene.cloud.n = 1;
    scene.pending = scene.scale = scene.unscale = hs_scale_of(0);
    scene.lattice.given[0][0] = scene.lattice.period[0] = 1.0;
    scene.cloud.x[0] = x;
    scene.cloud.lower[0] = scene.cloud.upper[0] = x[0];
    scene.keeps_originals = true;
    hs_scene_fold_far(&scene);
    CHECK(x[0] == 0x1p50 + 0.25);
    scene.cloud.lower[0] = scene.cloud.upper[0] = x[0] = 0x1p51 + 0.5;
    scene.keeps_originals = false;
    hs_scene_fold_far(&scene);
    CHECK(x[0] == 0x1p51 + 0.5);
    scene.keeps_originals = true;
    hs_scene_fold_far(&scene);
    CHECK(fabs(x[0]) == 0.5 && scene.cloud.lower[0] == -0.5 && scene.cloud.upper[0] == 0.5);
    x[0] = scene.cloud.lower[0] = -0x1p53; /* the far end may be the lower one */
    scene.cloud.upper[0] = 0.0;
    hs_scene_fold_far(&scene);
    CHECK(x[0] == 0.0);
}

/* A scene of three points in one dimension, with a period of 4, ready to be wrapped. */
static void
put_scene(double *x, int64_t n, hs_scene *scene)
{
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{4.0}}};
    memset(scene, 0, sizeof *scene);
    scene->ndim = scene->cloud.ndim = 1;
    scene->n = scene->cloud.n = n;
    scene->cloud.x[0] = x;
    scene->cloud.lower[0] = scene->cloud.upper[0] = n > 0 ? x[0] : 0.0;
    for (int64_t i = 0; i < n; i++) {
        scene->cloud.lower[0] = fmin(x[i], scene->cloud.lower[0]);
        scene->cloud.upper[0] = fmax(x[i], scene->cloud.upper[0]);
    }
    scene->cloud.largest = fmax(-scene->cloud.lower[0], scene->cloud.upper[0]);
    hs_lattice_init(&box, 1, hs_scale_of(0), &scene->lattice);
}

/* Points on the faces are inside: they stay where they are, and so does -0. */
static void
points_inside_are_left_alone(void)
{
    double           x[3] = {-2.0, -0.0, 2.0}, out[3] = {-2.0, 2.25, 1.0}, magnitude = 7.0;
    const hs_options options = hs_options_default();
    int32_t          turns[3] = {9, 9, 9};
    hs_failure       failure = HS_NO_FAILURE;
    hs_scene         scene;
    put_scene(x, 3, &scene);
    scene.turns.known = true;
    scene.turns.narrow[0] = turns;
    CHECK(hs_scene_wrap(&scene, NULL, &options, &magnitude, &failure) == HS_OK);
    CHECK(x[0] == -2.0 && signbit(x[1]) && x[2] == 2.0 && scene.x_largest[0] == 2.0);
    CHECK(turns[0] == 0 && turns[1] == 0 && turns[2] == 0 && magnitude == 0.0);
    put_scene(out, 3, &scene);
    scene.turns.known = true;
    scene.turns.narrow[0] = turns;
    CHECK(hs_scene_wrap(&scene, NULL, &options, &magnitude, &failure) == HS_OK);
    CHECK(out[0] == -2.0 && out[1] == -1.75 && out[2] == 1.0 && scene.x_largest[0] >= 2.0);
    CHECK(turns[0] == 0 && turns[1] == 1 && turns[2] == 0);
    put_scene(x, 0, &scene);
    CHECK(hs_scene_wrap(&scene, NULL, &options, &magnitude, &failure) == HS_OK);
    CHECK(scene.lower[0] == 0.0 && scene.upper[0] == 0.0 && scene.x_largest[0] == 0.0);
}

/* The first point whose turns cannot be counted is named, where they are wanted. */
static void
turns_that_cannot_be_counted_name_a_point(void)
{
    const hs_options options = hs_options_default();
    double           x[3] = {0.5, 0x1p60, -0x1p61}, same[3] = {0.5, 0x1p60, -0x1p61};
    double           magnitude;
    int64_t          turns[3] = {0};
    hs_failure       failure = HS_NO_FAILURE;
    hs_scene         scene;
    put_scene(x, 3, &scene);
    scene.turns.known = true;
    scene.turns.wide[0] = turns;
    CHECK(hs_scene_wrap(&scene, NULL, &options, &magnitude, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.row == 1);
    put_scene(same, 3, &scene);
    failure = HS_NO_FAILURE;
    CHECK(hs_scene_wrap(&scene, NULL, &options, &magnitude, &failure) == HS_OK);
    CHECK(failure.row == -1 && same[0] == 0.5 && same[1] == 0.0 && same[2] == 0.0);
}

void
test_scene_wrap(void)
{
    RUN(turns_of_an_axis_without_any_are_cleared_in_place);
    RUN(columns_are_wrapped_where_their_period_is_known);
    RUN(originals_too_far_to_count_are_wrapped);
    RUN(points_inside_are_left_alone);
    RUN(turns_that_cannot_be_counted_name_a_point);
}
