/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_precision.c: precision "single" and "double" on numbers that they hold exactly, where their
 * answers are those of the real numbers; and what they must not do: flush, or decide again.
 */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_precision(void);

/* All pairs, with S, against the brute force. */
static bool
is_like_brute_force(const brute_scene *scene, hs_precision precision, const char *kernel)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    found_pairs     found;
    brute_list      expected;
    int64_t         count = -1;
    CHECK(brute_find(scene, 1e7, &expected));
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    options.sorted = true;
    options.precision = precision;
    options.kernel = kernel;
    bool right = search_pairs(&points, scene->box, &options, &found, NULL) == HS_OK &&
                 found.n == expected.n;
    for (int64_t e = 0; right && e < found.n; e++)
        right = pair_matches(scene, &expected.pairs[e], &found, e);
    right = right && hs_pairs_count(AMONG(&points, scene->box), &options, &count, NULL) == HS_OK &&
            count == expected.n;
    found_free(&found);
    brute_free(&expected);
    return right;
}

/* Quarters in boxes of whole numbers: float32 holds all differences, squares and sums. */
static void
small_fractions_are_exact(void)
{
    enum { N = 150 };
    const double   cutoffs[] = {0.25, 0.75, 1.25, 1.5, 3.25};
    harness_random random = {32};
    static double  x[3 * N];
    const char    *names[16];
    const int      n_names = hs_kernel_names(names, 16);
    int64_t        wrong = 0;
    for (int trial = 0; trial < TRIALS(120); trial++) {
        const int   ndim = 1 + trial % 3;
        hs_box      box = {.ndim = ndim};
        brute_scene scene = {.ndim = ndim, .n = N, .x = x, .cutoff = cutoffs[trial / 3 % 5]};
        scene.inclusive = trial & 1;
        scene.box = trial % 4 ? &box : NULL;
        for (int k = 0; k < ndim; k++) {
            box.periodic[k] = trial % 4 == 1 || k == 0;
            box.rows[k][k] = 8.0;
        }
        for (int e = 0; e < ndim * N; e++)
            x[e] = 0.25 * random_below(&random, 32);
        for (int precision = HS_EXACT; precision <= HS_SINGLE; precision++)
            wrong += !is_like_brute_force(&scene, (hs_precision)precision,
                                          names[random_below(&random, n_names)]);
    }
    CHECK(wrong == 0);
}

/* Differences whose squares are subnormal float32, again and again: flushed to zero they would be
 * beyond no cutoff, and here each of them decides. */
static void
single_does_not_flush(void)
{
    enum { CLUSTERS = 60, EACH = 12, N = CLUSTERS * EACH };
    static double  x[2 * N];
    harness_random random = {3};
    for (int fine = 0; fine < 2; fine++) {
        brute_scene scene = {.ndim = 2, .n = N, .x = x, .inclusive = true};
        scene.cutoff = 1.0;
        for (int i = 0; i < N; i++) {
            for (int k = 0; k < 2; k++)
                x[2 * i + k] = 0x1p-66 * random_below(&random, 8);
            x[2 * i] += fine ? 0.0 : 16.0 * (i / EACH);
        }
        CHECK(is_like_brute_force(&scene, HS_SINGLE, NULL));
        CHECK(is_like_brute_force(&scene, HS_EXACT, NULL));
    }
}

/* Cutoff 0, where only equal points count, if these; and scales beyond float64's squares. */
static void
cutoff_zero_and_ends_of_the_range(void)
{
    enum { N = 60 };
    const int      exponents[] = {0, -1060, -600, 600, 1015};
    harness_random random = {4};
    double         x[2 * N];
    for (int trial = 0; trial < 120; trial++) {
        const int   exponent = exponents[trial % 5];
        brute_scene scene = {.ndim = 2, .n = N, .x = x, .inclusive = trial & 1};
        scene.cutoff = ldexp(trial % 3 ? 5.0 : 0.0, exponent);
        for (int e = 0; e < 2 * N; e++)
            x[e] = ldexp(random_below(&random, 9) - 4.0, exponent);
        for (int precision = HS_EXACT; precision <= HS_DOUBLE; precision++)
            CHECK(is_like_brute_force(&scene, (hs_precision)precision, NULL));
    }
}

/* Points so far away that float64 cannot tell one image from the next: the farthest is named. */
static void
double_names_the_farthest(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.0, 1.0}}};
    double       x[8] = {0.5, 0.5, 0.25, 0x1p60, 0x1p60, 0.0, 0.0, 0.0};
    double       q[4] = {0.0, 0.0, -0x1p61, 0.0};
    hs_points    points = {x, 4, 2, HS_FLOAT64, 16, 8}, queries = {q, 2, 2, HS_FLOAT64, 16, 8};
    hs_options   options = hs_options_default();
    hs_failure   failure;
    int64_t      count = -1;
    options.cutoff = 0.25;
    options.precision = HS_DOUBLE;
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, &failure) == HS_ERR_ROUNDING);
    CHECK(failure.row == 1 && !failure.in_queries && count == -1);
    CHECK(hs_pairs_count(QUERIED(&points, &queries, &box), &options, &count, &failure) ==
          HS_ERR_ROUNDING);
    CHECK(failure.row == 1 && failure.in_queries);
    q[2] = 1.0;
    CHECK(hs_pairs_count(QUERIED(&points, &queries, &box), &options, &count, &failure) ==
          HS_ERR_ROUNDING);
    CHECK(failure.row == 1 && !failure.in_queries);
    x[0] = 0x1p60; /* as far as the next two: the first is named */
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, &failure) == HS_ERR_ROUNDING);
    CHECK(failure.row == 0);
    x[0] = 0.5;
    options.precision = HS_EXACT;
    CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, &failure) == HS_OK && count == 3);
}

/* Whole numbers: in each neighbourhood hundreds of pairs are exactly as far as the cutoff. */
static void
many_ties_are_decided(void)
{
    enum { SIDE = 14, N = SIDE * SIDE * SIDE };
    static double x[3 * N];
    hs_box        box = {.ndim = 3,
                         .periodic = {true, true, true},
                         .rows = {{SIDE, 0, 0}, {0, SIDE, 0}, {0, 0, SIDE}}};
    for (int i = 0; i < N; i++) {
        x[3 * i] = i % SIDE;
        x[3 * i + 1] = i / SIDE % SIDE;
        x[3 * i + 2] = i / SIDE / SIDE;
    }
    brute_scene     scene = {.ndim = 3, .n = N, .x = x, .box = &box, .cutoff = 5.0};
    const hs_points points = points_of(&scene);
    for (int trial = 0; trial < 8; trial++) {
        hs_options options = options_of(&scene);
        int64_t    count = -1, expected = 0;
        box.rows[1][0] = trial & 2 ? SIDE : 0.0; /* an equivalent box, one that is reduced */
        options.inclusive = trial & 1;
        options.precision = trial & 4 ? HS_DOUBLE : HS_EXACT;
        for (int c = 0; c < 11 * 11 * 11; c++) {
            const int a = c % 11 - 5, b = c / 11 % 11 - 5, e = c / 121 - 5;
            const int square = a * a + b * b + e * e;
            expected += square > 0 && square < 25 + options.inclusive;
        }
        CHECK(hs_pairs_count(AMONG(&points, &box), &options, &count, NULL) == HS_OK);
        CHECK(count == expected / 2 * N);
    }
}

void
test_precision(void)
{
    RUN(small_fractions_are_exact);
    RUN(single_does_not_flush);
    RUN(cutoff_zero_and_ends_of_the_range);
    RUN(double_names_the_farthest);
    RUN(many_ties_are_decided);
}
