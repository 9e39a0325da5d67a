/* SPDX-License-Identifier: BSD-3-Clause */
/* test_recheck.c: pairs of a list are checked again at new positions. */
#include "../../../csrc/core/verlet/pair_list.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/list_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

#include <math.h>
#include <string.h>

void test_recheck(void);

/*
 * ---- recheck ----
 *
 * Listed pairs are decided, measured and written as a search does it: in every type, number of
 * dimensions and range of numbers.
 */

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
        for (int64_t off = -1; off <= 1; off++) { /* what the writer's sums of shifts may be */
            jump_by((INT64_C(1) << 29) + off, 0.0, 1.0, names[k], HS_OK);
            jump_by(-(INT64_C(1) << 29) + off, 0.0, 1.0, names[k], HS_OK);
        }
        jump_by(INT32_MAX, 0.0, 1.0, names[k], HS_OK);
        jump_by(-3, 0x1p20, 1.0, names[k], HS_OK);
        jump_by(0, 0x1p30, 1.0, names[k], HS_OK); /* points are listed far from where they are */
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

/* What finding with d, by a writer where there is one, takes in memory may be refused. */
static hs_status
find_distances(void *context)
{
    const hs_verlet *list = context;
    hs_options       options = hs_options_default();
    hs_pairs        *pairs = NULL;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE;
    const hs_status status = hs_verlet_find(list, &options, &pairs, NULL);
    CHECK((pairs != NULL) == (status == HS_OK));
    hs_pairs_free(pairs);
    return status;
}

/* All points of a list go on together by so many boxes: they are wrapped by other box vectors than
 * those that they have been counted by, as many as the writer's sums of shifts can hold, or more. */
static void
points_may_be_wrapped_anew(void)
{
    static const int64_t boxes[] = {0, 1, -3, 1 << 28, -(1 << 29), 1 << 29, INT64_C(1) << 33};
    for (int b = 0; b < 7; b++) {
        double     x[12];
        hs_box     box = {.ndim = 2, .periodic = {true, true}, .rows = {{4.0}, {0.0, 4.0}}};
        hs_points  points = {x, 6, 2, HS_FLOAT64, 16, 8};
        hs_options options = hs_options_default();
        hs_verlet *list = hs_verlet_new();
        bool       rebuilt;
        int64_t    n_pairs = 0;
        options.cutoff = 1.0;
        for (int step = 0; step < 2; step++) {
            for (int e = 0; e < 12; e++) {
                x[e] = 0.625 * (e * 5 % 12) + (step > 0 ? 4.0 * (double)boxes[b] : 0.0);
            }
            CHECK(hs_verlet_update(list, &points, &box, &options, 0.25, false, &rebuilt, NULL) ==
                  HS_OK);
            CHECK(rebuilt == (step == 0));
            CHECK(list_difference(list, &points, &box, options, &n_pairs) == NULL);
        }
        CHECK(n_pairs > 0);
        CHECK(fail_each_allocation(find_distances, list, 100) > 6);
        hs_verlet_free(list);
    }
}

/* ---- what a list has found becomes a result, in its order or sorted ---- */

static double
small_limit(void *context)
{
    return *(double *)context;
}

/* Arrays of the caller that are too small say how many pairs there are; refusals name the limit. */
static void
what_does_not_fit_is_told(void)
{
    harness_random random = {7};
    make_scene(&random, SCENE_TRICLINIC, 3, 300, 4.0, 0, &shared);
    shared.scene.cutoff = 1.5;
    const hs_points points = points_of(&shared.scene);
    hs_options      options = options_of(&shared.scene);
    hs_verlet      *list = hs_verlet_new();
    hs_pairs       *pairs = NULL;
    hs_failure      failure;
    bool            rebuilt;
    caller_arrays   c;
    int64_t         count;
    hs_status       status = HS_ERR_MEMORY;
    int             n_told = 0;
    double          limit;
    CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.2, false, &rebuilt, NULL) ==
          HS_OK);
    CHECK(hs_pairs_count(AMONG(&points, shared.scene.box), &options, &count, NULL) == HS_OK);
    CHECK(count > 5000);
    make_arrays(options.want, 3, 8, 100, &c);
    options.out = &c.arrays;
    CHECK(hs_verlet_find(list, &options, &pairs, &failure) == HS_ERR_CAPACITY && pairs == NULL);
    CHECK(failure.expected_pairs == (double)count && untouched_from(&c, 100));
    free_arrays(&c);
    options.out = NULL;
    for (limit = 10000.0; status != HS_OK && limit < 1e9; limit *= 1.25) {
        options.memory_limit = limit;
        status = hs_verlet_find(list, &options, &pairs, &failure);
        CHECK((status == HS_OK) == (pairs != NULL));
        CHECK(pairs == NULL || hs_pairs_length(pairs) == count);
        CHECK(status == HS_OK || (status == HS_ERR_MEMORY && failure.limit_bytes == limit));
        n_told += status != HS_OK && failure.expected_pairs > 0.0;
        hs_pairs_free(pairs);
    }
    CHECK(status == HS_OK && n_told > 0);
    options.memory_limit = INFINITY;
    options.find_limit = small_limit; /* not heard below HS_LIMIT_FREE */
    options.find_context = &limit;
    limit = 10000.0;
    CHECK(hs_verlet_find(list, &options, &pairs, &failure) == HS_OK);
    CHECK(hs_pairs_length(pairs) == count);
    hs_pairs_free(pairs);
    options.kernel = "none of that name";
    CHECK(hs_verlet_find(list, &options, &pairs, &failure) == HS_ERR_KERNEL && pairs == NULL);
    options.kernel = NULL;
    options.index_bytes = 5;
    CHECK(hs_verlet_find(list, &options, &pairs, &failure) == HS_ERR_ARGUMENT && pairs == NULL);
    hs_verlet_free(list);
}

/* Lists of many slabs: a thread that meets a pair whose S passes int32 names its lower number, and
 * all threads stop. */
static void
threads_stop_at_shifts_that_do_not_fit(void)
{
    enum { POINTS = 3000 };
    static double   x[3 * POINTS];
    const hs_points points = points_in_rows(x, POINTS, 3);
    hs_box          box = {.ndim = 3};
    harness_random  random = {12};
    for (int k = 0; k < 3; k++) {
        box.rows[k][k] = 10.0;
        box.periodic[k] = true;
    }
    for (int trial = 0; trial < 8; trial++) {
        const int  jumper = (int)(random_bits(&random) % POINTS);
        hs_options options = hs_options_default();
        hs_verlet *list = hs_verlet_new();
        hs_pairs  *pairs = NULL;
        hs_failure failure;
        bool       rebuilt, lower[POINTS] = {false};
        for (int e = 0; e < 3 * POINTS; e++)
            x[e] = (double)(random_bits(&random) % 640) / 64.0; /* exact, after a jump too */
        for (int i = 0; i < POINTS; i++) {
            double square = 0.0;
            for (int k = 0; k < 3; k++) {
                const double along = fabs(x[3 * i + k] - x[3 * jumper + k]);
                square += fmin(along, 10.0 - along) * fmin(along, 10.0 - along);
            }
            lower[i < jumper ? i : jumper] |= i != jumper && square <= 1.0;
        }
        options.cutoff = 1.0;
        for (int step = 0; step < 2; step++) {
            CHECK(hs_verlet_update(list, &points, &box, &options, 0.2, false, &rebuilt, NULL) ==
                  HS_OK);
            CHECK(rebuilt == (step == 0));
            x[3 * jumper] += 10.0 * 0x1p33;
        }
        options.want = HS_WANT_SHIFT;
        for (options.threads = 1; options.threads <= 3; options.threads++) {
            CHECK(hs_verlet_find(list, &options, &pairs, &failure) == HS_ERR_SHIFT_RANGE);
            CHECK(pairs == NULL && failure.row >= 0 && failure.row < POINTS && lower[failure.row]);
        }
        hs_verlet_free(list);
    }
}

void
test_recheck(void)
{
    RUN(every_type_and_dimension_gives_the_pairs_of_a_search);
    RUN(shifts_may_be_as_large_as_jumps_are);
    RUN(box_vectors_may_be_any_sum_of_shorter_ones);
    RUN(points_may_be_wrapped_anew);
    RUN(what_does_not_fit_is_told);
    RUN(threads_stop_at_shifts_that_do_not_fit);
}
