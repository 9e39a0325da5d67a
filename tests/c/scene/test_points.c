/* SPDX-License-Identifier: BSD-3-Clause */
/* test_points.c: points of any type and stride are read as the numbers they are. */
#include "../../../csrc/core/scene/points.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_points(void);

enum { N = 60 };

/* The points of a scene, N at most, written with this distance between entries; float32 or not. */
static hs_points
written_points(const brute_scene *scene, hs_real real, ptrdiff_t pitch, unsigned char *buffer)
{
    const int d = scene->ndim;
    hs_points points = {buffer, scene->n, d, real, pitch * d, pitch};
    for (int64_t e = 0; e < scene->n * d; e++) {
        const float narrow = (float)scene->x[e];
        memcpy(buffer + e * pitch, real == HS_FLOAT32 ? (const void *)&narrow : &scene->x[e],
               real == HS_FLOAT32 ? sizeof narrow : sizeof(double));
    }
    return points;
}

/* In one to eight dimensions, packed or with gaps: the range and the pairs. */
static void
every_layout_is_the_same_points(void)
{
    static unsigned char buffer[N * HS_MAX_DIM * 11];
    static random_scene  shared;
    harness_random       random = {91};
    for (int trial = 0; trial < TRIALS(160); trial++) {
        const int d = 1 + trial % HS_MAX_DIM;
        make_scene(&random, trial % SCENE_KINDS, d, d > 4 ? 12 : N, 4.0, 0, &shared);
        for (int e = 0; e < N * d; e++) {
            shared.x[e] = (float)shared.x[e];
        }
        const hs_points plain = points_of(&shared.scene);
        hs_options      options = options_of(&shared.scene);
        hs_pairs       *expected = NULL;
        double          least[HS_MAX_DIM], most[HS_MAX_DIM];
        options.want = HS_WANT_BOTH | HS_WANT_DISTANCE;
        CHECK(hs_pairs_find(AMONG(&plain, shared.scene.box), &options, &expected, NULL) == HS_OK);
        hs_points_range(&plain, least, most);
        for (int layout = 0; layout < 4; layout++) {
            const hs_real   real = layout & 1 ? HS_FLOAT32 : HS_FLOAT64;
            const ptrdiff_t pitch = (layout & 1 ? 4 : 8) + (layout & 2 ? 3 : 0);
            const hs_points points = written_points(&shared.scene, real, pitch, buffer);
            double          lower[HS_MAX_DIM], upper[HS_MAX_DIM];
            hs_pairs       *found = NULL;
            CHECK(hs_pairs_find(AMONG(&points, shared.scene.box), &options, &found, NULL) == HS_OK);
            CHECK(same_array(expected, found, HS_WANT_BOTH, 16));
            CHECK(same_array(expected, found, HS_WANT_DISTANCE, 8));
            hs_points_range(&points, lower, upper);
            for (int k = 0; k < d; k++) {
                CHECK(lower[k] == least[k] && upper[k] == most[k]);
            }
            hs_pairs_free(found);
        }
        hs_pairs_free(expected);
    }
}

/* Where float32 and float64 compute without rounding, every precision gives the exact pairs. */
static void
precisions_agree_where_nothing_is_rounded(void)
{
    static random_scene shared;
    harness_random      random = {19};
    int64_t             n_pairs = 0;
    for (int trial = 0; trial < 120; trial++) {
        const int d = 1 + trial % 4;
        hs_pairs *expected = NULL;
        make_scene(&random, trial % 2 ? SCENE_OPEN : SCENE_ALIGNED, d, N, 4.0, 0, &shared);
        for (int e = 0; e < N * d; e++) {
            shared.x[e] = random_below(&random, 33) * 0.25 - 4.0;
        }
        for (int k = 0; k < d; k++) {
            shared.box.rows[k][k] = 8.0;
        }
        shared.scene.cutoff = 1.25; /* as 0.75 and 1 make */
        const hs_points points = points_of(&shared.scene);
        hs_options      options = options_of(&shared.scene);
        options.want = HS_WANT_BOTH;
        options.sorted = true;
        CHECK(hs_pairs_find(AMONG(&points, shared.scene.box), &options, &expected, NULL) == HS_OK);
        for (int precision = HS_DOUBLE; precision <= HS_SINGLE; precision++) {
            hs_pairs *found = NULL;
            options.precision = (hs_precision)precision;
            CHECK(hs_pairs_find(AMONG(&points, shared.scene.box), &options, &found, NULL) == HS_OK);
            CHECK(same_array(expected, found, HS_WANT_BOTH, 16));
            hs_pairs_free(found);
        }
        n_pairs += hs_pairs_length(expected);
        hs_pairs_free(expected);
    }
    CHECK(n_pairs > 10000);
}

static void
copies_of_finite_points_name_the_first_that_is_not(void)
{
    double          rows[6], given[6] = {0.0, 1.0, 2.0, 3.0, 4.0, 5.0};
    const hs_points points = {.data = given,
                              .n = 3,
                              .ndim = 2,
                              .real = HS_FLOAT64,
                              .row_stride = 2 * (ptrdiff_t)sizeof(double),
                              .column_stride = sizeof(double)};
    hs_failure      failure = {.row = -1, .column = -1};
    CHECK(hs_points_copy_finite(&points, rows, &failure) == HS_OK);
    CHECK(failure.row == -1 && memcmp(rows, given, sizeof rows) == 0);
    given[3] = -INFINITY;
    given[4] = NAN;
    CHECK(hs_points_copy_finite(&points, rows, &failure) == HS_ERR_NOT_FINITE);
    CHECK(failure.row == 1 && failure.column == 1 && failure.value == -INFINITY);
}

void
test_points(void)
{
    RUN(every_layout_is_the_same_points);
    RUN(precisions_agree_where_nothing_is_rounded);
    RUN(copies_of_finite_points_name_the_first_that_is_not);
}
