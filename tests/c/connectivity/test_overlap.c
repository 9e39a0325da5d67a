/* SPDX-License-Identifier: BSD-3-Clause */
/* test_overlap.c: rows are the pattern of the product of matrices; rows that are none are refused,
 * and nothing is left when memory is. */
#include "../../../csrc/core/connectivity/overlap.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

void test_overlap(void);

static node_scene scene;
static bool       gathers[NODE_POINTS][NODE_POINTS], common[NODE_POINTS][NODE_POINTS];
static int64_t    offsets[NODE_POINTS + 1];
static int32_t    indices[NODE_PAIRS];
static double     limit = HUGE_VAL;

/* Random rows, not symmetric, and the product by its definition. */
static void
fill(harness_random *random)
{
    const double share = 0.2 * random_unit(random);
    int64_t      at = 0;
    for (int32_t i = 0; i < scene.n; i++) {
        offsets[i] = at;
        for (int32_t j = 0; j < scene.n; j++) {
            gathers[i][j] = i == j || random_unit(random) < share;
            if (gathers[i][j] && i != j)
                indices[at++] = j;
        }
    }
    offsets[scene.n] = at;
    for (int32_t i = 0; i < scene.n; i++) {
        for (int32_t j = 0; j < scene.n; j++) {
            common[i][j] = false;
            for (int32_t k = 0; i != j && k < scene.n; k++)
                common[i][j] = common[i][j] || (gathers[i][k] && gathers[j][k]);
        }
    }
}

static hs_index_rows
rows_given(void)
{
    return (hs_index_rows){
        .n = scene.n, .offsets = offsets, .n_indices = offsets[scene.n], .indices = indices};
}

static hs_points
points_given(void)
{
    return (hs_points){.data = scene.x,
                       .n = scene.n,
                       .ndim = 2,
                       .real = HS_FLOAT64,
                       .row_stride = 2 * sizeof(double),
                       .column_stride = sizeof(double)};
}

static void
rows_are_the_pattern_of_the_product(void)
{
    harness_random   random = {21};
    const hs_options options = hs_options_default();
    for (int trial = 0; trial < TRIALS(300); trial++) {
        const bool shuffled = trial & 1;
        hs_pairs  *rows;
        node_scene_fill(&random, shuffled, &scene);
        fill(&random);
        if (trial % 5 == 0 && scene.n > 0)
            scene.x[0] = HUGE_VAL; /* points only say what is near */
        const hs_index_rows gather = rows_given();
        const hs_points     points = points_given();
        const hs_node_lists lists = node_lists_of(&scene, shuffled, false, false);
        CHECK(hs_connectivity_overlap(&points, &gather, &lists, &options, &rows, NULL) == HS_OK);
        CHECK(node_rows_are(&scene, true, common, hs_pairs_offsets(rows),
                            hs_pairs_array(rows, HS_WANT_J)));
        hs_pairs_free(rows);
    }
}

static hs_status
find(void *context)
{
    const hs_index_rows gather = *(hs_index_rows *)context;
    const hs_points     points = points_given();
    const hs_node_lists lists = node_lists_of(&scene, false, true, true);
    hs_options          options = hs_options_default();
    hs_pairs           *rows = NULL;
    options.memory_limit = limit;
    const hs_status status =
        hs_connectivity_overlap(&points, &gather, &lists, &options, &rows, NULL);
    CHECK((rows != NULL) == (status == HS_OK));
    hs_pairs_free(rows);
    return status;
}

static void
rows_that_are_none_are_refused(void)
{
    static const int64_t descending[3] = {0, 2, 1}, late[3] = {1, 1, 1}, good[3] = {0, 1, 1};
    static const int32_t one[2] = {1, 1}, own[2] = {0, 0}, outside[2] = {2, 2}, below[2] = {-1, 0};
    static const int64_t both[3] = {0, 2, 2};
    scene = (node_scene){.n = 2, .n_lists = 1, .n_nodes = {2}};
    const hs_index_rows wrong[] = {
        {.n = 2, .offsets = descending, .n_indices = 1, .indices = one},
        {.n = 2, .offsets = late, .n_indices = 1, .indices = one},
        {.n = 2, .offsets = good, .n_indices = 2, .indices = one},
        {.n = 2, .offsets = good, .n_indices = 1, .indices = own},
        {.n = 2, .offsets = good, .n_indices = 1, .indices = outside},
        {.n = 2, .offsets = good, .n_indices = 1, .indices = below},
        {.n = 2, .offsets = both, .n_indices = 2, .indices = one},
        {.n = 1, .offsets = good, .n_indices = 1, .indices = one},
        {.n = -1, .offsets = good, .n_indices = 1, .indices = one},
        {.n = 2, .n_indices = 1, .indices = one},
        {.n = 2, .offsets = good, .n_indices = 1},
    };
    hs_index_rows fine = {.n = 2, .offsets = good, .n_indices = 1, .indices = one};
    CHECK(find(&fine) == HS_OK);
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        hs_index_rows rows = wrong[k];
        CHECK(find(&rows) == HS_ERR_ARGUMENT);
    }
}

static void
no_allocation_that_fails_leaves_anything(void)
{
    harness_random random = {4};
    node_scene_fill(&random, false, &scene);
    fill(&random);
    hs_index_rows gather = rows_given();
    CHECK(fail_each_allocation(find, &gather, 300) > 10);
    check_arena(find, &gather);
    CHECK(raise_memory_limit(find, &gather, &limit) > 20);
}

enum { CROWD = 800 };

/* Every point gathers every other one. */
static hs_status
find_crowd(int threads, int64_t polls, hs_pairs **rows)
{
    static int64_t       ends[CROWD + 1];
    static int32_t       others[CROWD * (CROWD - 1)];
    static double        x[CROWD];
    static const int64_t counts[2] = {CROWD / 2, CROWD / 2};
    int64_t              at = 0;
    for (int32_t i = 0; i < CROWD; i++) {
        ends[i] = at;
        x[i] = i % 17;
        for (int32_t j = 0; j < CROWD; j++) {
            if (j != i)
                others[at++] = j;
        }
    }
    ends[CROWD] = at;
    const hs_index_rows gather = {CROWD, ends, at, others};
    const hs_points     points = {x, CROWD, 1, HS_FLOAT64, sizeof *x, sizeof *x};
    const hs_node_lists lists = {.n_lists = 2, .n_nodes = counts};
    hs_options          options = hs_options_default();
    options.threads = threads;
    options.poll = stop_after;
    options.poll_context = &polls;
    return hs_connectivity_overlap(&points, &gather, &lists, &options, rows, NULL);
}

static void
long_rows_ask_the_caller(void)
{
    hs_pairs *rows;
    CHECK(find_crowd(1, 0, &rows) == HS_ERR_INTERRUPTED && rows == NULL);
    for (int threads = 1; threads <= 3; threads++) {
        CHECK(find_crowd(threads, 1 << 20, &rows) == HS_OK);
        CHECK(hs_pairs_length(rows) == CROWD * (CROWD - 1));
        const int64_t *first = hs_pairs_offsets(rows);
        const int32_t *index = hs_pairs_array(rows, HS_WANT_J);
        for (int64_t k = 0; k < 2 * CROWD; k++) {
            CHECK(first[k + 1] - first[k] == CROWD / 2 - (k / 2 / (CROWD / 2) == k % 2));
            for (int64_t e = first[k] + 1; e < first[k + 1]; e++)
                CHECK(index[e - 1] < index[e]);
        }
        hs_pairs_free(rows);
    }
}

void
test_overlap(void)
{
    RUN(rows_are_the_pattern_of_the_product);
    RUN(rows_that_are_none_are_refused);
    RUN(no_allocation_that_fails_leaves_anything);
    RUN(long_rows_ask_the_caller);
}
