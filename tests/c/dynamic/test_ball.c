/* SPDX-License-Identifier: BSD-3-Clause */
/* test_ball.c: points within a ball of a dynamic list. */
#include "../../../csrc/core/base/os.h"
#include "../../../csrc/core/dynamic/ball.h"
#include "../../../csrc/core/dynamic/dynamic.h"
#include "../support/dynamic_brute.h"
#include "../support/harness.h"

#include <math.h>

void test_ball(void);

/*
 * ---- cell axes ----
 *
 * The cells of a ball hold every coordinate within it, and gaps are no larger than distances, at
 * any width, radius and distance from the origin.
 */

/* The axis of a list in one dimension. */
static hs_axis
axis_of(double length, double cell_size, double radius)
{
    static hs_dynamic list;
    hs_box            box = {.ndim = 1, .periodic = {length > 0.0}, .rows = {{length}}};
    hs_lattice_init(length > 0.0 ? &box : NULL, 1, hs_scale_of(0), &list.lattice);
    list.max_radius = radius;
    hs_axes_init(&list, cell_size, false);
    return list.axis[0];
}

/* A number of ordinary size, often with few digits. */
static double
some_number(harness_random *random)
{
    const double x = ldexp(random_unit(random) - 0.5, (int)(random_bits(random) % 40) - 10);
    return random_bits(random) % 2 == 0 ? x : rint(x * 8.0) / 8.0;
}

static void
open_balls_hold_what_is_within(void)
{
    harness_random random = {7};
    for (int trial = 0; trial < TRIALS(200000); trial++) {
        const double  width = fabs(some_number(&random)) + 0x1p-20;
        const int     times = (int)(random_bits(&random) % 5);
        const double  radius = trial % 2 == 0 ? width * times : width * 5.0 * random_unit(&random);
        const hs_axis of_width = axis_of(0.0, width, radius), *axis = &of_width;
        const double  t = some_number(&random);
        const int64_t centre = hs_axis_cell(axis, t);
        hs_span_of_cells span;
        hs_axis_span(axis, t, radius, 0.0, &span);
        for (int side = -1; side <= 1; side += 2) {
            double y = t + side * radius;
            while (fabs(y - t) > radius) /* not beyond, for the numbers as rounded */
                y = nextafter(y, t);
            const int64_t cell = hs_axis_cell(axis, y);
            CHECK(cell >= span.first && cell <= span.last);
            CHECK(sqrt(hs_axis_gap(axis, t, cell, centre)) <= fabs(y - t) * (1.0 + 0x1p-50));
        }
        CHECK(span.first <= centre && centre <= span.last);
    }
}

/* x + image * length, rounded up or down, by exact sums of what is rounded. */
static double
image_of(double x, double image, double length, double towards)
{
    const double shift = image * length, rest = fma(image, length, -shift);
    const double sum = shift + x, back = sum - shift;
    const double error = (shift - (sum - back)) + (x - back) + rest;
    const bool   is_passed = towards > 0.0 ? error > 0.0 : error < 0.0;
    return is_passed ? nextafter(sum, towards) : sum;
}

/* Periods whose multiples are rounded: the end of a ball that is the image of a number next to an
 * edge of its cell still has this cell, on either side. */
static void
ends_in_far_images_are_held(void)
{
    harness_random random = {9};
    for (int trial = 0; trial < TRIALS(20000); trial++) {
        const double     length = 0.5 + 8.0 * random_unit(&random);
        const int        n = 2 + (int)(random_bits(&random) % 9);
        const hs_axis    of_cells = axis_of(length, length / (n + 0.25), 1.0), *axis = &of_cells;
        const int64_t    cell = 1 + (int64_t)(random_bits(&random) % (uint64_t)(n - 1));
        const int64_t    image = (trial % 2 ? 1 : -1) * (2 + trial / 2 % 300);
        const double     step = ldexp(1.0, ilogb(length) - 53); /* no coordinate has finer ones */
        double           x = (double)cell * axis->width - axis->half;
        hs_span_of_cells span;
        for (int n_steps = 0; n_steps < 1000 && hs_axis_cell(axis, x) >= cell; n_steps++)
            x -= step;
        for (int n_steps = 0; n_steps < 1000 && hs_axis_cell(axis, x + step) < cell; n_steps++)
            x += step;
        const double low = image_of(x, (double)image, length, -HUGE_VAL);
        hs_axis_images(axis, low, low + length, 0.0, &span);
        CHECK(axis->n == n && span.first <= hs_axis_cell(axis, x) + image * n);
        x += step;
        const double high = image_of(x, (double)image, length, HUGE_VAL);
        hs_axis_images(axis, high - length, high, 0.0, &span);
        CHECK(span.last >= hs_axis_cell(axis, x) + image * n);
    }
}

/*
 * ---- ball ----
 *
 * What the thresholds call sure is what the exact metric says of the positions as given, for points
 * about as far away as the radius, in any image.
 */

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
        CHECK(hs_dynamic_new(&options, &list, &failure) == HS_OK);
        if (u == 0) {
            CHECK(hs_ball_init(&ball, list, centre, 1e-17, &failure) == HS_OK);
            CHECK(ball.home.in == -1.0 && ball.home.out > 0.0 && ball.home.out < 1e-20);
        } else {
            CHECK(hs_ball_init(&ball, list, centre, 0x1p300, &failure) == HS_OK);
            CHECK(ball.home.in == -1.0 && ball.home.out == INFINITY);
        }
        hs_dynamic_free(list);
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
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_OK);
    for (int trial = 0; trial < 400; trial++) {
        const hs_axis *axis = &list->axis[trial % 2];
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
    hs_dynamic_free(list);
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
    hs_ball            at_first, with_far, emptied;
    options.ndim = 2;
    options.box = &box;
    CHECK(hs_dynamic_new(&options, &list, &failure) == HS_OK);
    CHECK(hs_ball_init(&at_first, list, centre, 1.0, &failure) == HS_OK);
    CHECK(hs_dynamic_insert(list, (hs_key){0, 0}, far, &failure) == HS_OK);
    CHECK(hs_ball_init(&with_far, list, centre, 1.0, &failure) == HS_OK);
    CHECK(with_far.error < 1.5 * at_first.error && list->magnitude > 0.0);
    hs_dynamic_clear(list);
    CHECK(hs_ball_init(&emptied, list, centre, 1.0, &failure) == HS_OK);
    CHECK(emptied.error == at_first.error && list->magnitude == 0.0);
    hs_dynamic_free(list);
}

/* ---- a list does only what its scene needs, as its counters show ---- */

static hs_dynamic *
filled(hs_storage storage, const hs_box *box, int ndim)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    harness_random     random = {11};
    options.ndim = ndim;
    options.box = box;
    options.storage = storage;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    for (int64_t id = 0; id < 500; id++) {
        double x[3];
        for (int k = 0; k < 3; k++)
            x[k] = 10.0 * random_unit(&random);
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, x, NULL) == HS_OK);
    }
    return list;
}

static void
what_a_scene_does_not_need_is_left_out(void)
{
    const hs_box        box = {.ndim = 2, .periodic = {true, true}, .rows = {{10, 0}, {0, 10}}};
    const double        centre[3] = {5.25, 5.25, 5.25};
    hs_dynamic_counters counters;
    bool                any;
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic *open = filled((hs_storage)storage, NULL, 2);
        hs_dynamic *periodic = filled((hs_storage)storage, &box, 2);
        hs_dynamic_count(open, &counters);
        for (int64_t id = 0; id < 500; id += 9)
            CHECK(hs_dynamic_move(open, (hs_key){id, 0}, centre, NULL) == HS_OK);
        CHECK(hs_dynamic_any_within(open, centre, 0.0, NULL, &any, NULL) == HS_OK && any);
        CHECK(counters.wraps == 0);
        CHECK((counters.lookups > 0) == (storage == HS_STORE_HASH));
        CHECK(counters.cells == 1);
        hs_dynamic_count(open, NULL);
        hs_dynamic_count(periodic, &counters);
        CHECK(hs_dynamic_any_within(periodic, centre, 0.0, NULL, &any, NULL) == HS_OK);
        CHECK(counters.wraps == 1);
        hs_dynamic_free(open);
        hs_dynamic_free(periodic);
    }
}

/* Points at the radius but for less than float64 resolves, and exactly at it. */
static void
ties_are_decided_exactly(void)
{
    for (int inclusive = 0; inclusive <= 1; inclusive++) {
        hs_dynamic_options  options = hs_dynamic_options_default();
        hs_dynamic_counters counters;
        hs_dynamic         *list;
        bool                any;
        options.ndim = 2;
        options.inclusive = inclusive == 1;
        options.max_radius = 5.0;
        CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
        hs_dynamic_count(list, &counters);
        const double tie[2] = {3.0, 4.0}, origin[2] = {0.0, 0.0}, above[2] = {5.0, 0x1p-60};
        CHECK(hs_dynamic_insert(list, (hs_key){0, 0}, tie, NULL) == HS_OK);
        CHECK(hs_dynamic_any_within(list, origin, 5.0, NULL, &any, NULL) == HS_OK);
        CHECK(any == (inclusive == 1) && counters.exact == 1);
        CHECK(hs_dynamic_move(list, (hs_key){0, 0}, above, NULL) == HS_OK);
        CHECK(hs_dynamic_any_within(list, origin, 5.0, NULL, &any, NULL) == HS_OK);
        CHECK(!any && counters.exact == 2);
        hs_dynamic_free(list);
    }
}

/* Held, a list gives the same answers. */
static void
held_lists_answer_the_same(void)
{
    const hs_box box = {
        .ndim = 3, .periodic = {true, true, true}, .rows = {{10, 0, 0}, {3, 9, 0}, {-2, 1, 8}}};
    hs_dynamic    *list = filled(HS_STORE_HASH, &box, 3);
    harness_random random = {13};
    bool           plain[100], held[100];
    for (int h = 0; h < 2; h++) {
        random.state = 13;
        if (h == 1)
            hs_dynamic_hold(list);
        for (int trial = 0; trial < 100; trial++) {
            double x[3];
            for (int k = 0; k < 3; k++)
                x[k] = 10.0 * random_unit(&random);
            CHECK(hs_dynamic_any_within(list, x, 0.7, NULL, h == 1 ? &held[trial] : &plain[trial],
                                        NULL) == HS_OK);
        }
        if (h == 1)
            hs_dynamic_release(list);
    }
    CHECK(memcmp(plain, held, sizeof plain) == 0);
    hs_dynamic_free(list);
}

static int
stop_at(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)key, (void)position, (void)shift;
    return --*(int *)user == 0;
}

/* A visitor ends any way through the cells, near or within, with images or without. */
static void
visitors_may_stop(void)
{
    const hs_box box = {.ndim = 3, .periodic = {true, true, true}};
    for (int kind = 0; kind < 6; kind++) {
        hs_box small = box;
        for (int l = 0; l < 3; l++)
            small.rows[l][l] = 10.0;
        hs_dynamic  *list = filled((hs_storage)(kind % 3), kind >= 3 ? &small : NULL, 3);
        const double corner[3] = {0.1, 0.1, 0.1};
        for (int after = 1; after <= 3; after++) {
            int near = after, within = after;
            CHECK(hs_dynamic_near(list, corner, 1.0, stop_at, &near, NULL) == HS_OK && near <= 0);
            CHECK(hs_dynamic_insert(list, (hs_key){after, 1}, corner, NULL) == HS_OK);
            CHECK(hs_dynamic_insert(list, (hs_key){after, 2}, corner, NULL) == HS_OK);
            CHECK(hs_dynamic_within(list, corner, 0.5, true, stop_at, &within, NULL) == HS_OK);
            CHECK(within == 0);
        }
        hs_dynamic_free(list);
    }
}

/* A near query compares no distances. */
static void
near_counts_cells_and_no_candidates(void)
{
    const double        middle[3] = {5.5, 5.5, 5.5};
    hs_dynamic_counters counters;
    for (int storage = 0; storage < 2; storage++) {
        hs_dynamic *list = filled((hs_storage)storage, NULL, 2);
        brute_found found = {.n = 0};
        hs_dynamic_count(list, &counters);
        CHECK(hs_dynamic_near(list, middle, 1.0, take_found, &found, NULL) == HS_OK);
        CHECK(counters.cells == 9 && counters.candidates == 0 && counters.exact == 0);
        CHECK(found.n > 9);
        hs_dynamic_free(list);
    }
}

void
test_ball(void)
{
    const hs_fpenv env = hs_fpenv_enter();
    RUN(open_balls_hold_what_is_within);
    RUN(ends_in_far_images_are_held);
    RUN(nothing_is_surely_within_less_than_the_error);
    RUN(balls_reach_as_far_as_errors_may);
    RUN(emptied_lists_are_as_exact_as_new_ones);
    hs_fpenv_leave(env);
    RUN(what_a_scene_does_not_need_is_left_out);
    RUN(ties_are_decided_exactly);
    RUN(held_lists_answer_the_same);
    RUN(visitors_may_stop);
    RUN(near_counts_cells_and_no_candidates);
}
