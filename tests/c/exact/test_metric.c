/* SPDX-License-Identifier: BSD-3-Clause */
/* test_metric.c: distances in any box: what the filter says of them, what integers decide, and
 * what is measured. */
#include "../../../csrc/core/exact/metric.h"
#include "../support/bigint.h"
#include "../support/harness.h"
#include "../support/random_scenes.h"

#include <float.h>
#include <math.h>

void test_metric(void);

/* Of |D|^2 - cutoff^2. */
static int
sign_by_integers(const hs_metric *metric, const double *p, const double *q, const int64_t *shift)
{
    return hs_integer_compare(metric, (hs_dw){metric->cutoff, 0.0}, p, q, shift);
}

/* ---- the decision, against exact arithmetic that shares no code with it ---- */

typedef struct scene {
    int     ndim, n_rows;
    double  p[8], q[8], rows[8][8];
    int64_t shift[8];
    double  cutoff;
} scene;

/* |D|^2, the plain way. */
static big
square_of(const scene *s)
{
    return big_square(s->ndim, s->n_rows, (const double(*)[8])s->rows, s->p, s->q, s->shift);
}

/* Sign of |D|^2 - (a + b)^2. */
static int
true_sign_sum(const scene *s, double a, double b)
{
    const big limit = big_sum(big_from_double(a), big_from_double(b));
    return big_compare(square_of(s), big_product(limit, limit));
}

/* Sign of |D|^2 - cutoff^2. */
static int
true_sign(const scene *s)
{
    return true_sign_sum(s, s->cutoff, 0.0);
}

static hs_metric
metric_of(const scene *s, double cutoff, bool inclusive)
{
    hs_metric metric;
    hs_metric_init(&metric, s->ndim, s->n_rows, (const double(*)[8])s->rows, cutoff, inclusive);
    return metric;
}

/* The library's decisions, strict and inclusive, and its last stage alone must all agree. */
static bool
decides_like(const scene *s, int sign, hs_stages *stages)
{
    hs_metric metric = metric_of(s, s->cutoff, true);
    bool      right = hs_metric_within(&metric, s->p, s->q, s->shift, stages) == (sign <= 0);
    right = right && hs_metric_within(&metric, s->q, s->p, NULL, stages) ==
                         hs_metric_within(&metric, s->p, s->q, NULL, stages);
    right = right && sign_by_integers(&metric, s->p, s->q, s->shift) == sign;
    metric = metric_of(s, s->cutoff, false);
    return right && hs_metric_within(&metric, s->p, s->q, s->shift, stages) == (sign < 0);
}

/* About |D|. */
static double
length_of(const scene *s)
{
    const big square = square_of(s);
    const int exponent = square.sign == 0 ? 0 : -2148 + 32 * square.n;
    return ldexp(sqrt(big_to_double(&square, -2148 - exponent)), exponent / 2);
}

/* A cutoff close to |D|: its float64 value or a neighbour of that. */
static double
cutoff_near(const scene *s, int steps)
{
    double cutoff = length_of(s);
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
    const big exact = square_of(s); /* there are no rows */
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
            s.cutoff = cutoff_near(&s, step);
            const hs_metric metric = metric_of(&s, s.cutoff, true);
            CHECK(hs_metric_within(&metric, s.p, s.q, NULL, &stages) ==
                  (sign_by_integers(&metric, s.p, s.q, NULL) <= 0));
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

/* precision="double" is a fixed formula; a lattice constant of 0.1 tells it from the exact one. With
 * rows, without, and with shifts of none. */
static void
double_formula_is_the_fixed_one(void)
{
    harness_random random = {5};
    for (int trial = 0; trial < 3000; trial++) {
        scene           s = {.ndim = 3, .n_rows = trial % 3};
        const int64_t  *shift = trial % 7 ? s.shift : NULL;
        volatile double square = 0.0; /* keeps the compiler from fusing or reordering */
        for (int k = 0; k < 3; k++) {
            s.p[k] = random_number(&random, 6);
            s.q[k] = random_number(&random, 6);
            s.rows[0][k] = random_number(&random, 6);
            s.rows[1][k] = random_number(&random, 0);
            s.shift[k] = (int64_t)(random_bits(&random) % 5) - 2;
        }
        for (int k = 0; k < 3; k++) {
            volatile double offset = 0.0, difference = s.q[k] - s.p[k];
            for (int l = 0; shift != NULL && l < s.n_rows; l++) {
                volatile double product = (double)shift[l] * s.rows[l][k];
                offset = l == 0 ? product : offset + product;
            }
            difference = difference + offset;
            volatile double term = difference * difference;
            square = square + term;
        }
        s.cutoff = cutoff_near(&s, (int)(random_bits(&random) % 3) - 1);
        s.cutoff = shift == NULL ? sqrt(square) : s.cutoff;
        volatile double limit = s.cutoff * s.cutoff;
        hs_metric       metric = metric_of(&s, s.cutoff, true);
        CHECK(hs_metric_within_double(&metric, s.p, s.q, shift) == (square <= limit));
        metric.inclusive = false;
        CHECK(hs_metric_within_double(&metric, s.p, s.q, shift) == (square < limit));
    }
}

/*
 * ---- metric integer ----
 *
 * The last stage alone: signs and differences for every finite number, against integers that share
 * no code with it.
 */

static void
nothing_is_as_long_as_nothing(void)
{
    const scene     s = {.ndim = 2, .n_rows = 1, .q = {0.0, -0.0}, .rows = {{5.0}}};
    const hs_metric metric = metric_of(&s, 0.0, true);
    const hs_span   span = {s.p, s.q, s.shift};
    hs_dw           value[8];
    int             exponent = 7;
    CHECK(sign_by_integers(&metric, s.p, s.q, s.shift) == 0);
    CHECK(sign_by_integers(&metric, s.p, s.q, NULL) == 0);
    CHECK(hs_integer_compare_two(&metric, &span, &span) == 0);
    hs_integer_difference(&metric, s.p, s.q, s.shift, value, &exponent);
    CHECK(exponent == 0 && value[0].hi == 0.0 && value[1].hi == 0.0);
    CHECK(value[0].lo == 0.0 && value[1].lo == 0.0);
}

/* Of shifts and rows there are as many as the metric has; what lies behind them is not looked at. */
static void
only_rows_that_there_are_count(void)
{
    const scene s = {
        .ndim = 2, .n_rows = 1, .q = {1.0}, .rows = {{4.0}}, .shift = {-1, 1, 1, 1, 1, 1, 1, 1}};
    hs_metric metric = metric_of(&s, 3.0, true);
    hs_dw     value[8];
    int       exponent;
    for (int l = 1; l < 8; l++)
        metric.rows[l][0] = metric.rows[l][1] = 64.0;
    CHECK(sign_by_integers(&metric, s.p, s.q, s.shift) == 0); /* 1 - 4 */
    hs_integer_difference(&metric, s.p, s.q, s.shift, value, &exponent);
    CHECK(ldexp(value[0].hi, exponent) == -3.0 && value[1].hi == 0.0);
}

/* Two points at one spot, of numbers that need one limb and many: D is 0, the cutoff is not. */
static void
equal_points_are_within_any_cutoff(void)
{
    static const double cutoffs[] = {5e-324, 1.0, DBL_MAX};
    const scene         s = {.ndim = 3, .p = {1.0, -3.0, 0x1p-1000}};
    for (int c = 0; c < 3; c++) {
        const hs_metric metric = metric_of(&s, cutoffs[c], true);
        hs_dw           value[8];
        int             exponent = 7;
        CHECK(sign_by_integers(&metric, s.p, s.p, NULL) == -1);
        hs_integer_difference(&metric, s.p, s.p, NULL, value, &exponent);
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
            const scene     in_2 = {.ndim = 2}, in_3 = {.ndim = 3};
            const hs_metric flat = metric_of(&in_2, cutoff, true);
            const hs_metric deep = metric_of(&in_3, 5.0 * high, true);
            const hs_span   one = {p, q, NULL}, other = {p, beside, NULL};
            wrong += sign_by_integers(&flat, p, q, NULL) != (side < 0);
            wrong += sign_by_integers(&flat, q, p, NULL) != (side < 0);
            wrong += sign_by_integers(&deep, p, beside, NULL) != (side != 0);
            wrong += hs_integer_compare_two(&deep, &one, &other) != -(side != 0);
            wrong += hs_integer_compare_two(&deep, &other, &one) != (side != 0);
            ties += side == 0;
        }
    }
    CHECK(wrong == 0 && ties == 300);
}

static void
fill_case(harness_random *random, int spread, scene *c)
{
    memset(c, 0, sizeof *c);
    c->ndim = c->n_rows = 1 + (int)(random_bits(random) % 8);
    for (int k = 0; k < c->ndim; k++) {
        c->p[k] = random_size(random, spread);
        c->q[k] = random_bits(random) % 4 == 0 ? c->p[k] : random_size(random, spread);
        c->shift[k] = (int64_t)(random_bits(random) >> random_bits(random) % 64);
        c->shift[k] = random_bits(random) % 3 ? c->shift[k] / 2 : -(c->shift[k] / 2);
        for (int l = 0; l < c->ndim; l++)
            c->rows[l][k] = random_size(random, spread);
    }
}

/* value * 2^exponent, times 2^scale, in the units of big_component(). */
static big
big_of(hs_dw value, int exponent, int scale)
{
    const big sum = big_sum(big_from_double(value.hi), big_from_double(value.lo));
    return big_product(sum, big_from_bits(1, exponent + scale, 1));
}

static bool
difference_is_right(const scene *c)
{
    enum { SCALE = 1400 };
    const hs_metric metric = metric_of(c, 0.0, true);
    hs_dw           value[8];
    int             exponent;
    double          largest = 0.0;
    bool            right = true, is_zero = true;
    big             error = big_from_int(0), most = big_from_int(0);
    hs_integer_difference(&metric, c->p, c->q, c->shift, value, &exponent);
    for (int k = 0; k < c->ndim; k++) {
        const big truth = big_product(
            big_component(c->n_rows, (const double(*)[8])c->rows, c->p, c->q, c->shift, k),
            big_from_bits(1, SCALE, 1));
        big off = big_difference(big_of(value[k], exponent, SCALE), truth);
        big size = truth;
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
        scene c;
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
        scene   c;
        int64_t back[8];
        fill_case(&random, trial % 5 * 40, &c);
        const hs_metric metric = metric_of(&c, 1.0, true);
        for (int l = 0; l < c.ndim; l++)
            back[l] = -c.shift[l];
        if (trial % 3 == 1)
            back[trial % c.ndim] += 1;
        if (trial % 3 == 2)
            c.q[trial % c.ndim] = nextafter(c.q[trial % c.ndim], 1.0);
        const hs_span one = {c.p, c.q, c.shift}, other = {c.q, c.p, back};
        const big     b = big_square(c.ndim, c.ndim, (const double(*)[8])c.rows, c.q, c.p, back);
        const int     sign = big_compare(square_of(&c), b);
        wrong += hs_integer_compare_two(&metric, &one, &other) != sign;
        wrong += hs_integer_compare_two(&metric, &other, &one) != -sign;
        ties += sign == 0;
    }
    CHECK(wrong == 0 && ties > 100);
}

/* ---- which of two is nearer, against integers that share no code with it ---- */

typedef struct spans {
    int     ndim, n_rows;
    double  p[8], q[2][8], rows[8][8];
    int64_t shift[2][8];
} spans;

static int
true_order(const spans *s)
{
    const double(*rows)[8] = (const double(*)[8])s->rows;
    return big_compare(big_square(s->ndim, s->n_rows, rows, s->p, s->q[0], s->shift[0]),
                       big_square(s->ndim, s->n_rows, rows, s->p, s->q[1], s->shift[1]));
}

static bool
orders_like(const spans *s, int sign, hs_stages *stages)
{
    const hs_span one = {s->p, s->q[0], s->shift[0]}, other = {s->p, s->q[1], s->shift[1]};
    hs_metric     metric;
    hs_metric_init(&metric, s->ndim, s->n_rows, (const double(*)[8])s->rows, 1.0, true);
    return hs_metric_compare(&metric, &one, &other, stages) == sign &&
           hs_metric_compare(&metric, &other, &one, stages) == -sign &&
           hs_metric_compare(&metric, &one, &one, stages) == 0 &&
           hs_integer_compare_two(&metric, &one, &other) == sign;
}

/* The second is the first, mirrored or turned, and then moved by a few last places or not. */
static void
make_spans(harness_random *random, spans *s)
{
    const int exponent = random_below(random, 8) ? 0 : random_below(random, 1200) - 600;
    const int numbers = random_below(random, 4), ndim = 1 + random_below(random, HS_MAX_DIM);
    memset(s, 0, sizeof *s);
    s->ndim = ndim;
    s->n_rows = random_below(random, ndim + 1);
    for (int k = 0; k < ndim; k++) {
        s->p[k] = ldexp(random_entry(random, numbers, 4.0), exponent);
        s->q[0][k] = ldexp(random_entry(random, numbers, 4.0), exponent);
        for (int l = 0; l < s->n_rows; l++)
            s->rows[l][k] = ldexp(random_entry(random, numbers, 2.0) - 1.0, exponent);
    }
    const int turn = random_below(random, ndim);
    for (int k = 0; k < ndim; k++) {
        const int other = (k + turn) % ndim;
        s->q[1][k] = random_below(random, 2) ? s->p[k] + (s->q[0][other] - s->p[other])
                                             : s->p[k] - (s->q[0][other] - s->p[other]);
    }
    for (int steps = random_below(random, 4); steps > 0; steps--)
        s->q[1][turn] = nextafter(s->q[1][turn], random_below(random, 2) ? -8.0 : 8.0);
    for (int l = 0; l < s->n_rows; l++) {
        s->shift[0][l] = random_below(random, 5) - 2;
        s->shift[1][l] = random_below(random, 3) ? s->shift[0][l] : -s->shift[0][l];
    }
    if (s->n_rows > 0 && random_below(random, 50) == 0)
        s->shift[1][0] = s->shift[0][0] = INT64_MAX - random_below(random, 3);
}

static void
order_is_that_of_real_numbers(void)
{
    harness_random random = {99};
    hs_stages      stages = {0};
    int            ties = 0, wrong = 0;
    for (int trial = 0; trial < THIRD_OF_TRIALS(40000); trial++) {
        spans s;
        make_spans(&random, &s);
        const int sign = true_order(&s);
        ties += sign == 0;
        wrong += !orders_like(&s, sign, &stages);
    }
    CHECK(wrong == 0);
    CHECK(ties > THIRD_OF_TRIALS(3000));
    const int64_t least = THIRD_OF_TRIALS(1000);
    CHECK(stages.by_float64 > least && stages.by_double_word > least && stages.by_integers > least);
}

static void
order_at_the_ends_of_the_range(void)
{
    const double ends[] = {0.0, 5e-324,  -5e-324, 1e-310,  0x1p-400, 0x1p-399,
                           1.0, 0x1p400, 0x1p401, DBL_MAX, -DBL_MAX};
    enum { ENDS = sizeof ends / sizeof ends[0] };
    hs_stages stages = {0};
    int       wrong = 0;
    for (int e = 0; e < ENDS * ENDS * ENDS; e++) {
        spans s = {.ndim = 2, .n_rows = 1};
        s.p[0] = ends[e % ENDS];
        s.q[0][0] = ends[e / ENDS % ENDS];
        s.q[1][1] = ends[e / ENDS / ENDS];
        s.rows[0][0] = ends[(e + 3) % ENDS];
        s.shift[0][0] = e % 3 - 1;
        wrong += !orders_like(&s, true_order(&s), &stages);
    }
    CHECK(wrong == 0);
}

/* Each stage tells two distances apart that it can tell, and leaves the others to the next; equal
 * ones are so for the first that loses nothing. */
static void
the_first_stage_that_can_tell_which_is_nearer_does(void)
{
    const double p[2] = {0.0, 0.0}, rows[1][8] = {{0.0}};
    const double odd = 1.0 + 0x1p-52; /* with a hair beside it more than two words hold */
    const struct {
        double        q[2];
        const double *to;
        int           sign;
        int64_t       stages[3];
    } cases[] = {
        {{1.0, 0.5}, (const double[2]){1.0, 0.25}, 1, {1, 0, 0}},
        {{1.0, 0x1p-30}, (const double[2]){1.0, 0.0}, 1, {0, 1, 0}},
        {{1.0, 0x1p-30}, (const double[2]){1.0, 0x1.8p-30}, -1, {0, 1, 0}},
        {{1.0, 0.5}, (const double[2]){-0.5, 1.0}, 0, {0, 1, 0}},
        {{odd, 0x1p-80}, (const double[2]){0x1p-80, odd}, 0, {0, 0, 1}},
        {{odd, 0x1.8p-80}, (const double[2]){odd, 0x1p-80}, 1, {0, 0, 1}},
    };
    hs_metric metric;
    hs_metric_init(&metric, 2, 0, rows, 1.0, true);
    for (int c = 0; c < 6; c++) {
        hs_stages     stages = {0};
        const hs_span one = {p, cases[c].q, NULL}, other = {p, cases[c].to, NULL};
        CHECK(hs_metric_compare(&metric, &one, &other, &stages) == cases[c].sign);
        CHECK(stages.by_float64 == cases[c].stages[0]);
        CHECK(stages.by_double_word == cases[c].stages[1]);
        CHECK(stages.by_integers == cases[c].stages[2]);
        CHECK(hs_metric_compare(&metric, &other, &one, &stages) == -cases[c].sign);
    }
}

/*
 * ---- metric hair ----
 *
 * Differences with components so small that their squares underflow, beside one that is the cutoff
 * or a hair less or more: decided as big integers say.
 */

static void
hairs_beside_the_cutoff(void)
{
    const double hairs[] = {0.0,     5e-324,  0x1p-1000, 0x1p-600, 0x1p-540, 0x1p-400,
                            0x1p-80, 0x1p-65, 0x1p-64,   0x1p-63,  0x1p-55,  0x1p-30};
    hs_stages    stages = {0};
    int          wrong = 0, signs[3] = {0};
    for (int trial = 0; trial < 12 * 12 * 12 * 3; trial++) {
        const double off = hairs[trial % 12], hair = hairs[trial / 12 % 12];
        const double last = hairs[trial / 144 % 12];
        const double cutoff = trial / 1728 == 2 ? 0x1.8p300 : 1.0;
        const double side = trial / 1728 == 1 ? nextafter(cutoff, 0.0) : cutoff;
        for (int turn = 0; turn < 4; turn++) {
            /* (side -+ off, hair -+ last): what p takes from it need not fit one float64. */
            const scene s = {.ndim = 2,
                             .p = {turn & 1 ? off : -off, turn & 2 ? last : -last},
                             .q = {side, hair},
                             .cutoff = cutoff};
            const int   sign = true_sign(&s);
            wrong += !decides_like(&s, sign, &stages);
            signs[sign + 1]++;
        }
    }
    CHECK(wrong == 0);
    CHECK(signs[0] > 100 && signs[1] > 10 && signs[2] > 100);
}

/* (1 + 2^-52)^2 = 1^2 + (2^-26)^2 + (2^-26)^2 + (2^-52)^2: less than that by so little that only
 * the hair, or nothing but integers, can tell. */
static void
sums_a_little_below_the_cutoff(void)
{
    const double fourths[] = {0.0,
                              0x1p-52,
                              0x1p-52 * (1.0 - 0x1p-20),
                              0x1p-52 * (1.0 - 0x1p-40),
                              0x1p-52 * (1.0 + 0x1p-40),
                              0x1p-53};
    const double fifths[] = {0.0, 5e-324, 0x1p-600, 0x1p-540, 0x1p-120, 0x1p-70};
    hs_stages    stages = {0};
    for (int trial = 0; trial < 36; trial++) {
        const scene s = {.ndim = 5,
                         .q = {1.0, 0x1p-26, -0x1p-26, fourths[trial % 6], fifths[trial / 6]},
                         .cutoff = 1.0 + 0x1p-52};
        CHECK(decides_like(&s, true_sign(&s), &stages));
    }
}

/* ---- distances and vectors to the last place, and never against the decision ---- */

/* One unit in the last place of a nonnegative number whose float64 neighbour below is x. */
static double
ulp_of(double x)
{
    return x >= DBL_MAX ? 0x1p971 : nextafter(x, INFINITY) - x;
}

/* The largest double that is at most |D|. */
static double
root_below(const scene *s)
{
    const big square = square_of(s);
    double    root = length_of(s);
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
    const big       square = square_of(s);
    const int       sign = true_sign_sum(s, cutoff, 0.0);
    const double    ulp = ulp_of(root_below(s));
    const hs_metric metric = metric_of(s, cutoff, inclusive);
    hs_stages       stages = {0, 0, 0};
    double          vector[8];
    const bool      within = hs_metric_within(&metric, s->p, s->q, s->shift, &stages);
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
    const double root = root_below(s);
    for (int strict = 0; strict < 2; strict++) {
        check_measured(s, root, !strict);
        check_measured(s, root < DBL_MAX ? nextafter(root, DBL_MAX) : root, !strict);
        check_measured(s, root < 1e308 ? root * 1.7 : root, !strict);
    }
}

static void
last_place_is_right_in_every_binade(void)
{
    harness_random random = {51};
    for (int exponent = -1074; exponent <= 1022; exponent++) {
        scene s = {.ndim = 1 + (exponent + 1074) % 4, .n_rows = 1};
        for (int k = 0; k < s.ndim; k++) {
            s.p[k] = ldexp(2.0 * random_unit(&random) - 1.0, exponent);
            s.q[k] = ldexp(2.0 * random_unit(&random) - 1.0, exponent);
            s.rows[0][k] = ldexp(2.0 * random_unit(&random) - 1.0, exponent);
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
                s.rows[l][k] =
                    ldexp(2.0 * random_unit(&random) - 1.0, (int)(random_bits(&random) % 20));
                s.shift[l] = (int64_t)(random_bits(&random) >> (11 + trial % 53));
            }
            for (int l = 0; l < s.n_rows; l++)
                sum += (double)s.shift[l] * s.rows[l][k];
            s.p[k] = trial % 5 ? sum : 0.0;
            s.q[k] = trial % 7
                         ? ldexp(random_unit(&random) - 0.5, (int)(random_bits(&random) % 100) - 60)
                         : 0.0;
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
    scene s = {.ndim = 2, .p = {1.0, 0x1p-60}};
    for (int step = 0; step < 40; step++) {
        s.p[0] = nextafter(1.0, 0.0) - 0x1p-53 * (double)step;
        s.p[1] = sqrt(1.0 - s.p[0] * s.p[0]);
        check_cutoffs(&s);
        check_measured(&s, 1.0, false);
        check_measured(&s, 1.0, true);
    }
    s.p[0] = 1.0 - 0x1p-53;
    s.p[1] = 0x1.fffp-27 * 0.7071;
    const hs_metric metric = metric_of(&s, 1.0, false);
    CHECK(hs_keep_within(hs_metric_measure(&metric, s.p, s.q, NULL, NULL), 1.0, false) < 1.0);
}

/*
 * ---- metric sum ----
 *
 * Limits that are sums of two numbers, held against the real sum as an integer: ties that no
 * float64 could tell, and what is a hair beside them.
 */

static int64_t
decided(const hs_stages *stages)
{
    return stages->by_float64 + stages->by_double_word + stages->by_integers;
}

/* The decision, strict and inclusive and both ways round, whatever the cutoff of the metric is; each
 * counts as one pair. */
static bool
decides_like_sum(const scene *s, double a, double b, int sign, hs_stages *stages)
{
    static const double cutoffs[] = {0.0, 1.0, DBL_MAX};
    const hs_dw         limit = hs_two_sum(a, b);
    const int64_t       before = decided(stages);
    int64_t             back[8];
    bool                right = true;
    int                 turns = 0;
    for (int l = 0; l < 8; l++)
        back[l] = -s->shift[l];
    for (int inclusive = 0; inclusive < 2; inclusive++) {
        const bool      within = sign < 0 || (sign == 0 && inclusive);
        const hs_metric metric = metric_of(s, cutoffs[(inclusive + s->ndim) % 3], inclusive);
        right = right &&
                hs_metric_within_sum(&metric, limit, s->p, s->q, s->shift, stages) == within &&
                hs_metric_within_sum(&metric, limit, s->q, s->p, back, stages) == within &&
                hs_integer_compare(&metric, limit, s->p, s->q, s->shift) == sign;
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
        CHECK(decides_like_sum(&s, a, b, 0, &stages));
        s.q[0] = nextafter(b, HUGE_VAL);
        CHECK(decides_like_sum(&s, a, b, 1, &stages));
        s.q[0] = nextafter(b, -HUGE_VAL);
        CHECK(decides_like_sum(&s, a, b, a + b == 0.0 ? 1 : -1, &stages));
    }
    CHECK(above >= 3 && below >= 2);
    CHECK(stages.by_integers > 0 && stages.by_float64 > 0);
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
            const int    sign = true_sign_sum(&s, a, b);
            wrong += !decides_like_sum(&s, a, b, sign, &stages);
            wrong += !decides_like_sum(&s, b, a, sign, &stages);
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
            const int    sign = true_sign_sum(&s, h, b);
            wrong += sign != (off > 0.0) - (off < 0.0);
            wrong += !decides_like_sum(&s, h, b, sign, &stages);
            by_integers += stages.by_integers > 0;
            wrong += width >= 60 && stages.by_integers != 4; /* between two neighbours */
        }
    }
    CHECK(wrong == 0 && by_integers > 2000);
}

/* One radius at random, the other one what |D| leaves of it, or a float64 beside that. */
static bool
random_case(harness_random *random, int spread, int *signs, hs_stages *stages)
{
    scene s = {.ndim = 1 + (int)(random_bits(random) % 8)};
    s.n_rows = (int)(random_bits(random) % (uint64_t)(s.ndim + 1));
    for (int k = 0; k < s.ndim; k++) {
        s.p[k] = random_size(random, spread);
        s.q[k] = random_size(random, spread);
        for (int l = 0; l < s.n_rows; l++)
            s.rows[l][k] = random_size(random, spread);
        s.shift[k] = k < s.n_rows ? (int64_t)(random_bits(random) % 7) - 3 : 0;
    }
    const double length = length_of(&s), a = length * random_unit(random);
    double       b = length - a;
    for (int step = (int)(random_bits(random) % 4); step > 0; step--)
        b = nextafter(b, HUGE_VAL);
    const int sign = true_sign_sum(&s, a, b);
    signs[sign + 1]++;
    return decides_like_sum(&s, a, b, sign, stages) && decides_like_sum(&s, b, a, sign, stages);
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
        CHECK(decides_like_sum(&at, limits[e], 0.0, 0, &stages));
        CHECK(decides_like_sum(&nowhere, limits[e], 0.0, e == 0 ? 0 : -1, &stages));
        CHECK(decides_like_sum(&at, 0.5 * limits[e], 0.0, e == 0 ? 0 : 1, &stages));
    }
}

/*
 * ---- metric foot ----
 *
 * Held against whole numbers, at right angles and a hair beside them, and where products leave the
 * range of float64.
 */

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

/* Sign of (x + S * rows - p).(q + T * rows - p). */
static int
true_sign_of_images(const hs_metric *images, const double *x, const int64_t *of_x, const double *p,
                    const double *q, const int64_t *of_q)
{
    big sum = big_from_int(0);
    for (int k = 0; k < images->ndim; k++) {
        const big origin = big_from_double(p[k]);
        big       a = big_difference(big_from_double(x[k]), origin);
        big       b = big_difference(big_from_double(q[k]), origin);
        for (int l = 0; l < images->n_rows; l++) {
            const big row = big_from_double(images->rows[l][k]);
            a = big_sum(a, big_product(big_from_int(of_x[l]), row));
            b = big_sum(b, big_product(big_from_int(of_q[l]), row));
        }
        sum = big_sum(sum, big_product(a, b));
    }
    return sum.sign;
}

/* From either end; adds to *ties. */
static bool
is_right(const hs_metric *images, const double *x, const int64_t *of_x, const double *p,
         const double *q, const int64_t *of_q, int *ties)
{
    int64_t from_q[HS_MAX_DIM], back[HS_MAX_DIM];
    for (int l = 0; l < images->n_rows; l++) {
        from_q[l] = of_x[l] - of_q[l];
        back[l] = -of_q[l];
    }
    const int  at_p = true_sign_of_images(images, x, of_x, p, q, of_q);
    const int  at_q = true_sign_of_images(images, x, from_q, q, p, back);
    const bool between = at_p >= 0 && at_q >= 0;
    *ties += at_p == 0 || at_q == 0;
    return hs_foot_is_between(images, x, of_x, p, q, of_q) == between &&
           hs_foot_is_between(images, x, from_q, q, p, back) == between;
}

/* Without images, and of images. */
static void
feet_are_where_whole_numbers_say(void)
{
    harness_random random = {19};
    int            ties = 0;
    for (int trial = 0; trial < TRIALS(9000); trial++) {
        const int kind = trial / 8 % 7, ndim = 1 + trial % 8;
        hs_metric images = {.ndim = ndim, .n_rows = trial % 2 ? 0 : ndim < 6 ? ndim : 6};
        double    x[8], p[8], q[8];
        int64_t   of_x[8], of_q[8];
        for (int k = 0; k < ndim; k++) {
            x[k] = a_number(&random, kind);
            p[k] = a_number(&random, kind);
            q[k] = trial % 11 == 0 ? p[k] : a_number(&random, kind);
            of_x[k] = (int64_t)(random_bits(&random) % 7) - 3;
            of_q[k] = trial % 11 == 0 ? 0 : (int64_t)(random_bits(&random) % 7) - 3;
            if (trial % 13 == 0)
                of_x[k] *= INT32_MAX;
            for (int l = 0; l < images.n_rows; l++)
                images.rows[l][k] = random_bits(&random) & 1 ? a_number(&random, kind) : 0.0;
        }
        CHECK(is_right(&images, x, of_x, p, q, of_q, &ties));
    }
    CHECK(ties > TRIALS(450));
}

/* q - p is (a, b), and x - p nearly (-b, a). */
static void
a_hair_beside_a_right_angle_is_told(void)
{
    const hs_metric plane = {.ndim = 2};
    harness_random  random = {18};
    int             ties = 0;
    for (int trial = 0; trial < TRIALS(3000); trial++) {
        const double a = random_unit(&random), b = random_unit(&random);
        const double p[2] = {0.25 * (trial % 4), trial % 3 - 1.0};
        const double q[2] = {p[0] + a, p[1] + b};
        double       x[2] = {p[0] - b, p[1] + a};
        for (int step = 0; step < 3; step++) {
            CHECK(is_right(&plane, x, NULL, p, q, NULL, &ties));
            x[trial % 2] = nextafter(x[trial % 2], trial % 5 < 2 ? 9.0 : -9.0);
        }
    }
}

void
test_metric(void)
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
    RUN(nothing_is_as_long_as_nothing);
    RUN(only_rows_that_there_are_count);
    RUN(equal_points_are_within_any_cutoff);
    RUN(signs_are_right_at_every_width);
    RUN(differences_hold_a_hundred_bits);
    RUN(two_are_compared_with_shifts);
    RUN(order_is_that_of_real_numbers);
    RUN(order_at_the_ends_of_the_range);
    RUN(the_first_stage_that_can_tell_which_is_nearer_does);
    RUN(hairs_beside_the_cutoff);
    RUN(sums_a_little_below_the_cutoff);
    RUN(last_place_is_right_in_every_binade);
    RUN(last_place_is_right_under_cancellation);
    RUN(coincident_points_are_at_distance_zero);
    RUN(strict_distances_stay_below_the_cutoff);
    RUN(a_tie_is_a_tie_of_the_real_sum);
    RUN(sums_of_every_scale_are_decided);
    RUN(sums_of_every_width_are_decided);
    RUN(random_sums_are_decided_as_integers_say);
    RUN(a_single_number_is_a_cutoff);
    RUN(feet_are_where_whole_numbers_say);
    RUN(a_hair_beside_a_right_angle_is_told);
}
