/* SPDX-License-Identifier: BSD-3-Clause */
/* test_close_gaps.c: columns that reach from the smallest to the largest numbers, condensed: every
 * difference of two coordinates against big integers. */
#include <float.h>

#include "../../../csrc/core/scene/close_gaps.h"
#include "../../../csrc/core/scene/unit.h"
#include "../support/bigint.h"
#include "../support/harness.h"

void test_close_gaps(void);

enum { POINTS = 40 };

/* A column, before and after. */
typedef struct column_case {
    int          n;
    int          unit; /* the cutoff is in [2^unit, 2^(unit + 1)) */
    bool         periodic;
    double       length, length_after;
    double       given[POINTS], wrapped[POINTS], after[POINTS];
    hs_condensed condensed;
} column_case;

static int
random_below(harness_random *random, int n)
{
    return (int)(random_bits(random) % (unsigned)n);
}

/* Any size, or near another number in the units that matter. */
static double
random_number(harness_random *random, const double *others, int n_others, int unit)
{
    static const int scales[] = {-1074, -1022, -500, 0, 40, 53, 54, 55, 70, 500, 1000};
    const double     sign = random_below(random, 2) ? 1.0 : -1.0;
    if (n_others > 0 && random_below(random, 3)) {
        double x = others[random_below(random, n_others)];
        switch (random_below(random, 4)) {
        case 0: return -x;
        case 1: return x;
        case 2: x = nextafter(x, sign * INFINITY); break;
        default: x += sign * ldexp(16.0 * random_unit(random), unit);
        }
        return isfinite(x) ? x : DBL_MAX;
    }
    const int    exponent = unit + scales[random_below(random, 11)] + random_below(random, 8);
    const double x = ldexp(1.0 + random_unit(random), exponent < 1023 ? exponent : 1023);
    return sign * (isfinite(x) ? x : 0.0);
}

/* Condenses one column of random numbers; false where it was refused. */
static bool
condense_random(harness_random *random, column_case *test)
{
    static const int units[] = {-1074, -1073, -1040, -600, -3, 0, 5, 300, 960, 1000};
    hs_account       account;
    hs_options       options = hs_options_default();
    hs_failure       failure;
    hs_box           box = {.ndim = 1};
    hs_cloud         cloud;
    hs_points        points = {.ndim = 1, .real = HS_FLOAT64};
    test->n = 1 + random_below(random, POINTS);
    test->unit = units[random_below(random, 10)];
    test->periodic = random_below(random, 2);
    test->length = fabs(random_number(random, NULL, 0, test->unit));
    test->periodic = test->periodic && test->length > 0.0;
    for (int i = 0; i < test->n; i++) {
        test->given[i] = random_number(random, test->given, i, test->unit);
        if (test->periodic && random_below(random, 2))
            test->given[i] = remainder(test->given[i], test->length);
        if (test->periodic && !random_below(random, 4))
            test->given[i] = random_below(random, 2) ? 0.5 * test->length : -0.5 * test->length;
    }
    box.periodic[0] = test->periodic;
    box.rows[0][0] = random_below(random, 2) ? test->length : -test->length;
    points.data = test->given;
    points.n = test->n;
    points.row_stride = points.column_stride = (ptrdiff_t)sizeof(double);
    options.want = random_below(random, 2) ? HS_WANT_SHIFT : HS_WANT_I;
    hs_account_init(&account, &options);
    CHECK(hs_cloud_load(&account, NULL, &points, &options, &cloud, &failure) == HS_OK);
    const hs_status status = hs_condense(&account, &options, test->periodic ? &box : NULL,
                                         test->unit,
                                         test->n % 2 ? HS_FAR_EXPONENT : HS_FAR_BOUNDED_EXPONENT,
                                         &cloud, NULL, &test->condensed, &failure);
    memcpy(test->after, cloud.x[0], (size_t)test->n * sizeof(double));
    for (int i = 0; i < test->n && status == HS_OK; i++) {
        CHECK(test->after[i] >= cloud.lower[0] && test->after[i] <= cloud.upper[0]);
        CHECK(fabs(test->after[i]) <= cloud.largest);
    }
    CHECK(status != HS_OK || cloud.largest == fmax(-cloud.lower[0], cloud.upper[0]));
    test->length_after = test->periodic ? fabs(test->condensed.box->rows[0][0]) : 0.0;
    if (test->periodic)
        CHECK(signbit(test->condensed.box->rows[0][0]) == signbit(box.rows[0][0]));
    CHECK(status == HS_OK || (status == HS_ERR_SHIFT_RANGE && options.want == HS_WANT_SHIFT));
    hs_condensed_free(&account, &test->condensed);
    hs_cloud_free(&account, &cloud);
    hs_account_close(&account);
    return status == HS_OK;
}

/* a - b + turns * length. */
static big
difference(double a, double b, double length, int turns)
{
    const big moved = big_product(big_from_int(turns), big_from_double(length));
    return big_sum(big_difference(big_from_double(a), big_from_double(b)), moved);
}

/* The same before and after, or both beyond any cutoff of this unit. */
static bool
is_kept(const column_case *test, big before, big after)
{
    const big one = big_from_double(1.0);
    const big unit = test->condensed.is_scaled ? big_from_double(ldexp(1.0, test->unit)) : one;
    const big far = big_product(big_from_double(ldexp(2.0, test->unit)), one);
    before = big_product(before, one);
    after = big_product(after, unit);
    return big_compare(before, after) == 0 ||
           (big_compare_magnitude(&before, &far) >= 0 && big_compare_magnitude(&after, &far) >= 0 &&
            before.sign == after.sign);
}

static void
differences_are_kept_or_beyond_the_cutoff(void)
{
    harness_random random = {3141};
    column_case    test;
    int            scaled = 0, shorter = 0;
    for (int trial = 0; trial < TRIALS(3000); trial++) {
        if (!condense_random(&random, &test) || test.periodic)
            continue;
        bool right = true;
        for (int i = 0; i < test.n; i++)
            for (int j = 0; j < i; j++)
                right = right && is_kept(&test, difference(test.given[i], test.given[j], 0.0, 0),
                                         difference(test.after[i], test.after[j], 0.0, 0));
        CHECK(right);
        scaled += test.condensed.is_scaled;
        shorter += test.after[0] != test.given[0] && !test.condensed.is_scaled;
    }
    CHECK(scaled > TRIALS(400));
    CHECK(shorter > TRIALS(100));
}

static void
images_are_kept_or_beyond_the_cutoff(void)
{
    harness_random random = {5926};
    column_case    test;
    int            short_boxes = 0, ties = 0;
    for (int trial = 0; trial < TRIALS(1500); trial++) {
        if (!condense_random(&random, &test) || !test.periodic)
            continue;
        bool right = true;
        for (int i = 0; i < test.n; i++)
            test.wrapped[i] = fabs(test.given[i]) > 0.5 * test.length
                                  ? remainder(test.given[i], test.length)
                                  : test.given[i];
        for (int i = 0; i < test.n; i++)
            for (int j = 0; j <= i; j++)
                for (int turn = -2; turn <= 2; turn++) {
                    const big before =
                        difference(test.wrapped[i], test.wrapped[j], test.length, turn);
                    const big after =
                        difference(test.after[i], test.after[j], test.length_after, turn);
                    /* Points that are near were not wrapped: their turn is another then. */
                    if (fabs(test.given[i]) > 0.5 * test.length ||
                        fabs(test.given[j]) > 0.5 * test.length)
                        continue;
                    right = right && is_kept(&test, before, after);
                    ties += turn != 0 && after.sign == 0;
                }
        CHECK(right);
        short_boxes += test.length_after != test.length && ties > 0;
    }
    CHECK(ties > TRIALS(100));
    CHECK(short_boxes > TRIALS(100));
}

/* An outlier is all that moves in a scene that is dense but for it. */
static void
dense_scenes_are_left_alone(void)
{
    enum { MANY = 1000 };
    static double    x[MANY];
    harness_random   random = {97};
    hs_account       account;
    const hs_options options = hs_options_default();
    hs_failure       failure;
    hs_cloud         cloud;
    hs_condensed     condensed;
    for (int i = 0; i < MANY; i++)
        x[i] = (MANY * random_unit(&random));
    for (int far = 0; far < 2; far++) {
        const hs_points points = {x, MANY, 1, HS_FLOAT64, sizeof(double), sizeof(double)};
        x[17] = far ? 1e300 : 0x1p54;
        hs_account_init(&account, &options);
        CHECK(hs_cloud_load(&account, NULL, &points, &options, &cloud, &failure) == HS_OK);
        CHECK(hs_condense(&account, &options, NULL, 0, HS_FAR_EXPONENT, &cloud, NULL, &condensed,
                          &failure) == HS_OK);
        for (int i = 0; i < MANY; i++)
            CHECK(i == 17 || cloud.x[0][i] == x[i]);
        CHECK(cloud.x[0][17] == (far ? cloud.upper[0] : 0x1p54));
        CHECK(cloud.upper[0] <= (far ? MANY + 12.0 : 0x1p54));
        hs_condensed_free(&account, &condensed);
        hs_cloud_free(&account, &cloud);
        hs_account_close(&account);
    }
}

/* Columns that are wrapped are kept as given where scaling will make numbers smaller; turns are
 * kept where they are wanted. */
static void
what_is_wrapped_is_kept_as_given(void)
{
    for (int unit = -1; unit <= 2; unit++) {
        for (unsigned want = 0; want <= HS_WANT_SHIFT; want += HS_WANT_SHIFT) {
            const double    length = ldexp(1.0, unit + 60), far = ldexp(5.25, unit + 60);
            double          x[3] = {0.0, far, 1.0};
            const hs_points points = {x, 3, 1, HS_FLOAT64, 8, 8};
            const hs_box    box = {.ndim = 1, .periodic = {true}, .rows = {{length}}};
            hs_options      options = hs_options_default();
            hs_account      account;
            hs_cloud        cloud;
            hs_condensed    condensed;
            hs_failure      failure;
            options.want = want;
            hs_account_init(&account, &options);
            CHECK(hs_cloud_load(&account, NULL, &points, &options, &cloud, &failure) == HS_OK);
            CHECK(hs_condense(&account, &options, &box, unit, HS_FAR_EXPONENT, &cloud, NULL,
                              &condensed, &failure) == HS_OK);
            CHECK(condensed.has_turns == (want != 0) && condensed.is_scaled == (unit < 0));
            CHECK((condensed.turns[0][0] != NULL) == (want != 0));
            CHECK((condensed.given[0][0] != NULL) == (want != 0 && unit > 0));
            if (condensed.given[0][0] != NULL)
                CHECK(condensed.given[0][0][1] == far && condensed.given[0][0][2] == 1.0);
            if (condensed.turns[0][0] != NULL)
                CHECK(condensed.turns[0][0][1] == 5 && condensed.turns[0][0][0] == 0);
            hs_condensed_free(&account, &condensed);
            hs_cloud_free(&account, &cloud);
            CHECK(account.held == 0);
        }
    }
}

void
test_close_gaps(void)
{
    RUN(what_is_wrapped_is_kept_as_given);
    RUN(differences_are_kept_or_beyond_the_cutoff);
    RUN(images_are_kept_or_beyond_the_cutoff);
    RUN(dense_scenes_are_left_alone);
}
