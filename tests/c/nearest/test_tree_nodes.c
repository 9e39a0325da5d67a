/* SPDX-License-Identifier: BSD-3-Clause */
/* test_tree_nodes.c: nodes of a tree part their points, within exact bounds, and it is not much
 * deeper than need be. */
#include "../support/pair_checks.h"
#include "../support/nearest_unit.h"

#include <math.h>
#include <string.h>

void test_tree_nodes(void);

enum { N = 3000 };

static nearest_unit unit;
static double       x[3 * N];

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

static void
nodes_part_their_points(void)
{
    harness_random random = {808};
    for (int trial = 0; trial < 24; trial++) {
        const int     d = 1 + trial % 3, n = trial < 6 ? 1 + trial * 7 : N / (1 + trial % 4);
        const int64_t k = trial % 2 ? 3 : 40; /* leaves of 8 and of 16 */
        const double  cells = trial / 6 == 2 ? 8.0 : trial / 6 == 3 ? 40.0 : 0x1p40;
        int           deepest;
        for (int e = 0; e < d * n; e++)
            x[e] = floor(random_unit(&random) * cells) / cells;
        const hs_points points = {x, n, d, HS_FLOAT64, d * 8, 8};
        nearest_unit_open(&points, NULL, NULL, k, HS_WANT_J, INFINITY, &unit);
        CHECK(check_nodes(k < 32 ? 8 : 16, &deepest) == n);
        CHECK(unit.near.tree.depth == deepest);
        CHECK(deepest <= 4 + (int)(1.6 * log2(n)));
        nearest_unit_close(&unit);
    }
}

static void
leaves_of_one_spot_say_so(void)
{
    int deepest;
    for (int i = 0; i < 100; i++) {
        x[2 * i] = 0.25 * (i % 2);
        x[2 * i + 1] = i == 77 ? 0.5 : 0.0;
    }
    const hs_points points = {x, 100, 2, HS_FLOAT64, 16, 8};
    nearest_unit_open(&points, NULL, NULL, 3, HS_WANT_J, INFINITY, &unit);
    const hs_tree *tree = &unit.near.tree;
    CHECK(tree->n_nodes == 5 && check_nodes(8, &deepest) == 100 && deepest == 2);
    int spots = 0;
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        const hs_tree_node *node = &tree->nodes[number];
        const int32_t       n = node->end - node->first;
        CHECK(hs_nearest_of_leaf(&unit.near, node) == (node->is_spot ? 4 : n)); /* k + 1 */
        spots += node->is_spot;
    }
    CHECK(spots == 2); /* the third leaf is one point */
    nearest_unit_close(&unit);
}

static bool
same_trees(const nearest_unit *one, const nearest_unit *other)
{
    const hs_tree *a = &one->near.tree, *b = &other->near.tree;
    const size_t   d = (size_t)a->ndim;
    bool           same = a->n_nodes == b->n_nodes && a->depth == b->depth;
    for (int32_t number = 0; same && number < a->n_nodes; number++) {
        const hs_tree_node *p = &a->nodes[number], *q = &b->nodes[number];
        same = p->first == q->first && p->end == q->end && p->left == q->left &&
               p->is_spot == q->is_spot;
    }
    return same &&
           memcmp(a->bounds, b->bounds, 2 * d * sizeof(double) * (size_t)(a->n_nodes - 1)) == 0 &&
           memcmp(a->lower, b->lower, d * sizeof(double)) == 0 &&
           memcmp(a->upper, b->upper, d * sizeof(double)) == 0 &&
           memcmp(one->search.bins.order, other->search.bins.order,
                  sizeof(int32_t) * (size_t)one->search.bins.n) == 0;
}

/* Enough points for several threads, a third of them in clusters, a third on a coarse lattice. */
static void
any_number_of_threads_builds_the_same_tree(void)
{
    enum { MANY = 60000 };
    harness_random random = {77};
    double        *many = array_of((int64_t)3 * MANY, sizeof *many);
    int            deepest;
    for (int i = 0; i < 3 * MANY; i++) {
        const double at = random_unit(&random), cluster = (double)(i / 300 % 50);
        many[i] = i % 9 < 3 ? at : i % 9 < 6 ? floor(at * 16.0) / 16.0 : cluster + 1e-3 * at;
    }
    const hs_points points = {many, MANY, 3, HS_FLOAT64, 24, 8};
    nearest_unit_open(&points, NULL, NULL, 4, HS_WANT_J, INFINITY, &unit);
    CHECK(check_nodes(8, &deepest) == MANY && unit.near.tree.depth == deepest);
    for (int threads = 2; threads <= 5; threads += 3) {
        nearest_unit other;
        nearest_unit_open_by(threads, &points, NULL, NULL, 4, HS_WANT_J, INFINITY, &other);
        CHECK(hs_team_size(other.call.team) == threads);
        CHECK(same_trees(&unit, &other));
        nearest_unit_close(&other);
    }
    nearest_unit_close(&unit);
    free(many);
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
test_tree_nodes(void)
{
    RUN(any_number_of_threads_builds_the_same_tree);
    RUN(nodes_part_their_points);
    RUN(leaves_of_one_spot_say_so);
    RUN(a_crowded_spot_is_one_leaf);
}
