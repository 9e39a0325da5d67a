/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_metric_sum.c: limits that are sums of two numbers, held against the real sum as an integer:
 * ties that no float64 could tell, and what is a hair beside them.
 */
#include <float.h>

#include "../../../csrc/core/exact/metric_integer.h"
#include "../../../csrc/core/exact/metric_sum.h"
#include "../support/bigint.h"
#include "../support/harness.h"

void test_metric_sum(void);

typedef struct scene {
    int     ndim, n_rows;
    double  p[8], q[8], rows[8][8];
    int64_t shift[8];
} scene;

/* Sign of |D|^2 - (a + b)^2. */
static int
true_sign(const scene *s, double a, double b)
{
    const big limit = big_sum(big_from_double(a), big_from_double(b));
    const big square =
        big_square(s->ndim, s->n_rows, (const double(*)[8])s->rows, s->p, s->q, s->shift);
    return big_compare(square, big_product(limit, limit));
}

static int64_t
decided(const hs_stages *stages)
{
    return stages->by_float64 + stages->by_double_word + stages->by_integers;
}

/* The decision, strict and inclusive and both ways round, whatever the cutoff of the metric is; each
 * counts as one pair. */
static bool
decides_like(const scene *s, double a, double b, int sign, hs_stages *stages)
{
    static const double cutoffs[] = {0.0, 1.0, DBL_MAX};
    const double(*rows)[8] = (const double(*)[8])s->rows;
    const hs_dw   limit = hs_two_sum(a, b);
    const int64_t before = decided(stages);
    int64_t       back[8];
    bool          right = true;
    int           turns = 0;
    for (int l = 0; l < 8; l++)
        back[l] = -s->shift[l];
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        const bool within = sign < 0 || (sign == 0 && inclusive);
        hs_metric  metric;
        hs_metric_init(&metric, s->ndim, s->n_rows, rows, cutoffs[(inclusive + s->ndim) % 3],
                       inclusive);
        right = right &&
                hs_metric_within_sum(&metric, limit, s->p, s->q, s->shift, stages) == within &&
                hs_metric_within_sum(&metric, limit, s->q, s->p, back, stages) == within &&
                hs_integer_compare_sum(&metric, limit, s->p, s->q, s->shift) == sign;
        turns += 2;
    }
    return right && decided(stages) == before + turns;
}

/* A point on one axis at exactly a + b, which no float64 is: p is -a, and q is b. */
static void
a_tie_is_a_tie_of_the_real_sum(void)
{
    static const double sums[][2] = {{0.1, 0.2},          {0.1, 0.7},       {1.0, 0x1p-53},
                                     {1.0, 0x1p-60},      {1.0, -0x1p-60},  {3.0, 0x1p-1074},
                                     {0.3, 0.6},          {0x1p1022, 1.0},  {0x1p1022, 0x1p-1074},
                                     {0x1p-1022, 5e-324}, {5e-324, 5e-324}, {0.0, 0.0}};
    hs_stages           stages = {0, 0, 0};
    int                 above = 0, below = 0;
    for (size_t e = 0; e < sizeof sums / sizeof sums[0]; e++) {
        const double a = sums[e][0], b = sums[e][1];
        const hs_dw  limit = hs_two_sum(a, b);
        scene        s = {.ndim = 1, .p = {-a}, .q = {b}};
        above += limit.lo > 0.0;
        below += limit.lo < 0.0;
        CHECK(decides_like(&s, a, b, 0, &stages));
        s.q[0] = nextafter(b, HUGE_VAL);
        CHECK(decides_like(&s, a, b, 1, &stages));
        s.q[0] = nextafter(b, -HUGE_VAL);
        CHECK(decides_like(&s, a, b, a + b == 0.0 ? 1 : -1, &stages));
    }
    CHECK(above >= 3 && below >= 2);
    CHECK(stages.by_integers > 0 && stages.by_float64 > 0);
}

/* The float64 next to a sum is a limit that would be wrong: the sum lies between two of them. */
static void
the_rounded_sum_is_not_the_limit(void)
{
    const double a[] = {0.1, 0.1}, b[] = {0.2, 0.7}; /* rounded up, and rounded down */
    for (int e = 0; e < 2; e++) {
        const hs_dw limit = hs_two_sum(a[e], b[e]);
        const scene at_hi = {.ndim = 1, .q = {limit.hi}};
        scene       beside = at_hi;
        hs_stages   stages = {0, 0, 0};
        CHECK(limit.lo != 0.0 && (limit.lo < 0.0) == (e == 0));
        CHECK(decides_like(&at_hi, a[e], b[e], limit.lo < 0.0 ? 1 : -1, &stages));
        beside.q[0] = nextafter(limit.hi, limit.lo < 0.0 ? 0.0 : 1.0);
        CHECK(decides_like(&beside, a[e], b[e], limit.lo < 0.0 ? -1 : 1, &stages));
    }
}

/* (3, 4) h and sums near 5 h, with shifts and without. */
static void
sums_of_every_scale_are_decided(void)
{
    hs_stages stages = {0, 0, 0};
    int       wrong = 0, ties = 0;
    for (int width = 0; width <= 300; width += 1 + width / 60) {
        for (int side = -1; side <= 1; side++) {
            const double h = ldexp(1.0, width / 2), low = ldexp(1.0, -(width - width / 2));
            scene        s = {.ndim = 2,
                              .n_rows = width % 3,
                              .p = {1.0 + side * h, -h},
                              .q = {1.0 + side * h, -h},
                              .rows = {{3.0 * h, 4.0 * h}, {-3.0 * h, -4.0 * h}},
                              .shift = {width % 3 == 1 ? 1 : 3, 2}};
            if (s.n_rows == 0) {
                s.p[0] = s.p[1] = 0.0;
                s.q[0] = -4.0 * h;
                s.q[1] = 3.0 * h;
            }
            const double a = 5.0 * h - low, b = low + side * 0.25 * low;
            const int    sign = true_sign(&s, a, b);
            wrong += !decides_like(&s, a, b, sign, &stages);
            wrong += !decides_like(&s, b, a, sign, &stages);
            ties += sign == 0;
        }
    }
    CHECK(wrong == 0 && ties > 20);
}

/* |D| = h + low a little off the same sum: from 54 bits on it is no float64, up to 62 one limb holds
 * all of it, up to 126 two, and then many. A row brings some of it by a shift. */
static void
sums_of_every_width_are_decided(void)
{
    int wrong = 0, by_integers = 0;
    for (int width = 1; width <= 300; width++) {
        for (int trial = 0; trial < 12; trial++) {
            const double h = ldexp(1.0, width / 2), low = ldexp(1.0, -(width - width / 2));
            const double off = trial % 3 == 0 ? 0.0 : trial % 3 == 1 ? 0.25 * low : -0.25 * low;
            const double b = trial / 3 % 2 ? -low : low;
            const scene  s = {.ndim = 1,
                              .n_rows = trial / 6,
                              .p = {trial / 6 ? 2.0 * h : -h},
                              .q = {b + off},
                              .rows = {{1.5 * h}},
                              .shift = {trial / 6 ? 2 : 0}};
            hs_stages    stages = {0, 0, 0};
            const int    sign = true_sign(&s, h, b);
            wrong += sign != (off > 0.0) - (off < 0.0);
            wrong += !decides_like(&s, h, b, sign, &stages);
            by_integers += stages.by_integers > 0;
            wrong += width >= 60 && stages.by_integers != 4; /* between two neighbours */
        }
    }
    CHECK(wrong == 0 && by_integers > 2000);
}

static double
random_double(harness_random *random, int spread)
{
    const int    exponent = (int)(random_bits(random) % (uint64_t)(2 * spread + 1)) - spread;
    const double size = ldexp(1.0 + random_unit(random), exponent);
    return random_bits(random) % 8 == 0 ? 0.0 : random_bits(random) & 1 ? size : -size;
}

/* One radius at random, the other one what |D| leaves of it, or a float64 beside that. */
static bool
random_case(harness_random *random, int spread, int *signs, hs_stages *stages)
{
    scene s = {.ndim = 1 + (int)(random_bits(random) % 8)};
    s.n_rows = (int)(random_bits(random) % (uint64_t)(s.ndim + 1));
    for (int k = 0; k < s.ndim; k++) {
        s.p[k] = random_double(random, spread);
        s.q[k] = random_double(random, spread);
        for (int l = 0; l < s.n_rows; l++)
            s.rows[l][k] = random_double(random, spread);
        s.shift[k] = k < s.n_rows ? (int64_t)(random_bits(random) % 7) - 3 : 0;
    }
    const big square = big_square(s.ndim, s.n_rows, (const double(*)[8])s.rows, s.p, s.q, s.shift);
    const int exponent = square.sign == 0 ? 0 : -2148 + 32 * square.n;
    const double length = ldexp(sqrt(big_to_double(&square, -2148 - exponent)), exponent / 2);
    const double a = length * random_unit(random);
    double       b = length - a;
    for (int step = (int)(random_bits(random) % 4); step > 0; step--)
        b = nextafter(b, HUGE_VAL);
    const int sign = true_sign(&s, a, b);
    signs[sign + 1]++;
    return decides_like(&s, a, b, sign, stages) && decides_like(&s, b, a, sign, stages);
}

static void
random_sums_are_decided_as_integers_say(void)
{
    static const int spreads[] = {0, 3, 20, 200, 490};
    harness_random   random = {2718};
    hs_stages        stages = {0, 0, 0};
    int              wrong = 0, signs[3] = {0};
    for (int trial = 0; trial < TRIALS(4000); trial++)
        wrong += !random_case(&random, spreads[trial % 5], signs, &stages);
    CHECK(wrong == 0);
    CHECK(signs[0] > TRIALS(300) && signs[2] > TRIALS(300));
    CHECK(stages.by_double_word > 0 && stages.by_integers > 0);
}

/* A limit that is one float64 is the cutoff of metric.h, at the ends of the numbers too. */
static void
a_single_number_is_a_cutoff(void)
{
    static const double limits[] = {0.0, 5e-324, 0x1p-1022, 1.0, 0x1p1022, DBL_MAX};
    hs_stages           stages = {0, 0, 0};
    for (int e = 0; e < 6; e++) {
        const scene at = {.ndim = 2, .q = {0.0, limits[e]}}, nowhere = {.ndim = 2};
        CHECK(decides_like(&at, limits[e], 0.0, 0, &stages));
        CHECK(decides_like(&nowhere, limits[e], 0.0, e == 0 ? 0 : -1, &stages));
        CHECK(decides_like(&at, 0.5 * limits[e], 0.0, e == 0 ? 0 : 1, &stages));
    }
}

/* The rows of a metric stay when its cutoff is set. */
static void
a_cutoff_is_set_and_no_more(void)
{
    const double rows[2][8] = {{1.0, 2.0}, {0.25, -3.0}};
    hs_metric    metric, made;
    hs_metric_init(&metric, 2, 2, rows, 7.0, true);
    hs_metric_set_cutoff(2.5, &metric);
    hs_metric_init(&made, 2, 2, rows, 2.5, true);
    CHECK(metric.cutoff == 2.5 && metric.inclusive && metric.n_rows == 2);
    CHECK(metric.square_hi == made.square_hi && metric.sure_in == made.sure_in);
    CHECK(metric.sure_out == made.sure_out && metric.floats_usable == made.floats_usable);
    for (int l = 0; l < 2; l++)
        CHECK(memcmp(metric.rows[l], rows[l], 2 * sizeof(double)) == 0);
}

void
test_metric_sum(void)
{
    RUN(a_tie_is_a_tie_of_the_real_sum);
    RUN(the_rounded_sum_is_not_the_limit);
    RUN(sums_of_every_scale_are_decided);
    RUN(sums_of_every_width_are_decided);
    RUN(random_sums_are_decided_as_integers_say);
    RUN(a_single_number_is_a_cutoff);
    RUN(a_cutoff_is_set_and_no_more);
}
