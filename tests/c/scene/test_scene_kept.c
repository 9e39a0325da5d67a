/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scene_kept.c: which queries a scene that was kept takes, step by step; and points that are
 * wrapped before they are scaled. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/scene/close_gaps.h"
#include "../../../csrc/core/scene/scene.h"
#include "../support/harness.h"

#include <math.h>

void test_scene_kept(void);

static hs_account account;
static hs_scene   kept;

static hs_points
points_in(const double *x, int64_t n, int ndim)
{
    return (hs_points){x, n, ndim, HS_FLOAT64, ndim * 8, 8};
}

/* A scene for queries to come, which knows the turns. */
static void
keep(const double *x, int64_t n, const hs_box *box)
{
    const hs_points points = points_in(x, n, box->ndim);
    const hs_sets   sets = {
          .points = &points, .is_kept = true, .is_full = true, .is_plain = true, .is_wide = true};
    hs_options options = hs_options_default();
    hs_failure failure;
    options.cutoff = 1.0;
    options.want = HS_WANT_SHIFT;
    hs_account_init(&account, &options);
    CHECK(hs_scene_init_sets(&account, NULL, &sets, box, &options, &kept, NULL, &failure) == HS_OK);
}

static hs_status
ask(const double *q, int64_t n, unsigned want, hs_failure *failure)
{
    const hs_points queries = points_in(q, n, kept.ndim);
    hs_options      options = hs_options_default();
    hs_scene        asking;
    options.cutoff = 1.0;
    options.want = want;
    *failure = HS_NO_FAILURE;
    const hs_status status =
        hs_scene_like(&account, NULL, &kept, &queries, &options, &asking, failure);
    if (status == HS_OK)
        hs_scene_free(&account, &asking);
    return status;
}

/* Queries may be four times as far away as the points. Where these are 2^50 box vectors away their
 * turns cannot be counted then: an error if they are wanted, else the queries need a scene of their
 * own that does without. */
static void
queries_too_far_to_count_get_another_scene(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const double x[4] = {0.25, 0.5, 0x1p50, 0.5}, near[2] = {-0x1p50, 0.25};
    const double far[4] = {0.5, 0.5, 0x1.8p51, 0.25}, farther[2] = {0x1.8p52, 0.0};
    hs_failure   failure;
    keep(x, 2, &box);
    const int64_t held = account.held;
    CHECK(kept.turns.known);
    CHECK(ask(near, 1, HS_WANT_J, &failure) == HS_OK && !failure.in_queries);
    CHECK(ask(near, 1, HS_WANT_SHIFT, &failure) == HS_OK);
    CHECK(ask(far, 2, HS_WANT_J, &failure) == HS_UNSERVED);
    CHECK(ask(far, 2, HS_WANT_SHIFT, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(failure.in_queries && failure.row == 1);
    CHECK(ask(farther, 1, HS_WANT_SHIFT, &failure) == HS_UNSERVED); /* not even tried */
    CHECK(account.held == held);
    hs_scene_free(&account, &kept);
    CHECK(account.held == 0);
}

/* Scenes that no scale holds, and scenes whose scale has lost digits, take no query. */
static void
scenes_that_hold_nothing_take_nothing(void)
{
    const hs_box box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const double x[2] = {0.25, 0.5};
    hs_failure   failure;
    keep(x, 2, &box);
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_OK);
    kept.extreme = true;
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_UNSERVED);
    kept.extreme = false;
    kept.in_one_cell = true;
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_UNSERVED);
    kept.in_one_cell = false;
    kept.x_error = kept.t_error[0] = 0.0; /* of an aligned box: these hold for all */
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_OK);
    kept.x_largest[0] = 0.25; /* queries lie beyond */
    CHECK(ask(x, 2, HS_WANT_J, &failure) == HS_UNSERVED);
    hs_scene_free(&account, &kept);
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

/* Of queries for cells the farthest number, or the first that no kept scene takes. */
static void
what_is_refused_is_named(void)
{
    const hs_box    box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    const double    x[4] = {0.25, 0.5, 0.75, 0.5}, q[6] = {1.0, -2.0, 3.0, -4.0, 2.0, 0.0};
    const double    far[6] = {1.0, 0x1p1000, 0x1p1020, 0.0, 0.0, 0.0};
    const hs_points queries = points_in(q, 3, 2), too_far = points_in(far, 3, 2);
    hs_failure      failure = HS_NO_FAILURE;
    keep(x, 2, &box);
    hs_scene_name_refused(&kept, &queries, &failure);
    CHECK(failure.in_queries && failure.row == 1 && failure.column == 1 && failure.value == -4.0);
    hs_scene_name_refused(&kept, &too_far, &failure);
    CHECK(failure.in_queries && failure.row == 0 && failure.column == 1);
    CHECK(failure.value == 0x1p1000);
    failure = HS_NO_FAILURE;
    hs_test_fail_allocation(1);
    hs_scene_name_refused(&kept, &queries, &failure);
    hs_test_fail_allocation(0);
    CHECK(!failure.in_queries && failure.row == -1);
    kept.in_one_cell = true;
    hs_scene_name_refused(&kept, &queries, &failure);
    CHECK(!failure.in_queries && failure.row == -1);
    hs_scene_free(&account, &kept);
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

/* Where box vectors as given are long, precision="double" adds numbers as large as those: it looks
 * as much further as their roundings may be, whatever the points are. */
static void
the_formula_of_double_errs_with_the_box_vectors(void)
{
    const double x[4] = {0.25, 0.5, 0.75, 0.5};
    for (int skew = 0; skew <= 4000; skew += 2000) {
        const hs_box box = {
            .ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {skew + 0.25, 1.0}}};
        const hs_points points = points_in(x, 2, 2);
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

void
test_scene_kept(void)
{
    RUN(the_formula_of_double_errs_with_the_box_vectors);
    RUN(what_is_refused_is_named);
    RUN(endless_images_are_refused_for_their_number);
    RUN(queries_too_far_to_count_get_another_scene);
    RUN(scenes_that_hold_nothing_take_nothing);
    RUN(columns_are_wrapped_where_their_period_is_known);
    RUN(originals_too_far_to_count_are_wrapped);
}
