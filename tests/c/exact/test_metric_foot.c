/* SPDX-License-Identifier: BSD-3-Clause */
/* test_metric_foot.c: held against whole numbers, at right angles and a hair beside them, and where
 * products leave the range of float64. */
#include "../../../csrc/core/exact/metric_foot.h"
#include "../support/bigint.h"
#include "../support/harness.h"

void test_metric_foot(void);

/* Sign of (x - p).(q - p). */
static int
true_sign(const double *x, const double *p, const double *q, int ndim)
{
    big sum = big_from_int(0);
    for (int k = 0; k < ndim; k++) {
        const big origin = big_from_double(p[k]);
        const big a = big_difference(big_from_double(x[k]), origin);
        const big b = big_difference(big_from_double(q[k]), origin);
        sum = big_sum(sum, big_product(a, b));
    }
    return sum.sign;
}

static bool
is_right(const double *x, const double *p, const double *q, int ndim, int *ties)
{
    const int  at_p = true_sign(x, p, q, ndim), at_q = true_sign(x, q, p, ndim);
    const bool between = at_p >= 0 && at_q >= 0;
    *ties += at_p == 0 || at_q == 0;
    return hs_foot_is_between(x, p, q, ndim) == between &&
           hs_foot_is_between(x, q, p, ndim) == between;
}

static double
a_number(harness_random *random, int kind)
{
    const double unit = random_unit(random);
    switch (kind) {
    case 0: return floor(6.0 * unit);
    case 1: return 0.1 * floor(10.0 * unit);
    case 2: return ldexp(floor(4.0 * unit), -1074);
    case 3: return (unit - 0.5) * 0x1.8p1023;
    case 4: return ldexp(floor(8.0 * unit), 1000);
    case 5: return ldexp(unit, (int)(random_bits(random) % 2000) - 1000);
    default: return unit;
    }
}

static void
feet_are_where_whole_numbers_say(void)
{
    harness_random random = {17};
    int            ties = 0;
    for (int trial = 0; trial < TRIALS(6000); trial++) {
        const int ndim = 1 + trial % 8, kind = trial / 8 % 7;
        double    x[8], p[8], q[8];
        for (int k = 0; k < ndim; k++) {
            x[k] = a_number(&random, kind);
            p[k] = a_number(&random, kind);
            q[k] = trial % 11 == 0 ? p[k] : a_number(&random, kind);
        }
        CHECK(is_right(x, p, q, ndim, &ties));
    }
    CHECK(ties > TRIALS(300));
}

/* q - p is (a, b), and x - p nearly (-b, a). */
static void
a_hair_beside_a_right_angle_is_told(void)
{
    harness_random random = {18};
    int            ties = 0;
    for (int trial = 0; trial < TRIALS(3000); trial++) {
        const double a = random_unit(&random), b = random_unit(&random);
        const double p[2] = {0.25 * (trial % 4), trial % 3 - 1.0};
        const double q[2] = {p[0] + a, p[1] + b};
        double       x[2] = {p[0] - b, p[1] + a};
        for (int step = 0; step < 3; step++) {
            CHECK(is_right(x, p, q, 2, &ties));
            x[trial % 2] = nextafter(x[trial % 2], trial % 5 < 2 ? 9.0 : -9.0);
        }
    }
}

void
test_metric_foot(void)
{
    RUN(feet_are_where_whole_numbers_say);
    RUN(a_hair_beside_a_right_angle_is_told);
}
