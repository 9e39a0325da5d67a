/* SPDX-License-Identifier: BSD-3-Clause */
/* test_overlap.c: overlaps and intersections of neighbourhoods. */
#include "../../../csrc/core/connectivity/connectivity.h"
#include "../support/among.h"
#include "../support/harness.h"
#include "../support/node_scenes.h"
#include "../support/poll_checks.h"

#include <math.h>

void test_overlap(void);

/* Overlap: rows are the pattern of the product of matrices. */

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
    return points_in_rows(scene.x, scene.n, 2);
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
    static const int64_t both[3] = {0, 2, 2}, falling[3] = {0, -1, 1}, none[3] = {0, 0, 0};
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
        {.n = 2, .offsets = falling, .n_indices = 1, .indices = one},
        {.n = 2, .offsets = good, .n_indices = -1, .indices = one},
        {.n = 2, .offsets = good, .n_indices = 1},
    };
    hs_index_rows fine = {.n = 2, .offsets = good, .n_indices = 1, .indices = one};
    CHECK(find(&fine) == HS_OK);
    fine = (hs_index_rows){.n = 2, .offsets = none};
    CHECK(find(&fine) == HS_OK);
    fine.indices = one;
    fine.n_indices = INT64_C(1) << 50; /* there is no room for so many, whatever they are */
    CHECK(find(&fine) == HS_ERR_MEMORY);
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
    const hs_index_rows gather = {CROWD, ends, at, others, NULL, 1};
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

/* Intersection: for each pair the common neighbours whose foot, by whole numbers, lies between the
 * ends, and the ends. */

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
    const hs_points     points = points_in_rows(scene.x, scene.n, DIM);
    options.memory_limit = limit;
    return hs_connectivity_intersect(&points, NULL, &half, &lists, &options, result, failure);
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
    return hs_connectivity_intersect(&points, NULL, &half, &lists, &options, result, NULL);
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

/* Images: overlaps and intersections of points in a box that repeats along one axis, held against
 * their definitions. */

enum { FEW = 9, REACH = 4, WIDE = 2 * REACH + 1, MOST_IMAGES = FEW * FEW * WIDE };

static bool    has[FEW][FEW][WIDE]; /* row i has j at shift S - REACH */
static int64_t ends_of_images[FEW + 1], counts_of_images[2], ghosts_of_images[2];
static int32_t index_of_images[MOST_IMAGES], shift_of_images[3 * MOST_IMAGES];
static int32_t i_of_images[MOST_IMAGES];
static double  x_of_images[3 * FEW];
static int     image_axes = 2;
static bool    turned_order;

/* Shifts of up to `most`; both ways: with each (i, j, S) there is (j, i, -S). The other axes do
 * not repeat. */
static void
fill_images(harness_random *random, int most, bool both_ways)
{
    static const double side[3] = {0.5, 0.05, 0.2};
    const double        share = side[random_bits(random) % 3];
    memset(has, 0, sizeof has);
    for (int32_t i = 0; i < FEW; i++)
        for (int32_t j = 0; j < FEW; j++)
            for (int32_t s = -most; s <= most; s++)
                if ((i != j || s != 0) && random_unit(random) < share) {
                    has[i][j][REACH + s] = true;
                    has[j][i][REACH - s] |= both_ways;
                }
    counts_of_images[0] = (int64_t)(random_bits(random) % (FEW + 1));
    counts_of_images[1] = FEW - counts_of_images[0];
    for (int l = 0; l < 2; l++)
        ghosts_of_images[l] = (int64_t)(random_bits(random) % (uint64_t)(counts_of_images[l] + 1));
    for (int k = 0; k < 3 * FEW; k++)
        x_of_images[k] = (double)(random_bits(random) % 4);
    turned_order = random_bits(random) & 1;
}

/* Row after row; of pairs that are there both ways one. Returns how many. */
static int64_t
list_images(bool once)
{
    int64_t n = 0;
    for (int32_t i = 0; i < FEW; i++) {
        ends_of_images[i] = n;
        for (int32_t j = once ? i : 0; j < FEW; j++)
            for (int32_t s = once && i == j ? 1 : -REACH; s <= REACH; s++)
                if (has[i][j][REACH + s]) {
                    i_of_images[n] = i;
                    index_of_images[n] = j;
                    for (int k = 0; k < image_axes; k++)
                        shift_of_images[image_axes * n + k] = k == 0 ? s : 0;
                    n++;
                }
    }
    ends_of_images[FEW] = n;
    return n;
}

static hs_points
image_points(void)
{
    return (hs_points){x_of_images, FEW, image_axes, HS_FLOAT64, 8 * image_axes, 8};
}

static hs_node_lists
image_lists(void)
{
    static const int32_t number[FEW] = {8, 7, 6, 5, 4, 3, 2, 1, 0};
    return (hs_node_lists){.n_lists = 2,
                           .n_nodes = counts_of_images,
                           .n_ghosts = ghosts_of_images,
                           .number = turned_order ? number : NULL,
                           .ghost_rows = true};
}

/* The node of a point among all. */
static int32_t
node_of(int32_t point)
{
    return turned_order ? FEW - 1 - point : point;
}

static bool
is_of_list(int32_t point, int l)
{
    return (node_of(point) >= counts_of_images[0]) == (l == 1);
}

static int32_t
number_of(int32_t point)
{
    const int32_t node = node_of(point);
    return node - (node >= counts_of_images[0] ? (int32_t)counts_of_images[0] : 0);
}

static hs_status
overlap_images(void *context)
{
    const hs_points     points = image_points();
    const hs_node_lists lists = image_lists();
    const int64_t       n = list_images(false);
    const hs_index_rows gather = {FEW,       ends_of_images, n, index_of_images, shift_of_images,
                                  image_axes};
    hs_options          options = hs_options_default();
    hs_pairs           *made = NULL;
    options.memory_limit = limit;
    const hs_status status =
        hs_connectivity_overlap(&points, &gather, &lists, &options, &made, NULL);
    CHECK((made != NULL) == (status == HS_OK));
    if (context != NULL)
        *(hs_pairs **)context = made;
    else
        hs_pairs_free(made);
    return status;
}

/* Whether i and (j, s) have an image in common; each has itself. */
static bool
have_common(int32_t i, int32_t j, int s)
{
    for (int32_t k = 0; k < FEW; k++)
        for (int t = -REACH; t <= REACH; t++) {
            const int  u = t - s;
            const bool of_i = (k == i && t == 0) || has[i][k][REACH + t];
            if (of_i && u >= -REACH && u <= REACH && ((k == j && u == 0) || has[j][k][REACH + u]))
                return true;
        }
    return false;
}

static void
overlaps_have_every_image(void)
{
    harness_random random = {91};
    for (int trial = 0; trial < TRIALS(60); trial++) {
        hs_pairs *made;
        image_axes = 2 + trial % 2;
        fill_images(&random, 2, false);
        CHECK(overlap_images(&made) == HS_OK);
        const int64_t *first = hs_pairs_offsets(made);
        const int32_t *j = hs_pairs_array(made, HS_WANT_J),
                      *s = hs_pairs_array(made, HS_WANT_SHIFT);
        bool right = true;
        for (int32_t node = 0; node < FEW; node++) {
            const int32_t i = turned_order ? FEW - 1 - node : node;
            for (int l = 0; l < 2; l++) {
                int64_t at = first[2 * node + l];
                for (int32_t q = 0; q < FEW; q++)
                    for (int t = -REACH; is_of_list(q, l) && t <= REACH; t++)
                        if ((q != i || t != 0) && have_common(i, q, t)) {
                            const int32_t *own = s + image_axes * at;
                            right = right && j[at++] == number_of(q) && own[0] == t;
                            right = right && own[1] == 0 && own[image_axes - 1] == 0;
                        }
                right = right && at == first[2 * node + l + 1];
            }
        }
        CHECK(right);
        hs_pairs_free(made);
    }
    image_axes = 2;
    fill_images(&random, 2, false);
    CHECK(fail_each_allocation(overlap_images, NULL, 200) > 8);
    check_arena(overlap_images, NULL);
    CHECK(raise_memory_limit(overlap_images, NULL, &limit) > 10);
}

static void
images_that_are_no_rows_are_refused(void)
{
    static const int64_t counts[1] = {2}, all[3] = {0, 2, 2}, fewer[3] = {0, 1, 1};
    static const int32_t index[2] = {1, 1}, falling[2] = {1, 0}, own[2] = {0, 1},
                         beyond[2] = {1, 2};
    static const int32_t below[2] = {-1, 1}, shift[2] = {0, 1}, same[2] = {1, 1};
    static const int32_t least[2] = {INT32_MIN, INT32_MAX};
    const hs_points      points = {x_of_images, 2, 1, HS_FLOAT64, 8, 8};
    const hs_node_lists  lists = {.n_lists = 1, .n_nodes = counts};
    const hs_options     options = hs_options_default();
    const hs_index_rows  wrong[] = {
         {2, all, 2, falling, shift, 1},
         {2, all, 2, own, shift, 1},
         {2, all, 2, beyond, shift, 1},
         {2, all, 2, below, shift, 1},
         {2, all, 2, index, same, 1},
         {2, all, 2, index, shift, 0},
         {2, all, 2, index, shift, HS_MAX_DIM + 1},
         {2, fewer, 2, index, shift, 1},
    };
    hs_pairs *rows;
    for (size_t k = 0; k < sizeof wrong / sizeof *wrong; k++)
        CHECK(hs_connectivity_overlap(&points, &wrong[k], &lists, &options, &rows, NULL) ==
              HS_ERR_ARGUMENT);
    const hs_index_rows late = {0, all + 1, 0, index, shift, 1}; /* no row, which begins at 2 */
    const hs_node_lists nothing = {.n_lists = 1, .n_nodes = all};
    const hs_points     nowhere = {x_of_images, 0, 1, HS_FLOAT64, 8, 8};
    CHECK(hs_connectivity_overlap(&nowhere, &late, &nothing, &options, &rows, NULL) ==
          HS_ERR_ARGUMENT);
    const hs_index_rows far = {2, all, 2, index, least, 1}; /* their difference is no shift */
    CHECK(hs_connectivity_overlap(&points, &far, &lists, &options, &rows, NULL) ==
          HS_ERR_SHIFT_RANGE);
    CHECK(rows == NULL);
}

static const hs_box image_box = {
    .ndim = 2, .periodic = {true, false}, .rows = {{3.0, 1.0}, {0.0, 4.0}}};

static hs_status
intersect_images(void *context)
{
    const hs_points     points = image_points();
    const hs_node_lists lists = image_lists();
    const hs_half_list half = {list_images(true), i_of_images, index_of_images, shift_of_images, 2};
    hs_options         options = hs_options_default();
    hs_pairs          *made = NULL;
    options.memory_limit = limit;
    const hs_status status =
        hs_connectivity_intersect(&points, &image_box, &half, &lists, &options, &made, NULL);
    CHECK((made != NULL) == (status == HS_OK));
    if (context != NULL)
        *(hs_pairs **)context = made;
    else
        hs_pairs_free(made);
    return status;
}

/* Of small whole numbers. */
static bool
is_between_images(int32_t k, int t, int32_t i, int32_t j, int s)
{
    double along = 0.0, square = 0.0;
    for (int d = 0; d < 2; d++) {
        const double p = x_of_images[2 * i + d], row = image_box.rows[0][d];
        const double q = x_of_images[2 * j + d] + s * row - p;
        along += (x_of_images[2 * k + d] + t * row - p) * q;
        square += q * q;
    }
    return along >= 0.0 && along <= square;
}

static void
intersections_have_every_image(void)
{
    harness_random random = {92};
    for (int trial = 0; trial < TRIALS(60); trial++) {
        hs_pairs *made;
        fill_images(&random, 2, true);
        const hs_node_lists lists = image_lists();
        CHECK(intersect_images(&made) == HS_OK);
        const int64_t *first = hs_pairs_offsets(made), n = list_images(true);
        const int32_t *node = hs_pairs_array(made, HS_WANT_J);
        const int32_t *shift = hs_pairs_array(made, HS_WANT_SHIFT);
        bool           right = true;
        for (int64_t e = 0; e < n; e++) {
            int32_t ends[2] = {i_of_images[e], index_of_images[e]};
            int     s = shift_of_images[2 * e];
            bool    ghost[2];
            for (int k = 0; k < 2; k++) {
                const int l = is_of_list(ends[k], 1);
                ghost[k] = number_of(ends[k]) >= counts_of_images[l] - ghosts_of_images[l];
            }
            if (ghost[0] && ghost[1])
                continue;
            if (ghost[0] && lists.number == NULL) {
                ends[0] = index_of_images[e];
                ends[1] = i_of_images[e];
                s = -s;
            }
            for (int l = 0; l < 2; l++) {
                int64_t at = *first++;
                for (int32_t k = 0; k < FEW; k++)
                    for (int t = -REACH; is_of_list(k, l) && t <= REACH; t++) {
                        const int u = t - s;
                        if (has[ends[0]][k][REACH + t] && u >= -REACH && u <= REACH &&
                            has[ends[1]][k][REACH + u] &&
                            is_between_images(k, t, ends[0], ends[1], s)) {
                            right = right && node[at] == number_of(k) && shift[2 * at] == t;
                            right = right && shift[2 * at++ + 1] == 0;
                        }
                    }
                for (int k = 0; k < 2; k++)
                    if (is_of_list(ends[k], l)) {
                        right = right && node[at] == number_of(ends[k]);
                        right = right && shift[2 * at++] == (k == 0 ? 0 : s);
                    }
                right = right && at == *first;
            }
        }
        CHECK(right);
        hs_pairs_free(made);
    }
    fill_images(&random, 1, true);
    CHECK(fail_each_allocation(intersect_images, NULL, 200) > 8);
    check_arena(intersect_images, NULL);
    CHECK(raise_memory_limit(intersect_images, NULL, &limit) > 10);
}

/* Keys of the Z curve never descend along an axis, and bits come in turns. */

static void
keys_never_descend(void)
{
    static const double ranges[][2] = {
        {0.0, 1.0}, {-3.0, 5.0}, {-0x1.8p1023, 0x1.8p1023}, {1.0, 1.0 + 0x1p-40}, {0.0, 5e-324}};
    static const double zeros[HS_MAX_DIM] = {0.0};
    harness_random      random = {6};
    for (int r = 0; r < 5; r++) {
        for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
            const int    axis = ndim - 1;
            const double bottom = ranges[r][0], top = ranges[r][1];
            double       low[HS_MAX_DIM] = {0.0}, high[HS_MAX_DIM] = {0.0}, x[HS_MAX_DIM] = {0.0};
            uint64_t     last = 0; /* all bits of this axis */
            for (int b = 0; b < 63 / ndim; b++)
                last |= UINT64_C(1) << (b * ndim + axis);
            low[axis] = bottom;
            high[axis] = top;
            CHECK(hs_morton_key(low, low, high, ndim) == 0);
            CHECK(hs_morton_key(high, low, high, ndim) == last);
            for (int trial = 0; trial < 100; trial++) {
                const double part = random_unit(&random);
                x[axis] = fmin(bottom * (1.0 - part) + top * part, top);
                const uint64_t key = hs_morton_key(x, low, high, ndim);
                x[axis] = nextafter(x[axis], top);
                const uint64_t next = hs_morton_key(x, low, high, ndim);
                CHECK(key <= next && next <= last && (next & ~last) == 0);
            }
        }
    }
    static const double two[2] = {2.0, 2.0}, quarter[2] = {0.25, 0.75}, one[2] = {1.0, 1.0};
    CHECK(hs_morton_key(two, two, two, 2) == 0);
    CHECK(hs_morton_key(quarter, zeros, one, 2) >> 58 == 0xB); /* 01 and 11 */
}

void
test_overlap(void)
{
    RUN(rows_are_the_pattern_of_the_product);
    RUN(rows_that_are_none_are_refused);
    RUN(no_allocation_that_fails_leaves_anything);
    RUN(long_rows_ask_the_caller);
    RUN(entries_are_those_of_the_definition);
    RUN(threads_change_nothing);
    RUN(failures_leave_nothing);
    RUN(overlaps_have_every_image);
    RUN(images_that_are_no_rows_are_refused);
    RUN(intersections_have_every_image);
    RUN(keys_never_descend);
}
