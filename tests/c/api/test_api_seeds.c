/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_seeds.c: every kind of search against the brute force: of the scenes that fuzzing keeps, of
 * random inputs like them, and of random scenes with as many points as have many cells. */
#define FUZZ_ALL_ANSWERS       1
#define LLVMFuzzerTestOneInput test_pairs_input
#include "../fuzz/fuzz_pairs.c"
#include "../support/harness.h"
#include "../support/kept.h"
#include "../support/random_scenes.h"
#include "../support/seeds.h"

void test_api_seeds(void);

static const char *const seeds[] = {
#include "../fuzz/pairs.txt"
};

enum { PARTS = 4, SEEDS = sizeof seeds / sizeof seeds[0] };

static void
seeds_of_part(int part)
{
    for (int s = part; s < SEEDS; s += PARTS * (IS_SLOW ? 3 : 1))
        run_seed(test_pairs_input, seeds[s]);
    run_random_inputs(test_pairs_input, 400 + (uint64_t)part, TRIALS(100));
}

static void
seeds_of_the_first_part(void)
{
    seeds_of_part(0);
}

static void
seeds_of_the_second_part(void)
{
    seeds_of_part(1);
}

static void
seeds_of_the_third_part(void)
{
    seeds_of_part(2);
}

static void
seeds_of_the_fourth_part(void)
{
    seeds_of_part(3);
}

/* Scenes of every kind of box, with kernels, algorithms and threads in turn. */
static void
check_scenes(int first, int end)
{
    static random_scene s;
    const char         *kernels[16];
    const int           n_kernels = hs_kernel_names(kernels, 16);
    harness_random      random = {20261127 + (uint64_t)first};
    uint64_t            work = 1;
    for (int trial = 0; trial < THIRD_OF_TRIALS(96); trial++) {
        const int  ndim = 1 + trial / SCENE_KINDS % 8;
        const int  n = random_below(&random, ndim > 3 ? 30 : trial % 5 == 0 ? 300 : 80);
        brute_list expected;
        make_scene(&random, ndim > 4 ? SCENE_OPEN : trial % SCENE_KINDS, ndim, n,
                   trial % 4 == 3 ? 40.0 : 4.0, trial % 8 == 7 ? (trial % 16 == 7 ? 300 : -400) : 0,
                   &s);
        if (trial % 5 == 0) /* many cells */
            s.scene.cutoff *= 0.25;
        kernel_to_check = kernels[trial % n_kernels];
        algorithm_to_check = (hs_algorithm)(trial % HS_ALGORITHM_END);
        if (!brute_find(&s.scene, 2e5, &expected))
            continue;
        for (int number = first; number < end; number++) {
            memset(&answer_counters, 0, sizeof answer_counters);
            const char *difference = answer_difference(
                number, &s.scene, &expected, (uint64_t)(trial + number), 1 + expected.n / 50);
            CHECK(difference == NULL);
            work = hash_counters(work, &answer_counters);
            if (difference != NULL)
                fprintf(stderr, "  %s, scene %d: %s\n", answer_checks[number].name, trial,
                        difference);
        }
        brute_free(&expected);
    }
    kernel_to_check = NULL;
    algorithm_to_check = HS_AUTO;
    if (!IS_SLOW) /* fewer scenes */
        check_kept(answer_checks[first].name, 0, work);
}

static void
rows_and_the_nearest(void)
{
    check_scenes(0, 2);
}

static void
histograms_shells_and_clusters(void)
{
    check_scenes(2, 5);
}

static void
streams_and_systems(void)
{
    check_scenes(5, 7);
}

static void
reaches(void)
{
    check_scenes(7, 10);
}

static void
selections_cells_and_lists(void)
{
    check_scenes(10, ANSWER_CHECKS);
}

/* Boxes of whole multiples of the cutoff, or one rounding beside: cells just as wide as it is, with
 * many points on their faces. */
static void
points_on_faces_of_cells(void)
{
    enum { N = 300 };
    static double  x[3 * N];
    harness_random random = {1234};
    for (int trial = 0; trial < TRIALS(120); trial++) {
        const int    d = 1 + trial % 3, parts = 2 + random_below(&random, d == 1 ? 60 : 9);
        const double length = random_below(&random, 2) ? 1.0 : 0.5 + random_unit(&random);
        const double lower = random_below(&random, 2) ? 0.0 : random_unit(&random) - 0.5;
        hs_box       box = {.ndim = d, .periodic = {true, true, true}};
        brute_list   expected;
        brute_scene  scene = {.ndim = d, .n = N, .x = x, .inclusive = random_below(&random, 2)};
        scene.cutoff = steps_from(length / parts, random_below(&random, 5) - 2);
        for (int k = 0; k < d; k++)
            box.rows[k][k] = length;
        scene.box = trial % 2 ? &box : NULL;
        for (int e = 0; e < d * N; e++)
            x[e] = lower + length * (random_below(&random, 3) ? random_below(&random, 64) / 64.0
                                                              : random_unit(&random));
        for (int k = 0; k < d; k++)
            x[k] = lower, x[d + k] = lower + length;
        algorithm_to_check = HS_GRID;
        CHECK(brute_find(&scene, 1e7, &expected));
        CHECK(pairs_difference(&scene, &expected, 50) == NULL);
        brute_free(&expected);
    }
    algorithm_to_check = HS_AUTO;
}

static uint64_t odd_boxes, odd_plans;

/* An input's box, and how its scene would be searched. */
static int
hash_odd_scene(const uint8_t *data, size_t size)
{
    input       in = {data, data + size};
    hs_failure  failure = {.row = -1};
    hs_plan     plan;
    hs_box_axes axes;
    double      heights[8], volume, wrapped[8 * 4] = {0.0}, places[8 * 4] = {0.0};
    int64_t     shift[8 * 4] = {0};
    fuzz_scene  f;
    take_scene(&in, &f);
    f.scene.cutoff = (float)f.scene.cutoff; /* hypot is not the same everywhere */
    const hs_points points = points_of(&f.scene);
    hs_options      options = options_of(&f.scene);
    options.memory_limit = PLAN_LIMIT;
    options.algorithm = (hs_algorithm)(size / 8 % HS_ALGORITHM_END);
    hs_status status = hs_plan_make(AMONG(&points, f.scene.box), &options, &plan, &failure);
    odd_plans = hash_bytes(odd_plans, &status, sizeof status);
    if (status == HS_OK)
        odd_plans = hash_plan(odd_plans, &plan);
    if (f.scene.box == NULL)
        return 0;
    status = hs_box_measure(f.scene.box, heights, &volume, &failure);
    odd_boxes = hash_bytes(odd_boxes, &status, sizeof status);
    for (int l = 0; status == HS_OK && l < f.box.ndim; l++)
        if (f.box.periodic[l])
            odd_boxes = hash_bytes(odd_boxes, &heights[l], sizeof heights[l]);
    if (status == HS_OK)
        odd_boxes = hash_bytes(odd_boxes, &volume, sizeof volume);
    status = hs_box_wrap(f.scene.box, &points, wrapped, shift, &failure);
    odd_boxes = hash_bytes(odd_boxes, &status, sizeof status);
    if (status == HS_OK) {
        odd_boxes = hash_bytes(odd_boxes, wrapped, sizeof wrapped);
        odd_boxes = hash_bytes(odd_boxes, shift, sizeof shift);
    }
    status =
        hs_box_places(f.scene.box, &points, f.scene.cutoff, 0x1p10, places, 8, &axes, &failure);
    odd_boxes = hash_bytes(odd_boxes, &status, sizeof status);
    if (status == HS_OK) {
        odd_boxes = hash_bytes(odd_boxes, places, sizeof places);
        odd_boxes = hash_bytes(odd_boxes, axes.reach, (size_t)f.box.ndim * sizeof *axes.reach);
        odd_boxes = hash_bytes(odd_boxes, axes.width, (size_t)f.box.ndim * sizeof *axes.width);
    }
    return 0;
}

static void
odd_scenes_are_planned_as_ever(void)
{
    odd_boxes = odd_plans = 1;
    for (int s = 0; s < SEEDS; s++)
        run_seed(hash_odd_scene, seeds[s]);
    run_random_inputs(hash_odd_scene, 31, 4000);
    check_kept("odd boxes", odd_boxes, 0);
    check_kept("odd plans", 0, odd_plans);
}

void
test_api_seeds(void)
{
    RUN(odd_scenes_are_planned_as_ever);
    RUN(points_on_faces_of_cells);
    RUN(seeds_of_the_first_part);
    RUN(seeds_of_the_second_part);
    RUN(seeds_of_the_third_part);
    RUN(seeds_of_the_fourth_part);
    RUN(rows_and_the_nearest);
    RUN(histograms_shells_and_clusters);
    RUN(streams_and_systems);
    RUN(reaches);
    RUN(selections_cells_and_lists);
}
