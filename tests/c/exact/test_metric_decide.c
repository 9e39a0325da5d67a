/* SPDX-License-Identifier: BSD-3-Clause */
/* test_metric_decide.c: the decision, against exact arithmetic that shares no code with it. */
#include <float.h>

#include "../../../csrc/core/exact/metric.h"
#include "../../../csrc/core/exact/metric_integer.h"
#include "../support/bigint.h"
#include "../support/harness.h"

void test_metric_decide(void);

typedef struct scene {
    int     ndim, n_rows;
    double  p[8], q[8], rows[8][8];
    int64_t shift[8];
    double  cutoff;
} scene;

/* Sign of |D|^2 - cutoff^2, the plain way. */
static int
true_sign(const scene *s)
{
    const big cutoff = big_from_double(s->cutoff);
    const big square =
        big_square(s->ndim, s->n_rows, (const double(*)[8])s->rows, s->p, s->q, s->shift);
    return big_compare(square, big_product(cutoff, cutoff));
}

/* The library's decisions, strict and inclusive, and its last stage alone must all agree. */
static bool
decides_like(const scene *s, int sign, hs_stages *stages)
{
    hs_metric metric;
    bool      right;
    hs_metric_init(&metric, s->ndim, s->n_rows, (const double(*)[8])s->rows, s->cutoff, true);
    right = hs_metric_within(&metric, s->p, s->q, s->shift, stages) == (sign <= 0);
    right = right && hs_metric_within(&metric, s->q, s->p, NULL, stages) ==
                         hs_metric_within(&metric, s->p, s->q, NULL, stages);
    right = right && hs_integer_compare(&metric, s->p, s->q, s->shift) == sign;
    hs_metric_init(&metric, s->ndim, s->n_rows, (const double(*)[8])s->rows, s->cutoff, false);
    return right && hs_metric_within(&metric, s->p, s->q, s->shift, stages) == (sign < 0);
}

/* A cutoff close to |D|: its float64 value or a neighbour of that. */
static double
cutoff_near(const scene *s, int steps)
{
    const big square =
        big_square(s->ndim, s->n_rows, (const double(*)[8])s->rows, s->p, s->q, s->shift);
    int exponent = 0;
    if (square.sign != 0)
        exponent = -2148 + 32 * square.n;
    double cutoff = ldexp(sqrt(big_to_double(&square, -2148 - exponent)), exponent / 2);
    for (; steps > 0; steps--)
        cutoff = nextafter(cutoff, DBL_MAX);
    for (; steps < 0; steps++)
        cutoff = nextafter(cutoff, 0.0);
    return cutoff <= DBL_MAX ? cutoff : DBL_MAX;
}

static double
random_sign(harness_random *random)
{
    return random_bits(random) & 1 ? 1.0 : -1.0;
}

/* Numbers of one kind: everyday, dyadic, all exponents, extremes, subnormal, medium, decimal. */
static double
random_number(harness_random *random, int kind)
{
    static const double extremes[] = {0.0, 0x1p-1074, DBL_MIN, DBL_MAX, 1.0, 0x1p1023, 0x1p-1022};
    const double        unit = 2.0 * random_unit(random) - 1.0;
    switch (kind) {
    case 0: return 3.0 * unit;
    case 1: return (double)(random_bits(random) % 17) * 0.25 - 2.0;
    case 2: return ldexp(unit, (int)(random_bits(random) % 2098) - 1074);
    case 3: return random_sign(random) * extremes[random_bits(random) % 7];
    case 4: return random_sign(random) * ldexp((double)(random_bits(random) % 40), -1074);
    case 5: return ldexp(unit, (int)(random_bits(random) % 120) - 60);
    default: return ((double)(random_bits(random) % 17) - 8.0) * 0.1;
    }
}

static int64_t
random_shift(harness_random *random)
{
    static const int64_t extremes[] = {INT64_MIN, INT64_MAX, -(INT64_C(1) << 53),
                                       (INT64_C(1) << 53) + 1};
    switch (random_bits(random) % 5) {
    case 0: return 0;
    case 1: return (int64_t)(random_bits(random) % 5) - 2;
    case 2: return (int64_t)(random_bits(random) >> 11) - (INT64_C(1) << 52);
    case 3: return extremes[random_bits(random) % 4];
    default: return (int64_t)(random_bits(random) % 2001) - 1000;
    }
}

static void
every_stage_agrees_with_exact_arithmetic(void)
{
    harness_random random = {20240117};
    hs_stages      stages = {0, 0, 0};
    int            ties = 0;
    for (int trial = 0; trial < 6000; trial++) {
        const int common = (int)(random_bits(&random) % 7);
        scene     s = {.ndim = 1 + (int)(random_bits(&random) % (trial % 10 ? 3 : 8))};
        s.n_rows = (int)(random_bits(&random) % (unsigned)(s.ndim + 1));
        for (int k = 0; k < s.ndim; k++) {
            s.p[k] = random_number(&random, random_bits(&random) % 10 ? common : 2);
            s.q[k] = random_bits(&random) % 8 ? random_number(&random, common) : s.p[k];
            s.shift[k] = random_shift(&random);
            for (int l = 0; l < s.n_rows; l++)
                s.rows[l][k] = random_number(&random, random_bits(&random) % 10 ? common : 5);
        }
        s.cutoff = random_bits(&random) % 5 ? cutoff_near(&s, (int)(random_bits(&random) % 5) - 2)
                                            : fabs(random_number(&random, common));
        const int sign = true_sign(&s);
        ties += sign == 0;
        CHECK(decides_like(&s, sign, &stages));
    }
    CHECK(ties > 100);
    CHECK(stages.by_float64 > 500 && stages.by_double_word > 500 && stages.by_integers > 500);
}

/* Coordinates of chosen width make the integers small, medium and large. */
static void
integers_of_every_size_agree(void)
{
    harness_random random = {77};
    hs_stages      stages = {0, 0, 0};
    for (int width = 1; width < 420; width++) {
        for (int trial = 0; trial < 4; trial++) {
            scene s = {.ndim = 1 + (int)(random_bits(&random) % 8)};
            s.n_rows = trial % 2 ? s.ndim : 0;
            for (int k = 0; k < s.ndim; k++) {
                s.p[k] = random_number(&random, 0);
                s.q[k] = ldexp(random_number(&random, 1), width / 2);
                s.rows[k][k] = ldexp(1.0 + (double)(random_bits(&random) % 3), -width / 2);
                s.shift[k] = random_shift(&random);
            }
            for (int step = -1; step <= 1; step++) {
                s.cutoff = cutoff_near(&s, step);
                CHECK(decides_like(&s, true_sign(&s), &stages));
            }
        }
    }
}

/* The longest integers there can be: every bit of float64's range, times every bit of int64. */
static void
largest_integers_fit(void)
{
    hs_stages stages = {0, 0, 0};
    for (int ndim = 1; ndim <= 8; ndim++) {
        scene s = {.ndim = ndim, .n_rows = ndim};
        for (int k = 0; k < ndim; k++) {
            s.p[k] = -DBL_MAX;
            s.q[k] = DBL_MAX;
            s.shift[k] = INT64_MIN;
            for (int l = 0; l < ndim; l++)
                s.rows[l][k] = k == 0 && l == 0 ? -0x1p-1074 : -DBL_MAX;
        }
        s.cutoff = DBL_MAX;
        CHECK(decides_like(&s, true_sign(&s), &stages));
        for (int k = 0; k < ndim; k++)
            s.shift[k] = 0;
        s.q[0] = 0x1p-1074;
        CHECK(decides_like(&s, true_sign(&s), &stages));
    }
}

/* Whole-number distances in every binade: exact ties, and the floats beside them. */
static void
ties_hold_in_every_binade(void)
{
    static const double quadruples[][4] = {{1, 2, 2, 3},  {2, 3, 6, 7}, {1, 4, 8, 9},
                                           {2, 6, 9, 11}, {0, 3, 4, 5}, {0, 0, 1, 1}};
    hs_stages           stages = {0, 0, 0};
    for (int exponent = -1074; exponent <= 1020; exponent++) {
        const double *length = quadruples[(exponent + 1074) % 6];
        scene         s = {.ndim = 3, .n_rows = 3};
        for (int k = 0; k < 3; k++) {
            s.p[k] = ldexp(length[k], exponent);
            s.q[k] = -0.0;
            s.rows[k][k] = ldexp(16.0, exponent < 1016 ? exponent : 1016);
        }
        const double distance = ldexp(length[3], exponent);
        for (int side = -1; side <= 1; side++) {
            s.cutoff = side == 0 ? distance : nextafter(distance, side < 0 ? 0.0 : INFINITY);
            CHECK(decides_like(&s, -side, &stages));
        }
        s.shift[0] = 2; /* away, and back by the neighbouring float64 of that length */
        s.q[0] = -2.0 * s.rows[0][0];
        s.cutoff = distance;
        CHECK(decides_like(&s, true_sign(&s), &stages));
    }
}

/* Near ties with full significands, cutoffs from the smallest number to the largest. */
static void
nearest_ties_hold_in_every_binade(void)
{
    harness_random random = {4711};
    hs_stages      stages = {0, 0, 0};
    for (int exponent = -1074; exponent <= 1021; exponent++) {
        for (int trial = 0; trial < 2; trial++) {
            scene s = {.ndim = 2 + trial, .n_rows = trial, .shift = {1}};
            for (int k = 0; k < s.ndim; k++) {
                s.p[k] = ldexp(random_number(&random, 0), exponent);
                s.q[k] = ldexp(random_number(&random, 0), exponent);
                s.rows[0][k] = ldexp(random_number(&random, 0), exponent);
            }
            for (int step = -1; step <= 1; step++) {
                s.cutoff = cutoff_near(&s, step);
                CHECK(decides_like(&s, true_sign(&s), &stages));
            }
        }
    }
}

/* (|D|^2 in float64 - |D|^2) / |D|^2, in units of 2^-53. */
static double
float64_error(const scene *s)
{
    double square = 0.0;
    for (int k = 0; k < s->ndim; k++)
        square += (s->q[k] - s->p[k]) * (s->q[k] - s->p[k]);
    const big exact = big_square(s->ndim, 0, NULL, s->p, s->q, NULL);
    const big error =
        big_difference(big_product(big_from_double(square), big_from_bits(1, 1074, 1)), exact);
    return big_to_double(&error, -2148) / big_to_double(&exact, -2148) * 0x1p53;
}

/*
 * Every rounding of the float64 stage in the same direction and nearly as large as it can be. With
 * v = 2^-53: the first two differences lie halfway between floats 1 + 2 k v; k is such that their
 * squares (2 k^2 v is 1/2 and 3/2) and the sum of these, just above 2, are halfway too; and every
 * further square is just lost in the sum, or just lifts it.
 */
static void
float64_stage_survives_its_worst_case(void)
{
    const double   halfway[] = {47453132.0, 82191236.0}; /* sqrt(2^51), sqrt(3 * 2^51), even */
    harness_random random = {99};
    hs_stages      stages = {0, 0, 0};
    double         least_reached = 1.0;
    for (int trial = 0; trial < 28000; trial++) {
        const double side = trial & 1 ? 1.0 : -1.0; /* computed square too large, too small */
        const int    ndim = 2 + trial / 2 % 7;
        scene        s = {.ndim = ndim};
        for (int k = 0; k < ndim; k++) {
            const double step = 2.0 * (double)(1 + random_bits(&random) % 4096);
            s.p[k] = k < 2 ? side * 0x1p-53 : 0.0;
            s.q[k] = k < 2 ? 1.0 + 0x1p-52 * (halfway[k] + side * step)
                           : 0x1p-26 * (1.0 + side * 0x1p-40);
        }
        if (trial < 140) {
            const double reached = side * float64_error(&s) / (ndim + 2);
            least_reached = reached < least_reached ? reached : least_reached;
        }
        for (int step = -1; step <= 1; step++) {
            hs_metric metric;
            s.cutoff = cutoff_near(&s, step);
            hs_metric_init(&metric, ndim, 0, NULL, s.cutoff, true);
            CHECK(hs_metric_within(&metric, s.p, s.q, NULL, &stages) ==
                  (hs_integer_compare(&metric, s.p, s.q, NULL) <= 0));
        }
    }
    CHECK(stages.by_double_word > 0);
    CHECK(least_reached > 0.999); /* of the d + 2 roundings that the stage allows for */
}

/*
 * x^2 + y^2 = z^2 with y and z of 53 bits, and a third axis that adds less than the double-word
 * stage can tell from nothing: only because it loses nothing, or notices that it does, is it right.
 */
static void
ties_of_full_width_are_told_from_near_ties(void)
{
    hs_stages stages = {0, 0, 0};
    int       n_ties = 0;
    for (int trial = 0; trial < 3000; trial++) {
        const double x = 94906265.0 - 2.0 * trial; /* at most sqrt(2^53), odd */
        const double y = (x * x - 1.0) / 2.0;
        scene        s = {.ndim = 3, .n_rows = 1, .p = {0, 0, 0}, .q = {x, y, 0}};
        const int    small = trial % 9;
        s.q[2] = small < 4 ? (double)small : ldexp(1.0, small < 8 ? -20 * (small - 4) : -600);
        s.q[2] = trial % 2 ? 0.0 : s.q[2];
        s.rows[0][1] = 4096.0;
        s.shift[0] = trial / 9 % 3;
        s.q[1] -= 4096.0 * (double)s.shift[0];
        s.cutoff = y + 1.0 - (double)(trial / 27 % 2) * 2.0;
        const int sign = true_sign(&s);
        n_ties += sign == 0;
        CHECK(decides_like(&s, sign, &stages));
    }
    CHECK(n_ties > 700);
    CHECK(stages.by_double_word > 2000);
}

/*
 * x^2 + y^2 just beside (x + 1)^2, by less than the last place of any low word; and a D that
 * differs from the cutoff by 2^-105, where the sum of q - p = 1 + 3 2^-53 - 2^-105 and 3 a =
 * 1 + 2^-53 loses that.
 */
static void
what_is_lost_below_the_low_words_is_noticed(void)
{
    harness_random random = {31};
    hs_stages      stages = {0, 0, 0};
    for (int trial = 0; trial < 3000; trial++) {
        const double x = floor(ldexp(1.0 + random_unit(&random), 52)) - 1.0;
        const scene  s = {.ndim = 2, .q = {x, sqrt(2.0 * x + 1.0)}, .cutoff = x + 1.0};
        CHECK(decides_like(&s, true_sign(&s), &stages));
    }
    CHECK(stages.by_integers > 0);
    scene s = {.ndim = 1, .n_rows = 1, .shift = {3}, .cutoff = 2.0 + 0x1p-51};
    s.p[0] = -0x1p-53 + 0x1p-105;
    s.q[0] = 1.0 + 0x1p-52;
    s.rows[0][0] = 3002399751580331.0 * 0x1p-53; /* (2^53 + 1) / 3 */
    CHECK(true_sign(&s) < 0);
    CHECK(decides_like(&s, -1, &stages));
}

/*
 * A tie, a D that is off it by any power of two, or one whose square is not exact; and components
 * of 2^-50 or less of the others, which is on both sides of where they count as a hair. With
 * shifts, some of whose products end in the hair, and without.
 */
static void
ties_are_broken_by_a_hair(void)
{
    static const double legs[][3] = {{3, 4, 5}, {5, 12, 13}, {119, 120, 169}, {1, 0, 1}};
    harness_random      random = {47};
    hs_stages           stages = {0, 0, 0};
    int                 n_ties = 0, n_within = 0;
    for (int trial = 0; trial < 20000; trial++) {
        const double *leg = legs[trial % 4], unit = ldexp(1.0, trial % 7 * 40 - 120);
        const int     below_one = (int)(random_bits(&random) % 140);
        const double  off = trial % 3 ? ldexp(random_sign(&random), -below_one) : 0.0;
        scene         s = {.ndim = 3 + trial / 4 % 3, .n_rows = trial / 12 % 2};
        for (int k = 0; k < s.ndim; k++) {
            const int below = 50 + (int)(random_bits(&random) % 30) * (trial % 5 ? 1 : 30);
            s.q[k] = k < 2 ? leg[k] : random_sign(&random) * ldexp(1.0, -below);
            s.q[k] *= random_bits(&random) % 4 || k < 2 ? unit : 0.0;
        }
        s.q[1] += off * unit; /* as much of it as there is room for */
        s.cutoff = leg[2] * unit;
        if (trial % 6 == 5) { /* the rest is not exact */
            const double x = floor(ldexp(1.0 + random_unit(&random), 52)) - 1.0;
            s.q[0] = x * unit;
            s.q[1] = sqrt(2.0 * x + 1.0) * unit;
            s.cutoff = (x + 1.0) * unit;
        }
        s.rows[0][0] = unit;
        s.rows[0][2] = trial % 11 ? 0.0 : unit * 0x1p-40;
        s.shift[0] = s.n_rows ? 1 + trial % 3 : 0;
        s.q[0] -= (double)s.shift[0] * unit;
        const int sign = true_sign(&s);
        n_ties += sign == 0;
        n_within += sign < 0;
        CHECK(decides_like(&s, sign, &stages));
    }
    CHECK(n_ties > 500 && n_within > 1000);
    CHECK(stages.by_integers > 1000 && stages.by_double_word > 5000);
}

static void
zero_cutoff_means_coincident(void)
{
    hs_stages stages = {0, 0, 0};
    scene     s = {.ndim = 3, .n_rows = 1, .p = {0.1, -0.0, 3}, .q = {0.1, 0.0, 3}};
    s.rows[0][0] = 0.5;
    CHECK(decides_like(&s, 0, &stages));
    s.shift[0] = 1;
    s.q[0] = s.p[0] - 0.5;
    CHECK(decides_like(&s, true_sign(&s), &stages));
    s.shift[0] = 0;
    s.q[0] = s.p[0];
    s.q[1] = 0x1p-1074;
    CHECK(decides_like(&s, 1, &stages));
    s.cutoff = 0x1p-1074;
    CHECK(decides_like(&s, 0, &stages));
    s.q[2] = nextafter(3.0, 4.0);
    CHECK(decides_like(&s, 1, &stages));
    for (int k = 0; k < 3; k++)
        s.p[k] = s.q[k] = 0.0;
    s.cutoff = 0.0;
    CHECK(decides_like(&s, 0, &stages));
}

/* precision="double" is a fixed formula; a lattice constant of 0.1 tells it from the exact one. */
static void
double_formula_is_the_fixed_one(void)
{
    harness_random random = {5};
    for (int trial = 0; trial < 2000; trial++) {
        scene           s = {.ndim = 3, .n_rows = 2};
        volatile double square = 0.0; /* keeps the compiler from fusing or reordering */
        for (int k = 0; k < 3; k++) {
            s.p[k] = random_number(&random, 6);
            s.q[k] = random_number(&random, 6);
            s.rows[0][k] = random_number(&random, 6);
            s.rows[1][k] = random_number(&random, 0);
            s.shift[k] = (int64_t)(random_bits(&random) % 5) - 2;
        }
        for (int k = 0; k < 3; k++) {
            volatile double first = (double)s.shift[0] * s.rows[0][k];
            volatile double second = (double)s.shift[1] * s.rows[1][k];
            volatile double offset = first + second;
            volatile double difference = s.q[k] - s.p[k];
            difference = difference + offset;
            volatile double term = difference * difference;
            square = square + term;
        }
        s.cutoff = cutoff_near(&s, (int)(random_bits(&random) % 3) - 1);
        volatile double limit = s.cutoff * s.cutoff;
        hs_metric       metric;
        hs_metric_init(&metric, 3, 2, (const double(*)[8])s.rows, s.cutoff, true);
        CHECK(hs_metric_within_double(&metric, s.p, s.q, s.shift) == (square <= limit));
        metric.inclusive = false;
        CHECK(hs_metric_within_double(&metric, s.p, s.q, s.shift) == (square < limit));
    }
}

void
test_metric_decide(void)
{
    RUN(every_stage_agrees_with_exact_arithmetic);
    RUN(integers_of_every_size_agree);
    RUN(largest_integers_fit);
    RUN(ties_hold_in_every_binade);
    RUN(nearest_ties_hold_in_every_binade);
    RUN(float64_stage_survives_its_worst_case);
    RUN(ties_of_full_width_are_told_from_near_ties);
    RUN(what_is_lost_below_the_low_words_is_noticed);
    RUN(ties_are_broken_by_a_hair);
    RUN(zero_cutoff_means_coincident);
    RUN(double_formula_is_the_fixed_one);
}
