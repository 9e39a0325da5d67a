/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_nearest.c: the nearest points in cells that are kept are those of a search of its own. */
#include "../../../csrc/core/memory/memory.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

#include <pthread.h>

void test_api_nearest(void);

static void
whichever_allocation_fails_nothing_is_left(void)
{
    harness_random      random = {2};
    static random_scene s;
    bool                ended = false;
    int                 nth = 0;
    make_scene(&random, SCENE_TRICLINIC, 3, 60, 4.0, 0, &s);
    const hs_points points = points_of(&s.scene);
    hs_options      options = options_of(&s.scene);
    options.cutoff = INFINITY;
    options.want = WANT_ALL;
    while (!ended && nth < 300) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *rows = NULL;
        hs_test_fail_allocation(++nth);
        const hs_status status =
            hs_nearest_find(AMONG(&points, s.scene.box), 100, &options, &rows, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        hs_pairs_free(rows);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && nth > 10);
}

/* Nearest cells: nearest points by a tree that cells keep are those of a search of its own, to the
 * last bit, whoever asks first and however far away queries are. */

/* NaN and all: what is missing has the same bits too. */
static bool
same_rows(const hs_pairs *a, const hs_pairs *b, int ndim)
{
    const size_t d = (size_t)ndim;
    return same_array(a, b, HS_WANT_J, 8) && same_array(a, b, HS_WANT_DISTANCE, 8) &&
           same_array(a, b, HS_WANT_VECTOR, 8 * d) && same_array(a, b, HS_WANT_SHIFT, 4 * d);
}

static bool
compare(const hs_cells *cells, const brute_scene *scene, const hs_points *queries, int64_t k,
        double limit)
{
    const hs_points points = points_of(scene);
    hs_options      options = options_of(scene);
    hs_pairs       *kept = NULL, *fresh = NULL;
    options.cutoff = limit;
    options.want = WANT_ALL & ~HS_WANT_I;
    const hs_status status =
        hs_nearest_find(QUERIED(&points, queries, scene->box), k, &options, &fresh, NULL);
    bool right = hs_nearest_find(QUERIED_CELLS(cells, queries), k, &options, &kept, NULL) == status;
    right = right && (status != HS_OK || same_rows(kept, fresh, scene->ndim));
    hs_pairs_free(kept);
    hs_pairs_free(fresh);
    return right;
}

/* Queries near and far; limits that the kept tree serves, and one that it does not. */
static void
a_kept_tree_gives_the_same_rows(void)
{
    harness_random      random = {2718};
    static random_scene s, other;
    for (int trial = 0; trial < 300; trial++) {
        const int ndim = 1 + trial / SCENE_KINDS % 6;
        const int n = random_below(&random, ndim <= 3 ? 60 : 12);
        hs_cells *cells = NULL;
        make_scene(&random, trial % SCENE_KINDS, ndim, n, 4.0,
                   trial % 11  ? 0
                   : trial % 2 ? -400
                               : 300,
                   &s);
        make_scene(&random, SCENE_OPEN, ndim, random_below(&random, 20), 4.0, trial % 5 ? 0 : 30,
                   &other);
        const hs_points  points = points_of(&s.scene), queries = points_of(&other.scene);
        const hs_options options = options_of(&s.scene);
        CHECK(hs_cells_build(&points, s.scene.box, &options, &cells, NULL) == HS_OK);
        for (int call = 0; call < 4; call++) {
            const double     limit = call == 0                  ? s.scene.cutoff
                                     : call == 3                ? 0x1p-900
                                     : random_below(&random, 2) ? 0.0
                                                                : 3.0;
            const hs_points *asking = (call + trial) % 2 ? &queries : NULL;
            const bool       right =
                compare(cells, &s.scene, asking, 1 + random_below(&random, 40), limit);
            CHECK(right);
            if (!right)
                fprintf(stderr, "  trial %d, call %d\n", trial, call);
        }
        hs_cells_free(cells);
    }
}

typedef struct together {
    const hs_cells    *cells;
    const brute_scene *scene;
    int                n_right;
} together;

static void *
ask(void *context)
{
    together *own = context;
    for (int call = 0; call < 5; call++)
        own->n_right += compare(own->cells, own->scene, NULL, 1 + call, INFINITY);
    return NULL;
}

static void
several_may_come_first(void)
{
    enum { ASKING = 4 };
    static random_scene s;
    harness_random      random = {8};
    make_scene(&random, SCENE_TRICLINIC, 3, 60, 4.0, 0, &s);
    const hs_points  points = points_of(&s.scene);
    const hs_options options = options_of(&s.scene);
    for (int round = 0; round < 20; round++) {
        hs_cells *cells = NULL;
        together  own[ASKING];
        pthread_t threads[ASKING];
        CHECK(hs_cells_build(&points, s.scene.box, &options, &cells, NULL) == HS_OK);
        for (int t = 0; t < ASKING; t++) {
            own[t] = (together){cells, &s.scene, 0};
            CHECK(pthread_create(&threads[t], NULL, ask, &own[t]) == 0);
        }
        for (int t = 0; t < ASKING; t++) {
            (void)pthread_join(threads[t], NULL);
            CHECK(own[t].n_right == 5);
        }
        hs_cells_free(cells);
    }
}

void
test_api_nearest(void)
{
    RUN(whichever_allocation_fails_nothing_is_left);
    RUN(a_kept_tree_gives_the_same_rows);
    RUN(several_may_come_first);
}
