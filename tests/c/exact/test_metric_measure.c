/* SPDX-License-Identifier: BSD-3-Clause */
/* test_metric_measure.c: distances and vectors to the last place, and never against the
 * decision. */
#include <float.h>

#include "../../../csrc/core/exact/metric.h"
#include "../support/bigint.h"
#include "../support/harness.h"

void test_metric_measure(void);

typedef struct scene {
    int     ndim, n_rows;
    double  p[8], q[8], rows[8][8];
    int64_t shift[8];
} scene;

/* One unit in the last place of a nonnegative number whose float64 neighbour below is x. */
static double
ulp_of(double x)
{
    return x >= DBL_MAX ? 0x1p971 : nextafter(x, INFINITY) - x;
}

/* The largest double whose square is at most `square` (units of 2^-2148). */
static double
root_below(big square)
{
    const int exponent = square.sign == 0 ? 0 : -2148 + 32 * square.n;
    double    root = ldexp(sqrt(big_to_double(&square, -2148 - exponent)), exponent / 2);
    root = root <= DBL_MAX ? root : DBL_MAX;
    for (;;) {
        const big candidate = big_from_double(root);
        if (big_compare(big_product(candidate, candidate), square) <= 0)
            return root;
        root = nextafter(root, 0.0);
    }
}

/* Measures the pair with a cutoff and checks every claim of hs_metric_measure. */
static void
check_measured(const scene *s, double cutoff, bool inclusive)
{
    const big square =
        big_square(s->ndim, s->n_rows, (const double(*)[8])s->rows, s->p, s->q, s->shift);
    const big    limit = big_product(big_from_double(cutoff), big_from_double(cutoff));
    const int    sign = big_compare(square, limit);
    const double ulp = ulp_of(root_below(square));
    hs_metric    metric;
    hs_stages    stages = {0, 0, 0};
    double       vector[8];
    hs_metric_init(&metric, s->ndim, s->n_rows, (const double(*)[8])s->rows, cutoff, inclusive);
    const bool within = hs_metric_within(&metric, s->p, s->q, s->shift, &stages);
    CHECK(within == (inclusive ? sign <= 0 : sign < 0));
    if (!within)
        return;

    const double measured = hs_metric_measure(&metric, s->p, s->q, s->shift, vector);
    const double distance = hs_keep_within(measured, cutoff, inclusive);
    CHECK(measured == hs_metric_measure(&metric, s->p, s->q, s->shift, NULL));
    CHECK(inclusive ? distance <= cutoff : distance < cutoff);
    const big lower = big_difference(big_from_double(distance), big_from_double(ulp));
    const big upper = big_sum(big_from_double(distance), big_from_double(ulp));
    CHECK(lower.sign < 0 || big_compare(big_product(lower, lower), square) <= 0);
    CHECK(big_compare(big_product(upper, upper), square) >= 0);
    for (int k = 0; k < s->ndim; k++) {
        big error = big_difference(
            big_from_double(vector[k]),
            big_component(s->n_rows, (const double(*)[8])s->rows, s->p, s->q, s->shift, k));
        error.sign = error.sign != 0;
        CHECK(big_compare(error, big_from_double(ulp)) <= 0);
    }
}

/* At the float64 value of |D|, beside it, and far from it. */
static void
check_cutoffs(const scene *s)
{
    const double root = root_below(
        big_square(s->ndim, s->n_rows, (const double(*)[8])s->rows, s->p, s->q, s->shift));
    for (int strict = 0; strict < 2; strict++) {
        check_measured(s, root, !strict);
        check_measured(s, root < DBL_MAX ? nextafter(root, DBL_MAX) : root, !strict);
        check_measured(s, root < 1e308 ? root * 1.7 : root, !strict);
    }
}

static double
random_number(harness_random *random, int exponent)
{
    return ldexp(2.0 * random_unit(random) - 1.0, exponent);
}

static void
last_place_is_right_in_every_binade(void)
{
    harness_random random = {51};
    for (int exponent = -1074; exponent <= 1022; exponent++) {
        scene s = {.ndim = 1 + (exponent + 1074) % 4, .n_rows = 1};
        for (int k = 0; k < s.ndim; k++) {
            s.p[k] = random_number(&random, exponent);
            s.q[k] = random_number(&random, exponent);
            s.rows[0][k] = random_number(&random, exponent);
        }
        s.shift[0] = (int64_t)(random_bits(&random) % 3) - 1;
        check_cutoffs(&s);
    }
}

/* Terms that cancel to a few units of their last places, or to nothing. */
static void
last_place_is_right_under_cancellation(void)
{
    harness_random random = {52};
    for (int trial = 0; trial < 1500; trial++) {
        scene s = {.ndim = 1 + trial % 3};
        s.n_rows = s.ndim;
        for (int k = 0; k < s.ndim; k++) {
            double sum = 0.0;
            for (int l = 0; l < s.n_rows; l++) {
                s.rows[l][k] = random_number(&random, (int)(random_bits(&random) % 20));
                s.shift[l] = (int64_t)(random_bits(&random) >> (11 + trial % 53));
            }
            for (int l = 0; l < s.n_rows; l++)
                sum += (double)s.shift[l] * s.rows[l][k];
            s.p[k] = trial % 5 ? sum : 0.0;
            s.q[k] = trial % 7 ? random_number(&random, (int)(random_bits(&random) % 100) - 60) : 0;
        }
        check_cutoffs(&s);
    }
}

static void
coincident_points_are_at_distance_zero(void)
{
    scene s = {.ndim = 3, .n_rows = 3, .p = {0.1, 0.2, 0.3}, .q = {0.1, 0.2, 0.3}};
    check_measured(&s, 0.0, true);
    check_measured(&s, 1.0, false);
    check_measured(&s, 0x1p-1074, false);
    s.rows[0][0] = 0.3;
    s.shift[0] = 1;
    s.q[0] = 0.1;
    s.p[0] = 0.4; /* 0.1 + 0.3 is not 0.4 */
    check_cutoffs(&s);
    s.rows[0][0] = s.p[0] - s.q[0];
    check_cutoffs(&s);
}

/* Strict pairs closer to the cutoff than one unit in the last place. */
static void
strict_distances_stay_below_the_cutoff(void)
{
    scene     s = {.ndim = 2, .p = {1.0, 0x1p-60}};
    hs_metric metric;
    for (int step = 0; step < 40; step++) {
        s.p[0] = nextafter(1.0, 0.0) - 0x1p-53 * (double)step;
        s.p[1] = sqrt(1.0 - s.p[0] * s.p[0]);
        check_cutoffs(&s);
        check_measured(&s, 1.0, false);
        check_measured(&s, 1.0, true);
    }
    s.p[0] = 1.0 - 0x1p-53;
    s.p[1] = 0x1.fffp-27 * 0.7071;
    hs_metric_init(&metric, 2, 0, NULL, 1.0, false);
    CHECK(hs_keep_within(hs_metric_measure(&metric, s.p, s.q, NULL, NULL), 1.0, false) < 1.0);
}

void
test_metric_measure(void)
{
    RUN(last_place_is_right_in_every_binade);
    RUN(last_place_is_right_under_cancellation);
    RUN(coincident_points_are_at_distance_zero);
    RUN(strict_distances_stay_below_the_cutoff);
}
