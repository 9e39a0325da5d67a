/* SPDX-License-Identifier: BSD-3-Clause */
/* test_connectivity.c: rows and pairs of a half list are those of its matrix; no allocation that
 * fails leaves anything behind. */
#include "../../../csrc/core/connectivity/connectivity.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_connectivity(void);

static node_scene scene;

static bool
pairs_are(hs_connectivity *made, bool shuffled, bool ghost_pairs)
{
    const hs_pairs *nodes = hs_connectivity_pairs(made), *lists = hs_connectivity_lists(made);
    const int32_t  *i = hs_pairs_array(nodes, HS_WANT_I), *j = hs_pairs_array(nodes, HS_WANT_J);
    const int32_t  *a = hs_pairs_array(lists, HS_WANT_I), *b = hs_pairs_array(lists, HS_WANT_J);
    int64_t         at = 0;
    bool            right = true;
    for (int64_t e = 0; right && e < scene.n_pairs; e++) {
        int32_t p = scene.i[e], q = scene.j[e];
        if (!ghost_pairs && scene.is_ghost[p] && scene.is_ghost[q])
            continue;
        if (!shuffled && scene.is_ghost[p] && !scene.is_ghost[q]) {
            p = scene.j[e];
            q = scene.i[e];
        }
        right = i[at] == scene.node[p] && a[at] == scene.list[p] && j[at] == scene.node[q] &&
                b[at] == scene.list[q];
        at++;
    }
    return right && at == hs_pairs_length(nodes) && at == hs_pairs_length(lists);
}

static void
rows_and_pairs_are_those_of_the_matrix(void)
{
    harness_random   random = {3};
    const hs_options options = hs_options_default();
    for (int trial = 0; trial < TRIALS(400); trial++) {
        const bool       shuffled = trial & 1, ghost_rows = trial & 2, ghost_pairs = trial & 4;
        hs_connectivity *made;
        node_scene_fill(&random, shuffled, &scene);
        const hs_half_list  half = node_half_of(&scene);
        const hs_node_lists lists = node_lists_of(&scene, shuffled, ghost_rows, ghost_pairs);
        CHECK(hs_connectivity_link(&half, &lists, &options, &made, NULL) == HS_OK);
        const hs_pairs *rows = hs_connectivity_rows(made);
        CHECK(node_rows_are(&scene, ghost_rows, scene.near, hs_pairs_offsets(rows),
                            hs_pairs_array(rows, HS_WANT_J)));
        CHECK(pairs_are(made, shuffled, ghost_pairs));
        hs_connectivity_free(made);
    }
}

static void
shifts_are_opposite_in_the_other_row(void)
{
    static const int32_t i[4] = {0, 0, 0, 1}, j[4] = {0, 1, 1, 1};
    static const int32_t shift[8] = {0, 1, -1, 4, 3, 5, 2, -7};
    static const int32_t of_rows[] = {0,  -1, 0, 1,  -1, 4, 3, 5, /* node 0: itself twice, 1 */
                                      -3, -5, 1, -4, -2, 7, 2, -7};
    static const int32_t of_pairs[] = {0, 1, 1, -4, -3, -5, 2, -7}; /* node 0 is a ghost */
    static const int64_t counts[1] = {2}, two_lists[2] = {1, 1}, ghosts[2] = {1, 0};
    const hs_half_list   half = {.n = 4, .i = i, .j = j, .shift = shift, .ndim = 2};
    hs_node_lists        lists = {.n_lists = 1, .n_nodes = counts};
    const hs_options     options = hs_options_default();
    hs_connectivity     *made;
    hs_failure           failure;
    CHECK(hs_connectivity_link(&half, &lists, &options, &made, NULL) == HS_OK);
    const hs_pairs *rows = hs_connectivity_rows(made);
    CHECK(hs_pairs_length(rows) == 8 && hs_pairs_rows(rows) == 2);
    CHECK(memcmp(hs_pairs_array(rows, HS_WANT_SHIFT), of_rows, sizeof of_rows) == 0);
    hs_connectivity_free(made);
    lists = (hs_node_lists){
        .n_lists = 2, .n_nodes = two_lists, .n_ghosts = ghosts, .ghost_pairs = true};
    CHECK(hs_connectivity_link(&half, &lists, &options, &made, NULL) == HS_OK);
    const hs_pairs *pairs = hs_connectivity_pairs(made);
    CHECK(hs_pairs_length(pairs) == 4);
    CHECK(memcmp(hs_pairs_array(pairs, HS_WANT_SHIFT), of_pairs, sizeof of_pairs) == 0);
    hs_connectivity_free(made);
    static const int32_t least[2] = {0, INT32_MIN};
    static const int32_t zero[1] = {0}, one[1] = {1};
    const hs_half_list   far = {.n = 1, .i = zero, .j = one, .shift = least, .ndim = 2};
    CHECK(hs_connectivity_link(&far, &lists, &options, &made, &failure) == HS_ERR_SHIFT_RANGE);
    CHECK(made == NULL && failure.row == 1);
}

/* One list, or rows alone, of all points or of those that are no ghosts. */
static void
searches_give_what_links_give(void)
{
    static const int64_t all[1] = {60}, ghosts[1] = {20}, none[1] = {0}, two[2] = {40, 20};
    static double        x[120];
    static int32_t       number[60];
    harness_random       random = {44};
    hs_options           options = hs_options_default();
    const hs_points      points = {x, 60, 2, HS_FLOAT64, 2 * sizeof *x, sizeof *x};
    const hs_among       among = {.points = &points};
    const hs_node_lists  kinds[] = {
         {.n_lists = 1, .n_nodes = all, .n_ghosts = none},
         {.n_lists = 1, .n_nodes = all, .n_ghosts = ghosts},
         {.n_lists = 1, .n_nodes = all, .n_ghosts = ghosts, .ghost_rows = true},
         {.n_lists = 1, .n_nodes = all, .number = number},
         {.n_lists = 2, .n_nodes = two},
         {.n_lists = 2, .n_nodes = two, .n_ghosts = two, .ghost_rows = true},
    };
    for (int k = 0; k < 120; k++)
        x[k] = random_unit(&random);
    for (int32_t p = 0; p < 60; p++)
        number[p] = 59 - p;
    options.cutoff = 0.2;
    options.index_bytes = 4;
    options.sorted = true;
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        hs_pairs        *pairs;
        hs_connectivity *linked, *built;
        CHECK(hs_pairs_find(&among, &options, &pairs, NULL) == HS_OK);
        const hs_half_list half = {.n = hs_pairs_length(pairs),
                                   .i = hs_pairs_array(pairs, HS_WANT_I),
                                   .j = hs_pairs_array(pairs, HS_WANT_J)};
        for (int rows_only = 0; rows_only < 2; rows_only++) {
            hs_node_lists lists = kinds[k];
            lists.rows_only = rows_only;
            CHECK(hs_connectivity_link(&half, &lists, &options, &linked, NULL) == HS_OK);
            CHECK(hs_connectivity_build(&among, &lists, &options, &built, NULL) == HS_OK);
            const hs_pairs *one = hs_connectivity_rows(linked),
                           *other = hs_connectivity_rows(built);
            const int64_t n = hs_pairs_length(one);
            CHECK(hs_pairs_rows(one) == hs_pairs_rows(other) && n == hs_pairs_length(other));
            CHECK(memcmp(hs_pairs_offsets(one), hs_pairs_offsets(other),
                         (size_t)(hs_pairs_rows(one) + 1) * 8) == 0);
            CHECK(memcmp(hs_pairs_array(one, HS_WANT_J), hs_pairs_array(other, HS_WANT_J),
                         (size_t)n * 4) == 0);
            one = hs_connectivity_pairs(linked);
            other = hs_connectivity_pairs(built);
            CHECK(hs_pairs_length(one) == hs_pairs_length(other));
            CHECK(rows_only ||
                  memcmp(hs_pairs_array(one, HS_WANT_I), hs_pairs_array(other, HS_WANT_I),
                         (size_t)hs_pairs_length(one) * 4) == 0);
            hs_connectivity_free(linked);
            hs_connectivity_free(built);
        }
        hs_pairs_free(pairs);
    }
}

static double limit = HUGE_VAL;

/* Of a search that had all the memory it wanted. */
static hs_status
fill_found(void *context)
{
    static double        x[60];
    static const int64_t counts[2] = {20, 10};
    harness_random       random = {45};
    hs_options           options = hs_options_default();
    const hs_points      points = {x, 30, 2, HS_FLOAT64, 2 * sizeof *x, sizeof *x};
    const hs_among       among = {.points = &points};
    const hs_node_lists  lists = {.n_lists = 2, .n_nodes = counts, .n_ghosts = context};
    hs_pairs            *found = NULL;
    hs_connectivity     *made = hs_connectivity_new();
    for (int k = 0; k < 60; k++)
        x[k] = random_unit(&random);
    options.cutoff = 0.4;
    options.want = HS_WANT_J;
    options.index_bytes = 4;
    CHECK(hs_neighbors_find(&among, &options, &found, NULL) == HS_OK);
    options.memory_limit = limit;
    (void)hs_call_enter(&options, NULL, &made->call);
    const hs_status status = hs_connectivity_fill_rows(made, &lists, &found);
    hs_call_leave(&made->call, 0);
    hs_pairs_free(found);
    hs_connectivity_free(made);
    return status;
}

static void
rows_that_are_found_may_be_too_many(void)
{
    static int64_t ghosts[2] = {5, 3};
    CHECK(raise_memory_limit(fill_found, NULL, &limit) > 5);
    CHECK(raise_memory_limit(fill_found, ghosts, &limit) > 5);
    const hs_points     points = {NULL, 0, 2, HS_FLOAT64, 16, 8};
    const hs_among      among = {.points = &points};
    const hs_node_lists none = {.n_lists = 0};
    hs_options          options = hs_options_default();
    hs_connectivity    *made;
    options.cutoff = 1.0;
    CHECK(hs_connectivity_build(&among, &none, &options, &made, NULL) == HS_OK);
    CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == 0);
    CHECK(hs_pairs_rows(hs_connectivity_rows(made)) == 0);
    hs_connectivity_free(made);
}

static hs_status
link_scene(void *context)
{
    const hs_half_list  half = node_half_of(&scene);
    const hs_node_lists lists = node_lists_of(&scene, true, true, true);
    hs_connectivity    *made = NULL;
    hs_options          options = hs_options_default();
    (void)context;
    const hs_status status = hs_connectivity_link(&half, &lists, &options, &made, NULL);
    CHECK((made != NULL) == (status == HS_OK));
    hs_connectivity_free(made);
    return status;
}

static void
no_allocation_that_fails_leaves_anything(void)
{
    harness_random random = {9};
    node_scene_fill(&random, true, &scene);
    CHECK(fail_each_allocation(link_scene, NULL, 200) > 5);
    check_arena(link_scene, NULL);
    hs_connectivity_free(NULL);
    CHECK(hs_connectivity_rows(NULL) == NULL && hs_connectivity_pairs(NULL) == NULL);
    CHECK(hs_connectivity_lists(NULL) == NULL);
}

void
test_connectivity(void)
{
    RUN(rows_and_pairs_are_those_of_the_matrix);
    RUN(shifts_are_opposite_in_the_other_row);
    RUN(searches_give_what_links_give);
    RUN(rows_that_are_found_may_be_too_many);
    RUN(no_allocation_that_fails_leaves_anything);
}
