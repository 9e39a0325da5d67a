/* SPDX-License-Identifier: BSD-3-Clause */
/* test_intersection.c: for each pair the common neighbours whose foot, by whole numbers, lies
 * between the ends, and the ends; nothing is left when memory is short. */
#include "../../../csrc/core/connectivity/intersection.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_intersection(void);

enum { DIM = 2 };

static node_scene scene;
static double     limit = HUGE_VAL;

/* Coordinates are small whole numbers. */
static bool
is_between(int32_t k, int32_t i, int32_t j)
{
    double along = 0.0, square = 0.0;
    for (int d = 0; d < DIM; d++) {
        const double p = scene.x[i * DIM + d], q = scene.x[j * DIM + d];
        along += (scene.x[k * DIM + d] - p) * (q - p);
        square += (q - p) * (q - p);
    }
    return along >= 0.0 && along <= square;
}

/* Whether entries from *entry on, one for each list, are those of the pair (i, j). */
static bool
entry_is(int32_t i, int32_t j, const int64_t *offsets, const int32_t *indices)
{
    bool right = true;
    for (int32_t l = 0; right && l < scene.n_lists; l++) {
        int64_t at = offsets[l];
        for (int32_t k = 0; right && k < scene.n; k++) {
            if (scene.list[k] == l && scene.near[i][k] && scene.near[j][k] && is_between(k, i, j))
                right = indices[at++] == scene.node[k];
        }
        if (scene.list[i] == l)
            right = right && indices[at++] == scene.node[i];
        if (scene.list[j] == l)
            right = right && indices[at++] == scene.node[j];
        right = right && at == offsets[l + 1];
    }
    return right;
}

static void
fill(harness_random *random, bool shuffled)
{
    node_scene_fill(random, shuffled, &scene);
    for (int k = 0; k < scene.n * DIM; k++)
        scene.x[k] = (double)(random_bits(random) % 5);
}

static hs_status
find(bool shuffled, bool ghost_pairs, hs_pairs **result, hs_failure *failure)
{
    const hs_half_list  half = node_half_of(&scene);
    const hs_node_lists lists = node_lists_of(&scene, shuffled, true, ghost_pairs);
    hs_options          options = hs_options_default();
    const hs_points     points = {.data = scene.x,
                                  .n = scene.n,
                                  .ndim = DIM,
                                  .real = HS_FLOAT64,
                                  .row_stride = DIM * sizeof(double),
                                  .column_stride = sizeof(double)};
    options.memory_limit = limit;
    return hs_connectivity_intersect(&points, &half, &lists, &options, result, failure);
}

static void
entries_are_those_of_the_definition(void)
{
    harness_random random = {33};
    for (int trial = 0; trial < TRIALS(200); trial++) {
        const bool shuffled = trial & 1, ghost_pairs = trial & 2;
        hs_pairs  *found;
        fill(&random, shuffled);
        CHECK(find(shuffled, ghost_pairs, &found, NULL) == HS_OK);
        const int64_t *offsets = hs_pairs_offsets(found);
        const int32_t *indices = hs_pairs_array(found, HS_WANT_J);
        for (int64_t e = 0; e < scene.n_pairs; e++) {
            int32_t i = scene.i[e], j = scene.j[e];
            if (!ghost_pairs && scene.is_ghost[i] && scene.is_ghost[j])
                continue;
            if (!shuffled && scene.is_ghost[i] && !scene.is_ghost[j]) {
                i = scene.j[e];
                j = scene.i[e];
            }
            CHECK(entry_is(i, j, offsets, indices));
            offsets += scene.n_lists;
        }
        hs_pairs_free(found);
    }
}

static hs_status
find_once(void *context)
{
    hs_pairs       *found = NULL;
    const hs_status status = find(false, *(bool *)context, &found, NULL);
    CHECK((found != NULL) == (status == HS_OK));
    CHECK(status != HS_OK || hs_pairs_array(found, HS_WANT_J) != NULL);
    hs_pairs_free(found);
    return status;
}

static void
failures_leave_nothing(void)
{
    harness_random random = {8};
    bool           ghost_pairs = true;
    hs_failure     failure;
    hs_pairs      *found;
    do {
        fill(&random, false);
    } while (scene.n_pairs == 0);
    CHECK(fail_each_allocation(find_once, &ghost_pairs, 200) > 8);
    check_arena(find_once, &ghost_pairs);
    CHECK(raise_memory_limit(find_once, &ghost_pairs, &limit) > 10);
    scene.x[DIM + 1] = NAN;
    CHECK(find(false, true, &found, &failure) == HS_ERR_NOT_FINITE && found == NULL);
    CHECK(failure.row == 1 && failure.column == 1);
    scene.n_nodes[0]++;
    CHECK(find(false, true, &found, &failure) == HS_ERR_ARGUMENT);
}

/* The array that was asked for is there, be it empty. */
static void
no_pairs_have_no_entries(void)
{
    harness_random random = {9};
    bool           ghost_pairs = true;
    hs_pairs      *found;
    fill(&random, false);
    scene.n_pairs = 0;
    CHECK(find(false, true, &found, NULL) == HS_OK);
    CHECK(hs_pairs_length(found) == 0 && hs_pairs_rows(found) == 0);
    CHECK(hs_pairs_offsets(found)[0] == 0);
    hs_pairs_free(found);
    CHECK(fail_each_allocation(find_once, &ghost_pairs, 200) > 4);
}

enum { CROWD = 200, CROWD_PAIRS = CROWD * (CROWD - 1) / 2 };

/* Every point is a neighbour of every other one. */
static hs_status
find_crowd(int threads, int64_t polls, hs_pairs **result)
{
    static int32_t       i[CROWD_PAIRS], j[CROWD_PAIRS];
    static double        x[CROWD];
    static const int64_t counts[2] = {CROWD / 2, CROWD / 2}, ghosts[2] = {CROWD / 4, 0};
    int64_t              e = 0;
    for (int32_t a = 0; a < CROWD; a++) {
        x[a] = a * 7 % CROWD;
        for (int32_t b = a + 1; b < CROWD; b++) {
            i[e] = a;
            j[e++] = b;
        }
    }
    const hs_half_list  half = {.n = CROWD_PAIRS, .i = i, .j = j};
    const hs_points     points = {x, CROWD, 1, HS_FLOAT64, sizeof *x, sizeof *x};
    const hs_node_lists lists = {
        .n_lists = 2, .n_nodes = counts, .n_ghosts = ghosts, .ghost_rows = true};
    hs_options options = hs_options_default();
    options.threads = threads;
    options.poll = stop_after;
    options.poll_context = &polls;
    return hs_connectivity_intersect(&points, &half, &lists, &options, result, NULL);
}

static void
threads_change_nothing(void)
{
    hs_pairs *alone, *found;
    CHECK(find_crowd(1, 0, &alone) == HS_ERR_INTERRUPTED && alone == NULL);
    CHECK(find_crowd(1, 1 << 20, &alone) == HS_OK);
    const int64_t n = hs_pairs_rows(alone);
    CHECK(n == 2 * (CROWD_PAIRS - CROWD / 4 * (CROWD / 4 - 1) / 2));
    for (int threads = 2; threads <= 3; threads++) {
        CHECK(find_crowd(threads, 1 << 20, &found) == HS_OK);
        CHECK(hs_pairs_rows(found) == n && hs_pairs_length(found) == hs_pairs_length(alone));
        CHECK(memcmp(hs_pairs_offsets(found), hs_pairs_offsets(alone), (size_t)(n + 1) * 8) == 0);
        CHECK(memcmp(hs_pairs_array(found, HS_WANT_J), hs_pairs_array(alone, HS_WANT_J),
                     (size_t)hs_pairs_length(alone) * 4) == 0);
        hs_pairs_free(found);
    }
    hs_pairs_free(alone);
}

void
test_intersection(void)
{
    RUN(entries_are_those_of_the_definition);
    RUN(threads_change_nothing);
    RUN(failures_leave_nothing);
    RUN(no_pairs_have_no_entries);
}
