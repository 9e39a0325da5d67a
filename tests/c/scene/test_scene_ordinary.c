/* SPDX-License-Identifier: BSD-3-Clause */
/* test_scene_ordinary.c: scenes that are filled in one go are what others are. */
#include "../../../csrc/core/scene/scene.h"
#include "../support/harness.h"
#include "../support/random_scenes.h"

#include <math.h>

void test_scene_ordinary(void);

static bool
are_equal(const double *a, const double *b, int n)
{
    return memcmp(a, b, (size_t)n * sizeof *a) == 0;
}

/* Scenes without a box are filled in one go where their numbers are ordinary. That makes them what
 * they are in a box that does not repeat, also behind a scene of the same kind. */
static void
ordinary_scenes_are_filled_like_others(void)
{
    enum { N = 20, MOST = 3 };
    static const double cutoffs[] = {0.0, 1.0, 1.0, 1.0, 0x1p-20, 0x1p-21, 0x1p20, 0x1p21, 70.0};
    hs_box              open = {.rows = {{1.0}, {0.0, 1.0}, {0.0, 0.0, 1.0}}};
    harness_random      random = {97};
    hs_options          options = hs_options_default();
    hs_account          account;
    static hs_scene     scene, other;
    int                 n_ordinary = 0;
    scene.is_ordinary = false;
    hs_account_init(&account, &options);
    for (int trial = 0; trial < 400; trial++) {
        double     x[N * MOST];
        hs_failure failure;
        const int  D = trial % 5 == 3 ? 2 : 3; /* then the scene before is of no use */
        /* the largest: from 2^-40 to 2^60, or 0 */
        const double size = trial % 50 == 0 ? 0.0 : ldexp(1.0, trial % 100 - 40);
        for (int e = 0; e < N * D; e++)
            x[e] = size * (2.0 * random_unit(&random) - 1.0);
        const hs_points points = {x, N, D, HS_FLOAT64, D * 8, 8};
        open.ndim = D;
        const hs_sets sets = {.points = &points, .follows = trial > 0};
        options.cutoff = cutoffs[trial % 9];
        options.inclusive = trial < 200;
        scene.is_ordinary = scene.is_ordinary && trial != 200; /* the options are others */
        options.precision = trial % 7 == 0 ? HS_DOUBLE : HS_EXACT;
        CHECK(hs_scene_init_sets(&account, NULL, &sets, NULL, &options, &scene, NULL, &failure) ==
              HS_OK);
        CHECK(hs_scene_init(&account, NULL, &points, &open, &options, &other, &failure) == HS_OK);
        n_ordinary += scene.is_ordinary;
        if (!scene.is_ordinary) { /* a box, too, may be scaled where points are far apart */
            hs_scene_free(&account, &other);
            hs_scene_free(&account, &scene);
            continue;
        }
        CHECK(!other.is_ordinary && scene.sought == other.sought);
        CHECK(scene.scale.exponent == other.scale.exponent && scene.extreme == other.extreme);
        CHECK(scene.unscale.exponent == -scene.scale.exponent);
        CHECK(scene.cutoff == other.cutoff && scene.cutoff_low == other.cutoff_low);
        CHECK(scene.radius == other.radius && scene.formula_error == other.formula_error);
        CHECK(scene.x_error == other.x_error && are_equal(scene.t_error, other.t_error, D));
        CHECK(are_equal(scene.lower, other.lower, D) && are_equal(scene.upper, other.upper, D));
        CHECK(are_equal(scene.x_largest, other.x_largest, D));
        CHECK(scene.keeps_originals == other.keeps_originals && !scene.turns.known);
        CHECK(scene.lattice.n_periodic == 0 && scene.lattice.aligned);
        CHECK(scene.lattice.ndim == D && scene.metric.ndim == D);
        CHECK(scene.metric.cutoff == other.metric.cutoff &&
              scene.metric.inclusive == other.metric.inclusive &&
              scene.metric.sure_in == other.metric.sure_in &&
              scene.metric.sure_out == other.metric.sure_out);
        for (int k = 0; k < D; k++)
            CHECK(are_equal(scene.cloud.x[k], other.cloud.x[k], N));
        hs_scene_free(&account, &other);
        hs_scene_free(&account, &scene);
    }
    CHECK(n_ordinary > 50 && n_ordinary < 350);
    hs_account_close(&account);
}

void
test_scene_ordinary(void)
{
    RUN(ordinary_scenes_are_filled_like_others);
}
