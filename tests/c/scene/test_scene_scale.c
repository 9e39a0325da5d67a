/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scene_scale.c: whether gaps are closed, which cutoff and scale a scene goes by, and why some
 * boxes have none. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/scene/close_gaps.h"
#include "../../../csrc/core/scene/scene.h"
#include "../../../csrc/core/scene/unit.h"
#include "../support/harness.h"

#include <float.h>
#include <math.h>

void test_scene_scale(void);

/* A scene of two points, at 0 and `far`, with this cutoff. */
static void
put_points(double far, double sought, double *x, hs_scene *scene)
{
    memset(scene, 0, sizeof *scene);
    scene->ndim = scene->cloud.ndim = 1;
    scene->n = scene->cloud.n = 2;
    x[0] = 0.0;
    x[1] = scene->cloud.upper[0] = scene->cloud.largest = far;
    scene->cloud.x[0] = x;
    scene->sought = sought;
}

static void
gaps_are_closed_where_nothing_comes_later(void)
{
    const hs_box_size none = hs_box_size_of(NULL);
    double            x[2], more[2];
    hs_scene          scene, asking;
    put_points(1.0, 1.0, x, &scene);
    put_points(1.0, 1.0, more, &asking);
    CHECK(hs_scene_may_condense(&scene, NULL, &none, 0));
    CHECK(!hs_scene_may_condense(&scene, &asking, &none, 0)); /* queries: only if need be */
    scene.is_plain = true;
    CHECK(!hs_scene_may_condense(&scene, NULL, &none, 0));
    put_points(0x1.1p900, 1.0, x, &scene);
    scene.is_plain = true;
    CHECK(hs_scene_may_condense(&scene, NULL, &none, 0));
    CHECK(hs_scene_may_condense(&scene, &asking, &none, 0));
    scene.is_kept = true;
    CHECK(!hs_scene_may_condense(&scene, NULL, &none, 0));
}

/* Of the nearest those within a largest distance only. */
static void
gaps_of_wide_scenes_are_closed_within_a_distance(void)
{
    const hs_box_size none = hs_box_size_of(NULL);
    double            x[2];
    hs_scene          scene;
    put_points(1.0, 1.0, x, &scene);
    scene.is_wide = true;
    CHECK(!hs_scene_may_condense(&scene, NULL, &none, 0));
    scene.within = 0.5; /* but something else is sought */
    CHECK(!hs_scene_may_condense(&scene, NULL, &none, 0));
    scene.sought = 0.5;
    CHECK(hs_scene_may_condense(&scene, NULL, &none, 0));
    scene.within = scene.sought = 0.0;
    CHECK(!hs_scene_may_condense(&scene, NULL, &none, 0));
}

static void
the_cutoff_is_one_that_is_enough(void)
{
    const hs_box_size none = hs_box_size_of(NULL);
    double            x[2];
    hs_scene          scene;
    put_points(1.0, 0.0, x, &scene);
    CHECK(hs_scene_settle_cutoff(&scene, &none, 1e9) == 256.0);
    scene.is_plain = true;
    CHECK(hs_scene_settle_cutoff(&scene, &none, 1e9) == 1e9);
    scene.is_plain = false;
    scene.is_kept = true;
    CHECK(hs_scene_settle_cutoff(&scene, &none, 1e9) == 1e9);
    scene.within = 0x1p-40; /* of points that are 2^40 times as far apart, at most */
    CHECK(hs_scene_settle_cutoff(&scene, &none, 7.0) == 7.0);
    scene.within = 0x1p-41;
    CHECK(hs_scene_settle_cutoff(&scene, &none, 7.0) == 0x1p-41);
}

static void
ordinary_scenes_keep_their_numbers(void)
{
    double   x[2];
    hs_scene scene;
    put_points(3.0, 0.7, x, &scene);
    hs_scene_set_scale(NULL, false, -1, &scene, NULL);
    CHECK(scene.scale.exponent == 0 && scene.unscale.exponent == 0 && !scene.extreme);
    CHECK(scene.cutoff == 0.7 && scene.cutoff_low == 0.7 && scene.pending.exponent == 0);
    put_points(0x1p60, 0x1.8p50, x, &scene);
    hs_scene_set_scale(NULL, false, 50, &scene, NULL);
    CHECK(scene.scale.exponent == 50 && scene.unscale.exponent == -50);
    CHECK(scene.pending.exponent == 50 && scene.cutoff == 1.5 && scene.cutoff_low == 1.5);
    hs_scene_set_scale(NULL, true, 50, &scene, NULL); /* the points are scaled already */
    CHECK(scene.pending.exponent == 0 && scene.scale.exponent == 50 && scene.cutoff == 1.5);
    CHECK(!scene.extreme);
}

/* Float32 holds less than float64. */
static void
wide_scenes_have_larger_numbers(void)
{
    double   x[2];
    hs_scene scene;
    put_points(0x1p100, 1.0, x, &scene);
    hs_scene_set_scale(NULL, false, 0, &scene, NULL);
    CHECK(scene.scale.exponent == 100 - HS_LARGEST_EXPONENT && scene.cutoff == 0x1p-44);
    scene.is_wide = true;
    hs_scene_set_scale(NULL, false, 0, &scene, NULL);
    CHECK(scene.scale.exponent == 0 && scene.cutoff == 1.0);
}

/* Where digits are lost the cutoff becomes two bounds, unless it is 0; of queries and of lengths
 * that pairs are compared with, too. */
static void
lost_digits_widen_the_cutoff(void)
{
    double   x[2], more[2];
    hs_scene scene, asking;
    put_points(0x1p-800, 0x1p300, x, &scene);
    hs_scene_set_scale(NULL, false, 300, &scene, NULL);
    CHECK(scene.extreme && scene.scale.exponent == 300);
    CHECK(scene.cutoff == 1.0 + 0x1p-1000 && scene.cutoff_low == 1.0);
    scene.sought = 0.0;
    hs_scene_set_scale(NULL, false, 300, &scene, NULL);
    CHECK(scene.extreme && scene.cutoff == 0.0 && scene.cutoff_low == 0.0);
    put_points(0x1p-800, 0x1p-700, x, &scene); /* scaled to about 2^-1000 */
    hs_scene_set_scale(NULL, false, 300, &scene, NULL);
    CHECK(scene.extreme && scene.cutoff == 0x1p-999 && scene.cutoff_low == 0.0);
    put_points(2.0, 0x1p300, x, &scene);
    hs_scene_set_scale(NULL, false, 300, &scene, NULL);
    CHECK(!scene.extreme);
    put_points(0x1p-800, 0x1p300, more, &asking);
    hs_scene_set_scale(NULL, false, 300, &scene, &asking);
    CHECK(scene.extreme && scene.scale.exponent == 300);
    scene.least_cutoff = 0x1p-800;
    hs_scene_set_scale(NULL, false, 300, &scene, NULL);
    CHECK(scene.extreme);
    hs_scene_set_scale(NULL, true, 300, &scene, NULL);
    CHECK(!scene.extreme);
}

/* One period of all is enough. */
static void
boxes_vanish_below_a_smallest_period(void)
{
    hs_scene scene;
    memset(&scene, 0, sizeof scene);
    scene.lattice.ndim = 3;
    scene.lattice.row_of_axis[0] = 0;
    scene.lattice.row_of_axis[1] = -1; /* whose period is 0 */
    scene.lattice.row_of_axis[2] = 1;
    scene.lattice.period[0] = 1.0;
    scene.lattice.period[2] = 0x1.1p-900;
    CHECK(!hs_scene_box_vanishes(&scene));
    scene.lattice.period[2] = 0x1p-900;
    CHECK(hs_scene_box_vanishes(&scene));
    scene.lattice.period[2] = NAN;
    CHECK(hs_scene_box_vanishes(&scene));
    scene.lattice.row_of_axis[2] = -1;
    CHECK(!hs_scene_box_vanishes(&scene));
}

/* Boxes that vanish beside the cutoff have no scale, but where that has images without end. */
static void
endless_images_are_refused_for_their_number(void)
{
    const hs_box tiny = {.ndim = 1, .periodic = {true}, .rows = {{0x1p-1000}}};
    hs_condensed condensed = {.box = &tiny, .given_box = &tiny};
    hs_scene     scene;
    hs_failure   failure = HS_NO_FAILURE;
    memset(&scene, 0, sizeof scene);
    scene.ndim = scene.cloud.ndim = scene.lattice.ndim = scene.lattice.n_periodic = 1;
    scene.lattice.period[0] = 0x1p-1000;
    scene.sought = 0x1p-960; /* scaled by 2^0 or by more */
    scene.cutoff = 0x1p-900;
    CHECK(hs_scene_box_vanishes(&scene));
    CHECK(hs_scene_has_no_scale(&scene, &condensed));
    CHECK(hs_scene_refuse_vanishing(&scene, &condensed, &failure) == HS_ERR_BOX_SKEWED);
    CHECK(failure.expected_pairs == 0.0);
    condensed.is_scaled = true;
    CHECK(!hs_scene_has_no_scale(&scene, &condensed));
    CHECK(hs_scene_refuse_vanishing(&scene, &condensed, &failure) == HS_ERR_MEMORY);
    CHECK(failure.expected_pairs == INFINITY && failure.expected_bytes == INFINITY);
    condensed.is_scaled = false;
    scene.sought = 0x1p-900;
    CHECK(!hs_scene_has_no_scale(&scene, &condensed));
    scene.lattice.aligned = true;
    scene.sought = 0x1p-960;
    CHECK(hs_scene_refuse_vanishing(&scene, &condensed, &failure) == HS_ERR_MEMORY);
    scene.lattice.period[0] = 0x1p-899;
    CHECK(!hs_scene_box_vanishes(&scene));
}

void
test_scene_scale(void)
{
    RUN(gaps_are_closed_where_nothing_comes_later);
    RUN(gaps_of_wide_scenes_are_closed_within_a_distance);
    RUN(the_cutoff_is_one_that_is_enough);
    RUN(ordinary_scenes_keep_their_numbers);
    RUN(wide_scenes_have_larger_numbers);
    RUN(lost_digits_widen_the_cutoff);
    RUN(boxes_vanish_below_a_smallest_period);
    RUN(endless_images_are_refused_for_their_number);
}
