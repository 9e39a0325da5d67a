/* SPDX-License-Identifier: BSD-3-Clause */
/* test_metric_integer.c: the last stage alone: signs and differences for every finite number,
 * against integers that share no code with it. */
#include "../../../csrc/core/exact/metric_integer.h"
#include "../support/bigint.h"
#include "../support/harness.h"

#include <float.h>

void test_metric_integer(void);

static hs_metric
metric_of(int ndim, int n_rows, const double rows[][8], double cutoff)
{
    hs_metric metric;
    hs_metric_init(&metric, ndim, n_rows, rows, cutoff, true);
    return metric;
}

static void
nothing_is_as_long_as_nothing(void)
{
    const double    zeros[8] = {0.0, -0.0}, row[1][8] = {{5.0}};
    const int64_t   none[8] = {0};
    const hs_metric metric = metric_of(2, 1, row, 0.0);
    const hs_span   span = {zeros, zeros, none};
    hs_dw           value[8];
    int             exponent = 7;
    CHECK(hs_integer_compare(&metric, zeros, zeros, none) == 0);
    CHECK(hs_integer_compare(&metric, zeros, zeros, NULL) == 0);
    CHECK(hs_integer_compare_two(&metric, &span, &span) == 0);
    hs_integer_difference(&metric, zeros, zeros, none, value, &exponent);
    CHECK(exponent == 0 && value[0].hi == 0.0 && value[1].hi == 0.0);
    CHECK(value[0].lo == 0.0 && value[1].lo == 0.0);
}

/* Of shifts and rows there are as many as the metric has; what lies behind them is not looked at. */
static void
only_rows_that_there_are_count(void)
{
    const double  p[8] = {0.0, 0.0}, q[8] = {1.0, 0.0}, rows[1][8] = {{4.0, 0.0}};
    const int64_t shift[8] = {-1, 1, 1, 1, 1, 1, 1, 1};
    hs_metric     metric = metric_of(2, 1, rows, 3.0);
    hs_dw         value[8];
    int           exponent;
    for (int l = 1; l < 8; l++)
        metric.rows[l][0] = metric.rows[l][1] = 64.0;
    CHECK(hs_integer_compare(&metric, p, q, shift) == 0); /* 1 - 4 */
    hs_integer_difference(&metric, p, q, shift, value, &exponent);
    CHECK(ldexp(value[0].hi, exponent) == -3.0 && value[1].hi == 0.0);
}

/* Two points at one spot, of numbers that need one limb and many: D is 0, the cutoff is not. */
static void
equal_points_are_within_any_cutoff(void)
{
    const double cutoffs[] = {5e-324, 1.0, DBL_MAX};
    for (int c = 0; c < 3; c++) {
        const double    p[8] = {1.0, -3.0, 0x1p-1000};
        const hs_metric metric = metric_of(3, 0, NULL, cutoffs[c]);
        hs_dw           value[8];
        int             exponent = 7;
        CHECK(hs_integer_compare(&metric, p, p, NULL) == -1);
        hs_integer_difference(&metric, p, p, NULL, value, &exponent);
        CHECK(exponent == 0 && value[0].hi == 0.0 && value[2].hi == 0.0);
    }
}

/* Where everything fits 62 bits, one word is enough; with one bit more, two are; from 127 bits on,
 * any number. The same signs, next to either end of each. */
static void
signs_are_right_at_every_width(void)
{
    int wrong = 0, ties = 0;
    for (int width = 1; width <= 300; width++) {
        for (int side = -1; side <= 1; side++) {
            /* 3, 4, 5 times 2^width, and a cutoff one smallest number off */
            const double    p[8] = {0.0, -1.0}, high = ldexp(1.0, width > 48 ? 48 : width);
            const double    low = width > 48 ? ldexp(1.0, 48 - width) : 1.0;
            const double    q[8] = {3.0 * high, 4.0 * high - 1.0};
            const double    beside[8] = {3.0 * high, 4.0 * high - 1.0, side == 0 ? 0.0 : low};
            const double    cutoff = 5.0 * high + (side < 0 ? -1.0 : 0.0);
            const hs_metric flat = metric_of(2, 0, NULL, cutoff);
            const hs_metric deep = metric_of(3, 0, NULL, 5.0 * high);
            const hs_span   one = {p, q, NULL}, other = {p, beside, NULL};
            wrong += hs_integer_compare(&flat, p, q, NULL) != (side < 0);
            wrong += hs_integer_compare(&flat, q, p, NULL) != (side < 0);
            wrong += hs_integer_compare(&deep, p, beside, NULL) != (side != 0);
            wrong += hs_integer_compare_two(&deep, &one, &other) != -(side != 0);
            wrong += hs_integer_compare_two(&deep, &other, &one) != (side != 0);
            ties += side == 0;
        }
    }
    CHECK(wrong == 0 && ties == 300);
}

typedef struct vector_case {
    int     ndim;
    double  p[8], q[8], rows[8][8];
    int64_t shift[8];
} vector_case;

static double
random_double(harness_random *random, int spread)
{
    const int    exponent = (int)(random_bits(random) % (uint64_t)(2 * spread + 1)) - spread;
    const double size = ldexp(1.0 + random_unit(random), exponent);
    return random_bits(random) % 8 == 0 ? 0.0 : random_bits(random) & 1 ? size : -size;
}

static void
fill_case(harness_random *random, int spread, vector_case *c)
{
    memset(c, 0, sizeof *c);
    c->ndim = 1 + (int)(random_bits(random) % 8);
    for (int k = 0; k < c->ndim; k++) {
        c->p[k] = random_double(random, spread);
        c->q[k] = random_bits(random) % 4 == 0 ? c->p[k] : random_double(random, spread);
        c->shift[k] = (int64_t)(random_bits(random) >> random_bits(random) % 64);
        c->shift[k] = random_bits(random) % 3 ? c->shift[k] / 2 : -(c->shift[k] / 2);
        for (int l = 0; l < c->ndim; l++)
            c->rows[l][k] = random_double(random, spread);
    }
}

/* Component k of D, in units of 2^-1074. */
static big
component(const vector_case *c, int k)
{
    big sum = big_difference(big_from_double(c->q[k]), big_from_double(c->p[k]));
    for (int l = 0; l < c->ndim; l++)
        sum = big_sum(sum, big_product(big_from_int(c->shift[l]), big_from_double(c->rows[l][k])));
    return sum;
}

/* value * 2^exponent, times 2^scale, in the units of component(). */
static big
big_of(hs_dw value, int exponent, int scale)
{
    const big sum = big_sum(big_from_double(value.hi), big_from_double(value.lo));
    return big_product(sum, big_from_bits(1, exponent + scale, 1));
}

static bool
difference_is_right(const vector_case *c)
{
    enum { SCALE = 1400 };
    const hs_metric metric = metric_of(c->ndim, c->ndim, c->rows, 0.0);
    hs_dw           value[8];
    int             exponent;
    double          largest = 0.0;
    bool            right = true, is_zero = true;
    big             error = big_from_int(0), most = big_from_int(0);
    hs_integer_difference(&metric, c->p, c->q, c->shift, value, &exponent);
    for (int k = 0; k < c->ndim; k++) {
        const big truth = big_product(component(c, k), big_from_bits(1, SCALE, 1));
        big       off = big_difference(big_of(value[k], exponent, SCALE), truth);
        big       size = truth;
        off.sign = off.sign != 0;
        size.sign = size.sign != 0;
        error = big_compare(off, error) > 0 ? off : error;
        most = big_compare(size, most) > 0 ? size : most;
        largest = fabs(value[k].hi) > largest ? fabs(value[k].hi) : largest;
        is_zero = is_zero && truth.sign == 0;
        right = right && truth.sign * value[k].hi >= 0.0;
    }
    right = right &&
            (is_zero ? largest == 0.0 && exponent == 0 : largest >= 0x1p128 && largest <= 0x1p192);
    return right && big_compare(big_product(error, big_from_bits(1, 100, 1)), most) <= 0;
}

static void
differences_hold_a_hundred_bits(void)
{
    static const int spreads[] = {0, 3, 20, 60, 200, 900};
    harness_random   random = {271};
    int              wrong = 0;
    for (int trial = 0; trial < TRIALS(3000); trial++) {
        vector_case c;
        fill_case(&random, spreads[trial % 6], &c);
        wrong += !difference_is_right(&c);
    }
    CHECK(wrong == 0);
}

/* Two that are nearly as long, in every width; turned round, the sign is the other one. */
static void
two_are_compared_with_shifts(void)
{
    harness_random random = {272};
    int            wrong = 0, ties = 0;
    for (int trial = 0; trial < TRIALS(4000); trial++) {
        vector_case c;
        int64_t     back[8];
        fill_case(&random, trial % 5 * 40, &c);
        const hs_metric metric = metric_of(c.ndim, c.ndim, c.rows, 1.0);
        for (int l = 0; l < c.ndim; l++)
            back[l] = -c.shift[l];
        if (trial % 3 == 1)
            back[trial % c.ndim] += 1;
        if (trial % 3 == 2)
            c.q[trial % c.ndim] = nextafter(c.q[trial % c.ndim], 1.0);
        const hs_span one = {c.p, c.q, c.shift}, other = {c.q, c.p, back};
        const big     a = big_square(c.ndim, c.ndim, (const double(*)[8])c.rows, c.p, c.q, c.shift);
        const big     b = big_square(c.ndim, c.ndim, (const double(*)[8])c.rows, c.q, c.p, back);
        const int     sign = big_compare(a, b);
        wrong += hs_integer_compare_two(&metric, &one, &other) != sign;
        wrong += hs_integer_compare_two(&metric, &other, &one) != -sign;
        ties += sign == 0;
    }
    CHECK(wrong == 0 && ties > 100);
}

void
test_metric_integer(void)
{
    RUN(nothing_is_as_long_as_nothing);
    RUN(only_rows_that_there_are_count);
    RUN(equal_points_are_within_any_cutoff);
    RUN(signs_are_right_at_every_width);
    RUN(differences_hold_a_hundred_bits);
    RUN(two_are_compared_with_shifts);
}
