/* SPDX-License-Identifier: BSD-3-Clause */
/* test_points.c: points of any type and stride are read as the numbers they are. */
#include "../../../csrc/core/scene/points.h"
#include "../support/among.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"

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

void
test_points(void)
{
    RUN(every_layout_is_the_same_points);
}
