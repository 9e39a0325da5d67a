/* SPDX-License-Identifier: BSD-3-Clause */
/* test_row_split.c: rows of points become rows of nodes and half lists, with their shifts. */
#include "../../../csrc/core/connectivity/half_list.h"
#include "../../../csrc/core/connectivity/row_split.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_row_split(void);

static node_scene scene;
static int64_t    offsets[NODE_POINTS + 1];
static int32_t    indices[2 * NODE_PAIRS];

static hs_rows_view
rows_of_points(void)
{
    int64_t at = 0;
    for (int32_t p = 0; p < scene.n; p++) {
        offsets[p] = at;
        for (int32_t q = 0; q < scene.n; q++) {
            if (scene.near[p][q])
                indices[at++] = q;
        }
    }
    offsets[scene.n] = at;
    return (hs_rows_view){.first = offsets, .end = offsets + 1, .index = indices, .ndim = 1};
}

static hs_status
split(void *context)
{
    const bool          shuffled = *(bool *)context;
    const hs_options    options = hs_options_default();
    const hs_node_lists lists = node_lists_of(&scene, shuffled, shuffled, false);
    const hs_rows_view  view = rows_of_points();
    hs_node_map         map;
    hs_call             call;
    hs_output           half;
    (void)hs_call_enter(&options, NULL, &call);
    hs_pairs *rows = hs_pairs_new();
    hs_status status = rows != NULL ? HS_OK : HS_ERR_MEMORY;
    if (status == HS_OK) {
        memset(&rows->call, 0, sizeof rows->call);
        status = hs_node_map_make(&call.account, &lists, scene.n, &map);
    }
    if (status == HS_OK) {
        status = hs_row_split_fill(&call, &map, &view, rows);
        CHECK(status != HS_OK || node_rows_are(&scene, shuffled, scene.near, hs_pairs_offsets(rows),
                                               hs_pairs_array(rows, HS_WANT_J)));
        hs_node_map_free(&call.account, &map);
    }
    if (status == HS_OK) {
        status = hs_row_split_half(&call, scene.n, &view, &half);
        const hs_half_columns found = hs_half_list_columns(&half);
        const size_t          bytes = (size_t)scene.n_pairs * sizeof(int32_t);
        CHECK(status != HS_OK || found.n == scene.n_pairs);
        CHECK(status != HS_OK || bytes == 0 ||
              (memcmp(found.i, scene.i, bytes) == 0 && memcmp(found.j, scene.j, bytes) == 0));
        hs_output_free(&half);
    }
    hs_pairs_free(rows);
    hs_call_leave(&call, 0);
    hs_account_close(&call.account);
    return status;
}

static void
rows_and_half_lists_are_those_of_the_matrix(void)
{
    harness_random random = {14};
    for (int trial = 0; trial < TRIALS(300); trial++) {
        bool shuffled = trial & 1;
        node_scene_fill(&random, shuffled, &scene);
        CHECK(split(&shuffled) == HS_OK);
    }
    bool shuffled = true;
    CHECK(fail_each_allocation(split, &shuffled, 100) > 5);
}

static void
images_go_once_and_with_their_shifts(void)
{
    static const int64_t first[3] = {0, 3, 7};
    static const int32_t index[7] = {0, 0, 1, 0, 0, 1, 1};
    static const int32_t shift[14] = {0, -1, 0, 1, 3, 5, -3, -5, -2, 0, 0, -4, 0, 4};
    static const int32_t of_half[6] = {0, 1, 3, 5, 0, 4};
    const hs_rows_view   view = {first, first + 1, index, shift, 2};
    const hs_options     options = hs_options_default();
    hs_call              call;
    hs_output            half;
    (void)hs_call_enter(&options, NULL, &call);
    CHECK(hs_row_split_half(&call, 2, &view, &half) == HS_OK);
    const hs_half_columns found = hs_half_list_columns(&half);
    CHECK(found.n == 3 && memcmp(found.shift, of_half, sizeof of_half) == 0);
    CHECK(found.i[0] == 0 && found.j[0] == 0 && found.i[1] == 0 && found.j[1] == 1);
    CHECK(found.i[2] == 1 && found.j[2] == 1);
    hs_output_free(&half);
    hs_call_leave(&call, 0);
    hs_account_close(&call.account);
}

void
test_row_split(void)
{
    RUN(rows_and_half_lists_are_those_of_the_matrix);
    RUN(images_go_once_and_with_their_shifts);
}
