/* SPDX-License-Identifier: BSD-3-Clause */
/* test_alloc.c: whichever allocation fails, nothing leaks and outputs stay as they were. */
#include "../../../csrc/core/memory/account.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_alloc(void);

enum { MOST_ALLOCATIONS = 300 }; /* of one call here; a search that never succeeds ends at this */

static random_scene shared;
static int          several_blocks; /* searches with pairs of more than one stage */

static brute_scene *
scene_of(scene_kind kind, int n, double cutoff, int exponent)
{
    harness_random random = {60302};
    make_scene(&random, kind, 3, n, 4.0, exponent, &shared);
    shared.scene.cutoff = ldexp(cutoff, exponent);
    return &shared.scene;
}

static int64_t
count_pairs(const brute_scene *scene)
{
    const hs_points  points = points_of(scene);
    const hs_options options = options_of(scene);
    int64_t          count = 0;
    CHECK(hs_pairs_count(AMONG(&points, scene->box), &options, &count, NULL) == HS_OK);
    return count;
}

/* Lets allocation 1, 2, 3 ... of find fail, into arrays of the caller or new ones. Some of them a
 * search can do without. Returns how many there are. */
static int
fail_each(const brute_scene *scene, unsigned want, bool sorted, bool into)
{
    const hs_points points = points_of(scene);
    const int64_t   n = count_pairs(scene);
    hs_options      options = options_of(scene);
    hs_status       status = HS_ERR_MEMORY;
    bool            ended = false;
    caller_arrays   c;
    int             nth = 0;
    make_arrays(want, scene->ndim, 8, n, &c);
    options.want = want;
    options.sorted = sorted;
    options.out = into ? &c.arrays : NULL;
    while (!ended && nth < MOST_ALLOCATIONS) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *pairs = (hs_pairs *)&options;
        hs_failure    failure;
        hs_test_fail_allocation(++nth);
        status = hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, &failure);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        CHECK((status == HS_OK) == (pairs != NULL));
        if (status == HS_OK) {
            several_blocks += hs_pairs_length(pairs) > 1024;
            CHECK(hs_pairs_length(pairs) == n);
            hs_pairs_free(pairs);
        } else {
            CHECK(failure.row == -1 && failure.column == -1);
        }
        CHECK(untouched_from(&c, into ? n : 0));
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && status == HS_OK);
    free_arrays(&c);
    return nth - 1;
}

static int
fail_each_of_find(const brute_scene *scene, unsigned want, bool sorted)
{
    const int into = fail_each(scene, want, sorted, true);
    CHECK(into > 6);
    return fail_each(scene, want, sorted, false);
}

static void
find_fails_cleanly(void)
{
    const unsigned indices = HS_WANT_I | HS_WANT_J;
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        const brute_scene *scene = scene_of(kind, 150, 2.5, 0);
        const int          least = fail_each_of_find(scene, 0, false);
        const int          plain = fail_each_of_find(scene, indices, false);
        const int          sorted = fail_each_of_find(scene, WANT_ALL, true);
        CHECK(least > 4);
        CHECK(plain >= least);
        CHECK(sorted > plain);
    }
    CHECK(several_blocks > 10);
    for (int kind = 0; kind < SCENE_KINDS; kind++) /* many cells */
        CHECK(fail_each_of_find(scene_of(kind, 400, 1.5, 0), WANT_ALL, true) > 20);
}

static void
find_fails_cleanly_where_numbers_are_extreme(void)
{
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        brute_scene *scene = scene_of(kind, 150, 2.5, 1010);
        shared.x[0] = 0x1p-1070; /* a digit that scaling would lose: originals are kept */
        CHECK(fail_each_of_find(scene, WANT_ALL, true) > 20);
    }
}

static void
count_fails_cleanly(void)
{
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        const brute_scene *scene = scene_of(kind, 400, 1.2, 0);
        const hs_points    points = points_of(scene);
        const hs_options   options = options_of(scene);
        hs_status          status = HS_ERR_MEMORY;
        bool               ended = false;
        int                nth = 0;
        while (!ended && nth < MOST_ALLOCATIONS) {
            const int64_t before = hs_test_live_blocks();
            int64_t       count = -7;
            hs_test_fail_allocation(++nth);
            status = hs_pairs_count(AMONG(&points, scene->box), &options, &count, NULL);
            ended = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || (status == HS_ERR_MEMORY && count == -7));
            CHECK(hs_test_live_blocks() == before);
        }
        CHECK(ended && status == HS_OK && nth > 6);
    }
}

static void
plan_fails_cleanly(void)
{
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        const brute_scene *scene = scene_of(kind, 200, 1.2, 0);
        const hs_points    points = points_of(scene);
        const hs_options   options = options_of(scene);
        hs_status          status = HS_ERR_MEMORY;
        bool               ended = false;
        int                nth = 0;
        while (!ended && nth < MOST_ALLOCATIONS) {
            const int64_t before = hs_test_live_blocks();
            hs_plan       plan, untouched;
            memset(&plan, 0x5a, sizeof plan);
            memset(&untouched, 0x5a, sizeof untouched);
            hs_test_fail_allocation(++nth);
            status = hs_plan_make(AMONG(&points, scene->box), &options, &plan, NULL);
            ended = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || status == HS_ERR_MEMORY);
            CHECK(status == HS_OK || memcmp(&plan, &untouched, sizeof plan) == 0);
            CHECK(hs_test_live_blocks() == before);
        }
        CHECK(ended && status == HS_OK && nth > 3);
    }
}

static void
wrap_fails_cleanly(void)
{
    const brute_scene *scene = scene_of(SCENE_TRICLINIC, 20, 1.0, 0);
    const hs_points    points = points_of(scene);
    hs_status          status = HS_ERR_MEMORY;
    bool               ended = false;
    int                nth = 0;
    while (!ended && nth < MOST_ALLOCATIONS) {
        const int64_t before = hs_test_live_blocks();
        double        wrapped[60];
        int64_t       shift[60];
        memset(wrapped, 0x5a, sizeof wrapped);
        memset(shift, 0x5a, sizeof shift);
        hs_test_fail_allocation(++nth);
        status = hs_box_wrap(scene->box, &points, wrapped, shift, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        for (size_t b = 0; status != HS_OK && b < sizeof wrapped; b++)
            CHECK(((unsigned char *)wrapped)[b] == 0x5a && ((unsigned char *)shift)[b] == 0x5a);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && status == HS_OK && nth > 1);
}

/* Every other way to fail must not leak either. */
static void
no_failure_leaks(void)
{
    static const double bad[] = {NAN, INFINITY, -1.0};
    brute_scene        *scene = scene_of(SCENE_TRICLINIC, 20, 1.0, 0);
    const hs_points     points = points_of(scene);
    const int64_t       before = hs_test_live_blocks();
    for (int trial = 0; trial < 6; trial++) {
        hs_options   options = options_of(scene);
        hs_pairs    *pairs;
        hs_plan      plan;
        int64_t      count;
        const double kept = shared.x[7], kept_row = shared.box.rows[1][1];
        if (trial < 3)
            options.cutoff = bad[trial];
        else if (trial == 3)
            shared.x[7] = NAN;
        else if (trial == 4)
            shared.box.rows[1][1] = INFINITY;
        else
            options.memory_limit = 1000.0;
        CHECK(hs_pairs_find(AMONG(&points, scene->box), &options, &pairs, NULL) != HS_OK);
        CHECK(pairs == NULL);
        CHECK(hs_pairs_count(AMONG(&points, scene->box), &options, &count, NULL) != HS_OK);
        CHECK(hs_plan_make(AMONG(&points, scene->box), &options, &plan, NULL) != HS_OK);
        shared.x[7] = kept;
        shared.box.rows[1][1] = kept_row;
        CHECK(hs_test_live_blocks() == before);
    }
}

void
test_alloc(void)
{
    RUN(find_fails_cleanly);
    RUN(find_fails_cleanly_where_numbers_are_extreme);
    RUN(count_fails_cleanly);
    RUN(plan_fails_cleanly);
    RUN(wrap_fails_cleanly);
    RUN(no_failure_leaks);
}
