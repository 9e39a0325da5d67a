/* SPDX-License-Identifier: BSD-3-Clause */
/* test_recheck_find.c: what a list has found becomes a result, in its order or sorted; what does
 * not fit is told. */
#include "../support/harness.h"
#include "../support/list_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

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

void
test_recheck_find(void)
{
    RUN(what_does_not_fit_is_told);
    RUN(sorted_pairs_are_those_of_a_search);
}
