/* SPDX-License-Identifier: BSD-3-Clause */
/* test_node_rows.c: rows and pairs of many pairs ask the caller, and leave nothing when they end
 * early; test_connectivity.c has what they are. */
#include "../../../csrc/core/connectivity/connectivity.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_node_rows(void);

enum { MANY = 1500, MANY_PAIRS = MANY * (MANY - 1) / 2 };

static int32_t    i[MANY_PAIRS], j[MANY_PAIRS];
static node_scene scene;
static double     limit = HUGE_VAL;

static hs_status
link_many(int64_t polls, bool rows_only, hs_connectivity **made)
{
    static const int64_t counts[2] = {MANY - 1, 1};
    const hs_half_list   half = {.n = MANY_PAIRS, .i = i, .j = j};
    const hs_node_lists  lists = {.n_lists = 2, .n_nodes = counts, .rows_only = rows_only};
    hs_options           options = hs_options_default();
    options.poll = stop_after;
    options.poll_context = &polls;
    return hs_connectivity_link(&half, &lists, &options, made, NULL);
}

static void
many_pairs_ask_the_caller(void)
{
    hs_connectivity *made;
    int64_t          e = 0;
    for (int32_t a = 0; a < MANY; a++) {
        for (int32_t b = a + 1; b < MANY; b++) {
            i[e] = a;
            j[e++] = b;
        }
    }
    for (int64_t polls = 0; polls < 2; polls++) {
        CHECK(link_many(polls, false, &made) == HS_ERR_INTERRUPTED);
        CHECK(made == NULL);
    }
    for (int rows_only = 0; rows_only < 2; rows_only++) {
        CHECK(link_many(2, rows_only, &made) == HS_OK);
        CHECK(hs_pairs_length(hs_connectivity_rows(made)) == 2 * (int64_t)MANY_PAIRS);
        CHECK(hs_pairs_length(hs_connectivity_pairs(made)) == (rows_only ? 0 : MANY_PAIRS));
        const int64_t *offsets = hs_pairs_offsets(hs_connectivity_rows(made));
        for (int32_t row = 0; row < MANY; row++)
            CHECK(offsets[2 * row + 1] - offsets[2 * row] == MANY - 1 - (row < MANY - 1));
        hs_connectivity_free(made);
    }
}

static hs_status
link_scene(void *context)
{
    const hs_half_list  half = node_half_of(&scene);
    const hs_node_lists lists = node_lists_of(&scene, true, true, true);
    hs_options          options = hs_options_default();
    hs_connectivity    *made = NULL;
    (void)context;
    options.memory_limit = limit;
    const hs_status status = hs_connectivity_link(&half, &lists, &options, &made, NULL);
    CHECK((made != NULL) == (status == HS_OK));
    hs_connectivity_free(made);
    return status;
}

static void
no_limit_of_memory_leaves_anything(void)
{
    harness_random random = {31};
    do {
        node_scene_fill(&random, true, &scene);
    } while (scene.n_pairs < 40);
    CHECK(raise_memory_limit(link_scene, NULL, &limit) > 10);
}

void
test_node_rows(void)
{
    RUN(many_pairs_ask_the_caller);
    RUN(no_limit_of_memory_leaves_anything);
}
