/* SPDX-License-Identifier: BSD-3-Clause */
/* test_node_map.c: each point is the node that its number says, and what is no map is refused. */
#include "../support/node_scenes.h"

void test_node_map(void);

static node_scene scene;

static hs_status
make(const hs_node_lists *lists, int64_t n, hs_node_map *map)
{
    hs_account       account;
    const hs_options options = hs_options_default();
    hs_account_init(&account, &options);
    const hs_status status = hs_node_map_make(&account, lists, n, map);
    if (status == HS_OK) {
        for (int32_t p = 0; p < scene.n; p++) {
            const int64_t row =
                node_rows_before(&scene, scene.list[p], lists->ghost_rows) + scene.node[p];
            const bool has_row = lists->ghost_rows || !scene.is_ghost[p];
            CHECK(map->list[p] == scene.list[p] && map->node[p] == scene.node[p]);
            CHECK(map->is_ghost[p] == scene.is_ghost[p]);
            CHECK(map->row[p] == (has_row ? row : -1));
        }
        CHECK(map->n_rows == node_rows_before(&scene, scene.n_lists, lists->ghost_rows));
    }
    hs_node_map_free(&account, map);
    hs_node_map_free(&account, map);
    CHECK(account.held == 0);
    hs_account_close(&account);
    return status;
}

static void
every_point_is_its_node(void)
{
    harness_random random = {11};
    hs_node_map    map;
    for (int trial = 0; trial < 300; trial++) {
        const bool shuffled = trial % 2 == 1, ghost_rows = trial % 4 < 2;
        node_scene_fill(&random, shuffled, &scene);
        const hs_node_lists lists = node_lists_of(&scene, shuffled, ghost_rows, false);
        CHECK(make(&lists, scene.n, &map) == HS_OK);
    }
}

static void
what_is_no_map_is_refused(void)
{
    hs_node_map         map;
    const int64_t       counts[2] = {2, 1}, too_many[2] = {2, 2}, ghosts[2] = {3, 0};
    const int64_t       negative[2] = {-1, 4};
    const int32_t       twice[3] = {0, 1, 1}, outside[3] = {0, 1, 3}, below[3] = {0, -1, 2};
    const hs_node_lists wrong[] = {
        {.n_lists = -1},
        {.n_lists = 2},
        {.n_lists = 1, .n_nodes = counts},
        {.n_lists = 2, .n_nodes = too_many},
        {.n_lists = 2, .n_nodes = negative},
        {.n_lists = 2, .n_nodes = counts, .n_ghosts = ghosts},
        {.n_lists = 2, .n_nodes = counts, .n_ghosts = negative},
        {.n_lists = 2, .n_nodes = counts, .number = twice},
        {.n_lists = 2, .n_nodes = counts, .number = outside},
        {.n_lists = 2, .n_nodes = counts, .number = below},
    };
    scene.n = 0;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++)
        CHECK(make(&wrong[k], 3, &map) == HS_ERR_ARGUMENT);
    CHECK(hs_node_map_make(NULL, NULL, 0, &map) == HS_ERR_ARGUMENT);
}

void
test_node_map(void)
{
    RUN(every_point_is_its_node);
    RUN(what_is_no_map_is_refused);
}
