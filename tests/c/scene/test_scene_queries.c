/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scene_queries.c: points and queries get one scale and bounds that hold for both, also where
 * queries come later: which of these a scene that was kept takes, step by step. */
#include "../../../csrc/core/base/outcome.h"
#include "../../../csrc/core/scene/scene.h"
#include "../support/harness.h"

#include <math.h>

void test_scene_queries(void);

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

/* Two points on the ends of a range along each axis. */
static void
put_range(double low, double high, hs_scene *scene)
{
    memset(scene, 0, sizeof *scene);
    scene->ndim = scene->cloud.ndim = 2;
    scene->n = scene->cloud.n = 2;
    for (int k = 0; k < 2; k++) {
        scene->cloud.lower[k] = scene->lower[k] = low - k;
        scene->cloud.upper[k] = scene->upper[k] = high + k;
        scene->x_largest[k] = fmax(-low, high) + k;
    }
    scene->cloud.largest = fmax(-low, high) + 1.0;
}

static void
joined_ranges_are_those_of_both(void)
{
    hs_scene scene, asking;
    put_range(-1.0, 5.0, &scene);
    put_range(-7.0, 2.0, &asking);
    hs_scene_join_clouds(&scene, &asking);
    for (int k = 0; k < 2; k++) {
        CHECK(scene.cloud.lower[k] == -7.0 - k && asking.cloud.lower[k] == -7.0 - k);
        CHECK(scene.cloud.upper[k] == 5.0 + k && asking.cloud.upper[k] == 5.0 + k);
    }
    CHECK(scene.cloud.largest == 8.0 && asking.cloud.largest == 8.0);
    scene.x_largest[2] = -1.0; /* is of no axis */
    asking.x_largest[2] = 3.0;
    hs_scene_join_wrapped(&scene, &asking);
    CHECK(scene.is_asked && scene.x_largest[0] == 7.0 && scene.x_largest[1] == 8.0);
    CHECK(scene.x_largest[2] == -1.0);
    CHECK(scene.lower[0] == -7.0 && scene.upper[1] == 6.0);
}

/* Ranges of nothing are those of the other, or stay. */
static void
joined_ranges_leave_out_what_is_empty(void)
{
    hs_scene scene, asking;
    put_range(-1.0, 5.0, &scene);
    put_range(-7.0, 9.0, &asking);
    asking.n = 0;
    hs_scene_join_wrapped(&scene, &asking);
    CHECK(scene.is_asked && scene.lower[0] == -1.0 && scene.upper[1] == 6.0);
    put_range(-1.0, 5.0, &scene);
    put_range(2.0, 3.0, &asking);
    scene.n = 0;
    hs_scene_join_wrapped(&scene, &asking);
    CHECK(scene.lower[0] == 2.0 && scene.upper[0] == 3.0);
    put_range(-1.0, 5.0, &scene);
    scene.n = 1;
    asking.n = 1;
    hs_scene_join_wrapped(&scene, &asking);
    CHECK(scene.lower[0] == -1.0 && scene.upper[0] == 5.0);
}

/* Room for queries four times as far away, or a thousand box vectors. */
static void
room_is_made_for_queries_to_come(void)
{
    hs_scene scene;
    double   magnitude = 3.0;
    put_range(-1.0, 5.0, &scene); /* |X| up to 5 and 6 */
    scene.lattice.ndim = 2;
    hs_scene_make_room(&scene, &magnitude);
    CHECK(magnitude == 12.0 && scene.cloud.largest == 24.0);
    CHECK(scene.x_largest[0] == 20.0 && scene.x_largest[1] == 24.0);
    put_range(-1.0, 5.0, &scene);
    scene.lattice.ndim = 2;
    scene.lattice.n_periodic = 1;
    scene.lattice.rows[0][0] = -16.0;
    magnitude = 3.0;
    hs_scene_make_room(&scene, &magnitude);
    CHECK(magnitude == 16384.0 && scene.cloud.largest == 16384.0);
    CHECK(scene.x_largest[0] == 16.0 && scene.x_largest[1] == 16384.0);
    scene.t_error[0] = 0.5;
    scene.t_error[1] = 0.25;
    hs_scene_widen_errors(&scene);
    CHECK(scene.t_error[0] == 1.0 && scene.t_error[1] == 0.5);
}

/* What is larger, or what scaling would round, is not taken; for cells alone it is. */
static void
queries_that_fit_are_taken(void)
{
    double   x[2] = {0x1p-1000, 2.0};
    hs_scene scene;
    hs_cloud cloud = {.ndim = 1, .n = 2, .x = {x}, .largest = 2.0, .lower = {0.0}, .upper = {2.0}};
    put_range(-1.0, 1.0, &scene); /* the largest is 2 */
    scene.scale = hs_scale_of(0);
    CHECK(hs_scene_takes(&scene, &cloud));
    cloud.largest = nextafter(2.0, 3.0);
    CHECK(!hs_scene_takes(&scene, &cloud));
    cloud.largest = 2.0;
    scene.scale = hs_scale_of(22); /* smallest normal number */
    CHECK(hs_scene_takes(&scene, &cloud));
    scene.scale = hs_scale_of(23);
    CHECK(!hs_scene_takes(&scene, &cloud));
    scene.is_untested = true;
    CHECK(hs_scene_takes(&scene, &cloud));
    scene.is_untested = false;
    cloud.largest = x[1] = cloud.upper[0] = 0.0;
    x[0] = 0.0;
    CHECK(hs_scene_takes(&scene, &cloud)); /* nothing to lose */
    scene.scale = hs_scale_of(0);
    scene.is_untested = scene.lattice.aligned = true;
    cloud.largest = 0x1p900;
    CHECK(hs_scene_takes(&scene, &cloud));
    cloud.largest = 0x1.1p900;
    CHECK(!hs_scene_takes(&scene, &cloud));
    scene.lattice.aligned = false;
    cloud.largest = 3.0;
    CHECK(!hs_scene_takes(&scene, &cloud));
    scene.n = 0;
    CHECK(hs_scene_takes(&scene, &cloud));
    scene.scale = hs_scale_of(-2000);
    cloud.largest = 0x1p1000;
    CHECK(!hs_scene_takes(&scene, &cloud));
}

/* Each bound must hold; only the first of them where cells are all that is wanted. */
static void
bounds_cover_queries_or_do_not(void)
{
    hs_scene scene, asking;
    put_range(-1.0, 5.0, &scene);
    scene.x_error = scene.t_error[0] = scene.t_error[1] = 0.5;
    asking = scene;
    CHECK(hs_scene_covers(&scene, &asking));
    for (int untested = 0; untested < 2; untested++) {
        scene.is_untested = untested;
        asking.x_error = 0.625;
        CHECK(hs_scene_covers(&scene, &asking) == untested);
        asking.x_error = 0.5;
        asking.x_largest[1] = 7.0;
        CHECK(hs_scene_covers(&scene, &asking) == untested);
        asking.x_largest[1] = 6.0;
        for (int k = 0; k < 2; k++) {
            asking.t_error[k] = 0.625;
            CHECK(!hs_scene_covers(&scene, &asking));
            asking.t_error[k] = 0.5;
        }
    }
    scene.n = 0; /* nothing is found */
    asking.t_error[0] = asking.x_error = 9.0;
    CHECK(hs_scene_covers(&scene, &asking));
}

/* One cell with everything, of points that no scale holds. */
static void
one_spot_of_open_space(void)
{
    double   x[2][2] = {{0x1p1000, 3.0}, {5.0, -0x1p1000}};
    hs_scene scene;
    put_range(-0x1p1000, 0x1p1000, &scene);
    scene.cloud.x[0] = x[0];
    scene.cloud.x[1] = x[1];
    scene.extreme = true;
    scene.formula_error = 7.0;
    scene.cutoff = scene.cutoff_low = scene.radius = 0.0;
    hs_scene_put_in_one_cell(&scene);
    for (int k = 0; k < 2; k++) {
        CHECK(x[k][0] == 0.0 && x[k][1] == 0.0);
        CHECK(scene.cloud.lower[k] == 0.0 && scene.cloud.upper[k] == 0.0);
        CHECK(scene.lattice.row_of_axis[k] == -1);
    }
    CHECK(scene.cloud.largest == 0.0 && scene.in_one_cell && !scene.extreme);
    CHECK(scene.cutoff == 1.0 && scene.cutoff_low == 1.0 && scene.radius == 1.0);
    CHECK(scene.formula_error == 0.0 && scene.scale.exponent == 0);
    CHECK(hs_scale_apply(scene.unscale, 3.0) == 3.0 && hs_scale_apply(scene.pending, 3.0) == 3.0);
    CHECK(scene.lattice.ndim == 2 && scene.lattice.n_periodic == 0 && scene.lattice.aligned);
}

/* What has been settled for the points is settled for the queries, and nothing else. */
static void
queries_share_what_is_settled(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {1.0, 2.0}}};
    hs_scene     scene, asking;
    put_range(-1.0, 5.0, &scene);
    put_range(-3.0, 4.0, &asking);
    scene.scale = hs_scale_of(3);
    scene.unscale = hs_scale_of(-3);
    scene.pending = hs_scale_of(2);
    scene.sought = 1.0;
    scene.cutoff = 2.0;
    scene.cutoff_low = 3.0;
    scene.radius = 4.0;
    scene.formula_error = 5.0;
    scene.extreme = true;
    hs_lattice_init(&box, 2, scene.scale, &scene.lattice);
    hs_scene_share(&scene, &asking);
    CHECK(asking.scale.exponent == 3 && asking.unscale.exponent == -3);
    CHECK(asking.pending.exponent == 2 && asking.sought == 1.0 && asking.cutoff == 2.0);
    CHECK(asking.cutoff_low == 3.0 && asking.radius == 4.0 && asking.formula_error == 5.0);
    CHECK(asking.extreme && asking.lattice.n_periodic == 2 && !asking.lattice.aligned);
    CHECK(asking.x_largest[1] == 5.0 && asking.cloud.lower[0] == -3.0);
}

/* Turns that cannot be counted are those of the set that is named. */
static void
turns_that_cannot_be_counted_name_their_set(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0}, {0.0, 1.0}}};
    for (int in_queries = 0; in_queries < 2; in_queries++) {
        double          x[6] = {0.25, 0.5, 0.5, 0.5, 0.75, 0.5};
        double          q[6] = {0.25, 0.5, 0.5, 0.5, 0.75, 0.5};
        const hs_points points = points_in(x, 3, 2), queries = points_in(q, 3, 2);
        const hs_sets   sets = {.points = &points, .queries = &queries, .is_full = true};
        hs_options      options = hs_options_default();
        hs_failure      failure = HS_NO_FAILURE;
        hs_scene        scene, asking;
        options.cutoff = 0.25;
        options.want = HS_WANT_SHIFT;
        (in_queries ? q : x)[4] = 0x1p60;
        hs_account_init(&account, &options);
        CHECK(hs_scene_init_sets(&account, NULL, &sets, &box, &options, &scene, &asking,
                                 &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(failure.row == 2 && failure.in_queries == in_queries && account.held == 0);
        hs_account_close(&account);
    }
}

void
test_scene_queries(void)
{
    RUN(joined_ranges_are_those_of_both);
    RUN(joined_ranges_leave_out_what_is_empty);
    RUN(room_is_made_for_queries_to_come);
    RUN(queries_that_fit_are_taken);
    RUN(bounds_cover_queries_or_do_not);
    RUN(one_spot_of_open_space);
    RUN(queries_share_what_is_settled);
    RUN(what_is_refused_is_named);
    RUN(queries_too_far_to_count_get_another_scene);
    RUN(scenes_that_hold_nothing_take_nothing);
    RUN(turns_that_cannot_be_counted_name_their_set);
}
