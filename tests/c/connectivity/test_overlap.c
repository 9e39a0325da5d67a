/* SPDX-License-Identifier: BSD-3-Clause */
/* test_overlap.c: overlaps and intersections of neighbourhoods. */
#include "../../../csrc/core/connectivity/overlap.h"
#include "../support/harness.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_overlap(void);

/*
 * ---- point rows ----
 *
 * Rows that are given are copied with their own numbers, turned under others, and made of half
 * lists.
 */

static void
what_are_no_rows_is_refused(void)
{
    static const int64_t ends[3] = {0, 1, 1}, none[3] = {0, 0, 0};
    static const int32_t one[1] = {1};
    hs_point_rows        rows;
    const hs_index_rows  wrong[] = {{-1, ends, 1, one},
                                    {INT64_C(1) << 31, ends, 1, one},
                                    {2, NULL, 1, one},
                                    {2, ends, 1, NULL},
                                    {2, ends, 0, NULL}};
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++) {
        CHECK(hs_point_rows_copy(NULL, &wrong[k], &rows) == HS_ERR_ARGUMENT);
        CHECK(rows.first == NULL && rows.index == NULL);
    }
    const hs_index_rows empty = {2, none, 0, NULL};
    CHECK(hs_point_rows_copy(NULL, &empty, &rows) == HS_OK && rows.first[2] == 2);
    hs_point_rows_free(NULL, &rows);
}

/* ---- rows are the pattern of the product of matrices ---- */

static node_scene scene;
static bool       gathers[NODE_POINTS][NODE_POINTS], common[NODE_POINTS][NODE_POINTS];
static int64_t    offsets_overlap[NODE_POINTS + 1];
static int32_t    indices_overlap[NODE_PAIRS];
static double     limit = HUGE_VAL;

/* Random rows, not symmetric, and the product by its definition. */
static void
fill(harness_random *random)
{
    const double share = 0.2 * random_unit(random);
    int64_t      at = 0;
    for (int32_t i = 0; i < scene.n; i++) {
        offsets_overlap[i] = at;
        for (int32_t j = 0; j < scene.n; j++) {
            gathers[i][j] = i == j || random_unit(random) < share;
            if (gathers[i][j] && i != j)
                indices_overlap[at++] = j;
        }
    }
    offsets_overlap[scene.n] = at;
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
    return (hs_index_rows){.n = scene.n,
                           .offsets = offsets_overlap,
                           .n_indices = offsets_overlap[scene.n],
                           .indices = indices_overlap};
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

/*
 * ---- intersection ----
 *
 * For each pair the common neighbours whose foot, by whole numbers, lies between the ends, and the
 * ends.
 */

enum { DIM = 2 };

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

/* Whether offsets and indices from here on, one range for each list, are those of the pair
 * (i, j). */
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
fill_intersection(harness_random *random, bool shuffled)
{
    node_scene_fill(random, shuffled, &scene);
    for (int k = 0; k < scene.n * DIM; k++)
        scene.x[k] = (double)(random_bits(random) % 5);
}

static hs_status
find_intersection(bool shuffled, bool ghost_pairs, hs_pairs **result, hs_failure *failure)
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
        fill_intersection(&random, shuffled);
        CHECK(find_intersection(shuffled, ghost_pairs, &found, NULL) == HS_OK);
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
    const hs_status status = find_intersection(false, *(bool *)context, &found, NULL);
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
        fill_intersection(&random, false);
    } while (scene.n_pairs == 0);
    CHECK(fail_each_allocation(find_once, &ghost_pairs, 200) > 8);
    check_arena(find_once, &ghost_pairs);
    CHECK(raise_memory_limit(find_once, &ghost_pairs, &limit) > 10);
    scene.x[DIM + 1] = NAN;
    CHECK(find_intersection(false, true, &found, &failure) == HS_ERR_NOT_FINITE && found == NULL);
    CHECK(failure.row == 1 && failure.column == 1);
    scene.n_nodes[0]++;
    CHECK(find_intersection(false, true, &found, &failure) == HS_ERR_ARGUMENT);
}

enum { CROWD_INTERSECTION = 200, CROWD_PAIRS = CROWD_INTERSECTION * (CROWD_INTERSECTION - 1) / 2 };

/* Every point is a neighbour of every other one. */
static hs_status
find_crowd_intersection(int threads, int64_t polls, hs_pairs **result)
{
    static int32_t       i[CROWD_PAIRS], j[CROWD_PAIRS];
    static double        x[CROWD_INTERSECTION];
    static const int64_t counts[2] = {CROWD_INTERSECTION / 2, CROWD_INTERSECTION / 2},
                         ghosts[2] = {CROWD_INTERSECTION / 4, 0};
    int64_t e = 0;
    for (int32_t a = 0; a < CROWD_INTERSECTION; a++) {
        x[a] = a * 7 % CROWD_INTERSECTION;
        for (int32_t b = a + 1; b < CROWD_INTERSECTION; b++) {
            i[e] = a;
            j[e++] = b;
        }
    }
    const hs_half_list  half = {.n = CROWD_PAIRS, .i = i, .j = j};
    const hs_points     points = {x, CROWD_INTERSECTION, 1, HS_FLOAT64, sizeof *x, sizeof *x};
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
    CHECK(find_crowd_intersection(1, 0, &alone) == HS_ERR_INTERRUPTED && alone == NULL);
    CHECK(find_crowd_intersection(1, 1 << 20, &alone) == HS_OK);
    const int64_t n = hs_pairs_rows(alone);
    CHECK(n == 2 * (CROWD_PAIRS - CROWD_INTERSECTION / 4 * (CROWD_INTERSECTION / 4 - 1) / 2));
    for (int threads = 2; threads <= 3; threads++) {
        CHECK(find_crowd_intersection(threads, 1 << 20, &found) == HS_OK);
        CHECK(hs_pairs_rows(found) == n && hs_pairs_length(found) == hs_pairs_length(alone));
        CHECK(memcmp(hs_pairs_offsets(found), hs_pairs_offsets(alone), (size_t)(n + 1) * 8) == 0);
        CHECK(memcmp(hs_pairs_array(found, HS_WANT_J), hs_pairs_array(alone, HS_WANT_J),
                     (size_t)hs_pairs_length(alone) * 4) == 0);
        hs_pairs_free(found);
    }
    hs_pairs_free(alone);
}

/* ---- slices never descend, bits come in turns, and points are put in order by them ---- */

static void
slices_never_descend(void)
{
    static const double ranges[][2] = {
        {0.0, 1.0}, {-3.0, 5.0}, {-0x1.8p1023, 0x1.8p1023}, {1.0, 1.0 + 0x1p-40}, {0.0, 5e-324}};
    harness_random random = {6};
    for (int r = 0; r < 5; r++) {
        const double low = ranges[r][0], high = ranges[r][1];
        for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
            const int      bits = hs_morton_bits(ndim);
            const uint64_t last = (UINT64_C(1) << bits) - 1;
            CHECK(hs_morton_slice(low, low, high, bits) == 0);
            CHECK(hs_morton_slice(high, low, high, bits) == last);
            for (int trial = 0; trial < 100; trial++) {
                const double part = random_unit(&random);
                const double x = fmin(low * (1.0 - part) + high * part, high);
                const double y = nextafter(x, high);
                CHECK(hs_morton_slice(x, low, high, bits) <= hs_morton_slice(y, low, high, bits));
                CHECK(hs_morton_slice(y, low, high, bits) <= last);
            }
        }
    }
    CHECK(hs_morton_slice(2.0, 2.0, 2.0, 21) == 0);
    CHECK(hs_morton_slice(0.25, 0.0, 1.0, 2) == 1 && hs_morton_slice(0.75, 0.0, 1.0, 2) == 3);
}

void
test_overlap(void)
{
    RUN(what_are_no_rows_is_refused);
    RUN(rows_are_the_pattern_of_the_product);
    RUN(rows_that_are_none_are_refused);
    RUN(no_allocation_that_fails_leaves_anything);
    RUN(long_rows_ask_the_caller);
    RUN(entries_are_those_of_the_definition);
    RUN(threads_change_nothing);
    RUN(failures_leave_nothing);
    RUN(slices_never_descend);
}
