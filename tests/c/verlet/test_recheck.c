/* SPDX-License-Identifier: BSD-3-Clause */
/* test_recheck.c: listed pairs are decided, measured and written as a search does it: in every
 * type, number of dimensions and range of numbers. */
#include "../support/harness.h"
#include "../support/list_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_recheck(void);

enum { STEPS = 4, FLOATS = SCENE_POINTS * HS_MAX_DIM };

static random_scene shared;

/* The points of a scene, as float32 in `narrow` unless that is NULL. */
static hs_points
typed_points(const brute_scene *scene, float *narrow)
{
    hs_points points = points_of(scene);
    for (int64_t e = 0; narrow != NULL && e < scene->n * scene->ndim; e++) {
        narrow[e] = (float)scene->x[e];
    }
    if (narrow != NULL) {
        points.data = narrow;
        points.real = HS_FLOAT32;
        points.row_stride = scene->ndim * (ptrdiff_t)sizeof(float);
        points.column_stride = sizeof(float);
    }
    return points;
}

/* A step: all points move by up to half of `size` along each axis, some by whole box vectors. */
static void
move(harness_random *random, random_scene *scene, double size, bool jumps)
{
    const int d = scene->scene.ndim;
    for (int64_t i = 0; i < scene->scene.n; i++) {
        for (int k = 0; k < d; k++) {
            scene->x[i * d + k] += size * (random_unit(random) - 0.5);
        }
        for (int l = 0; jumps && scene->scene.box != NULL && l < d; l++) {
            const int times = scene->box.periodic[l] ? random_below(random, 7) - 3 : 0;
            for (int k = 0; k < d; k++) {
                scene->x[i * d + k] += times * scene->box.rows[l][k];
            }
        }
    }
}

/* float32 and float64, in up to eight dimensions, of any size, with i and j of 4 and 8 bytes. */
static void
every_type_and_dimension_gives_the_pairs_of_a_search(void)
{
    static float     narrow[FLOATS];
    static const int exponents[] = {0, 0, 0, 0, 40, -100, 400, -1000, 900};
    harness_random   random = {1999};
    int64_t          n_pairs = 0, n_kept = 0;
    for (int trial = 0; trial < THIRD_OF_TRIALS(250); trial++) {
        const bool is_narrow = trial % 2;
        const int  d = 1 + trial / 2 % HS_MAX_DIM, exponent = exponents[random_below(&random, 9)];
        make_scene(&random, trial % SCENE_KINDS, d, 1 + random_below(&random, d > 4 ? 12 : 40), 4.0,
                   is_narrow ? exponent / 20 : exponent, &shared);
        hs_verlet   *list = hs_verlet_new();
        hs_options   options = options_of(&shared.scene);
        const double skin = 0.3 * options.cutoff;
        options.index_bytes = trial % 3 ? 4 : 8;
        options.threads = trial % 5 == 0 ? 9 : 1;
        for (int step = 0; step < STEPS; step++) {
            const hs_points points = typed_points(&shared.scene, is_narrow ? narrow : NULL);
            bool            rebuilt;
            CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, skin, false, &rebuilt,
                                   NULL) == HS_OK);
            CHECK(list_difference(list, &points, shared.scene.box, options, &n_pairs) == NULL);
            n_kept += !rebuilt;
            move(&random, &shared, 0.05 * options.cutoff, step == 1 || trial % 4 == 0);
        }
        hs_verlet_free(list);
    }
    CHECK(n_pairs > THIRD_OF_TRIALS(50000) && n_kept > THIRD_OF_TRIALS(250));
}

/* Coordinates at both ends of the numbers: no scale keeps the digits of all. */
static void
digits_that_scaling_would_lose_are_kept(void)
{
    harness_random random = {1010};
    int64_t        n_pairs = 0;
    for (int kind = 0; kind < 2 * SCENE_KINDS; kind++) {
        make_scene(&random, kind % SCENE_KINDS, 3, 60, 4.0, 1010, &shared);
        shared.scene.cutoff = kind < SCENE_KINDS ? 0x1p1010 : 0x1.8p-1060;
        for (int e = 0; e < 30; e++) {
            shared.x[e] = ldexp(random_below(&random, 4), -1061);
        }
        const hs_points  points = points_of(&shared.scene);
        const hs_options options = options_of(&shared.scene);
        hs_verlet       *list = hs_verlet_new();
        bool             rebuilt;
        CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.0, false, &rebuilt,
                               NULL) == HS_OK);
        CHECK(list_difference(list, &points, shared.scene.box, options, &n_pairs) == NULL);
        hs_verlet_free(list);
    }
    CHECK(n_pairs > 1000);
}

/* A pair at the cutoff, and a point of it that jumps by so many heights of a box that an upright
 * one is equivalent to. */
static void
jump_by(int64_t periods, double tilt, double height, const char *kernel, hs_status shift_status)
{
    double     x[6] = {0.25, 0.25, 0.25, 0.5, 0.75, 0.5};
    hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{1.0, 0.0}, {tilt, height}}};
    hs_points  points = {x, 3, 2, HS_FLOAT64, 16, 8};
    hs_options options = hs_options_default();
    hs_verlet *list = hs_verlet_new();
    hs_pairs  *pairs = NULL;
    hs_failure failure;
    bool       rebuilt;
    int64_t    n_pairs = 0;
    options.cutoff = 0.25;
    options.kernel = kernel;
    CHECK(hs_verlet_update(list, &points, &box, &options, 0.5 * height, false, &rebuilt, NULL) ==
          HS_OK);
    CHECK(list_difference(list, &points, &box, options, &n_pairs) == NULL && n_pairs == 1);
    x[3] += (double)periods * height;
    CHECK(hs_verlet_update(list, &points, &box, &options, 0.5 * height, false, &rebuilt, NULL) ==
          HS_OK);
    CHECK(!rebuilt);
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    for (int sorted = 0; sorted < 2; sorted++) {
        options.sorted = sorted;
        CHECK(hs_verlet_find(list, &options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == 1);
        CHECK(*(const int64_t *)hs_pairs_array(pairs, HS_WANT_I) == 0);
        CHECK(*(const int64_t *)hs_pairs_array(pairs, HS_WANT_J) == 1);
        CHECK(*(const double *)hs_pairs_array(pairs, HS_WANT_DISTANCE) == 0.25);
        hs_pairs_free(pairs);
    }
    options.want = HS_WANT_SHIFT;
    CHECK(hs_verlet_find(list, &options, &pairs, &failure) == shift_status);
    CHECK((pairs == NULL) == (shift_status != HS_OK));
    if (pairs != NULL) {
        const int32_t *shift = hs_pairs_array(pairs, HS_WANT_SHIFT);
        CHECK(shift[1] == -periods && shift[0] == (int64_t)(tilt * (double)periods));
    } else {
        CHECK(failure.row == 0);
    }
    hs_pairs_free(pairs);
    hs_verlet_free(list);
}

/* Shifts need not fit into int32, nor into a double, as long as they are not asked for. */
static void
shifts_may_be_as_large_as_jumps_are(void)
{
    const char *names[16];
    const int   n_names = hs_kernel_names(names, 16);
    for (int k = 0; k < n_names; k++) {
        jump_by(3, 4.0, 1.0, names[k], HS_OK);
        jump_by(-3, 0x1p20, 1.0, names[k], HS_OK);
        jump_by(INT64_C(1) << 33, 0.0, 1.0, names[k], HS_ERR_SHIFT_RANGE);
        jump_by(-(INT64_C(1) << 33), 0.0, 1.0, names[k], HS_ERR_SHIFT_RANGE);
        jump_by(INT64_C(1) << 34, 0x1p20, 128.0, names[k], HS_ERR_SHIFT_RANGE);
        jump_by(-(INT64_C(1) << 34), 0x1p20, 128.0, names[k], HS_ERR_SHIFT_RANGE);
        /* A box that is skewed in a shorter basis, too: what is measured are points as given. */
        jump_by(4, 4.5, 1.0, names[k], HS_OK);
        jump_by(INT64_C(1) << 34, 0x1p20 + 0.5, 128.0, names[k], HS_ERR_SHIFT_RANGE);
        jump_by(-(INT64_C(1) << 34), 0x1p20 + 0.5, 128.0, names[k], HS_ERR_SHIFT_RANGE);
    }
}

/* Of several pairs of a point, the one whose shift does not fit is named by its lower number:
 * -2^31 fits, 2^31 does not. */
static void
the_pair_that_does_not_fit_is_named(void)
{
    enum { N = 5 };
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{2.0}, {0.0, 2.0}}};
    for (int trial = 0; trial < N * 2 * 2 * 2; trial++) {
        const int  jumper = trial % N, axis = trial / N % 2;
        const bool backwards = trial / N / 2 % 2, is_down = trial / N / 4;
        /* S of pairs with higher numbers is the jump, of those with lower ones its negative. */
        const int  beyond = is_down ? 0 : jumper;
        const bool is_told = is_down ? jumper > 0 : jumper < N - 1;
        double     x[2 * N];
        hs_points  points = {x, N, 2, HS_FLOAT64, 16, 8};
        hs_options options = hs_options_default();
        hs_verlet *list = hs_verlet_new();
        hs_pairs  *pairs = NULL;
        hs_failure failure;
        bool       rebuilt;
        options.cutoff = 0.5;
        options.threads = 1;
        for (int i = 0; i < N; i++) {
            x[2 * i] = 0.5 + 0.0625 * (backwards ? N - i : i);
            x[2 * i + 1] = 0.5;
        }
        CHECK(hs_verlet_update(list, &points, &box, &options, 0.25, false, &rebuilt, NULL) ==
              HS_OK);
        x[2 * jumper + axis] += is_down ? -0x1p32 : 0x1p32;
        CHECK(hs_verlet_update(list, &points, &box, &options, 0.25, false, &rebuilt, NULL) ==
              HS_OK);
        CHECK(!rebuilt);
        options.want = HS_WANT_SHIFT;
        CHECK(hs_verlet_find(list, &options, &pairs, &failure) ==
              (is_told ? HS_ERR_SHIFT_RANGE : HS_OK));
        CHECK(is_told ? failure.row >= beyond && failure.row <= (is_down ? jumper - 1 : jumper)
                      : hs_pairs_length(pairs) == N * (N - 1) / 2);
        CHECK((pairs == NULL) == is_told);
        hs_pairs_free(pairs);
        hs_verlet_free(list);
    }
}

/* A strict limit of 0 has no pairs; any other has those that are nearer. */
static void
strict_limits_have_what_is_nearer(void)
{
    static const double cutoffs[] = {0.0, 0.5, 1.0, 2.0};
    double              x[6] = {0.0, 0.25, 0.25, 1.25, 2.0, 2.0};
    const hs_points     points = {x, 6, 1, HS_FLOAT64, 8, 8};
    for (int c = 0; c < 4; c++) {
        hs_options options = hs_options_default();
        hs_verlet *list = hs_verlet_new();
        hs_pairs  *pairs = NULL;
        int64_t    n = 0;
        bool       rebuilt;
        options.cutoff = cutoffs[c];
        options.inclusive = false;
        options.want = HS_WANT_I | HS_WANT_J;
        for (int i = 0; i < 6; i++)
            for (int j = 0; j < i; j++)
                n += x[i] - x[j] < cutoffs[c];
        CHECK(hs_verlet_update(list, &points, NULL, &options, 0.5, false, &rebuilt, NULL) == HS_OK);
        CHECK(hs_verlet_find(list, &options, &pairs, NULL) == HS_OK);
        CHECK(hs_pairs_length(pairs) == n && (n > 0) == (c > 0));
        hs_pairs_free(pairs);
        hs_verlet_free(list);
    }
}

/* Box vectors along the axes but for so many times the one before: shifts over the upright box are
 * found modulo 2^64. */
static void
box_vectors_may_be_any_sum_of_shorter_ones(void)
{
    enum { N = 400 };
    static const int tilts[] = {0, 24, 48, 54, 60}; /* the largest: so many bits */
    static double    x[4 * N];
    harness_random   random = {52};
    int64_t          n_pairs = 0;
    for (int trial = 0; trial < 15; trial++) {
        const int  d = 2 + trial / 5;
        hs_box     box = {.ndim = d};
        hs_points  points = {x, N, d, HS_FLOAT64, 8 * d, 8};
        hs_options options = hs_options_default();
        hs_verlet *list = hs_verlet_new();
        hs_pairs  *found = NULL, *expected = NULL;
        bool       rebuilt;
        options.cutoff = 0.2 * d;
        options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR;
        options.sorted = true;
        for (int e = 0; e < d * N; e++) {
            x[e] = 4.0 * random_unit(&random) - 2.0; /* far from all faces */
        }
        for (int k = 0; k < d; k++) {
            box.periodic[k] = true;
            box.rows[k][k] = 16.0;
        }
        CHECK(hs_pairs_find(AMONG(&points, &box), &options, &expected, NULL) == HS_OK);
        for (int l = 1; l < d; l++) {
            for (int k = 0; k < l; k++) {
                box.rows[l][k] = ldexp(16.0, tilts[trial % 5] / (d - 1) * (l - k));
            }
        }
        CHECK(hs_verlet_update(list, &points, &box, &options, 0.05, false, &rebuilt, NULL) ==
              HS_OK);
        CHECK(hs_verlet_find(list, &options, &found, NULL) == HS_OK);
        CHECK(found != NULL && same_columns(found, expected, options.want, d, 8));
        n_pairs += hs_pairs_length(expected);
        hs_pairs_free(found);
        hs_pairs_free(expected);
        hs_verlet_free(list);
    }
    CHECK(n_pairs > 10000);
}

/* Each pair of the list is a candidate once for each find, and each that float32 cannot tell is
 * decided by one stage. */
static void
what_is_counted_adds_up(void)
{
    harness_random random = {77};
    int64_t        ambiguous = 0;
    for (int trial = 0; trial < 8; trial++) {
        make_scene(&random, trial % 2 ? SCENE_TRICLINIC : SCENE_ALIGNED, 3, 300, 4.0, 0, &shared);
        for (int e = 0; e < 900; e++) /* a lattice: many distances are the cutoff */
            shared.x[e] = floor(shared.x[e] * 4.0) * 0.25;
        shared.scene.cutoff = 1.25;
        const hs_points points = points_of(&shared.scene);
        hs_options      options = options_of(&shared.scene);
        hs_counters     counters;
        hs_verlet      *list = hs_verlet_new();
        hs_pairs       *pairs = NULL;
        bool            rebuilt;
        CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.25, false, &rebuilt,
                               NULL) == HS_OK);
        options.counters = &counters;
        CHECK(hs_verlet_find(list, &options, &pairs, NULL) == HS_OK);
        CHECK(counters.pairs == hs_pairs_length(pairs) && counters.candidates >= counters.pairs);
        CHECK(counters.ambiguous ==
              counters.by_float64 + counters.by_double_word + counters.by_integers);
        ambiguous += counters.ambiguous;
        hs_pairs_free(pairs);
        hs_verlet_free(list);
    }
    CHECK(ambiguous > 1000);
}

/* x^2 + y^2 is beside (x + 1)^2 by less than the last place of any low word. */
static void
what_integers_decide_is_counted(void)
{
    harness_random random = {31};
    int64_t        by_integers = 0;
    for (int trial = 0; trial < 300; trial++) {
        const double    x = floor(ldexp(1.0 + random_unit(&random), 52)) - 1.0;
        const double    at[4] = {0.0, 0.0, x, sqrt(2.0 * x + 1.0)};
        const hs_points points = {at, 2, 2, HS_FLOAT64, 16, 8};
        hs_options      options = hs_options_default();
        hs_counters     counters;
        hs_verlet      *list = hs_verlet_new();
        hs_pairs       *pairs = NULL;
        bool            rebuilt;
        options.cutoff = x + 1.0;
        CHECK(hs_verlet_update(list, &points, NULL, &options, 0.25 * x, false, &rebuilt, NULL) ==
              HS_OK);
        options.counters = &counters;
        CHECK(hs_verlet_find(list, &options, &pairs, NULL) == HS_OK);
        CHECK(counters.ambiguous == 1 && counters.by_integers >= 0);
        by_integers += counters.by_integers;
        hs_pairs_free(pairs);
        hs_verlet_free(list);
    }
    CHECK(by_integers > 0);
}

void
test_recheck(void)
{
    RUN(what_integers_decide_is_counted);
    RUN(what_is_counted_adds_up);
    RUN(every_type_and_dimension_gives_the_pairs_of_a_search);
    RUN(digits_that_scaling_would_lose_are_kept);
    RUN(shifts_may_be_as_large_as_jumps_are);
    RUN(the_pair_that_does_not_fit_is_named);
    RUN(strict_limits_have_what_is_nearer);
    RUN(box_vectors_may_be_any_sum_of_shorter_ones);
}
