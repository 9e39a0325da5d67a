/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_verlet.c: a list that is used for many steps gives what a search of each step gives. */
#include "../../../csrc/core/verlet/shift_table.h"
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/box/strain.h"
#include "../support/output_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_api_verlet(void);

enum { MOST_ALLOCATIONS = 400 };

static random_scene shared;

/* The arrays of both, byte for byte: ascending order. */
static bool
same_pairs(const hs_pairs *one, const hs_pairs *other, int ndim)
{
    static const unsigned bits[] = {HS_WANT_I, HS_WANT_J, HS_WANT_DISTANCE, HS_WANT_VECTOR,
                                    HS_WANT_SHIFT};
    const size_t          sizes[] = {8, 8, 8, 8 * (size_t)ndim, 4 * (size_t)ndim};
    const int64_t         n = hs_pairs_length(one);
    bool                  same = n == hs_pairs_length(other);
    for (int k = 0; k < 5 && same; k++) {
        same = memcmp(hs_pairs_array(one, bits[k]), hs_pairs_array(other, bits[k]),
                      (size_t)n * sizes[k]) == 0;
    }
    return same;
}

/* Whether list and search agree; adds the pairs to *n_pairs. */
static bool
agree(const hs_verlet *list, const brute_scene *scene, int threads, int64_t *n_pairs)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *found = NULL, *expected = NULL;
    options.want = WANT_ALL;
    options.sorted = true;
    bool same = hs_pairs_find(AMONG(&points, scene->box), &options, &expected, NULL) == HS_OK;
    options.threads = threads;
    same = same && hs_verlet_find(list, &options, &found, NULL) == HS_OK;
    same = same && same_pairs(found, expected, scene->ndim);
    *n_pairs += same ? hs_pairs_length(found) : 0;
    hs_pairs_free(found);
    hs_pairs_free(expected);
    return same;
}

/* A step: everything moves a little, and now and then by whole box vectors or with the box. */
static void
move(harness_random *random, random_scene *scene, double size)
{
    const int d = scene->scene.ndim;
    const int what = random_below(random, 4);
    for (int64_t i = 0; i < scene->scene.n; i++) {
        for (int k = 0; k < d; k++)
            scene->x[i * d + k] += size * (random_unit(random) - 0.5);
        for (int l = 0; what == 1 && scene->scene.box != NULL && l < d; l++) {
            const int times = scene->box.periodic[l] ? random_below(random, 5) - 2 : 0;
            for (int k = 0; k < d; k++)
                scene->x[i * d + k] += times * scene->box.rows[l][k];
        }
    }
    for (int l = 0; what == 2 && l < d; l++) {
        for (int k = 0; k < d; k++)
            scene->box.rows[l][k] *= 1.0 + 0.002 * (random_unit(random) - 0.5);
    }
}

static void
every_step_is_that_of_a_search(void)
{
    harness_random random = {4711};
    int64_t        n_pairs = 0, n_kept = 0;
    for (int trial = 0; trial < THIRD_OF_TRIALS(240); trial++) {
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 4, 1 + random_below(&random, 60), 4.0,
                   trial % 7 == 6   ? 300
                   : trial % 7 == 5 ? -300
                                    : 0,
                   &shared);
        hs_verlet       *list = hs_verlet_new();
        const hs_points  points = points_of(&shared.scene);
        const hs_options options = options_of(&shared.scene);
        const double     skin = 0.3 * shared.scene.cutoff;
        for (int step = 0; step < 6; step++) {
            bool rebuilt;
            CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, skin, false, &rebuilt,
                                   NULL) == HS_OK);
            CHECK(rebuilt || step > 0);
            const hs_verlet_state state = hs_verlet_look(list);
            CHECK(state.margin >= 0.0 && state.margin <= state.radius - state.cutoff);
            CHECK(state.cutoff == shared.scene.cutoff && state.n_points == shared.scene.n);
            CHECK(agree(list, &shared.scene, 1 + step % 3, &n_pairs));
            n_kept += !rebuilt;
            move(&random, &shared, 0.05 * shared.scene.cutoff);
        }
        hs_verlet_free(list);
    }
    CHECK(n_pairs > THIRD_OF_TRIALS(100000));
    CHECK(n_kept > THIRD_OF_TRIALS(500));
}

/* Two points on a line, moving towards each other until they come within the cutoff. */
static void
head_on_pairs_are_never_missed(void)
{
    const hs_options options = {.cutoff = 1.0,
                                .want = HS_WANT_I,
                                .index_bytes = 8,
                                .threads = 1,
                                .inclusive = true,
                                .memory_limit = INFINITY};
    int64_t          n_found = 0, n_kept = 0;
    for (int skin = 1; skin < 40; skin++) {
        for (int beside = -4; beside <= 4; beside++) { /* ulps, to more than any rounding */
            const double reach = 0.013 * skin;
            double       x[2] = {0.0, nextafter(1.0 + reach, 9.0)};
            hs_points    points = {x, 2, 1, HS_FLOAT64, 8, 8};
            hs_verlet   *list = hs_verlet_new();
            hs_pairs    *pairs = NULL;
            int64_t      expected;
            bool         rebuilt;
            CHECK(hs_verlet_update(list, &points, NULL, &options, reach, false, &rebuilt, NULL) ==
                  HS_OK);
            x[0] += 0.5 * reach;
            x[1] -= 0.5 * reach;
            x[0] -= beside * beside * beside * 0x1p-50;
            x[1] += beside * beside * beside * 0x1p-50;
            CHECK(hs_verlet_update(list, &points, NULL, &options, reach, false, &rebuilt, NULL) ==
                  HS_OK);
            CHECK(hs_verlet_find(list, &options, &pairs, NULL) == HS_OK);
            CHECK(hs_pairs_count(AMONG(&points, NULL), &options, &expected, NULL) == HS_OK);
            CHECK(hs_pairs_length(pairs) == expected);
            n_found += expected;
            n_kept += !rebuilt;
            hs_pairs_free(pairs);
            hs_verlet_free(list);
        }
    }
    CHECK(n_found > 50 && n_found < 300);
    CHECK(n_kept > 20 && n_kept < 300);
}

/* Lets each allocation of an update and of finding fail: nothing leaks, and the list is as it
 * was. */
static void
failures_leave_the_list_as_it_was(void)
{
    harness_random random = {99};
    for (int kind = 0; kind < SCENE_KINDS; kind++) {
        make_scene(&random, kind, 3, 200, 4.0, 0, &shared);
        shared.scene.cutoff = 1.2;
        const hs_points points = points_of(&shared.scene);
        const int64_t   before = hs_test_live_blocks();
        hs_verlet      *list = hs_verlet_new();
        hs_options      options = options_of(&shared.scene);
        bool            rebuilt = false, ended = false;
        int64_t         n_pairs = 0;
        static double   old[SCENE_POINTS * HS_MAX_DIM];
        options.threads = 1 + kind % 2;
        CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.2, false, &rebuilt,
                               NULL) == HS_OK);
        for (int nth = 1; !ended && nth < MOST_ALLOCATIONS; nth += IS_SLOW ? 5 : 1) {
            memcpy(old, shared.x, sizeof old);
            move(&random, &shared, 2.0); /* far: the list must be built again */
            hs_test_fail_allocation(nth);
            const hs_status status = hs_verlet_update(list, &points, shared.scene.box, &options,
                                                      0.2, true, &rebuilt, NULL);
            ended = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || status == HS_ERR_MEMORY);
            if (status != HS_OK) {
                static double next[SCENE_POINTS * HS_MAX_DIM];
                memcpy(next, shared.x, sizeof next);
                memcpy(shared.x, old, sizeof old);
                if (shared.scene.box == NULL)
                    CHECK(agree(list, &shared.scene, 1, &n_pairs));
                memcpy(shared.x, next, sizeof next);
                CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.2, false,
                                       &rebuilt, NULL) == HS_OK);
            }
            CHECK(agree(list, &shared.scene, 1, &n_pairs));
        }
        CHECK(ended && n_pairs > 0);
        hs_verlet_free(list);
        CHECK(hs_test_live_blocks() == before);
    }
}

static void
finding_fails_cleanly(void)
{
    harness_random random = {123};
    for (int kind = 0; kind < 2 * SCENE_KINDS; kind++) {
        make_scene(&random, kind % SCENE_KINDS, 3, 200, 4.0, 0, &shared);
        shared.scene.cutoff = 1.2;
        const hs_points points = points_of(&shared.scene);
        hs_verlet      *list = hs_verlet_new();
        hs_options      options = options_of(&shared.scene);
        bool            rebuilt, ended = false;
        CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.2, false, &rebuilt,
                               NULL) == HS_OK);
        options.want = WANT_ALL;
        options.sorted = kind >= SCENE_KINDS;
        const int64_t before = hs_test_live_blocks();
        for (int nth = 1; !ended && nth < MOST_ALLOCATIONS; nth++) {
            hs_pairs *pairs = NULL;
            hs_test_fail_allocation(nth);
            const hs_status status = hs_verlet_find(list, &options, &pairs, NULL);
            ended = hs_test_failure_is_due();
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || (status == HS_ERR_MEMORY && pairs == NULL));
            hs_pairs_free(pairs);
            CHECK(hs_test_live_blocks() == before);
        }
        CHECK(ended);
        hs_verlet_free(list);
    }
}

static bool
refuse(void *context, double fraction)
{
    (void)fraction;
    ++*(int *)context;
    return false;
}

static void
finding_can_be_interrupted(void)
{
    enum { N = 3000 };
    static double   x[3 * N];
    harness_random  random = {5};
    hs_options      options = hs_options_default();
    const hs_points points = {x, N, 3, HS_FLOAT64, 24, 8};
    int             polls = 0;
    bool            rebuilt;
    hs_pairs       *pairs = NULL;
    hs_verlet      *list = hs_verlet_new();
    for (int e = 0; e < 3 * N; e++)
        x[e] = random_unit(&random);
    options.cutoff = 2.0;
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.1, false, &rebuilt, NULL) == HS_OK);
    options.poll = refuse;
    options.poll_context = &polls;
    const int64_t before = hs_test_live_blocks();
    CHECK(hs_verlet_find(list, &options, &pairs, NULL) == HS_ERR_INTERRUPTED);
    CHECK(polls == 1 && pairs == NULL);
    CHECK(hs_test_live_blocks() == before);
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.1, true, &rebuilt, NULL) ==
          HS_ERR_INTERRUPTED);
    hs_verlet_free(list);
}

static void
memory_limits_hold(void)
{
    harness_random random = {77};
    make_scene(&random, SCENE_TRICLINIC, 3, 300, 4.0, 0, &shared);
    shared.scene.cutoff = 1.5;
    const hs_points points = points_of(&shared.scene);
    hs_options      options = options_of(&shared.scene);
    hs_verlet      *list = hs_verlet_new();
    hs_pairs       *pairs = NULL;
    hs_failure      failure;
    bool            rebuilt;
    options.memory_limit = 20000.0;
    CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.2, false, &rebuilt,
                           &failure) == HS_ERR_MEMORY);
    CHECK(failure.limit_bytes == 20000.0 && !hs_verlet_look(list).has_list);
    options.memory_limit = INFINITY;
    CHECK(hs_verlet_update(list, &points, shared.scene.box, &options, 0.2, false, &rebuilt,
                           &failure) == HS_OK);
    options.memory_limit = 20000.0;
    CHECK(hs_verlet_find(list, &options, &pairs, &failure) == HS_ERR_MEMORY && pairs == NULL);
    hs_verlet_free(list);
}

/* The bound holds for all vectors, and is hardly ever much too small. */
static void
smallest_stretch_is_a_lower_bound(void)
{
    harness_random random = {31};
    for (int trial = 0; trial < 3000; trial++) {
        const int    d = 1 + trial % HS_MAX_DIM;
        const double size = trial % 3 == 0 ? 1.0 : 0.01;
        double       F[HS_MAX_DIM][HS_MAX_DIM];
        long double  least = 1e9L;
        for (int a = 0; a < d; a++) {
            for (int b = 0; b < d; b++)
                F[a][b] = (a == b) + size * (random_unit(&random) - 0.5);
        }
        const double bound = hs_smallest_stretch(d, (const double(*)[HS_MAX_DIM])F);
        for (int sample = 0; sample < 50; sample++) {
            long double before = 0.0L, behind = 0.0L, v[HS_MAX_DIM];
            for (int a = 0; a < d; a++)
                v[a] = random_unit(&random) - 0.5;
            for (int b = 0; b < d; b++) {
                long double sum = 0.0L;
                for (int a = 0; a < d; a++)
                    sum += v[a] * F[a][b];
                before += v[b] * v[b];
                behind += sum * sum;
            }
            least = fminl(least, sqrtl(behind / before));
        }
        CHECK((long double)bound <= least);
        CHECK(d > 1 || (long double)bound >= least * (1.0L - 1e-12L));
    }
    const double turned[2][HS_MAX_DIM] = {{0.6, 0.8}, {-0.8, 0.6}};
    const double sheared[2][HS_MAX_DIM] = {{1.0, 0.5}, {0.0, 1.0}};
    const double flat[2][HS_MAX_DIM] = {{1.0, 1.0}, {1.0, 1.0}};
    const double wild[2][HS_MAX_DIM] = {{NAN, 1.0}, {1.0, 1.0}};
    CHECK(fabs(hs_smallest_stretch(2, turned) - 1.0) < 1e-13);
    CHECK(fabs(hs_smallest_stretch(2, sheared) - 0.78077640640441515) < 1e-13);
    CHECK(hs_smallest_stretch(2, flat) < 1e-6);
    CHECK(hs_smallest_stretch(2, wild) <= 0.0);
}

/* A box that is stretched by halves: shrink is the half, less next to nothing. */
static void
strain_of_a_known_change(void)
{
    hs_box    before = {.ndim = 3, .periodic = {true, true, true}}, now;
    hs_strain strain;
    for (int k = 0; k < 3; k++)
        before.rows[k][k] = 10.0;
    before.rows[1][0] = 3.0;
    now = before;
    for (int k = 0; k < 3; k++)
        now.rows[k][2] *= 0.5;
    CHECK(hs_strain_find(&before, &now, &strain));
    CHECK(strain.shrink <= 0.5 && strain.shrink > 0.5 - 1e-13);
    CHECK(strain.residual < 1e-13);
    now.rows[2][2] = 0.0;
    CHECK(!hs_strain_find(&before, &now, &strain));
}

static void
images_are_numbered_as_they_come(void)
{
    hs_images      images;
    harness_random random = {8};
    enum { N = 5000 };
    static int32_t shifts[N][3];
    int32_t        n = 0;
    hs_images_init(3, &images);
    for (int e = 0; e < N; e++) {
        for (int k = 0; k < 3; k++)
            shifts[e][k] = random_below(&random, 15) - 7;
        const int32_t number = hs_images_number(&images, shifts[e]);
        CHECK(number >= 0 && number <= n);
        n += number == n;
        CHECK(images.n == n && memcmp(images.of + 3 * number, shifts[e], sizeof shifts[e]) == 0);
        CHECK(hs_images_number(&images, shifts[e / 2]) == hs_images_number(&images, shifts[e / 2]));
    }
    CHECK(n > 1000);
    hs_images_free(&images);
    hs_images_free(&images);
}

/* A skin that no list can have matters only when one is built. */
static void
the_skin_is_not_looked_at_while_the_list_is_kept(void)
{
    static const double x[] = {0.0, 0.5, 2.0};
    const hs_points     points = {x, 3, 1, HS_FLOAT64, 8, 8};
    hs_options          options = hs_options_default();
    hs_verlet          *list = hs_verlet_new();
    hs_failure          failure;
    bool                rebuilt;
    options.cutoff = 1.0;
    CHECK(hs_verlet_update(list, &points, NULL, &options, NAN, false, &rebuilt, &failure) ==
          HS_ERR_CUTOFF);
    CHECK(hs_verlet_update(list, &points, NULL, &options, 0.25, false, &rebuilt, &failure) ==
          HS_OK);
    CHECK(rebuilt);
    CHECK(hs_verlet_update(list, &points, NULL, &options, NAN, false, &rebuilt, &failure) == HS_OK);
    CHECK(!rebuilt);
    CHECK(hs_verlet_update(list, &points, NULL, &options, -1.0, true, &rebuilt, &failure) ==
          HS_ERR_CUTOFF);
    CHECK(hs_verlet_look(list).radius == 1.25);
    hs_verlet_free(list);
}

void
test_api_verlet(void)
{
    RUN(the_skin_is_not_looked_at_while_the_list_is_kept);
    RUN(every_step_is_that_of_a_search);
    RUN(head_on_pairs_are_never_missed);
    RUN(failures_leave_the_list_as_it_was);
    RUN(finding_fails_cleanly);
    RUN(finding_can_be_interrupted);
    RUN(memory_limits_hold);
    RUN(smallest_stretch_is_a_lower_bound);
    RUN(strain_of_a_known_change);
    RUN(images_are_numbered_as_they_come);
}
