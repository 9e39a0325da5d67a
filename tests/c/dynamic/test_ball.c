/* SPDX-License-Identifier: BSD-3-Clause */
/* test_ball.c: what the thresholds call sure is what the exact metric says of the positions as given,
 * for points about as far away as the radius, in any image. */
#include "../../../csrc/core/base/fpenv.h"
#include "../../../csrc/core/dynamic/ball.h"
#include "../../../csrc/core/dynamic/new_list.h"
#include "../../../csrc/core/dynamic/update.h"
#include "../support/harness.h"

void test_ball(void);

/* The image in which the entry has this S. */
static void
turn_to(hs_ball *ball, uint32_t place, const int64_t *S, hs_ball_image *turned)
{
    int64_t image[2], shift[2] = {INT64_MIN, 0};
    for (image[0] = -6; image[0] <= 6; image[0]++) {
        for (image[1] = -6; image[1] <= 6; image[1]++) {
            hs_ball_turn(ball, image, turned);
            hs_ball_shift(ball, turned, place, shift);
            if (shift[0] == S[0] && shift[1] == S[1])
                return;
        }
    }
}

static void
check_box(const hs_box *box, double far, uint64_t seed)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    harness_random     random = {seed};
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    int                unsure = 0;
    options.ndim = 2;
    options.box = box;
    options.max_radius = 3.0;
    CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const double  angle = 6.3 * random_unit(&random);
        const double  radius = 0.5 + 2.0 * random_unit(&random);
        const double  off = trial % 3 == 0 ? 0.0 : ldexp(random_unit(&random) - 0.5, -40);
        const int64_t S[2] = {(int64_t)(random_bits(&random) % 5) - 2,
                              (int64_t)(random_bits(&random) % 5) - 2};
        double        centre[2], point[2];
        hs_ball       ball;
        hs_ball_image turned;
        hs_placed     placed;
        int64_t       shift[2] = {0, 0};
        for (int k = 0; k < 2; k++) {
            centre[k] = far * (random_unit(&random) - 0.5);
            point[k] = centre[k] + (radius + off) * (k == 0 ? cos(angle) : sin(angle));
            for (int l = 0; box != NULL && l < 2; l++)
                point[k] -= (double)S[l] * box->rows[l][k];
        }
        CHECK(hs_ball_init(&ball, list, centre, radius, &failure) == HS_OK);
        CHECK(hs_dynamic_place(list, point, &placed, &failure) == HS_OK);
        CHECK(hs_update_insert(list, (hs_key){0, 0}, &placed, &failure) == HS_OK);
        const uint32_t place = hs_key_map_find(&list->map, &list->entries, (hs_key){0, 0});
        double         x = 0.0;
        turned = ball.home;
        if (box != NULL)
            turn_to(&ball, place, S, &turned);
        hs_ball_shift(&ball, &turned, place, shift);
        CHECK(box == NULL || (shift[0] == S[0] && shift[1] == S[1]));
        for (int k = 0; k < 2; k++) {
            const double difference = hs_entry_at(&list->entries, place)[k] - turned.centre[k];
            x += difference * difference;
        }
        hs_metric metric;
        hs_stages stages = {0};
        if (box != NULL) {
            hs_metric_init(&metric, 2, 2, box->rows, radius, true);
        } else {
            hs_metric_init(&metric, 2, 0, NULL, radius, true);
        }
        const bool within = hs_metric_within(&metric, centre, point, S, &stages);
        CHECK(!(x < turned.in) || within);
        CHECK(!(x > turned.out) || !within);
        CHECK(hs_ball_settle(&ball, &turned, place) == within);
        unsure += !(x < turned.in) && !(x > turned.out);
    }
    CHECK(unsure > 0);
    hs_list_free(list);
}

static void
thresholds_are_never_wrong(void)
{
    const hs_box aligned = {.ndim = 2, .periodic = {true, true}, .rows = {{3.1, 0}, {0, 4.3}}};
    const hs_box skewed = {.ndim = 2, .periodic = {true, true}, .rows = {{3.1, 0.2}, {1.3, 4.3}}};
    check_box(NULL, 10.0, 1);
    check_box(&aligned, 10.0, 2);
    check_box(&aligned, 1e6, 3);
    check_box(&skewed, 10.0, 4);
    check_box(&skewed, 1e6, 5);
}

/* Without ordinary numbers nothing is sure, and all is decided by the stages behind. */
static void
extreme_radii_are_left_to_the_exact_stages(void)
{
    const double       centre[3] = {0.0, 0.0, 0.0};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    hs_ball            ball;
    CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
    CHECK(hs_ball_init(&ball, list, centre, 1e-200, &failure) == HS_OK);
    CHECK(ball.home.in < 0.0 && ball.home.out == INFINITY);
    CHECK(hs_ball_init(&ball, list, centre, 0.0, &failure) == HS_OK && ball.home.in < 0.0);
    hs_list_free(list);
}

/* In skewed boxes rounded coordinates may be wrong by more than the radius, and radius and error
 * together be more than has an ordinary square. */
static void
nothing_is_surely_within_less_than_the_error(void)
{
    const double       centre[2] = {0.0, 0.0};
    const double       units[] = {1.0, 0x1p299};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_failure         failure;
    hs_ball            ball;
    options.ndim = 2;
    for (int u = 0; u < 2; u++) {
        hs_box box = {.ndim = 2, .periodic = {true, true}};
        box.rows[0][0] = box.rows[1][1] = units[u];
        box.rows[1][0] = 0.25 * units[u];
        options.box = &box;
        options.cell_size = units[u];
        options.max_radius = 2.0 * units[u];
        hs_dynamic *list = NULL;
        CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
        if (u == 0) {
            CHECK(hs_ball_init(&ball, list, centre, 1e-17, &failure) == HS_OK);
            CHECK(ball.home.in == -1.0 && ball.home.out > 0.0 && ball.home.out < 1e-20);
        } else {
            CHECK(hs_ball_init(&ball, list, centre, 0x1p300, &failure) == HS_OK);
            CHECK(ball.home.in == -1.0 && ball.home.out == INFINITY);
        }
        hs_list_free(list);
    }
}

/* A ball that ends before a cell by less than coordinates may be wrong by reaches that cell. */
static void
balls_reach_as_far_as_errors_may(void)
{
    static const hs_box box = {
        .ndim = 2, .periodic = {true, true}, .rows = {{40.0, 3.0}, {7.0, 40.0}}};
    hs_dynamic_options options = hs_dynamic_options_default();
    harness_random     random = {77};
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    int                n_tried = 0;
    options.ndim = 2;
    options.box = &box;
    options.max_radius = 9.0;
    options.cell_size = 2.0;
    CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
    for (int trial = 0; trial < 400; trial++) {
        const hs_axis *axis = &list->axes.axis[trial % 2];
        double         centre[2];
        hs_ball        ball;
        for (int k = 0; k < 2; k++)
            centre[k] = 30.0 * (random_unit(&random) - 0.5);
        CHECK(hs_ball_init(&ball, list, centre, 3.0, &failure) == HS_OK);
        const double  t = ball.centre.t[trial % 2];
        const double  terms = hs_axis_terms(&list->lattice, ball.centre.x, trial % 2);
        const double  error = hs_axis_rounding(2) * (2.0 * terms + 24.0) + axis->leak;
        const int64_t next = hs_axis_cell(axis, t + 3.0) + 1;
        const double  edge = (double)next * axis->width - axis->half;
        if (!(next < axis->n - 1 && t - 7.0 > -axis->half))
            continue;
        CHECK(error > 0x1p-44 && error < 0x1p-30);
        for (int more = 0; more < 2; more++) {
            const double radius = edge - t - (more ? 0.5 : 2.0) * error;
            CHECK(hs_ball_init(&ball, list, centre, radius, &failure) == HS_OK);
            CHECK(ball.span[trial % 2].last == next - !more);
        }
        n_tried++;
    }
    CHECK(n_tried > 100);
    hs_list_free(list);
}

/* Lengths times a power of two, and squares times its square. */
static void
thresholds_are_scaled_with_the_lengths(void)
{
    double errors[2], ends[2][4];
    for (int s = 0; s < 2; s++) {
        const double       unit = s == 0 ? 1.0 : 0x1p-100;
        const double       centre[2] = {0.5 * unit, -unit};
        const hs_box       box = {.ndim = 2,
                                  .periodic = {true, true},
                                  .rows = {{3.0 * unit, 0.25 * unit}, {unit, 4.0 * unit}}};
        hs_dynamic_options options = hs_dynamic_options_default();
        hs_dynamic        *list = NULL;
        hs_failure         failure;
        hs_ball            ball;
        hs_ball_image      turned;
        options.ndim = 2;
        options.box = &box;
        options.cell_size = options.max_radius = 2.0 * unit;
        CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
        CHECK(hs_ball_init(&ball, list, centre, 1.5 * unit, &failure) == HS_OK);
        hs_ball_turn(&ball, (const int64_t[]){1, -2}, &turned);
        errors[s] = ball.error / unit;
        const double found[4] = {ball.home.in, ball.home.out, turned.in, turned.out};
        for (int e = 0; e < 4; e++)
            ends[s][e] = found[e] / unit / unit;
        hs_list_free(list);
    }
    CHECK(errors[0] > 0.0 && errors[0] == errors[1] && ends[0][0] > 2.0);
    CHECK(memcmp(ends[0], ends[1], sizeof ends[0]) == 0);
}

/* A far point hardly matters to others; a list that was emptied is as exact as a new one. */
static void
emptied_lists_are_as_exact_as_new_ones(void)
{
    const hs_box       box = {.ndim = 2, .periodic = {true}, .rows = {{3.0, 1.0}}};
    const double       centre[2] = {0.5, 0.5}, far[2] = {-1e12, 1e12};
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_failure         failure;
    hs_placed          placed;
    hs_ball            at_first, with_far, emptied;
    options.ndim = 2;
    options.box = &box;
    CHECK(hs_list_new(&options, &list, &failure) == HS_OK);
    CHECK(hs_ball_init(&at_first, list, centre, 1.0, &failure) == HS_OK);
    CHECK(hs_dynamic_place(list, far, &placed, &failure) == HS_OK);
    CHECK(hs_update_insert(list, (hs_key){0, 0}, &placed, &failure) == HS_OK);
    CHECK(hs_ball_init(&with_far, list, centre, 1.0, &failure) == HS_OK);
    CHECK(with_far.error < 1.5 * at_first.error && list->magnitude > 0.0);
    hs_list_clear(list);
    CHECK(hs_ball_init(&emptied, list, centre, 1.0, &failure) == HS_OK);
    CHECK(emptied.error == at_first.error && list->magnitude == 0.0);
    hs_list_free(list);
}

void
test_ball(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(thresholds_are_never_wrong);
    RUN(extreme_radii_are_left_to_the_exact_stages);
    RUN(nothing_is_surely_within_less_than_the_error);
    RUN(thresholds_are_scaled_with_the_lengths);
    RUN(emptied_lists_are_as_exact_as_new_ones);
    RUN(balls_reach_as_far_as_errors_may);
    hs_fpenv_leave(env);
}
