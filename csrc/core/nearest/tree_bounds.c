/* SPDX-License-Identifier: BSD-3-Clause */
/* tree_bounds.c: the range of each node, from the leaves up, and the depth of a tree. */
#include "tree_bounds.h"

/* Steps down to each node, kept for a moment where the bounds will be. */
static int
measure_depth(hs_tree *tree)
{
    double *steps = tree->bounds;
    int     deepest = 0;
    steps[0] = 0.0;
    for (int32_t number = 0; number < tree->n_nodes; number++) {
        const int32_t left = tree->nodes[number].left;
        deepest = (int)hs_larger(steps[number], (double)deepest);
        if (left != 0) {
            steps[left] = steps[left + 1] = steps[number] + 1.0;
        }
    }
    return deepest;
}

/* Sets the range of a leaf from its points, which are in tree order by now; of another node, from
 * its children. */
static void
bound_axis(const hs_bins *bins, const hs_tree *tree, int32_t number, int k, double *range)
{
    const hs_tree_node *node = &tree->nodes[number];
    if (node->left != 0) {
        const double *of = hs_tree_bounds(tree, node->left, tree->ndim) + 4 * k;
        range[0] = hs_smaller(of[0], of[1]);
        range[1] = hs_larger(of[2], of[3]);
        return;
    }
    const double *x = bins->x[k];
    double        low = x[node->first], high = low;
    for (int32_t si = node->first + 1; si < node->end; si++) {
        low = hs_smaller(x[si], low);
        high = hs_larger(x[si], high);
    }
    range[0] = low;
    range[1] = high;
}

/* Of nodes [first, last), from the last to the first: children come after their parents. The first
 * node of the tree is not among them. */
static void
bound_nodes(const hs_bins *bins, hs_tree *tree, int32_t first, int32_t last)
{
    const int d = tree->ndim;
    double    range[2];
    for (int32_t number = last - 1; number >= first; number--) {
        const int side = (number - 1) % 2;
        double   *of = tree->bounds + (int64_t)(number - 1 - side) * 2 * d;
        for (int k = 0; k < d; k++) {
            bound_axis(bins, tree, number, k, range);
            of[4 * k + side] = range[0];
            of[4 * k + 2 + side] = range[1];
        }
    }
}

typedef struct tree_bounder {
    const hs_bins *bins;
    const int32_t *begins;
    hs_tree       *tree;
} tree_bounder;

static void
bound_subtree(void *context, int64_t task)
{
    const tree_bounder *bounder = context;
    bound_nodes(bounder->bins, bounder->tree, bounder->begins[task], bounder->begins[task + 1]);
}

void
hs_tree_bound(hs_team *team, const hs_bins *bins, const int32_t *begins, int32_t n_subtrees,
              hs_tree *tree)
{
    tree_bounder bounder = {bins, begins, tree};
    double       range[2];
    tree->depth = measure_depth(tree);
    hs_team_run(team, n_subtrees, bound_subtree, &bounder);
    bound_nodes(bins, tree, 1, begins[0]);
    for (int k = 0; k < tree->ndim; k++) {
        bound_axis(bins, tree, 0, k, range);
        tree->lower[k] = range[0];
        tree->upper[k] = range[1];
    }
}
