/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_box_skew.c: boxes that are equivalent to an upright one, by so many of its vectors that
 * shifts over the vectors as given pass int32, 2^53 and int64: the same pairs, or a status that
 * says so.
 */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_box_skew(void);

enum { N = 12 };

/* Rows (1, 0) and (times + tilt, 1), which is a combination of (1, 0) and (tilt, 1). */
static hs_box
skewed(double times, double tilt)
{
    return (hs_box){.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {times + tilt, 1.0}}};
}

static void
make_points(harness_random *random, double *x)
{
    for (int e = 0; e < 2 * N; e++)
        x[e] = random_unit(random) - 0.5;
}

static bool
is_refusal(hs_status status)
{
    return status == HS_ERR_SHIFT_RANGE || status == HS_ERR_BOX_SKEWED;
}

/* Sorted by (i, j); within an ulp or two, for the vectors are those of other numbers. */
static bool
same_pairs(const found_pairs *a, const found_pairs *b)
{
    bool same = a->n == b->n;
    for (int64_t e = 0; same && e < a->n; e++)
        same = a->i[e] == b->i[e] && a->j[e] == b->j[e];
    return same;
}

/* What needs no S is found; S is right where it fits. */
static void
check_pairs(const brute_scene *scene, const hs_box *upright, double times, bool sorted)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    found_pairs     found = {0}, expected = {0};
    hs_failure      failure;
    int64_t         count = -1, expected_count = -2;
    CHECK(hs_pairs_count(AMONG(&points, upright), &options, &expected_count, NULL) == HS_OK);
    const hs_status counted =
        hs_pairs_count(AMONG(&points, scene->box), &options, &count, &failure);
    CHECK(counted == HS_OK ? count == expected_count : is_refusal(counted));
    options.sorted = sorted;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR;
    hs_status status = search_pairs(&points, scene->box, &options, &found, &failure);
    CHECK(status == HS_OK || is_refusal(status));
    CHECK(search_pairs(&points, upright, &options, &expected, NULL) == HS_OK);
    CHECK(status != HS_OK || found.n == expected.n);
    CHECK(status != HS_OK || !sorted || same_pairs(&found, &expected));
    found_free(&found);
    found_free(&expected);
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    options.sorted = true;
    status = search_pairs(&points, scene->box, &options, &found, &failure);
    CHECK(search_pairs(&points, upright, &options, &expected, NULL) == HS_OK);
    bool fits = true, right = true;
    for (int64_t e = 0; e < expected.n; e++) {
        const double first = expected.shift[2 * e] - times * expected.shift[2 * e + 1];
        fits = fits && first >= INT32_MIN && first <= INT32_MAX;
    }
    CHECK(fits ? status == HS_OK || is_refusal(status) : is_refusal(status));
    CHECK(status != HS_OK || found.n == expected.n);
    for (int64_t e = 0; status == HS_OK && e < found.n; e++)
        right = right && fabs(found.shift[2 * e] + times * found.shift[2 * e + 1]) < 64.0;
    CHECK(right);
    found_free(&found);
    found_free(&expected);
}

static void
check_rows(const brute_scene *scene, const hs_box *upright)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *rows = NULL, *expected = NULL;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    for (int queries = 0; queries < 2; queries++) {
        const hs_points *asking = queries ? &points : NULL;
        hs_status        status =
            hs_neighbors_find(QUERIED(&points, asking, scene->box), &options, &rows, NULL);
        CHECK(status == HS_OK || is_refusal(status));
        if (status == HS_OK) {
            CHECK(hs_neighbors_find(QUERIED(&points, asking, upright), &options, &expected, NULL) ==
                  HS_OK);
            CHECK(same_array(rows, expected, HS_WANT_J, 8));
            hs_pairs_free(expected);
        }
        hs_pairs_free(rows);
        status = hs_nearest_find(QUERIED(&points, asking, scene->box), 70, &options, &rows, NULL);
        CHECK(status == HS_OK || is_refusal(status));
        if (status == HS_OK) {
            CHECK(hs_nearest_find(QUERIED(&points, asking, upright), 70, &options, &expected,
                                  NULL) == HS_OK);
            CHECK(same_array(rows, expected, HS_WANT_J, 8));
            hs_pairs_free(expected);
        }
        hs_pairs_free(rows);
    }
}

static void
equivalent_boxes_have_the_same_pairs(void)
{
    harness_random random = {1};
    double         x[2 * N];
    for (int trial = 0; trial < 4; trial++) {
        const double tilt = trial % 2 ? 0.375 : 0.0;
        const hs_box upright = skewed(0.0, tilt);
        make_points(&random, x);
        for (int i = 0; i < N && trial & 1; i++) /* turned by up to 20 vectors */
            x[2 * i + 1] += random_below(&random, 41) - 20.0;
        for (int exponent = 1; exponent <= 62; exponent += exponent < 48 ? 5 : 1) {
            const double times = ldexp(trial < 2 ? 1.0 : -1.0, exponent);
            const hs_box box = skewed(times, tilt);
            if (box.rows[1][0] - times != tilt)
                continue;
            brute_scene scene = {.ndim = 2, .n = N, .x = x, .box = &box, .inclusive = true};
            scene.cutoff = trial % 3 ? 1.25 : 4.5;
            check_pairs(&scene, &upright, times, trial & 1);
            check_rows(&scene, &upright);
        }
    }
}

/* Points far away along the skewed vector: wrapping passes the range first. */
static void
far_points_pass_the_range(void)
{
    harness_random random = {2};
    double         x[2 * N];
    make_points(&random, x);
    for (int exponent = 10; exponent <= 51; exponent++) {
        const hs_box box = skewed(0x1p45, 0.125);
        brute_scene  scene = {.ndim = 2, .n = N, .x = x, .box = &box, .cutoff = 0.75};
        hs_points    points = points_of(&scene);
        hs_options   options = options_of(&scene);
        hs_pairs    *rows = NULL;
        hs_failure   failure;
        int64_t      count = -1;
        x[5] = ldexp(1.0, exponent);
        x[6] = -ldexp(1.0, exponent);
        const hs_status status = hs_pairs_count(AMONG(&points, &box), &options, &count, &failure);
        CHECK(status == HS_OK || is_refusal(status));
        CHECK(exponent > 12 || status == HS_OK);
        CHECK(exponent < 30 || is_refusal(status));
        options.want = HS_WANT_J;
        const hs_status nearest =
            hs_nearest_find(AMONG(&points, &box), 3, &options, &rows, &failure);
        CHECK(nearest == HS_OK || is_refusal(nearest));
        hs_pairs_free(rows);
    }
}

/* Each is within a unit in the last place of the same number. */
static bool
same_distances(const hs_pairs *a, const hs_pairs *b)
{
    const double *one = hs_pairs_array(a, HS_WANT_DISTANCE);
    const double *other = hs_pairs_array(b, HS_WANT_DISTANCE);
    bool          same = hs_pairs_length(a) == hs_pairs_length(b);
    for (int64_t e = 0; same && e < hs_pairs_length(a); e++)
        same = one[e] == other[e] ||
               fabs(one[e] - other[e]) <= 2.0 * (nextafter(one[e], INFINITY) - one[e]);
    return same;
}

/* Shifts beyond 2^53, which batch kernels do not take: points that are so many vectors apart. */
static void
shifts_beyond_float64(void)
{
    enum { MANY = 60 };
    harness_random random = {7};
    double         x[2 * MANY];
    for (int trial = 0; trial < 12; trial++) {
        const double    tilt = 0.125, times = trial % 2 ? 0x1p49 : -0x1p49;
        const hs_box    box = skewed(times, tilt), upright = skewed(0.0, tilt);
        brute_scene     scene = {.ndim = 2, .n = MANY, .x = x, .box = &box, .inclusive = true};
        const hs_points points = points_of(&scene);
        scene.cutoff = trial % 3 ? 1.25 : 0.25;
        for (int i = 0; i < MANY; i++) {
            x[2 * i] = 0.25 * random_below(&random, 8);
            x[2 * i + 1] = 0.25 * random_below(&random, 8) + 1000.0 * (i % 3 - 1);
        }
        for (int full = 0; full < 2; full++) {
            hs_options options = options_of(&scene);
            hs_pairs  *skew = NULL, *expected = NULL;
            options.want = HS_WANT_J | HS_WANT_DISTANCE;
            for (int of = 0; of < 2; of++) {
                const hs_box   *in = of ? &box : &upright;
                hs_pairs      **rows = of ? &skew : &expected;
                const hs_status status =
                    full ? hs_neighbors_find(AMONG(&points, in), &options, rows, NULL)
                         : hs_nearest_find(AMONG(&points, in), 25, &options, rows, NULL);
                CHECK(status == HS_OK);
            }
            CHECK(same_array(skew, expected, HS_WANT_J, 8));
            /* Images of one point are in the order of their shifts, which are others. */
            CHECK(full || same_distances(skew, expected));
            hs_pairs_free(skew);
            hs_pairs_free(expected);
        }
    }
}

/* Each point is within the range, and their difference is not. */
static void
differences_pass_the_range(void)
{
    double x[8] = {0.0, 0x1.8p16, 0.0, -0x1.8p16, 0.25, 0x1.8p16, 0.25, -0x1.8p16};
    for (int trial = 0; trial < 3; trial++) {
        const hs_box    box = skewed(0x1p45, trial == 2 ? 0.0 : 0.125);
        brute_scene     scene = {.ndim = 2, .n = 4, .x = x, .box = &box, .cutoff = 0.75};
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        hs_pairs       *rows = NULL;
        hs_failure      failure;
        int64_t         count = -1;
        options.cutoff = trial == 1 ? 0.25 : 0.75; /* 1: some pairs are exactly as far */
        options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
        hs_status status = hs_pairs_find(AMONG(&points, &box), &options, &rows, &failure);
        CHECK(status == HS_OK ? hs_pairs_length(rows) == 6 : is_refusal(status));
        hs_pairs_free(rows);
        status = hs_pairs_count(AMONG(&points, &box), &options, &count, &failure);
        CHECK(status == HS_OK ? count == 6 : is_refusal(status));
        for (int64_t k = 1; k < 200; k = 3 * k + 1) {
            options.cutoff = k == 4 ? 0.25 : INFINITY;
            options.want = HS_WANT_J | HS_WANT_DISTANCE;
            status = hs_nearest_find(AMONG(&points, &box), k, &options, &rows, &failure);
            CHECK(status == HS_OK || is_refusal(status));
            CHECK(trial == 2 || status != HS_OK);
            hs_pairs_free(rows);
        }
    }
}

/* Independent vectors whose heights are nothing beside their lengths, which no reduction helps. */
static void
nearly_flat_boxes(void)
{
    harness_random random = {3};
    double         x[3 * N];
    for (int trial = 0; trial < 200; trial++) {
        const int   e = random_below(&random, 110), f = random_below(&random, 110);
        hs_box      box = {.ndim = 3, .periodic = {true, true, trial % 3 != 0}};
        brute_scene scene = {.ndim = 3, .n = 6, .x = x, .box = &box, .inclusive = true};
        brute_list  expected;
        for (int l = 0; l < 3; l++) {
            for (int k = 0; k < 3; k++)
                box.rows[l][k] = l == k               ? ldexp(1.0, l == 0   ? 0
                                                                   : l == 1 ? -e
                                                                            : -f)
                                 : k < l || trial % 2 ? random_unit(&random)
                                                      : 0.0;
        }
        for (int k = 0; k < 3 * 6; k++)
            x[k] = random_unit(&random);
        scene.cutoff = 0.5;
        const hs_points points = points_of(&scene);
        hs_options      options = options_of(&scene);
        int64_t         count = -1;
        options.memory_limit = 1e8;
        if (!brute_find(&scene, 1e5, &expected)) {
            hs_plan plan; /* more pairs than are counted here: not refused, or for a reason */
            (void)hs_plan_make(AMONG(&points, &box), &options, &plan, NULL);
            continue;
        }
        const hs_status status = hs_pairs_count(AMONG(&points, &box), &options, &count, NULL);
        CHECK(status == HS_OK ? count == expected.n
                              : status == HS_ERR_BOX_SKEWED || status == HS_ERR_BOX_DEPENDENT);
        brute_free(&expected);
    }
}

void
test_box_skew(void)
{
    RUN(equivalent_boxes_have_the_same_pairs);
    RUN(far_points_pass_the_range);
    RUN(shifts_beyond_float64);
    RUN(differences_pass_the_range);
    RUN(nearly_flat_boxes);
}
