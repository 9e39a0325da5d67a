/* SPDX-License-Identifier: BSD-3-Clause */
/* test_tree.c: the tree of points: how it is divided, and its bounds. */
#include "../support/among.h"
#include "../support/answers.h"
#include "../support/harness.h"
#include "../support/nearest_unit.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"

#include <math.h>
#include <string.h>

void test_tree(void);

/*
 * ---- tree build ----
 *
 * The tree of nearest points, for points that samples do not show as they lie, so that nodes are
 * many.
 */

/*
 * Points that samples see least of: many are 0, the others each twice as far as the last, in an
 * order in which samples meet few of these, so that nearly each cut leaves one point alone.
 */
enum { N = 28 };
static const double lopsided[N] = {
    4096.0, 0.0,     0.0,    2.0,   0.0, 8192.0, 0.0,   8.0, 16384.0, 512.0,  0.0,  0.0, 16.0, 64.0,
    0.0,    32768.0, 1024.0, 256.0, 0.0, 0.0,    128.0, 0.0, 0.0,     2048.0, 32.0, 1.0, 0.0,  4.0,
};

static void
lopsided_points_need_many_nodes(void)
{
    double      x[2 * N] = {0.0};
    brute_scene scene = {.ndim = 1, .n = N, .x = lopsided, .cutoff = 40000.0};
    for (int salt = 0; salt < 10; salt++)
        CHECK(nearest_are_right(&scene, (uint64_t)salt));
    for (int i = 0; i < N; i++)
        x[2 * i + 1] = lopsided[i];
    scene.ndim = 2;
    scene.x = x;
    CHECK(nearest_are_right(&scene, 1));
}

/* One search, which frees its rows. */
typedef struct tree_search {
    hs_points points;
    int       threads;
} tree_search;

static hs_status
search_once(void *context)
{
    const tree_search *search = context;
    hs_options         options = hs_options_default();
    hs_pairs          *rows = NULL;
    options.cutoff = INFINITY;
    options.want = HS_WANT_J;
    options.threads = search->threads;
    const hs_status status =
        hs_nearest_find(AMONG(&search->points, NULL), 2, &options, &rows, NULL);
    hs_pairs_free(rows);
    return status;
}

static void
allocations_fail_in_a_subtree_that_grows(void)
{
    tree_search search = {{lopsided, N, 1, HS_FLOAT64, 8, 8}, 1};
    CHECK(fail_each_allocation(search_once, &search, 200) > 10);
    enum { MANY = 20000 }; /* of several subtrees */
    static double  x[MANY];
    harness_random random = {28};
    for (int i = 0; i < MANY; i++)
        x[i] = random_unit(&random);
    search.points = (hs_points){x, MANY, 1, HS_FLOAT64, 8, 8};
    CHECK(fail_each_allocation(search_once, &search, 200) > 10);
}

/* Two numbers that nothing lies between, a hundred times each: no middle is below one of them. */
static void
neighbouring_numbers_are_told_apart(void)
{
    double x[200];
    for (int trial = 0; trial < 4; trial++) {
        const double low = trial % 2 ? 1.0 : -1.0, high = nextafter(low, 2.0);
        brute_scene  scene = {.ndim = 1, .n = 200, .x = x, .cutoff = 0x1p-40};
        for (int i = 0; i < 200; i++) /* samples see both, or one of them alone */
            x[i] = (trial < 2 ? i == 3 : i % 2) ? high : low;
        CHECK(nearest_are_right(&scene, (uint64_t)trial));
    }
}

/*
 * ---- tree nodes ----
 *
 * Nodes of a tree part their points, within exact bounds, and it is not much deeper than need be.
 */

static nearest_unit unit;

/* Whether [low, high] is the exact range of the node's points along axis k. */
static bool
is_range(const hs_tree_node *node, int k, double low, double high)
{
    const double *of = unit.search.bins.x[k];
    double        least = INFINITY, most = -INFINITY;
    for (int32_t si = node->first; si < node->end; si++) {
        least = fmin(of[si], least);
        most = fmax(of[si], most);
    }
    return low == least && high == most;
}

/* Bounds and ranges of all nodes; returns how many points are in leaves. */
static int32_t
check_nodes(int32_t leaf_points, int *deepest)
{
    const hs_tree *tree = &unit.near.tree;
    const hs_bins *bins = &unit.search.bins;
    const int      d = tree->ndim;
    int           *depth = calloc((size_t)tree->n_nodes, sizeof *depth);
    int32_t        in_leaves = 0;
    bool           right = true, bounded = true, ascends = true;
    *deepest = 0;
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        const hs_tree_node *node = &tree->nodes[number], *left = &tree->nodes[node->left];
        *deepest = depth[number] > *deepest ? depth[number] : *deepest;
        right = right && node->first < node->end;
        if (node->left == 0) {
            in_leaves += node->end - node->first;
            right = right && (node->end - node->first <= leaf_points || node->is_spot);
            for (int32_t si = node->first + 1; si < node->end; si++) {
                ascends = ascends && bins->order[si - 1] < bins->order[si];
                for (int k = 0; node->is_spot && k < d; k++)
                    right = right && bins->x[k][si] == bins->x[k][si - 1];
            }
            continue;
        }
        right = right && node->left > number && !node->is_spot;
        right = right && left[0].first == node->first && left[0].end == left[1].first &&
                left[1].end == node->end;
        depth[node->left] = depth[node->left + 1] = depth[number] + 1;
        const double *bounds = hs_tree_bounds(tree, node->left, d);
        for (int k = 0; k < d; k++) {
            for (int side = 0; side < 2; side++)
                bounded = bounded &&
                          is_range(&left[side], k, bounds[4 * k + side], bounds[4 * k + 2 + side]);
        }
    }
    for (int k = 0; k < d; k++)
        bounded = bounded && is_range(&tree->nodes[0], k, tree->lower[k], tree->upper[k]);
    CHECK(right && bounded && ascends);
    free(depth);
    return in_leaves;
}

/* More points on one spot than a subtree has: they are one leaf, whoever splits the rest. */
static void
a_crowded_spot_is_one_leaf(void)
{
    enum { MANY = 30000, CROWD = 20000 };
    harness_random random = {78};
    double        *many = array_of(2 * MANY, sizeof *many);
    int            deepest;
    int64_t        largest = 0;
    for (int e = 0; e < 2 * MANY; e++)
        many[e] = e < 2 * CROWD ? 0.3 : random_unit(&random);
    const hs_points points = {many, MANY, 2, HS_FLOAT64, 16, 8};
    nearest_unit_open_by(2, &points, NULL, NULL, 4, HS_WANT_J, INFINITY, &unit);
    CHECK(check_nodes(8, &deepest) == MANY && unit.near.tree.depth == deepest);
    for (int32_t number = 0; number < unit.near.tree.n_nodes; number++) {
        const hs_tree_node *node = &unit.near.tree.nodes[number];
        if (node->is_spot)
            largest = node->end - node->first > largest ? node->end - node->first : largest;
    }
    CHECK(largest == CROWD);
    nearest_unit_close(&unit);
    free(many);
}

void
test_tree(void)
{
    RUN(lopsided_points_need_many_nodes);
    RUN(allocations_fail_in_a_subtree_that_grows);
    RUN(neighbouring_numbers_are_told_apart);
    RUN(a_crowded_spot_is_one_leaf);
}
