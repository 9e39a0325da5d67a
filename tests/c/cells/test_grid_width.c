/* SPDX-License-Identifier: BSD-3-Clause */
/* test_grid_width.c: how wide cells are, and where their faces lie, changes no answer. */
#include "../support/harness.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_grid_width(void);

static random_scene shared;

/* The status of a search with such cells, and its sorted pairs. */
static hs_status
find(const brute_scene *scene, double cell_size, hs_pairs **pairs)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    options.want = HS_WANT_BOTH | HS_WANT_SHIFT;
    options.sorted = true;
    options.cell_size = cell_size;
    return hs_pairs_find(AMONG(&points, scene->box), &options, pairs, NULL);
}

/* Whether all sizes of cells give the same pairs; *n_pairs becomes more by them. */
static bool
sizes_agree(const brute_scene *scene, const double *sizes, int n_sizes, int64_t *n_pairs)
{
    hs_pairs *first = NULL;
    bool      same = find(scene, 0.0, &first) == HS_OK;
    for (int s = 0; same && s < n_sizes; s++) {
        hs_pairs *pairs = NULL;
        same = find(scene, sizes[s], &pairs) == HS_OK &&
               same_array(first, pairs, HS_WANT_BOTH, 16) &&
               same_array(first, pairs, HS_WANT_SHIFT, 4 * (size_t)scene->ndim);
        hs_pairs_free(pairs);
    }
    *n_pairs += same ? hs_pairs_length(first) : 0;
    hs_pairs_free(first);
    return same;
}

static void
any_size_of_cells_gives_the_same_pairs(void)
{
    harness_random random = {90210};
    int64_t        n_pairs = 0;
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const int d = 1 + trial % HS_MAX_DIM;
        make_scene(&random, trial % SCENE_KINDS, d, random_below(&random, d > 3 ? 12 : 150), 4.0,
                   trial % 5 == 4 ? 900 : 0, &shared);
        shared.scene.cutoff *= d > 3 ? 0.5 : 1.0;
        const double c = shared.scene.cutoff;
        const double sizes[] = {c, 0.3 * c, 0.01 * c, 1e-300, c * (1.0 + 1e-13), 2.0 * c, 0x1p1000};
        CHECK(sizes_agree(&shared.scene, sizes, 7, &n_pairs));
    }
    CHECK(n_pairs > TRIALS(50000));
}

/* In many dimensions small cells have more neighbours than are worth a list: they become larger. */
static void
small_cells_of_many_dimensions_are_made_larger(void)
{
    harness_random random = {66};
    int64_t        n_pairs = 0;
    for (int d = 5; d <= 7; d++) {
        make_scene(&random, SCENE_OPEN, d, SCENE_POINTS, 1.0, 0, &shared);
        for (int e = 0; e < SCENE_POINTS * d; e++) {
            shared.x[e] = random_unit(&random);
        }
        shared.scene.cutoff = 0.6;
        const double sizes[] = {0.3, 0.2, 0.1, 0.01};
        CHECK(sizes_agree(&shared.scene, sizes, 4, &n_pairs));
    }
    CHECK(n_pairs > 1000);
}

static void
small_cells_of_many_points_are_made_larger(void)
{
    enum { N = 5000 };
    static double  x[6 * N];
    harness_random random = {67};
    brute_scene    scene = {.ndim = 6, .n = N, .x = x, .cutoff = 0.35};
    int64_t        n_pairs = 0;
    const double   sizes[] = {0.35, 0.1};
    for (int e = 0; e < 6 * N; e++) {
        x[e] = random_unit(&random);
    }
    CHECK(sizes_agree(&scene, sizes, 2, &n_pairs) && n_pairs > 1000);
}

/* Boxes so short that a cutoff passes more images than are counted are refused with any cells. */
static void
endless_images_are_refused_with_any_cells(void)
{
    static const double lengths[] = {1e-9, 1e-11, 1e-30, 0x1p-1000};
    double              x[4] = {0.0, 0.0, 0.1, 0.1};
    for (int l = 0; l < 4; l++) {
        hs_box      box = {.ndim = 2, .periodic = {true, false}, .rows = {{lengths[l], 0.0}}};
        brute_scene scene = {.ndim = 2, .n = 2, .x = x, .box = &box, .cutoff = 10.0};
        for (double size = 1.0; size > 1e-40; size *= 1e-8) {
            const hs_points points = points_of(&scene);
            hs_options      options = options_of(&scene);
            hs_plan         plan;
            options.cell_size = 0.0;
            const hs_status without = hs_plan_make(AMONG(&points, &box), &options, &plan, NULL);
            options.cell_size = size;
            CHECK(hs_plan_make(AMONG(&points, &box), &options, &plan, NULL) == without);
            CHECK(without == HS_OK || without == HS_ERR_MEMORY);
            CHECK(l == 0 || without == HS_ERR_MEMORY);
        }
    }
}

/* Boxes of whole multiples of the cutoff, or one rounding beside: cells just as wide as it is. */
static void
faces_at_multiples_of_the_cutoff_lose_no_pair(void)
{
    harness_random random = {1234};
    int64_t        n_pairs = 0;
    for (int trial = 0; trial < TRIALS(400); trial++) {
        const int d = 1 + trial % 3, kind = trial % 2 ? SCENE_OPEN : SCENE_ALIGNED;
        make_scene(&random, kind, d, 300, 4.0, 0, &shared);
        const double length = random_below(&random, 2) ? 1.0 : 0.5 + random_unit(&random);
        const int    parts = 2 + random_below(&random, d == 1 ? 60 : 9);
        const double lower = random_below(&random, 2) ? 0.0 : random_unit(&random) - 0.5;
        double       cutoff = length / parts;
        for (int step = random_below(&random, 5) - 2; step != 0; step += step < 0 ? 1 : -1) {
            cutoff = nextafter(cutoff, step < 0 ? 0.0 : 1.0);
        }
        for (int e = 0; e < 300 * d; e++) { /* many on the faces of cells */
            const double place = random_below(&random, 3) ? random_unit(&random)
                                                          : random_below(&random, 64) / 64.0;
            shared.x[e] = lower + length * place;
            shared.x[e] = e < d ? lower : e < 2 * d ? lower + length : shared.x[e];
        }
        for (int k = 0; k < d; k++) {
            shared.box.rows[k][k] = length;
        }
        shared.scene.cutoff = cutoff * (trial % 4 ? 1 : random_below(&random, 3) + 1);
        shared.scene.inclusive = random_below(&random, 2);
        const double sizes[] = {shared.scene.cutoff, 0.7 * shared.scene.cutoff};
        CHECK(sizes_agree(&shared.scene, sizes, 2, &n_pairs));
    }
    CHECK(n_pairs > TRIALS(100000));
}

/* -n: so many threads, where there are points enough for them. */
static void
few_points_are_not_worth_a_thread(void)
{
    static double x[HS_POINTS_FOR_THREADS];
    hs_options    options = hs_options_default();
    hs_points     points = {x, HS_POINTS_FOR_THREADS, 1, HS_FLOAT64, 8, 8};
    hs_plan       plan;
    for (int i = 0; i < HS_POINTS_FOR_THREADS; i++) {
        x[i] = i;
    }
    options.cutoff = 0.5;
    for (int threads = -3; threads <= 3; threads++) {
        const int few = threads > 1 ? threads : 1, many = threads < -1 ? -threads : few;
        options.threads = threads;
        points.n = HS_POINTS_FOR_THREADS;
        CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK &&
              plan.threads == many);
        points.n--;
        CHECK(hs_plan_make(AMONG(&points, NULL), &options, &plan, NULL) == HS_OK &&
              plan.threads == few);
    }
}

void
test_grid_width(void)
{
    RUN(any_size_of_cells_gives_the_same_pairs);
    RUN(small_cells_of_many_dimensions_are_made_larger);
    RUN(small_cells_of_many_points_are_made_larger);
    RUN(endless_images_are_refused_with_any_cells);
    RUN(faces_at_multiples_of_the_cutoff_lose_no_pair);
    RUN(few_points_are_not_worth_a_thread);
}
