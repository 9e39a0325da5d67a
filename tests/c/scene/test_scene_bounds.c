/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scene_bounds.c: how far what is computed with may be from the numbers that were given. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/scene/scene.h"
#include "../support/harness.h"

#include <math.h>

void test_scene_bounds(void);

static hs_account account;

/* Where box vectors as given are long, precision="double" adds numbers as large as those: it looks
 * as much further as their roundings may be, whatever the points are. */
static void
the_formula_of_double_errs_with_the_box_vectors(void)
{
    const double x[4] = {0.25, 0.5, 0.75, 0.5};
    for (int skew = 0; skew <= 4000; skew += 2000) {
        const hs_box box = {
            .ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {skew + 0.25, 1.0}}};
        const hs_points points = {x, 2, 2, HS_FLOAT64, 16, 8};
        hs_options      options = hs_options_default();
        hs_scene        scene;
        hs_failure      failure;
        options.cutoff = 1.0;
        options.precision = HS_DOUBLE;
        hs_account_init(&account, &options);
        CHECK(hs_scene_init(&account, NULL, &points, &box, &options, &scene, &failure) == HS_OK);
        /* One of the second, less so many of the first: two products and their sum. */
        CHECK(scene.formula_error >= 3.0 * 0x1p-53 * skew + 0x1p-52);
        CHECK(scene.formula_error <= 0x1p-40 * (1.0 + skew));
        CHECK(scene.radius == scene.cutoff + scene.formula_error);
        hs_scene_free(&account, &scene);
    }
}

/* The error is one of lengths: it has their unit, also where nothing is scaled. */
static void
the_error_of_the_formula_has_the_unit_of_the_cutoff(void)
{
    double errors[2];
    for (int s = 0; s < 2; s++) {
        const double length = s == 0 ? 1.0 : 0x1p-15;
        const double x[4] = {0.25 * length, 0.5 * length, 0.75 * length, 0.5 * length};
        const hs_box box = {
            .ndim = 2, .periodic = {true, true}, .rows = {{length, 0.0}, {8.25 * length, length}}};
        const hs_points points = {x, 2, 2, HS_FLOAT64, 16, 8};
        hs_options      options = hs_options_default();
        hs_scene        scene;
        hs_failure      failure;
        options.cutoff = length;
        options.precision = HS_DOUBLE;
        hs_account_init(&account, &options);
        CHECK(hs_scene_init(&account, NULL, &points, &box, &options, &scene, &failure) == HS_OK);
        CHECK(scene.cutoff == length);
        errors[s] = scene.formula_error / length;
        hs_scene_free(&account, &scene);
    }
    CHECK(errors[0] > 0.0 && errors[0] == errors[1]);
}

/* Two dimensions, the first of them periodic with a period of 4. */
static void
put_scene(hs_scene *scene)
{
    const hs_box box = {.ndim = 2, .periodic = {true, false}, .rows = {{4.0}, {0.0, 1.0}}};
    memset(scene, 0, sizeof *scene);
    scene->ndim = 2;
    scene->scale = scene->unscale = hs_scale_of(0);
    hs_lattice_init(&box, 2, hs_scale_of(0), &scene->lattice);
}

/* The grid covers the whole period. What rounding left outside is put on the face. */
static void
ranges_become_periods(void)
{
    hs_scene scene;
    put_scene(&scene);
    scene.lower[0] = -1.0;
    scene.upper[0] = 2.0 + 0x1p-50;
    scene.lower[1] = -7.0;
    scene.upper[1] = 9.0;
    scene.t_error[0] = 0x1p-52;
    scene.t_error[1] = 0x1p-51;
    hs_scene_settle_ranges(&scene);
    CHECK(scene.lower[0] == -2.0 && scene.upper[0] == 2.0);
    CHECK(scene.lower[1] == -7.0 && scene.upper[1] == 9.0);
    CHECK(scene.t_error[0] == 0x1p-52 + 0x1p-50 && scene.t_error[1] == 0x1p-51);
    scene.lower[0] = -2.0 - 0x1p-49;
    scene.upper[0] = 2.0 + 0x1p-50;
    scene.t_error[0] = 0.0;
    hs_scene_settle_ranges(&scene);
    CHECK(scene.t_error[0] == 0x1p-49 && scene.lower[0] == -2.0);
    scene.t_error[0] = 0.0;
    hs_scene_settle_ranges(&scene);
    CHECK(scene.t_error[0] == 0.0);
}

/* Aligned scenes err only by what scaling lost. */
static void
aligned_scenes_do_not_err(void)
{
    hs_scene scene;
    put_scene(&scene);
    scene.x_largest[0] = scene.x_largest[1] = 1e6;
    hs_scene_bound_errors(&scene, 1e9);
    CHECK(scene.x_error == 0.0 && scene.t_error[0] == 0.0 && scene.t_error[1] == 0.0);
    scene.extreme = true;
    hs_scene_bound_errors(&scene, 1e9);
    CHECK(scene.x_error == HS_SCALING_LOSS && scene.t_error[1] == HS_SCALING_LOSS);
}

/* Others err by 2^-52 of the largest X along each axis, and by next to nothing of what was taken
 * away; a component that is not part of t_k adds nothing to its error. */
static void
skewed_scenes_err_component_by_component(void)
{
    const hs_box box = {
        .ndim = 3, .periodic = {true, true, false}, .rows = {{4.0}, {1.0, 4.0}, {0.0, 0.0, 1.0}}};
    hs_scene scene;
    memset(&scene, 0, sizeof scene);
    scene.ndim = 3;
    hs_lattice_init(&box, 3, hs_scale_of(0), &scene.lattice);
    CHECK(!scene.lattice.aligned);
    scene.x_largest[0] = 1.0;
    scene.x_largest[1] = 2.0;
    scene.x_largest[2] = 0x1p40;
    hs_scene_bound_errors(&scene, 0.0);
    CHECK(scene.x_error == 0x1p-12);
    /* Axis 1 is upright on the first row: its error is that of component 1, and five roundings. */
    CHECK(scene.lattice.normal[1][0] == 0.0 && scene.lattice.normal[1][1] == 1.0);
    CHECK(fabs(scene.t_error[1] / (2.0 * 0x1p-52 + 5.0 * 0x1p-53 * 2.0) - 1.0) < 0x1p-30);
    CHECK(scene.t_error[0] < 1e-14 && scene.t_error[2] > 0x1p-12 && scene.t_error[2] < 0x1p-9);
    const double alone = scene.t_error[1];
    hs_scene_bound_errors(&scene, 0x1p80); /* 36 parts of 2^-104 */
    CHECK(fabs(scene.t_error[1] / (alone + 36.0 * 0x1p-24) - 1.0) < 0x1p-30);
    scene.x_largest[0] = scene.x_largest[1] = scene.x_largest[2] = 0.0;
    scene.extreme = true;
    hs_scene_bound_errors(&scene, 0.0);
    CHECK(scene.x_error == HS_SCALING_LOSS && scene.t_error[1] >= HS_SCALING_LOSS);
}

/* Pairs are decided on X; on the originals, scaled, if these are kept; as given where scaling lost
 * digits. */
static void
the_metric_has_the_rows_that_pairs_are_decided_on(void)
{
    const hs_options options = hs_options_default();
    hs_scene         scene;
    put_scene(&scene);
    scene.scale = hs_scale_of(1);
    scene.sought = 3.0;
    scene.lattice.rows[0][0] = 5.0;
    scene.lattice.scaled[0][0] = 6.0;
    scene.lattice.given[0][0] = 7.0;
    hs_scene_init_metric(&scene, &options);
    CHECK(scene.metric.rows[0][0] == 5.0 && scene.metric.cutoff == 1.5);
    CHECK(scene.metric.ndim == 2 && scene.metric.n_rows == 1);
    scene.keeps_originals = true;
    hs_scene_init_metric(&scene, &options);
    CHECK(scene.metric.rows[0][0] == 6.0 && scene.metric.cutoff == 1.5);
    scene.extreme = true;
    hs_scene_init_metric(&scene, &options);
    CHECK(scene.metric.rows[0][0] == 7.0 && scene.metric.cutoff == 3.0);
}

/* Another cutoff for the same points. */
static void
another_cutoff_changes_radius_and_metric(void)
{
    hs_options options = hs_options_default();
    hs_scene   scene;
    put_scene(&scene);
    scene.scale = hs_scale_of(-2);
    scene.cloud.largest = 1.0;
    options.cutoff = 0.75;
    options.inclusive = !options.inclusive;
    hs_scene_set_cutoff(&scene, &options);
    CHECK(scene.sought == 0.75 && scene.cutoff == 3.0 && scene.cutoff_low == 3.0);
    CHECK(scene.radius == 3.0 && scene.formula_error == 0.0);
    CHECK(scene.metric.cutoff == 3.0 && scene.metric.inclusive == options.inclusive);
    options.precision = HS_DOUBLE;
    hs_scene_set_cutoff(&scene, &options);
    CHECK(scene.formula_error > 0x1p-53 && scene.formula_error < 0x1p-40);
    CHECK(scene.radius == scene.cutoff + scene.formula_error);
    const double near = scene.formula_error;
    hs_scene_set_radius(&scene, &options, 1000.0);
    CHECK(scene.formula_error > 100.0 * near && scene.formula_error < 10000.0 * near);
    scene.lattice.n_periodic = 0; /* differences alone: four units for each axis */
    hs_scene_set_radius(&scene, &options, 1e9);
    CHECK(scene.formula_error == 4.0 * 0x1p-53 * 3.0 * 2.0);
}

static double widths[2], asked_enough;

static hs_status
width_along(const void *context, const double *normal, double enough, double *width)
{
    CHECK(context == widths && normal[0] + normal[1] == 1.0);
    asked_enough = enough;
    *width = widths[normal[1] > 0.5];
    return *width == HUGE_VAL ? HS_ERR_INTERRUPTED : HS_OK;
}

/* Where pairs are surely narrower, by a fifth at least: in the scene's unit, which is half of the
 * caller's, and less of what the formula may err by. */
static void
scenes_are_narrowed_by_what_is_sure(void)
{
    static const struct {
        double formula_error, width[2], less[2];
    } cases[] = {{0.0, {0.1, 0.45}, {0.8, 0.0}},
                 {0.5, {0.3, 0.1}, {0.0, 0.3}},
                 {0.0, {0.39, 0.4}, {0.22, 0.0}},
                 {0.0, {0.0, 1.0}, {1.0, 0.0}}};
    const hs_narrowing narrowing = {width_along, widths};
    hs_scene           scene;
    put_scene(&scene);
    scene.radius = 1.0;
    scene.scale = hs_scale_of(-1);
    scene.unscale = hs_scale_of(1);
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        scene.formula_error = cases[c].formula_error;
        memcpy(widths, cases[c].width, sizeof widths);
        CHECK(hs_scene_narrow(&scene, &narrowing) == HS_OK);
        CHECK(asked_enough == 0.8 * 0.5);
        for (int k = 0; k < 2; k++) {
            const double less = cases[c].less[k];
            CHECK(less == 0.0 ? scene.less[k] == 0.0
                              : scene.less[k] < less && scene.less[k] > less - 1e-9);
            CHECK(hs_scene_radius_along(&scene, k) == 1.0 - scene.less[k]);
        }
        const double volume = hs_scene_volume(&scene, 3.0);
        CHECK(volume == 3.0 * (1.0 - scene.less[0]) * (1.0 - scene.less[1]));
    }
    CHECK(hs_scene_narrow(&scene, NULL) == HS_OK);
    CHECK(scene.less[0] > 0.9);
    widths[1] = HUGE_VAL;
    CHECK(hs_scene_narrow(&scene, &narrowing) == HS_ERR_INTERRUPTED);
}

/* The first of those that are farthest, among points before queries. */
static void
the_farthest_is_named(void)
{
    double     x[2][3] = {{1.0, -2.0, 5.0}, {1.0, -5.0, 3.0}}, q[2][2] = {{5.0, 1.0}, {0.0, -6.0}};
    hs_scene   scene, asking;
    hs_failure failure = HS_NO_FAILURE;
    put_scene(&scene);
    put_scene(&asking);
    scene.cloud = (hs_cloud){.ndim = 2, .n = 3, .x = {x[0], x[1]}};
    asking.cloud = (hs_cloud){.ndim = 2, .n = 2, .x = {q[0], q[1]}};
    hs_scene_name_farthest(&scene, NULL, &failure);
    CHECK(failure.row == 1 && !failure.in_queries);
    hs_scene_name_farthest(&scene, &asking, &failure);
    CHECK(failure.row == 1 && failure.in_queries);
    q[1][1] = -5.0; /* no farther than a point */
    x[1][1] = 0.0;
    hs_scene_name_farthest(&scene, &asking, &failure);
    CHECK(failure.row == 2 && !failure.in_queries);
}

/* An error beyond the cutoff, and so large that candidates would be many. */
static void
drowned_scenes_err_by_more_than_their_cutoff(void)
{
    hs_scene scene;
    put_scene(&scene); /* 2^-6 of a period: 2^-4 */
    scene.cutoff = 0x1p-5;
    scene.formula_error = 0x1p-4;
    CHECK(!hs_scene_is_drowned(&scene));
    scene.formula_error = 0x1.1p-4;
    CHECK(hs_scene_is_drowned(&scene));
    scene.formula_error = NAN;
    scene.cutoff = 0.0;
    CHECK(!hs_scene_is_drowned(&scene));
    scene.formula_error = 0x1.1p-4;
    scene.cutoff = 0x1.1p-4;
    CHECK(!hs_scene_is_drowned(&scene));
    scene.cutoff = 0x1p-5;
    scene.lattice.row_of_axis[1] = 1;
    scene.lattice.period[1] = 8.0;
    CHECK(hs_scene_is_drowned(&scene));
    scene.lattice.period[0] = 5.0;
    CHECK(!hs_scene_is_drowned(&scene));
}

void
test_scene_bounds(void)
{
    RUN(the_formula_of_double_errs_with_the_box_vectors);
    RUN(the_error_of_the_formula_has_the_unit_of_the_cutoff);
    RUN(ranges_become_periods);
    RUN(aligned_scenes_do_not_err);
    RUN(skewed_scenes_err_component_by_component);
    RUN(the_metric_has_the_rows_that_pairs_are_decided_on);
    RUN(another_cutoff_changes_radius_and_metric);
    RUN(scenes_are_narrowed_by_what_is_sure);
    RUN(the_farthest_is_named);
    RUN(drowned_scenes_err_by_more_than_their_cutoff);
}
