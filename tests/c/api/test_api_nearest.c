/* SPDX-License-Identifier: BSD-3-Clause */
/* test_api_nearest.c: several threads may be the first to search kept cells for nearest points. */
#include "../support/among.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"
#include "../support/random_scenes.h"

#include <pthread.h>

void test_api_nearest(void);

typedef struct together {
    const hs_among   *among;
    const hs_options *options;
    const hs_pairs   *wanted; /* three for each point */
    bool              right;
} together;

static void *
ask(void *context)
{
    together *own = context;
    hs_pairs *rows = NULL;
    own->right = hs_nearest_find(own->among, 3, own->options, &rows, NULL) == HS_OK &&
                 same_array(rows, own->wanted, HS_WANT_J, 8) &&
                 same_array(rows, own->wanted, HS_WANT_DISTANCE, 8);
    hs_pairs_free(rows);
    return NULL;
}

static void
several_may_come_first(void)
{
    enum { ASKING = 4 };
    static random_scene s;
    harness_random      random = {8};
    hs_pairs           *wanted = NULL;
    make_scene(&random, SCENE_TRICLINIC, 3, 60, 4.0, 0, &s);
    const hs_points points = points_of(&s.scene);
    hs_options      options = options_of(&s.scene);
    options.cutoff = 1.0;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    CHECK(hs_nearest_find(AMONG(&points, s.scene.box), 3, &options, &wanted, NULL) == HS_OK);
    for (int round = 0; round < 60; round++) {
        hs_cells *cells = NULL;
        together  own[ASKING];
        pthread_t threads[ASKING];
        CHECK(hs_cells_build(&points, s.scene.box, &options, &cells, NULL) == HS_OK);
        const hs_among among = {.cells = cells};
        for (int t = 0; t < ASKING; t++) {
            own[t] = (together){&among, &options, wanted, false};
            CHECK(pthread_create(&threads[t], NULL, ask, &own[t]) == 0);
        }
        for (int t = 0; t < ASKING; t++) {
            (void)pthread_join(threads[t], NULL);
            CHECK(own[t].right);
        }
        hs_cells_free(cells);
    }
    hs_pairs_free(wanted);
}

static hs_status
find_far_more(void *context)
{
    const random_scene *s = context;
    const hs_points     points = points_of(&s->scene);
    hs_options          options = hs_options_default();
    hs_cells           *cells = NULL;
    hs_pairs           *rows = NULL;
    options.want = HS_WANT_J | HS_WANT_DISTANCE;
    options.cutoff = 1.0;
    hs_status status = hs_cells_build(&points, s->scene.box, &options, &cells, NULL);
    options.cutoff = INFINITY;
    if (status == HS_OK)
        status = hs_nearest_find(IN_CELLS(cells), 100, &options, &rows, NULL);
    hs_pairs_free(rows);
    hs_cells_free(cells);
    return status;
}

/* With more candidates than there was room for at first. */
static void
any_allocation_may_be_refused(void)
{
    harness_random      random = {2};
    static random_scene s;
    make_scene(&random, SCENE_TRICLINIC, 3, 60, 4.0, 0, &s);
    CHECK(fail_each_allocation(find_far_more, &s, 300) > 10);
    check_arena(find_far_more, &s);
}

void
test_api_nearest(void)
{
    RUN(any_allocation_may_be_refused);
    RUN(several_may_come_first);
}
