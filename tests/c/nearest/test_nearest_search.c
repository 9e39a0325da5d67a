/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_nearest_search.c: rows of nearest points are right where groups, ranges of them, images and
 * ties are at their limits, and refused beyond these.
 */
#include "../support/harness.h"
#include "../support/nearest_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_nearest_search(void);

/* Leaves of one spot are larger than groups, and need ranges of their own. */
static void
spots_are_searched_in_parts(void)
{
    enum { N = 12000, SPOTS = 3 };
    double         *x = array_of(2 * N, sizeof *x);
    const hs_points points = {x, N, 2, HS_FLOAT64, 16, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    int64_t         wrong = 0;
    for (int i = 0; i < N; i++) {
        x[2 * i] = i % SPOTS;
        x[2 * i + 1] = 0.5;
    }
    options.cutoff = INFINITY;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    CHECK(hs_nearest_find(AMONG(&points, NULL), 2, &options, &rows, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    const double  *d = hs_pairs_array(rows, HS_WANT_DISTANCE);
    for (int64_t i = 0; i < N; i++) {
        /* The two least numbers of the same spot that are not the point's own. */
        const int64_t first = i % SPOTS, second = first + SPOTS, third = second + SPOTS;
        wrong += j[2 * i] != (i == first ? second : first) || d[2 * i] != 0.0;
        wrong += j[2 * i + 1] != (i == first || i == second ? third : second);
        wrong += d[2 * i + 1] != 0.0;
    }
    CHECK(wrong == 0);
    hs_pairs_free(rows);
    free(x);
}

/* Points that one box vector apart are the same in X, and are not as given. */
static void
points_that_wrapping_makes_equal(void)
{
    static double x[2 * 60];
    hs_box        box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0.5, 1.0}}};
    brute_scene   scene = {.ndim = 2, .n = 60, .x = x, .box = &box, .cutoff = 1.0};
    for (int i = 0; i < 60; i++) {
        x[2 * i] = i % 20 + 0.25;
        x[2 * i + 1] = 0.25 * (i / 20);
    }
    for (int64_t k = 1; k < 100; k += 14) {
        CHECK(compare_rows(&scene, -1, k, 1) > 0);
        CHECK(compare_rows(&scene, 20, k, 1) > 0);
    }
}

/* A query so far from points that repeat that more images than memory holds are about as near. */
static void
too_many_images_are_refused(void)
{
    const double    x[4] = {0.0, 0.0, 0.25, 0.0};
    const hs_box    box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0, 0.0}, {0.0, 1.0}}};
    const hs_points points = {x, 2, 2, HS_FLOAT64, 16, 8};
    hs_options      options = hs_options_default();
    options.cutoff = INFINITY;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    for (int exponent = 20; exponent <= 900; exponent += 440) {
        const double    far[2] = {0.0, ldexp(1.0, exponent)};
        const hs_points query = {far, 1, 2, HS_FLOAT64, 16, 8};
        hs_pairs       *rows = NULL;
        const hs_status status =
            hs_nearest_find(QUERIED(&points, &query, &box), 1, &options, &rows, NULL);
        CHECK(status == (exponent <= 20 ? HS_OK : HS_ERR_MEMORY));
        if (status == HS_OK) {
            CHECK(((const int64_t *)hs_pairs_array(rows, HS_WANT_J))[0] == 0);
            CHECK(((const double *)hs_pairs_array(rows, HS_WANT_DISTANCE))[0] == far[1]);
        }
        hs_pairs_free(rows);
    }
}

/* More entries than memory holds, or numbers count. */
static void
too_many_neighbours_are_refused(void)
{
    const double    x[2] = {0.0, 0.25};
    const hs_box    box = {.ndim = 1, .periodic = {true}, .rows = {{1.0}}};
    const hs_points points = {x, 2, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    hs_pairs       *rows = NULL;
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    options.memory_limit = 1e6;
    for (int exponent = 20; exponent <= 62; exponent += 42)
        CHECK(hs_nearest_find(AMONG(&points, &box), INT64_C(1) << exponent, &options, &rows,
                              NULL) == HS_ERR_MEMORY);
    options.kernel = "none";
    CHECK(hs_nearest_find(AMONG(&points, &box), 1, &options, &rows, NULL) == HS_ERR_KERNEL);
    CHECK(rows == NULL);
}

/* Scales in one search that are far apart: clusters that are nothing beside their distances. */
static void
clusters_of_all_sizes(void)
{
    enum { N = 120 };
    static double  x[2 * N];
    harness_random random = {12};
    for (int trial = 0; trial < 30; trial++) {
        hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0, 0.0}, {3.0, 7.0}}};
        brute_scene scene = {.ndim = 2, .n = N, .x = x, .cutoff = 0.5};
        scene.box = trial % 3 ? &box : NULL;
        for (int i = 0; i < N; i++) {
            const int spread = -random_below(&random, trial % 2 ? 60 : 20);
            for (int k = 0; k < 2; k++)
                x[2 * i + k] = ldexp(random_unit(&random) - 0.5, spread) + i % 3;
        }
        CHECK(compare_rows(&scene, trial % 5 ? -1 : 40, 1 + random_below(&random, 20), 1) > 0);
    }
}

/* Where all that are wanted are within the cutoff, rows are the same without one. */
static void
check_unlimited(const brute_scene *scene, int64_t k)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *limited = NULL, *unlimited = NULL;
    options.want = HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_SHIFT;
    CHECK(hs_nearest_find(AMONG(&points, scene->box), k, &options, &limited, NULL) == HS_OK);
    options.cutoff = INFINITY;
    CHECK(hs_nearest_find(AMONG(&points, scene->box), k, &options, &unlimited, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(limited, HS_WANT_J);
    const int64_t *of = hs_pairs_array(unlimited, HS_WANT_J);
    const double  *d = hs_pairs_array(limited, HS_WANT_DISTANCE);
    const double  *without = hs_pairs_array(unlimited, HS_WANT_DISTANCE);
    int64_t        wrong = 0;
    for (int64_t e = 0; e < hs_pairs_length(limited); e++)
        wrong += j[e] >= 0 ? j[e] != of[e] || d[e] != without[e]
                           : of[e] >= 0 && without[e] <= scene->cutoff;
    CHECK(wrong == 0);
    hs_pairs_free(limited);
    hs_pairs_free(unlimited);
}

/* Clusters in a box so long that what wrapping rounds is a good part of their size: a radius that
 * should suffice may turn out too small, and floats tell nothing. */
static void
clusters_that_rounding_blurs(void)
{
    enum { N = 90 };
    static double  x[2 * N];
    harness_random random = {13};
    for (int trial = 0; trial < 120; trial++) {
        const int    exponent = 20 + 10 * (trial % 3), fine = exponent - 53 + trial / 3 % 16;
        const double side = ldexp(1.0, exponent), step = ldexp(1.0, fine);
        hs_box       box = {.ndim = 2,
                            .periodic = {true, true},
                            .rows = {{side, 0.0}, {0.375 * side, 0.875 * side}}};
        brute_scene  scene = {.ndim = 2, .n = N, .x = x, .box = &box, .cutoff = 40.0 * step};
        for (int i = 0; i < N; i++) {
            for (int k = 0; k < 2; k++) {
                x[2 * i + k] = 0.3 * side * (i % 3) + step * 20.0 * random_unit(&random);
                x[2 * i + k] += random_below(&random, 3) * box.rows[k][k];
            }
        }
        CHECK(compare_rows(&scene, trial % 4 ? -1 : 30, 1 + random_below(&random, 12), 1) > 0);
        check_unlimited(&scene, 5);
    }
}

/* A hundred thousand points of the lattice of whole numbers, whose nearest are known. */
static void
many_points_on_a_lattice(void)
{
    enum { SIDE = 45, N = SIDE * SIDE * SIDE, K = 6 };
    double    *x = array_of(3 * N, sizeof *x);
    int64_t    wrong = 0;
    hs_options options = hs_options_default();
    hs_pairs  *rows = NULL;
    for (int i = 0; i < N; i++) {
        x[3 * i] = i % SIDE;
        x[3 * i + 1] = i / SIDE % SIDE;
        x[3 * i + 2] = i / SIDE / SIDE;
    }
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    options.cutoff = INFINITY;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    options.threads = 2;
    CHECK(hs_nearest_find(AMONG(&points, NULL), K, &options, &rows, NULL) == HS_OK);
    const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
    const double  *d = hs_pairs_array(rows, HS_WANT_DISTANCE);
    for (int64_t i = 0; i < N; i++) {
        const int steps[] = {-SIDE * SIDE, -SIDE, -1, 1, SIDE, SIDE * SIDE};
        int       n = 0;
        for (int s = 0; s < 6; s++) {
            const int    k = s < 3 ? 2 - s : s - 3;
            const double to = x[3 * i + k] + (s < 3 ? -1.0 : 1.0);
            if (to >= 0.0 && to < SIDE) {
                wrong += j[K * i + n] != i + steps[s] || d[K * i + n] != 1.0;
                n++;
            }
        }
        for (; n < K; n++)
            wrong += d[K * i + n] != sqrt(2.0) ||
                     (d[K * i + n - 1] > 1.0 && j[K * i + n] <= j[K * i + n - 1]);
    }
    CHECK(wrong == 0);
    hs_pairs_free(rows);
    free(x);
}

/* Many dimensions, where each group needs nearly all leaves; and one leaf alone. */
static void
many_leaves_and_few(void)
{
    enum { N = 24000, D = 6 };
    double        *x = array_of(D * N, sizeof *x);
    harness_random random = {14};
    int64_t        wrong = 0;
    hs_options     options = hs_options_default();
    hs_pairs      *rows = NULL;
    for (int e = 0; e < D * N; e++)
        x[e] = random_unit(&random);
    for (int few = 0; few < 2; few++) {
        const hs_points points = {x, few ? 5 : N, D, HS_FLOAT64, 8 * D, 8};
        const hs_points queries = {x, few ? 3000 : 700, D, HS_FLOAT64, 8 * D, 8};
        options.cutoff = INFINITY;
        options.want = HS_WANT_J | HS_WANT_DISTANCE;
        CHECK(hs_nearest_find(QUERIED(&points, &queries, NULL), 2, &options, &rows, NULL) == HS_OK);
        const int64_t *j = hs_pairs_array(rows, HS_WANT_J);
        for (int64_t i = 0; i < queries.n; i += few ? 37 : 23) {
            double  least = INFINITY; /* of all but the point itself */
            int64_t nearest = -1;
            for (int64_t q = 0; q < points.n; q++) {
                double square = 0.0;
                for (int k = 0; k < D; k++)
                    square += (x[D * q + k] - x[D * i + k]) * (x[D * q + k] - x[D * i + k]);
                if (q != i && square < least) {
                    least = square;
                    nearest = q;
                }
            }
            wrong += i < points.n ? j[2 * i] != i || j[2 * i + 1] != nearest : j[2 * i] != nearest;
        }
        hs_pairs_free(rows);
    }
    CHECK(wrong == 0);
    free(x);
}

/* Boxes so long that a ball as large as the density says holds thousands of images of few
 * points. */
static void
long_boxes_have_many_images(void)
{
    static double  x[3 * 120];
    harness_random random = {15};
    for (int e = 0; e < 3 * 120; e++)
        x[e] = random_unit(&random);
    for (int trial = 0; trial < 12; trial++) {
        hs_box      box = {.ndim = 3, .periodic = {true, true, true}};
        brute_scene scene = {.ndim = 3, .n = trial % 2 ? 2 : 120, .x = x, .box = &box};
        scene.cutoff = trial % 2 ? 3.0 : 0.75;
        box.rows[0][0] = box.rows[1][1] = 1.0;
        box.rows[2][2] = trial % 4 < 2 ? 1e6 : 1e15;
        box.rows[1][0] = trial % 3 ? 0.25 : 0.0;
        CHECK(compare_rows(&scene, -1, 10, 1) > 0);
        CHECK(compare_rows(&scene, scene.n / 2, 10, 1) > 0);
        check_unlimited(&scene, 10);
    }
}

void
test_nearest_search(void)
{
    RUN(spots_are_searched_in_parts);
    RUN(points_that_wrapping_makes_equal);
    RUN(too_many_images_are_refused);
    RUN(too_many_neighbours_are_refused);
    RUN(clusters_of_all_sizes);
    RUN(clusters_that_rounding_blurs);
    RUN(many_points_on_a_lattice);
    RUN(many_leaves_and_few);
    RUN(long_boxes_have_many_images);
}
