/* SPDX-License-Identifier: BSD-3-Clause */
/* test_pair_list_build.c: when a list is built again, and that it stays as it was when that
 * fails. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/verlet/pair_list.h"
#include "../support/list_checks.h"
#include "../support/random_scenes.h"

void test_pair_list_build(void);

enum { MOST_ALLOCATIONS = 400 };

static random_scene shared;

static brute_scene *
scene_of(scene_kind kind, int n)
{
    harness_random random = {31337};
    make_scene(&random, kind, 3, n, 4.0, 0, &shared);
    shared.scene.cutoff = 1.0;
    return &shared.scene;
}

static hs_status
update(hs_verlet *list, const brute_scene *scene, double skin, bool *rebuilt, hs_failure *failure)
{
    const hs_points  points = points_of(scene);
    const hs_options options = options_of(scene);
    return hs_verlet_update(list, &points, scene->box, &options, skin, false, rebuilt, failure);
}

/* Whether the list has the pairs of the scene. */
static bool
has_pairs_of(const hs_verlet *list, const brute_scene *scene)
{
    const hs_points points = points_of(scene);
    int64_t         n_pairs = 0;
    return list_difference(list, &points, scene->box, options_of(scene), &n_pairs) == NULL &&
           n_pairs > 0;
}

static void
bad_lengths_are_named(void)
{
    static const double bad[] = {-1.0, NAN, INFINITY, -0x1p-1074};
    static const double reach[] = {0.0, NAN, INFINITY, 1.0}; /* 1 and a bad skin */
    brute_scene         scene = *scene_of(SCENE_OPEN, 20);
    hs_verlet          *list = hs_verlet_new();
    hs_failure          failure;
    bool                rebuilt = true;
    for (int b = 0; b < 4; b++) {
        scene.cutoff = bad[b];
        CHECK(update(list, &scene, 0.5, &rebuilt, &failure) == HS_ERR_CUTOFF);
        CHECK(memcmp(&failure.value, &bad[b], sizeof failure.value) == 0);
        scene.cutoff = 1.0;
        CHECK(update(list, &scene, bad[b], &rebuilt, &failure) == HS_ERR_CUTOFF);
        CHECK(isnan(reach[b]) == isnan(failure.value));
        CHECK(isnan(reach[b]) || failure.value == reach[b]);
    }
    scene.cutoff = 0x1.8p1023; /* the sum is none */
    CHECK(update(list, &scene, 0x1.8p1023, &rebuilt, &failure) == HS_ERR_CUTOFF);
    CHECK(failure.value == INFINITY);
    CHECK(rebuilt && !hs_verlet_look(list).has_list);
    hs_verlet_free(list);
    hs_verlet_free(NULL);
    hs_test_fail_allocation(1);
    CHECK(hs_verlet_new() == NULL);
    hs_test_fail_allocation(0);
}

/* Another cutoff, number or type of points, or other axes that repeat. */
static void
other_scenes_get_lists_of_their_own(void)
{
    brute_scene *scene = scene_of(SCENE_ALIGNED, 60);
    hs_verlet   *list = hs_verlet_new();
    bool         rebuilt;
    scene->n = 30; /* more points than there is room for will come */
    CHECK(update(list, scene, 0.25, &rebuilt, NULL) == HS_OK && rebuilt);
    CHECK(update(list, scene, 0.25, &rebuilt, NULL) == HS_OK && !rebuilt);
    for (int what = 0; what < 6; what++) {
        switch (what) {
        case 0: scene->cutoff = 1.125; break;
        case 1: scene->cutoff = 0.75; break;
        case 2: scene->n = 40; break;
        case 3: shared.box.periodic[1] = false; break;
        case 4: scene->box = NULL; break;
        default: scene->n = 60; break;
        }
        CHECK(update(list, scene, 0.25, &rebuilt, NULL) == HS_OK && rebuilt);
        CHECK(hs_verlet_look(list).tried == -INFINITY && has_pairs_of(list, scene));
        CHECK(update(list, scene, 0.25, &rebuilt, NULL) == HS_OK && !rebuilt);
    }
    float narrow[180];
    for (int e = 0; e < 180; e++) {
        narrow[e] = (float)shared.x[e];
    }
    const hs_points  points = {narrow, 60, 3, HS_FLOAT32, 12, 4};
    const hs_options options = options_of(scene);
    int64_t          n_pairs = 0;
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.25, false, &rebuilt, NULL) == HS_OK);
    CHECK(rebuilt && list_difference(list, &points, NULL, options, &n_pairs) == NULL);
    hs_verlet_free(list);
}

/* A list of few pairs that becomes one of many, while one allocation after the other fails: up
 * to the last one the few are there. */
static void
a_list_that_cannot_grow_stays(void)
{
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        bool ended = false;
        int  n_failed = 0;
        for (int nth = 1; !ended && nth < MOST_ALLOCATIONS; nth += IS_SLOW ? 5 : 1) {
            brute_scene   few = *scene_of(kind, 200), many = few;
            const int64_t before = hs_test_live_blocks();
            hs_verlet    *list = hs_verlet_new();
            bool          rebuilt;
            few.cutoff = 0.7;
            many.cutoff = 1.6;
            CHECK(update(list, &few, 0.1, &rebuilt, NULL) == HS_OK);
            hs_test_fail_allocation(nth);
            hs_failure      failure;
            const hs_status status = update(list, &many, 0.3, &rebuilt, &failure);
            ended = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || status == HS_ERR_MEMORY);
            CHECK(hs_verlet_look(list).cutoff == (status == HS_OK ? 1.6 : 0.7));
            CHECK(has_pairs_of(list, status == HS_OK ? &many : &few));
            if (status != HS_OK) { /* as many as there are, if it is known */
                const double said = failure.expected_pairs;
                CHECK(update(list, &many, 0.3, &rebuilt, NULL) == HS_OK);
                CHECK(said == 0.0 || said == (double)list->listing.n_pairs);
            }
            n_failed += status != HS_OK;
            hs_verlet_free(list);
            CHECK(hs_test_live_blocks() == before);
        }
        CHECK(ended && n_failed > TRIALS(10));
    }
}

/* Whatever the limit: the list is built, or the refusal says how many pairs there would be. */
static void
limits_leave_the_list_as_it_was(void)
{
    brute_scene few = *scene_of(SCENE_TRICLINIC, 200), many = few;
    hs_verlet  *list = hs_verlet_new();
    hs_options  options = options_of(&few);
    hs_status   status = HS_ERR_MEMORY;
    int         n_refused = 0, n_late = 0;
    bool        rebuilt;
    few.cutoff = 0.7;
    many.cutoff = options.cutoff = 4.0;
    const hs_points points = points_of(&few);
    CHECK(update(list, &few, 0.1, &rebuilt, NULL) == HS_OK);
    for (double limit = 1000.0; status != HS_OK && limit < 1e8; limit *= IS_SLOW ? 1.2 : 1.02) {
        hs_failure failure;
        options.memory_limit = limit;
        status = hs_verlet_update(list, &points, few.box, &options, 0.3, false, &rebuilt, &failure);
        if (status != HS_OK) {
            CHECK(status == HS_ERR_MEMORY && failure.limit_bytes == limit);
            CHECK(n_refused % 16 != 0 || has_pairs_of(list, &few));
            n_late += failure.expected_pairs > 0.0;
            n_refused++;
        }
    }
    CHECK(status == HS_OK && n_refused > TRIALS(100) && n_late > TRIALS(10) &&
          has_pairs_of(list, &many));
    hs_verlet_free(list);
}

/* Images whose shifts over the box vectors as given pass int32, and turns that pass int64. */
static void
shifts_that_do_not_fit_name_a_point(void)
{
    static const double tilts[] = {0x1p31, -0x1p31, 0x1p40, -0x1p50, 0x1p60, 0x1p60};
    for (int t = 0; t < 6; t++) {
        double      x[6] = {0.0, 0.0, 3.5, 3.75, -3.5, -3.75};
        hs_box      box = {.ndim = 2, .periodic = {true, true}, .rows = {{8.0, 0.0}, {0.0, 8.0}}};
        brute_scene scene = {.ndim = 2, .n = 3, .x = x, .box = &box, .cutoff = 1.25};
        hs_verlet  *list = hs_verlet_new();
        hs_failure  failure;
        bool        rebuilt;
        scene.cutoff = t == 5 ? 50.0 : 1.25; /* six times the second: more than 2^62 of the first */
        CHECK(update(list, &scene, 0.25, &rebuilt, NULL) == HS_OK && has_pairs_of(list, &scene));
        box.rows[1][0] = 8.0 * tilts[t];
        CHECK(update(list, &scene, 0.25, &rebuilt, &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(failure.row >= 0 && failure.row < 3);
        box.rows[1][0] = 8.0;
        CHECK(update(list, &scene, 0.25, &rebuilt, NULL) == HS_OK && has_pairs_of(list, &scene));
        box.rows[1][0] = 0x1p23; /* 2^20 of the first */
        x[3] = 0x1p48;           /* 2^45 of the second: 2^65 */
        CHECK(update(list, &scene, 0.25, &rebuilt, &failure) == HS_ERR_SHIFT_RANGE);
        CHECK(failure.row == 1);
        hs_verlet_free(list);
    }
}

static bool
refuse(void *context, double fraction)
{
    (void)context;
    (void)fraction;
    return false;
}

/* Also while it is found out whether the list can stay. */
static void
interrupts_leave_the_list_as_it_was(void)
{
    enum { N = (int)HS_POLL_POINTS };
    static double x[N];
    hs_options    options = hs_options_default();
    hs_points     points = {x, N, 1, HS_FLOAT64, 8, 8};
    hs_verlet    *list = hs_verlet_new();
    bool          rebuilt = true;
    int64_t       n_pairs = 0;
    for (int i = 0; i < N; i++) {
        x[i] = i;
    }
    options.cutoff = 1.0;
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.5, false, &rebuilt, NULL) == HS_OK);
    options.poll = refuse;
    x[5] += 0.125;
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.5, false, &rebuilt, NULL) ==
          HS_ERR_INTERRUPTED);
    x[5] -= 0.125;
    options.poll = NULL;
    CHECK(list_difference(list, &points, NULL, options, &n_pairs) == NULL && n_pairs == N - 1);
    hs_verlet_free(list);
}

/* Two points at exactly cutoff and skin from each other, or a little more: the first come within
 * the cutoff just when the list is built anew. */
static void
pairs_at_the_radius_are_listed(void)
{
    double      x[2] = {0.0, 1.25};
    brute_scene scene = {.ndim = 1, .n = 2, .x = x, .cutoff = 1.0}; /* not inclusive */
    for (int beyond = 0; beyond < 2; beyond++) {
        hs_verlet *list = hs_verlet_new();
        bool       rebuilt;
        x[1] = beyond ? 1.25 + 0x1p-30 : 1.25;
        CHECK(update(list, &scene, 0.25, &rebuilt, NULL) == HS_OK && rebuilt);
        CHECK(list->listing.radius == 1.25 && list->listing.n_pairs == !beyond);
        hs_verlet_free(list);
    }
}

void
test_pair_list_build(void)
{
    RUN(bad_lengths_are_named);
    RUN(other_scenes_get_lists_of_their_own);
    RUN(a_list_that_cannot_grow_stays);
    RUN(limits_leave_the_list_as_it_was);
    RUN(shifts_that_do_not_fit_name_a_point);
    RUN(interrupts_leave_the_list_as_it_was);
    RUN(pairs_at_the_radius_are_listed);
}
