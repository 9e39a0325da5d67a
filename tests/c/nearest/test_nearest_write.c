/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_nearest_write.c: the columns of nearest points: each alone has the bits that it has beside
 * all others, in either width of index, whether shifts are those of images or of points as given;
 * and shifts that are too large for one column or for all.
 */
#include "../support/harness.h"
#include "../support/nearest_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_nearest_write(void);

/* Whether an int32 column holds the numbers of an int64 one. */
static bool
same_numbers(const int32_t *narrow, const int64_t *wide, int64_t n)
{
    for (int64_t e = 0; e < n; e++) {
        if (narrow[e] != wide[e])
            return false;
    }
    return true;
}

static bool
same_bits(const hs_pairs *one, const hs_pairs *all, unsigned which, size_t width)
{
    return hs_pairs_array(one, which) == NULL || same_array(one, all, which, width);
}

/* Each choice of columns gives what the search for all of them gives. */
static void
check_columns(const brute_scene *scene, const hs_points *queries, int64_t k, double limit)
{
    const unsigned  choices[] = {HS_WANT_J,
                                 HS_WANT_DISTANCE,
                                 HS_WANT_VECTOR,
                                 HS_WANT_SHIFT,
                                 HS_WANT_J | HS_WANT_DISTANCE,
                                 HS_WANT_DISTANCE | HS_WANT_VECTOR,
                                 HS_WANT_J | HS_WANT_VECTOR};
    const hs_points points = points_of(scene);
    const size_t    d = (size_t)scene->ndim;
    hs_options      options = options_of(scene);
    hs_pairs       *all = NULL;
    options.cutoff = limit;
    options.want = WANT_ALL & ~HS_WANT_I;
    CHECK(hs_nearest_find(QUERIED(&points, queries, scene->box), k, &options, &all, NULL) == HS_OK);
    for (int c = 0; c < 14; c++) {
        hs_pairs *one = NULL;
        options.want = choices[c % 7];
        options.index_bytes = c < 7 ? 8 : 4;
        CHECK(hs_nearest_find(QUERIED(&points, queries, scene->box), k, &options, &one, NULL) ==
              HS_OK);
        CHECK(hs_pairs_length(one) == hs_pairs_length(all));
        CHECK(same_bits(one, all, HS_WANT_DISTANCE, 8));
        CHECK(same_bits(one, all, HS_WANT_VECTOR, 8 * d));
        CHECK(same_bits(one, all, HS_WANT_SHIFT, 4 * d));
        if (options.want & HS_WANT_J) {
            const void *j = hs_pairs_array(one, HS_WANT_J);
            CHECK(c < 7 ? same_array(one, all, HS_WANT_J, 8)
                        : same_numbers(j, hs_pairs_array(all, HS_WANT_J), hs_pairs_length(all)));
        }
        hs_pairs_free(one);
    }
    hs_pairs_free(all);
}

static void
each_column_alone_is_the_same(void)
{
    harness_random      random = {1618};
    static random_scene s, other;
    for (int trial = 0; trial < 180; trial++) {
        const int ndim = 1 + trial / SCENE_KINDS % 4;
        const int exponent = trial % 5 ? 0 : trial % 2 ? -400 : 300;
        make_scene(&random, trial % SCENE_KINDS, ndim, random_below(&random, 30), 4.0, exponent,
                   &s);
        make_scene(&random, SCENE_OPEN, ndim, random_below(&random, 8), 4.0, exponent, &other);
        const hs_points queries = points_of(&other.scene);
        check_columns(&s.scene, trial % 2 ? &queries : NULL, 1 + random_below(&random, 40),
                      s.scene.cutoff);
    }
}

/* Numbers from the smallest to the largest that there are: measured on the numbers as given. */
static void
columns_of_extreme_scenes(void)
{
    harness_random random = {77};
    double         x[3 * 24];
    for (int trial = 0; trial < 60; trial++) {
        hs_box      box = {.ndim = 3, .periodic = {true}, .rows = {{0x1p-1000}, {0, 1}, {0, 0, 1}}};
        brute_scene scene = {.ndim = 3, .n = 24, .x = x, .inclusive = true, .cutoff = 0x1p-999};
        scene.box = trial % 2 ? &box : NULL;
        for (int e = 0; e < 3 * 24; e++) {
            x[e] = ldexp(random_unit(&random), e % 3 == 0 ? -1000 : e % 2 ? -1070 : -1003);
            if (scene.box == NULL && e % 3 != 0 && random_below(&random, 6) == 0)
                x[e] = 0x1p300 * (1 + trial % 3);
        }
        check_columns(&scene, NULL, 5, scene.cutoff);
        CHECK(compare_rows(&scene, trial % 3 ? -1 : 6, 5, 1) > 0);
    }
}

/* Numbers so large that scaling them down loses the digits of others, which decide. */
static void
columns_of_scenes_that_lose_digits(void)
{
    harness_random random = {78};
    double         x[2 * 24];
    for (int trial = 0; trial < 24; trial++) {
        brute_scene scene = {.ndim = 2, .n = 24, .x = x, .inclusive = true};
        scene.cutoff = trial % 3 == 0 ? 0x1p1010 : trial % 3 == 1 ? 1.0 : 0x1p-1040;
        for (int e = 0; e < 2 * 24; e++) {
            const int exponents[] = {1009, -1050, -1, -1060};
            x[e] = ldexp(random_unit(&random) - 0.5, exponents[random_below(&random, 4)]);
            if (random_below(&random, 3) == 0)
                x[e] = trial % 2 ? 0x1p1009 : 0.0;
        }
        check_columns(&scene, NULL, 7, trial % 4 ? scene.cutoff : INFINITY);
        CHECK(compare_rows(&scene, trial % 5 ? -1 : 8, 7, 1) > 0);
    }
}

/* A tiny box, its points and its distances are those of an ordinary one, scaled. */
static void
tiny_boxes_are_scaled_ones(void)
{
    harness_random random = {79};
    double         x[2][3 * 20];
    for (int trial = 0; trial < 12; trial++) {
        const int exponent = -300 - 60 * trial, d = 3, n = 20;
        hs_pairs *rows[2];
        for (int tiny = 0; tiny < 2; tiny++) {
            hs_box box = {.ndim = d, .periodic = {true, true, trial % 2}};
            for (int k = 0; k < d; k++)
                box.rows[k][k] = ldexp(1.0, tiny ? exponent : 0);
            box.rows[1][0] = trial % 3 ? 0.25 * box.rows[0][0] : 0.0;
            for (int e = 0; e < d * n; e++)
                x[tiny][e] = tiny ? ldexp(x[0][e], exponent)
                                  : 0x1p-20 * random_below(&random, 1 << 21);
            brute_scene     scene = {.ndim = d, .n = n, .x = x[tiny], .box = &box};
            const hs_points points = points_of(&scene);
            hs_options      options = options_of(&scene);
            options.cutoff = INFINITY;
            options.want = WANT_ALL & ~HS_WANT_I;
            CHECK(hs_nearest_find(AMONG(&points, &box), 30, &options, &rows[tiny], NULL) == HS_OK);
        }
        CHECK(same_array(rows[0], rows[1], HS_WANT_J, 8));
        CHECK(same_array(rows[0], rows[1], HS_WANT_SHIFT, 12));
        const double *a = hs_pairs_array(rows[0], HS_WANT_DISTANCE);
        const double *b = hs_pairs_array(rows[1], HS_WANT_DISTANCE);
        bool          scaled = true;
        for (int64_t e = 0; e < 30 * n; e++)
            scaled = scaled && ldexp(a[e], exponent) == b[e];
        CHECK(scaled);
        hs_pairs_free(rows[0]);
        hs_pairs_free(rows[1]);
    }
}

/* Points in their box: nothing is turned, and the shifts are those of images. */
static void
images_have_their_shifts(void)
{
    harness_random random = {5};
    double         x[3 * 30];
    for (int trial = 0; trial < 40; trial++) {
        hs_box      box = {.ndim = 3, .periodic = {true, trial % 2, trial % 3}};
        brute_scene scene = {.ndim = 3, .x = x, .box = &box, .cutoff = 1.25};
        scene.n = 1 + random_below(&random, 30);
        for (int k = 0; k < 3; k++)
            box.rows[k][k] = 1.0;
        for (int e = 0; e < 3 * scene.n; e++)
            x[e] = trial % 4 ? random_unit(&random) - 0.5 : 0.25 * random_below(&random, 4) - 0.5;
        check_columns(&scene, NULL, 60, trial % 5 ? INFINITY : 0.75);
        CHECK(compare_rows(&scene, -1, 60, 1) > 0);
    }
}

/* One point and one query so many boxes apart: S, or the status that says that it is too large. */
static hs_status
find_far(double away, unsigned want, double *distance, int32_t *shift, hs_failure *failure)
{
    const double    x[2] = {0.25, 0.5}, far[2] = {away, 0.5};
    const hs_box    box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.5, 1.0}}};
    const hs_points point = {x, 1, 2, HS_FLOAT64, 16, 8}, query = {far, 1, 2, HS_FLOAT64, 16, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    options.cutoff = INFINITY;
    options.want = want | HS_WANT_DISTANCE;
    const hs_status status =
        hs_nearest_find(QUERIED(&point, &query, &box), 1, &options, &rows, failure);
    if (status == HS_OK) {
        *distance = ((const double *)hs_pairs_array(rows, HS_WANT_DISTANCE))[0];
        *shift = want != 0 ? ((const int32_t *)hs_pairs_array(rows, HS_WANT_SHIFT))[0] : 0;
    }
    hs_pairs_free(rows);
    return status;
}

static void
shifts_may_be_too_large(void)
{
    double     distance = -1.0;
    int32_t    shift = -1;
    hs_failure failure;
    CHECK(find_far(0x1p30, HS_WANT_SHIFT, &distance, &shift, &failure) == HS_OK);
    CHECK(distance == 0.25 && shift == 1 << 30);
    CHECK(find_far(-0x1p31, HS_WANT_SHIFT, &distance, &shift, &failure) == HS_OK);
    CHECK(distance == 0.25 && shift == INT32_MIN);
    for (int sign = -1; sign <= 1; sign += 2) {
        CHECK(find_far(sign * 0x1p32, HS_WANT_SHIFT, &distance, &shift, &failure) ==
              HS_ERR_SHIFT_RANGE);
        CHECK(failure.row == 0);
        for (int exponent = 33; exponent <= 50; exponent += 17) {
            CHECK(find_far(sign * ldexp(1.0, exponent), 0, &distance, &shift, &failure) == HS_OK);
            CHECK(distance == 0.25);
        }
    }
}

/* Those that ask lie at one face of the box and all points at the other: no candidate is where it
 * lies in the box. */
static void
all_candidates_may_lie_in_one_image(void)
{
    enum { POINTS = 60, QUERIES = 12 };
    double         x[2 * POINTS], q[2 * QUERIES];
    harness_random random = {95};
    hs_box         box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    for (int trial = 0; trial < 4; trial++) {
        for (int p = 0; p < POINTS; p++) {
            x[2 * p] = 0.4375 + 0.05 * random_unit(&random);
            x[2 * p + 1] = 0.1 * random_unit(&random);
        }
        for (int p = 0; p < QUERIES; p++) {
            q[2 * p] = (trial % 2 ? 0.51 : -0.49) + 0.03 * random_unit(&random);
            q[2 * p + 1] = 0.1 * random_unit(&random);
        }
        const brute_scene scene = {.ndim = 2, .n = POINTS, .x = x, .box = &box, .cutoff = 1.0};
        const hs_points   queries = {q, QUERIES, 2, HS_FLOAT64, 16, 8};
        check_columns(&scene, &queries, 3, trial < 2 ? INFINITY : 0.125);
    }
}

/* More groups on one spot than a thread takes at a time. */
static void
eight_thousand_points_may_be_one(void)
{
    enum { POINTS = 8000 };
    static double   x[3 * POINTS];
    hs_counters     counters;
    const hs_points points = {x, POINTS, 3, HS_FLOAT64, 24, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    int64_t         wrong = 0;
    for (int e = 0; e < 3 * POINTS; e++)
        x[e] = 0.25 * (e % 3);
    options.cutoff = INFINITY;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    options.counters = &counters;
    CHECK(hs_nearest_find(AMONG(&points, NULL), 2, &options, &rows, NULL) == HS_OK);
    CHECK(counters.groups == (POINTS + 47) / 48); /* each candidate is met by all of a group */
    CHECK(counters.candidates == 3 * POINTS && counters.pairs == 2 * POINTS);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    const double  *d = hs_pairs_array(rows, HS_WANT_DISTANCE);
    for (int i = 0; i < POINTS; i++) {
        wrong += j[2 * i] != (i == 0) || j[2 * i + 1] != (i < 2 ? 2 : 1);
        wrong += d[2 * i] != 0.0 || d[2 * i + 1] != 0.0;
    }
    CHECK(wrong == 0);
    hs_pairs_free(rows);
}

void
test_nearest_write(void)
{
    RUN(all_candidates_may_lie_in_one_image);
    RUN(eight_thousand_points_may_be_one);
    RUN(each_column_alone_is_the_same);
    RUN(columns_of_extreme_scenes);
    RUN(columns_of_scenes_that_lose_digits);
    RUN(tiny_boxes_are_scaled_ones);
    RUN(images_have_their_shifts);
    RUN(shifts_may_be_too_large);
}
