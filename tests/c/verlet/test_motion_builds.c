/* SPDX-License-Identifier: BSD-3-Clause */
/* test_motion_builds.c: a list is kept where nothing but what all points share has moved far. */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"

void test_motion_builds(void);

static random_scene shared;

/* How many of `steps` updates build the list anew, each point moving by `by` and a little more. */
static int
count_builds(const double *by, double jitter, int steps)
{
    harness_random random = {1234};
    hs_verlet     *list = hs_verlet_new();
    int            n_builds = 0;
    make_scene(&random, SCENE_TRICLINIC, 3, 200, 4.0, 0, &shared);
    for (int l = 0; l < 3; l++)
        shared.box.periodic[l] = true;
    shared.scene.cutoff = 1.0;
    const hs_points  points = points_of(&shared.scene);
    const hs_options options = options_of(&shared.scene);
    static double    first[3 * SCENE_POINTS];
    memcpy(first, shared.x, sizeof first);
    for (int step = 0; step <= steps; step++) {
        bool rebuilt = false;
        CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.4, false, &rebuilt,
                               NULL) == HS_OK);
        n_builds += step > 0 && rebuilt;
        for (int e = 0; e < 3 * 200; e++)
            shared.x[e] = first[e] + (step + 1) * by[e % 3] + jitter * (random_unit(&random) - 0.5);
    }
    hs_verlet_free(list);
    return n_builds;
}

/* Points that were all moved by whole box vectors, or any vector as long, are the same points. */
static void
what_all_points_share_costs_no_build(void)
{
    harness_random random = {77};
    make_scene(&random, SCENE_TRICLINIC, 3, 200, 4.0, 0, &shared);
    for (int trial = 0; trial < 40; trial++) {
        double by[3] = {0.0, 0.0, 0.0};
        for (int l = 0; l < 3; l++) {
            const double times = trial < 8 ? trial >> l & 1 : 3.0 * random_unit(&random) - 1.5;
            for (int k = 0; k < 3; k++)
                by[k] += times * shared.box.rows[l][k];
        }
        CHECK(count_builds(by, 0.1, 4) == 0);
        CHECK(count_builds(by, 1.5, 4) == 4); /* more than half of the skin */
    }
}

void
test_motion_builds(void)
{
    RUN(what_all_points_share_costs_no_build);
}
