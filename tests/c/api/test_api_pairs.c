/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_pairs.c: the set of pairs, and what is returned with them, against the brute force. */
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_api_pairs(void);

/* Compares by any kernel of this CPU, and names the scene if it differs. Returns the number of
 * pairs, -1 if not compared. */
static int64_t
compare_scene(const brute_scene *scene, double budget, int64_t stride)
{
    static harness_random turn = {97};
    const char           *names[16];
    brute_list            expected;
    kernel_to_check = names[random_below(&turn, hs_kernel_names(names, 16))];
    algorithm_to_check = (hs_algorithm)random_below(&turn, HS_ALGORITHM_END);
    if (!brute_find(scene, budget, &expected))
        return -1;
    const char   *difference = pairs_difference(scene, &expected, stride);
    const int64_t n = expected.n;
    CHECK(difference == NULL);
    if (difference != NULL)
        fprintf(stderr,
                "  %s: d = %d, n = %d, cutoff %a, %d pairs expected, kernel %s, algorithm %d\n",
                difference, scene->ndim, (int)scene->n, scene->cutoff, (int)n, kernel_to_check,
                (int)algorithm_to_check);
    brute_free(&expected);
    kernel_to_check = NULL;
    algorithm_to_check = HS_AUTO;
    return n;
}

static void
big_integers_confirm_the_plain_numbers(void)
{
    harness_random      random = {77};
    static random_scene s;
    for (int trial = 0; trial < 60; trial++) {
        brute_rows r;
        int64_t    shift[HS_MAX_DIM] = {0};
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 3, 6, 8.0, trial % 5 ? 0 : -530, &s);
        if (!brute_prepare(&s.scene, &r))
            continue;
        for (int i = 0; i < 6; i++) {
            for (int l = 0; l < r.m; l++)
                shift[l] = random_below(&random, 5) - 2;
            const double *p = s.x, *q = s.x + i * s.scene.ndim;
            CHECK(brute_sign(&s.scene, &r, p, q, shift) ==
                  brute_sign_exact(&s.scene, &r, p, q, shift));
        }
    }
}

static void
every_kind_of_box_in_every_dimension(void)
{
    harness_random      random = {20240601};
    static random_scene s;
    int                 compared = 0;
    int64_t             pairs = 0;
    for (int trial = 0; trial < TRIALS(1440); trial++) {
        const int kind = trial % SCENE_KINDS, ndim = 1 + trial / SCENE_KINDS % HS_MAX_DIM;
        const int n = random_below(&random, ndim <= 3 ? 30 : ndim <= 5 ? 10 : 6);
        make_scene(&random, kind, ndim, n, 4.0, 0, &s);
        const int64_t found = compare_scene(&s.scene, 30000.0, 1);
        compared += found >= 0;
        pairs += found > 0 ? found : 0;
    }
    CHECK(compared > TRIALS(1000));
    CHECK(pairs > TRIALS(20000));
}

static void
points_far_outside_the_box(void)
{
    harness_random      random = {31337};
    static random_scene s;
    int64_t             pairs = 0;
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const double spread = trial % 3 == 0 ? 40.0 : trial % 3 == 1 ? 1e5 : 1e8;
        make_scene(&random, trial % SCENE_KINDS, 1 + trial / SCENE_KINDS % 3, 8, spread, 0, &s);
        if (spread > 1e7) { /* keep S within int32 in sheared boxes, too */
            for (int e = 0; e < 8 * s.scene.ndim; e++)
                s.x[e] *= 0.1;
        }
        const int64_t found = compare_scene(&s.scene, 20000.0, 1);
        pairs += found > 0 ? found : 0;
    }
    CHECK(pairs > TRIALS(1000));
}

/* Coordinates that float32 cannot tell apart, and a cutoff that some of their distances are at. */
static void
clusters_far_from_the_origin(void)
{
    harness_random      random = {60221};
    static random_scene s;
    int64_t             pairs = 0;
    for (int trial = 0; trial < TRIALS(120); trial++) {
        const int ndim = 1 + trial % 4;
        make_scene(&random, trial % 2 ? SCENE_OPEN : SCENE_MIXED, ndim, 120, 4.0, 0, &s);
        for (int e = 0; e < 120 * ndim; e++)
            s.x[e] += ldexp(1.25, trial % 32) * (e % ndim == 0 ? 1.0 : -3.0);
        s.scene.cutoff = 0.0;
        while (s.scene.cutoff == 0.0 || s.scene.cutoff > 4.0)
            s.scene.cutoff = cutoff_of_some_pair(&random, &s.scene);
        const int64_t found = compare_scene(&s.scene, 200000.0, 11);
        pairs += found > 0 ? found : 0;
    }
    CHECK(pairs > TRIALS(20000));
}

static void
every_scale_has_the_same_answer(void)
{
    static const int    exponents[] = {-1060, -1000, -500, -60, -21, 21, 60, 500, 1000, 1018};
    harness_random      random = {4242};
    static random_scene s;
    int                 compared = 0;
    for (int trial = 0; trial < TRIALS(600); trial++) {
        const int exponent = exponents[trial / 2 % 10];
        make_scene(&random, random_below(&random, SCENE_KINDS), 1 + trial % 4, 7, 4.0, exponent,
                   &s);
        compared += compare_scene(&s.scene, 4000.0, 1) >= 0;
    }
    CHECK(compared > TRIALS(400));
}

/* One scene holds numbers of very different size: the cutoff, the points or the box. */
static void
scenes_of_several_scales(void)
{
    harness_random      random = {909};
    static random_scene s;
    int                 compared = 0;
    for (int trial = 0; trial < TRIALS(600); trial++) {
        make_scene(&random, random_below(&random, SCENE_KINDS), 1 + trial % 3, 7, 4.0, 0, &s);
        const int exponent = random_below(&random, 2000) - 1000;
        if (trial % 3 == 0) {
            s.scene.cutoff = ldexp(s.scene.cutoff, -abs(exponent));
        } else {
            for (int k = 0; k < s.scene.ndim; k++)
                s.x[(trial % 7) * s.scene.ndim + k] = ldexp(s.x[k], -abs(exponent));
        }
        if (trial % 2) {
            const int scale = random_below(&random, 60) + 960;
            for (int e = 0; e < 7 * s.scene.ndim; e++)
                s.x[e] = ldexp(s.x[e], scale);
            for (int e = 0; e < 8 * s.scene.ndim; e++)
                s.box.rows[e / 8][e % 8] = ldexp(s.box.rows[e / 8][e % 8], scale);
            s.scene.cutoff = ldexp(s.scene.cutoff, scale);
        }
        compared += compare_scene(&s.scene, 4000.0, 1) >= 0;
    }
    CHECK(compared > TRIALS(400));
}

/* A distant coordinate leaves no exponents for the square of a tiny cutoff; images still count. */
static void
tiny_cutoffs_beside_distant_points(void)
{
    static const double periods[] = {0x1p-560, 0x1p-600, 1e-200};
    for (int trial = 0; trial < 6; trial++) {
        const double period = periods[trial % 3], x[2] = {0.0, trial < 3 ? 1e300 : 0.5};
        hs_box       box = {.ndim = 2, .periodic = {true}};
        brute_scene  s = {.ndim = 2, .n = 1, .x = x, .box = &box, .inclusive = true};
        box.rows[0][0] = period;
        s.cutoff = 2.5 * period;
        CHECK(compare_scene(&s, 1000.0, 1) == 2);
    }
}

static void
no_one_and_two_points(void)
{
    static const double cutoffs[] = {0.0, 0x1p-1074, 0.5, 1.0, 1.5, 3.25};
    hs_box              box = {.ndim = 2, .periodic = {true, false}, .rows = {{1.0}, {0.0, 1.0}}};
    double              x[4] = {0.25, 0.5, 0.25, 0.5};
    for (int trial = 0; trial < 72; trial++) {
        brute_scene s = {.ndim = 2, .n = trial % 3, .x = x, .inclusive = trial / 3 % 2};
        s.cutoff = cutoffs[trial / 6 % 6];
        s.box = trial < 36 ? NULL : &box;
        CHECK(compare_scene(&s, 1000.0, 1) >= 0);
    }
}

static void
coincident_points_are_pairs_at_cutoff_zero(void)
{
    static double x[3 * 100];
    hs_box        box = {.ndim = 3, .periodic = {true, true, true}};
    for (int k = 0; k < 3; k++)
        box.rows[k][k] = 2.0;
    for (int i = 0; i < 100; i++) { /* images of one another, too */
        x[3 * i] = 0.1 + (i % 2 ? 2.0 : 0.0);
        x[3 * i + 1] = i % 5;
        x[3 * i + 2] = -7.0;
    }
    x[0] = 0.1 + 0x1p-50;
    for (int trial = 0; trial < 4; trial++) {
        brute_scene s = {.ndim = 3, .n = 100, .x = x, .inclusive = trial % 2};
        s.box = trial < 2 ? NULL : &box;
        const int64_t found = compare_scene(&s, 1e6, 1);
        CHECK(s.inclusive ? found > 100 : found == 0);
    }
}

/* More candidates than one block holds, and more points in a cell than one group holds. */
static void
crowded_cells_and_several_blocks(void)
{
    harness_random      random = {555};
    static random_scene s;
    static double       x[3 * 3000];
    for (int trial = 0; trial < 5; trial++) {
        make_scene(&random, trial < 3 ? SCENE_ALIGNED : SCENE_TRICLINIC, trial < 4 ? 2 : 3,
                   trial < 4 ? 300 : 100, 4.0, 0, &s);
        s.scene.cutoff = trial < 4 ? 6.0 : 4.5;
        CHECK(compare_scene(&s.scene, 1e7, 97) > 10000);
    }
    for (int e = 0; e < 3 * 3000; e++) {
        x[e] = random_unit(&random);
        x[e] *= random_below(&random, 20) ? 1.0 : 40.0;
    }
    for (int e = 3 * 2500; e < 3 * 3000; e++)
        x[e] = 0.5 + 0x1p-40 * random_unit(&random); /* one cell full of them */
    brute_scene open = {.ndim = 3, .n = 3000, .x = x, .cutoff = 0.06, .inclusive = true};
    CHECK(compare_scene(&open, 1e7, 997) > 100000);
    open.n = 4300;
    open.cutoff = 200.0; /* everything: one cell, two blocks */
    open.ndim = 1;
    hs_options      options = options_of(&open);
    const hs_points points = points_of(&open);
    int64_t         count = 0;
    CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL) == HS_OK);
    CHECK(count == (int64_t)4300 * 4299 / 2);
}

/* Each image of a single point is a run of its own: more of them than a block has room for. */
static void
cutoffs_much_larger_than_the_box(void)
{
    double x[3] = {0.3, -0.2, 0.9};
    hs_box box = {.ndim = 3, .periodic = {true, true, false}, .rows = {{1.0}, {0.5, 1.0}}};
    for (int trial = 0; trial < 6; trial++) {
        brute_scene s = {.ndim = 3, .n = 1, .x = x, .box = &box, .inclusive = trial % 2};
        box.rows[1][0] = trial < 4 ? 0.5 : 0.0;
        s.cutoff = trial < 2 ? 30.0 : 5.0 * (trial + 1);
        CHECK(compare_scene(&s, 1e5, 1) > 100);
    }
}

/* Whole shells of a lattice lie on the cutoff; every pair of them must go the same way. */
static void
lattice_shells_at_the_cutoff(void)
{
    static const double steps[] = {1.0, 0.1, 1.0 / 3.0, 0x1.8p-30};
    static double       x[3 * 125];
    for (int trial = 0; trial < 32; trial++) {
        const double step = steps[trial % 4];
        hs_box       box = {.ndim = 3, .periodic = {true, true, trial % 8 < 4}};
        for (int k = 0; k < 3; k++)
            box.rows[k][k] = 5.0 * step;
        box.rows[2][0] = trial % 16 < 8 ? 0.0 : step;
        for (int i = 0; i < 125; i++) {
            x[3 * i] = step * (i % 5);
            x[3 * i + 1] = step * (i / 5 % 5);
            x[3 * i + 2] = step * (i / 25);
        }
        brute_scene s = {.ndim = 3, .n = 125, .x = x, .box = &box, .inclusive = trial % 3 != 0};
        s.cutoff = trial < 16 ? step : 2.0 * step;
        CHECK(compare_scene(&s, 1e6, 7) >= 0);
    }
}

/* precision="double" is one formula, in plain float64, on the points and shifts as given. */
static bool
formula_says_within(const brute_scene *scene, const brute_pair *pair)
{
    volatile double sum = 0.0; /* volatile: every operation is rounded by itself */
    for (int k = 0; k < scene->ndim; k++) {
        volatile double along = scene->x[pair->j * scene->ndim + k];
        volatile double moved = 0.0;
        bool            first = true;
        along = along - scene->x[pair->i * scene->ndim + k];
        for (int l = 0; scene->box != NULL && l < scene->ndim; l++) {
            if (scene->box->periodic[l]) {
                volatile double product = (double)pair->shift[l] * scene->box->rows[l][k];
                moved = first ? product : moved + product;
                first = false;
            }
        }
        if (!first)
            along = along + moved;
        const volatile double square = along * along;
        sum = k == 0 ? square : sum + square;
    }
    const volatile double limit = scene->cutoff * scene->cutoff;
    return scene->inclusive ? sum <= limit : sum < limit;
}

static void
double_precision_is_the_plain_formula(void)
{
    harness_random      random = {8088};
    static random_scene s;
    int                 unlike_exact = 0;
    for (int trial = 0; trial < 900; trial++) {
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 4, 12, trial % 5 ? 4.0 : 3e4, 0, &s);
        brute_scene wider = s.scene;
        brute_list  candidates;
        int64_t     formula = 0, exact = 0, count = -1;
        if (s.scene.cutoff < 1e-100)
            continue; /* the formula's squares would underflow; the search scales them */
        wider.cutoff = wider.cutoff * (1.0 + 1e-8) + 1e-8;
        if (!brute_find(&wider, 20000.0, &candidates))
            continue;
        for (int64_t e = 0; e < candidates.n; e++)
            formula += formula_says_within(&s.scene, &candidates.pairs[e]);
        brute_free(&candidates);
        hs_options      options = options_of(&s.scene);
        const hs_points points = points_of(&s.scene);
        CHECK(hs_pairs_count(AMONG(&points, s.scene.box), &options, &exact, NULL) == HS_OK);
        options.precision = HS_DOUBLE;
        CHECK(hs_pairs_count(AMONG(&points, s.scene.box), &options, &count, NULL) == HS_OK);
        CHECK(count == formula);
        unlike_exact += count != exact;
    }
    CHECK(unlike_exact > 5);
}

void
test_api_pairs(void)
{
    RUN(big_integers_confirm_the_plain_numbers);
    RUN(every_kind_of_box_in_every_dimension);
    RUN(points_far_outside_the_box);
    RUN(clusters_far_from_the_origin);
    RUN(every_scale_has_the_same_answer);
    RUN(scenes_of_several_scales);
    RUN(tiny_cutoffs_beside_distant_points);
    RUN(no_one_and_two_points);
    RUN(coincident_points_are_pairs_at_cutoff_zero);
    RUN(crowded_cells_and_several_blocks);
    RUN(cutoffs_much_larger_than_the_box);
    RUN(lattice_shells_at_the_cutoff);
    RUN(double_precision_is_the_plain_formula);
}
