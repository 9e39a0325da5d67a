/* SPDX-License-Identifier: BSD-3-Clause */
/* test_recheck_find.c: what a list has found becomes a result, in its order or sorted; what does
 * not fit is told. */
#include "../support/harness.h"
#include "../support/list_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

#include <string.h>

void test_recheck_find(void);

static random_scene shared;

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

/* A pair whose S passes int32 by jumps of one of its points, where numbers descend from cell to
 * cell, so that most pairs are found the other way round: its lower number is named, of a neighbour
 * by brute force. */
static void
shifts_that_do_not_fit_are_named(void)
{
    enum { N = 200 };
    const hs_box   box = {.ndim = 2, .periodic = {true, true}, .rows = {{16.0}, {0.0, 16.0}}};
    harness_random random = {9};
    int            n_told = 0;
    for (int trial = 0; trial < 40; trial++) {
        const int  jumper = 5 * trial;
        const bool is_down = trial & 1;
        bool       lower[N] = {false}, is_told = false, rebuilt;
        double     x[2 * N];
        hs_points  points = {x, N, 2, HS_FLOAT64, 16, 8};
        hs_options options = hs_options_default();
        hs_verlet *list = hs_verlet_new();
        hs_pairs  *pairs = NULL;
        hs_failure failure;
        options.cutoff = 1.0;
        for (int i = 0; i < N; i++) {
            x[2 * i] = 15.5 - i / 16.0;
            x[2 * i + 1] = (double)(1 + random_bits(&random) % 14);
        }
        for (int i = 0; i < N; i++) {
            const double along = x[2 * i] - x[2 * jumper], up = x[2 * i + 1] - x[2 * jumper + 1];
            lower[i] = along * along + up * up <= 1.0 && (is_down ? i < jumper : i == jumper);
            is_told = is_told ||
                      (along * along + up * up <= 1.0 && (is_down ? i < jumper : i > jumper));
        }
        for (int step = 0; step < 2; step++) {
            CHECK(hs_verlet_update(list, &points, &box, &options, 0.25, false, &rebuilt, NULL) ==
                  HS_OK);
            CHECK(rebuilt == (step == 0));
            x[2 * jumper] += step > 0 ? 0.0 : is_down ? -0x1p35 : 0x1p35; /* 2^31 periods */
        }
        options.want = HS_WANT_SHIFT;
        CHECK(hs_verlet_find(list, &options, &pairs, &failure) ==
              (is_told ? HS_ERR_SHIFT_RANGE : HS_OK));
        CHECK(!is_told || (failure.row >= 0 && failure.row < N && lower[failure.row]));
        n_told += is_told;
        hs_pairs_free(pairs);
        hs_verlet_free(list);
    }
    CHECK(n_told > 20);
}

/* A list whose points have jumped, and what is wanted of it. */
typedef struct jumped {
    hs_verlet *list;
    unsigned   want;
    int        threads;
    int64_t    n;
} jumped;

static hs_status
find_once(void *context)
{
    const jumped *of = context;
    hs_options    options = options_of(&shared.scene);
    hs_pairs     *pairs = NULL;
    options.threads = of->threads;
    options.want = of->want;
    const hs_status status = hs_verlet_find(of->list, &options, &pairs, NULL);
    CHECK((status == HS_OK) == (pairs != NULL));
    CHECK(pairs == NULL || hs_pairs_length(pairs) == of->n);
    hs_pairs_free(pairs);
    return status;
}

static void
any_allocation_may_be_refused(void)
{
    harness_random random = {9};
    make_scene(&random, SCENE_TRICLINIC, 3, 100, 4.0, 0, &shared);
    shared.scene.cutoff = 1.0;
    const hs_points points = points_of(&shared.scene);
    hs_options      options = options_of(&shared.scene);
    bool            rebuilt;
    jumped          of = {.list = hs_verlet_new()};
    CHECK(hs_verlet_update(of.list, &points, shared.scene.box, &options, 0.25, false, &rebuilt,
                           NULL) == HS_OK);
    for (int i = 0; i < 100; i += 3) {
        for (int k = 0; k < 3; k++)
            shared.x[3 * i + k] += shared.box.rows[0][k] + shared.box.rows[2][k];
    }
    CHECK(hs_verlet_update(of.list, &points, shared.scene.box, &options, 0.25, false, &rebuilt,
                           NULL) == HS_OK);
    CHECK(!rebuilt);
    CHECK(hs_pairs_count(AMONG(&points, shared.scene.box), &options, &of.n, NULL) == HS_OK);
    for (of.threads = 1; of.threads <= 2; of.threads++) {
        of.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR | HS_WANT_SHIFT;
        CHECK(fail_each_allocation(find_once, &of, 100) > 8);
        of.want = HS_WANT_I | HS_WANT_DISTANCE;
        CHECK(fail_each_allocation(find_once, &of, 100) > 8);
        of.want = HS_WANT_BOTH;
        CHECK(fail_each_allocation(find_once, &of, 100) > 4);
    }
    hs_verlet_free(of.list);
}

/* Sorted pairs are those of a search, whichever quantities are wanted, with images and without. */
static void
sorted_pairs_are_those_of_a_search(void)
{
    static const unsigned wants[] = {HS_WANT_I, HS_WANT_BOTH, HS_WANT_J | HS_WANT_DISTANCE,
                                     HS_WANT_SHIFT, HS_WANT_VECTOR | HS_WANT_I};
    harness_random        random = {8};
    for (int trial = 0; trial < 20; trial++) {
        make_scene(&random, trial % 2 ? SCENE_TRICLINIC : SCENE_OPEN, 3, 150, 4.0, 0, &shared);
        shared.scene.cutoff = 1.25;
        const hs_points points = points_of(&shared.scene);
        hs_options      options = options_of(&shared.scene);
        hs_verlet      *list = hs_verlet_new();
        hs_pairs       *found = NULL, *expected = NULL;
        bool            rebuilt;
        options.want = wants[trial % 5];
        options.sorted = true;
        options.index_bytes = trial % 3 ? 4 : 8;
        CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.25, false, &rebuilt,
                               NULL) == HS_OK);
        CHECK(hs_verlet_find(list, &options, &found, NULL) == HS_OK);
        CHECK(hs_pairs_find(AMONG(&points, shared.scene.box), &options, &expected, NULL) == HS_OK);
        CHECK(hs_pairs_length(found) > 100);
        CHECK(same_columns(found, expected, options.want, 3, options.index_bytes));
        hs_pairs_free(found);
        hs_pairs_free(expected);
        hs_verlet_free(list);
    }
}

/* A short list of many points, for which there are threads but no work for two: nothing is written
 * behind the last pair of the caller's arrays. */
static void
nothing_is_written_behind_a_short_list(void)
{
    enum { POINTS = 400, PAIRS = POINTS / 2, ROOM = PAIRS + 32 };
    static double        x[3 * POINTS], distance[ROOM], vector[3 * ROOM];
    static int32_t       i[ROOM], j[ROOM];
    const hs_pair_arrays arrays = {.capacity = PAIRS,
                                   .index_bytes = 4,
                                   .i = i,
                                   .j = j,
                                   .distance = distance,
                                   .vector = vector};
    hs_verlet           *list = hs_verlet_new();
    const hs_points      points = points_in_space(x, POINTS);
    hs_options           options = hs_options_default();
    hs_pairs            *found = NULL;
    bool                 rebuilt, untouched = true;
    for (int e = 0; e < POINTS; e++) {
        x[3 * e] = (double)(e / 2) * 10.0 + (double)(e % 2) * 0.5; /* one pair each */
    }
    options.cutoff = 1.0;
    options.threads = 2;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR;
    options.index_bytes = 4;
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.2, false, &rebuilt, NULL) == HS_OK);
    memset(distance, 77, sizeof distance);
    memset(vector, 77, sizeof vector);
    memset(i, 77, sizeof i);
    memset(j, 77, sizeof j);
    options.out = &arrays;
    CHECK(hs_verlet_find(list, &options, &found, NULL) == HS_OK);
    CHECK(hs_pairs_length(found) == PAIRS && distance[PAIRS - 1] == 0.5);
    for (int p = PAIRS; p < ROOM; p++) {
        untouched = untouched && memcmp(&i[p], &j[ROOM - 1], sizeof *i) == 0 &&
                    memcmp(&j[p], &j[ROOM - 1], sizeof *j) == 0 &&
                    memcmp(&distance[p], &distance[ROOM - 1], sizeof *distance) == 0 &&
                    memcmp(&vector[3 * p], &vector[3 * ROOM - 3], 3 * sizeof *vector) == 0;
    }
    CHECK(untouched);
    hs_pairs_free(found);
    hs_verlet_free(list);
}

/* Lists of many slabs, with images and without: any number of threads writes the same bytes in the
 * same order, to new arrays and to the caller's, and counts the same. */
static void
threads_write_the_same_bytes(void)
{
    enum { POINTS = 3000, MOST = 60000 };
    static const unsigned wants[] = {HS_WANT_I | HS_WANT_J, HS_WANT_BOTH,
                                     HS_WANT_I | HS_WANT_J | HS_WANT_DISTANCE | HS_WANT_VECTOR,
                                     HS_WANT_I | HS_WANT_J | HS_WANT_VECTOR | HS_WANT_SHIFT};
    static double         x[3 * POINTS], distance[MOST], vector[3 * MOST];
    static int32_t        i[MOST], j[MOST], both[2 * MOST], shift[3 * MOST];
    const hs_pair_arrays  arrays = {.capacity = MOST,
                                    .index_bytes = 4,
                                    .i = i,
                                    .j = j,
                                    .both = both,
                                    .distance = distance,
                                    .vector = vector,
                                    .shift = shift};
    harness_random        random = {11};
    hs_box                box = {.ndim = 3};
    hs_verlet            *list = hs_verlet_new();
    const hs_points       points = points_in_space(x, POINTS);
    for (int k = 0; k < 3; k++) {
        box.rows[k][k] = 10.0;
        box.periodic[k] = true;
    }
    for (int e = 0; e < 3 * POINTS; e++) {
        x[e] = 10.0 * random_unit(&random);
    }
    hs_options  options = hs_options_default();
    hs_counters counters;
    bool        rebuilt;
    options.cutoff = 1.0;
    options.counters = &counters;
    CHECK(hs_verlet_update(list, &points, &box, &options, 0.2, false, &rebuilt, NULL) == HS_OK);
    for (int w = 0; w < 4; w++) {
        hs_pairs *alone = NULL, *found = NULL;
        options.want = wants[w];
        options.index_bytes = 4;
        options.threads = 1;
        CHECK(hs_verlet_find(list, &options, &alone, NULL) == HS_OK);
        const int64_t n = hs_pairs_length(alone), candidates = counters.candidates;
        CHECK(n > 15000 && n < MOST && candidates > 20000);
        for (options.threads = 2; options.threads < 6; options.threads += 3) {
            CHECK(hs_verlet_find(list, &options, &found, NULL) == HS_OK);
            CHECK(hs_pairs_length(found) == n && counters.candidates == candidates);
            CHECK(same_columns(found, alone, options.want, 3, 4));
            hs_pairs_free(found);
            options.out = &arrays;
            CHECK(hs_verlet_find(list, &options, &found, NULL) == HS_OK);
            options.out = NULL;
            CHECK(hs_pairs_length(found) == n);
            hs_pairs_free(found);
            const size_t size = (size_t)n * sizeof(int32_t);
            CHECK((options.want & HS_WANT_BOTH) ||
                  (memcmp(i, hs_pairs_array(alone, HS_WANT_I), size) == 0 &&
                   memcmp(j, hs_pairs_array(alone, HS_WANT_J), size) == 0));
            CHECK(!(options.want & HS_WANT_DISTANCE) ||
                  memcmp(distance, hs_pairs_array(alone, HS_WANT_DISTANCE), 2 * size) == 0);
            CHECK(!(options.want & HS_WANT_VECTOR) ||
                  memcmp(vector, hs_pairs_array(alone, HS_WANT_VECTOR), 6 * size) == 0);
            CHECK(!(options.want & HS_WANT_SHIFT) ||
                  memcmp(shift, hs_pairs_array(alone, HS_WANT_SHIFT), 3 * size) == 0);
            CHECK(!(options.want & HS_WANT_BOTH) ||
                  memcmp(both, hs_pairs_array(alone, HS_WANT_BOTH), 2 * size) == 0);
        }
        hs_pairs_free(alone);
    }
    hs_verlet_free(list);
}

/* Lists of many slabs: a thread that meets a pair whose S passes int32 names its lower number, and
 * all threads stop. */
static void
threads_stop_at_shifts_that_do_not_fit(void)
{
    enum { POINTS = 3000 };
    static double   x[3 * POINTS];
    const hs_points points = points_in_space(x, POINTS);
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
test_recheck_find(void)
{
    RUN(what_does_not_fit_is_told);
    RUN(shifts_that_do_not_fit_are_named);
    RUN(any_allocation_may_be_refused);
    RUN(sorted_pairs_are_those_of_a_search);
    RUN(nothing_is_written_behind_a_short_list);
    RUN(threads_write_the_same_bytes);
    RUN(threads_stop_at_shifts_that_do_not_fit);
}
