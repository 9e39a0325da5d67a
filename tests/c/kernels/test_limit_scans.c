/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_limit_scans.c: the scans of every kernel of this CPU in which each pair has a limit of its
 * own, against a plain loop: the same hits where no rounding can differ, and the right ones where
 * it can.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */
#include <math.h>

#include "../support/scan_checks.h"

void test_limit_scans(void);

enum { SHORT_BLOCK = 3 * 32 + 2 }; /* past three times the widest vector */

static numbers scene;

/* Forms with which thresholds of small integers are exact, fused or not. */
static const hs_limit_form exact_forms[] = {{1.0f, 0.0f, 1.0f, 0.0f},
                                            {1.0f, 1.0f, 1.0f, 1.0f},
                                            {0.5f, 0.5f, 2.0f, 0.25f},
                                            {1.0f, INFINITY, 1.0f, INFINITY}};

/* Small integers as radii, or none, of points or candidates, in a row or several; infinity, too, where
 * that is odd. */
static void
fill_radii(harness_random *random, bool odd, numbers *s)
{
    s->rule = (hs_rule)(random_bits(random) % HS_RULE_END);
    s->bound = random_bits(random) % 2 ? INFINITY : (float)(random_bits(random) % 5);
    s->form = exact_forms[random_bits(random) % (odd ? 4 : 3)];
    s->has_of_point = random_bits(random) % 8 != 0;
    s->has_of_block = random_bits(random) % 8 != 0;
    s->n_rows = random_bits(random) % 2 ? 0 : 1 + (int32_t)(random_bits(random) % MOST_ROWS);
    for (int32_t t = 0; t < s->n_points; t++) {
        s->of_point[t] = (float)(random_bits(random) % 5);
    }
    for (int32_t c = 0; c < s->n; c++) {
        s->of_block[c] = (float)(random_bits(random) % 4);
        if (odd && random_bits(random) % 8 == 0) {
            s->of_block[c] = INFINITY;
        }
    }
}

static int
check_limits(const hs_kernel *kernel, const numbers *s)
{
    return check_both((scan_pair){kernel->list_limits, kernel->count_limits, by_limits}, s, NULL);
}

static void
every_kernel_lists_what_the_plain_loop_lists(void)
{
    harness_random   random = {141421};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int32_t n = 0; n <= SHORT_BLOCK; n++) {
            for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
                const int32_t n_points = 1 + (int32_t)(random_bits(&random) % 5);
                fill_with_integers(&random, ndim, n, n_points, &scene);
                fill_radii(&random, false, &scene);
                (void)check_limits(kernel, &scene);
            }
        }
    }
}

/* Every rule with radii of both sides, of one and of none. */
static void
every_rule_takes_what_radii_there_are(void)
{
    harness_random   random = {173205};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < HS_RULE_END * 4 * 16; trial++) {
            fill_with_integers(&random, 1 + trial % 3, SHORT_BLOCK - trial % 8, 5, &scene);
            fill_radii(&random, false, &scene);
            scene.rule = (hs_rule)(trial / 4 % HS_RULE_END);
            scene.has_of_point = trial & 1;
            scene.has_of_block = trial & 2;
            (void)check_limits(kernel, &scene);
        }
    }
}

static void
fill_for_room(harness_random *random, int trial, numbers *s)
{
    (void)trial;
    fill_radii(random, false, s);
}

static void
scans_stop_before_hits_might_not_fit(void)
{
    check_room(223606, fill_for_room, check_limits, &scene);
}

/* Coordinates of any kind, radii that are infinite, forms that make nothing sure. */
static void
infinity_and_nan_are_listed_as_unsure(void)
{
    static const float odd[] = {NAN, INFINITY, -INFINITY, 0x1p-149f, -0.0f};
    harness_random     random = {244948};
    const hs_kernel   *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        for (int trial = 0; trial < 1000; trial++) {
            const int32_t n = (int32_t)(random_bits(&random) % (SHORT_BLOCK + 1));
            const int     ndim = 1 + trial % HS_MAX_DIM;
            fill_with_integers(&random, ndim, n, 3, &scene);
            fill_radii(&random, true, &scene);
            for (int32_t c = 0; c < n; c++) {
                if (random_bits(&random) % 4 == 0) {
                    const int axis = (int)(random_bits(&random) % (unsigned)ndim);
                    scene.y[axis][c] = odd[random_bits(&random) % 5];
                }
            }
            scene.q[0][0] = trial % 5 == 0 ? odd[random_bits(&random) % 4] : scene.q[0][0];
            (void)check_limits(kernel, &scene);
        }
    }
}

/* Numbers of any kind, and radii of which some nearly touch. */
static void
fill_with_reals(harness_random *random, int ndim, int32_t n)
{
    fill_with_integers(random, ndim, n, 1, &scene);
    fill_radii(random, false, &scene);
    scene.triangular = false;
    scene.has_of_point = scene.has_of_block = true;
    scene.n_rows = 0;
    scene.bound = INFINITY;
    scene.form = hs_limit_form_of(ndim, 0.0, 0.0); /* these floats are the real numbers */
    scene.of_point[0] = (float)random_unit(random);
    for (int32_t c = 0; c < n; c++) {
        double square = 0.0;
        for (int k = 0; k < ndim; k++) {
            scene.y[k][c] += (float)random_unit(random);
            const double along = (double)scene.y[k][c] - (double)scene.q[k][0];
            square += along * along;
        }
        const double left = scene.rule == HS_RULE_MAX || scene.rule == HS_RULE_MIN
                                ? sqrt(square)
                                : sqrt(square) - (double)scene.of_point[0];
        scene.of_block[c] = c % 3 != 0 && left > 0.0 ? (float)left : (float)random_unit(random);
    }
}

/* |D|^2 over the square of the limit, less 1. */
static double
beyond_limit(int32_t c)
{
    const double a = (double)scene.of_point[0], b = (double)scene.of_block[c];
    const double limit = scene.rule == HS_RULE_MAX   ? fmax(a, b)
                         : scene.rule == HS_RULE_MIN ? fmin(a, b)
                                                     : a + b;
    double       square = 0.0;
    for (int k = 0; k < scene.ndim; k++) {
        const double along = (double)scene.y[k][c] - (double)scene.q[k][0];
        square += along * along;
    }
    return square / (limit * limit) - 1.0;
}

/* Whatever a kernel fuses: what it lists as sure is within the limit, and what it does not list is
 * beyond; what it cannot tell is near it. */
static void
kernels_are_right_about_any_numbers(void)
{
    harness_random   random = {264575};
    const hs_kernel *kernel;
    for (int k = 0; (kernel = kernel_number(k)) != NULL; k++) {
        int wrong = 0, unsure = 0, sure = 0;
        for (int trial = 0; trial < 3000; trial++) {
            fill_with_reals(&random, 1 + trial % HS_MAX_DIM,
                            (int32_t)(random_bits(&random) % (SHORT_BLOCK + 1)));
            hs_scan scan = place_scan(&scene, trial & 8);
            CHECK(kernel->list_limits(&scan, 0) == 1);
            for (int32_t c = 0, h = 0, u = 0; c < scene.n; c++) {
                const double beyond = beyond_limit(c);
                const bool   is_hit = h < scan.n_hits && scan.hits[h] == scene.label[c];
                const bool   is_unsure = is_hit && u < scan.n_unsure && scan.unsure[u].at == h;
                wrong += is_unsure ? fabs(beyond) > 1e-5
                         : is_hit  ? beyond > 1e-14
                                   : beyond < -1e-14;
                h += is_hit;
                u += is_unsure;
                unsure += is_unsure;
                sure += is_hit && !is_unsure;
            }
            hs_scan counted = place_scan(&scene, !(trial & 8));
            wrong += kernel->count_limits(&counted, 0) != 1 || counted.n_hits != scan.n_hits;
            wrong += counted.n_unsure != scan.n_unsure;
        }
        CHECK(wrong == 0 && unsure > 1000 && sure > 1000);
    }
}

void
test_limit_scans(void)
{
    guard_scans();
    RUN(every_kernel_lists_what_the_plain_loop_lists);
    RUN(every_rule_takes_what_radii_there_are);
    RUN(scans_stop_before_hits_might_not_fit);
    RUN(infinity_and_nan_are_listed_as_unsure);
    RUN(kernels_are_right_about_any_numbers);
}
