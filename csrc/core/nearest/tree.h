/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_NEAREST_TREE_H
#define HS_NEAREST_TREE_H

#include "../cells/bins.h"

#include <math.h>

/*
 * tree.h: cells that follow the points: each node halves its points along the axis where they are
 * spread widest, about evenly, so that cells are small where points crowd and few where they are
 * rare, on any scale and in any box. The search for the nearest walks it.
 */

typedef struct hs_tree_node {
    int32_t first, end; /* its points, in tree order */
    int32_t left;       /* its children are nodes left and left + 1; 0: it has none */
    bool    is_spot;    /* its points have equal coordinates, to the last digit; a leaf */
} hs_tree_node;

typedef struct hs_tree {
    int           ndim;
    int32_t       n_nodes; /* the first one holds all points; 0 without points */
    int           depth;   /* most steps from the first node to a leaf */
    hs_tree_node *nodes;   /* owned; children come after their parent */
    /* Range of X: of the first node, and of each pair of children, for every axis: lowest of left
     * and right, largest of left and right. */
    double  lower[HS_MAX_DIM], upper[HS_MAX_DIM];
    double *bounds; /* owned */
} hs_tree;

HS_ALWAYS_INLINE int32_t
hs_tree_points(const hs_tree_node *node)
{
    return node->end - node->first;
}

/* The bounds of nodes left and left + 1. */
HS_ALWAYS_INLINE const double *
hs_tree_bounds(const hs_tree *tree, int32_t left, const int ndim)
{
    return tree->bounds + (int64_t)(left - 1) * 2 * ndim;
}

/* Twice the distance from [low, high] to [lower, upper]. Sums and absolute values alone, all of
 * them exact but the two differences: compilers make vectors of these, not of comparisons. */
HS_ALWAYS_INLINE double
hs_tree_apart(double lower, double upper, double low, double high)
{
    const double below = lower - high, above = low - upper;
    return (below + fabs(below)) + (above + fabs(above));
}

/* Squared distances, in a given unit, from [low, high] to the ranges of two nodes. */
HS_ALWAYS_INLINE void
hs_tree_gaps(const double *bounds, const double *low, const double *high, double unit,
             const int ndim, double *gaps)
{
    double sum[2] = {0.0, 0.0};
    for (int k = 0; k < ndim; k++) {
        double apart[2];
        for (int side = 0; side < 2; side++) {
            apart[side] =
                hs_tree_apart(bounds[4 * k + side], bounds[4 * k + 2 + side], low[k], high[k]) *
                (0.5 * unit);
        }
        sum[0] += apart[0] * apart[0];
        sum[1] += apart[1] * apart[1];
    }
    gaps[0] = sum[0];
    gaps[1] = sum[1];
}

/* Squared distance, in a given unit, from [low, high] to the range of the first node. */
HS_ALWAYS_INLINE double
hs_tree_gap(const hs_tree *tree, const double *low, const double *high, double unit)
{
    double sum = 0.0;
    for (int k = 0; k < tree->ndim; k++) {
        const double apart =
            hs_tree_apart(tree->lower[k], tree->upper[k], low[k], high[k]) * (0.5 * unit);
        sum += apart * apart;
    }
    return sum;
}

/*
 * Sorts the points of the scene, whose arrays the bins take over, into leaves of at most
 * leaf_points; spots may be larger. In each node points are in the caller's order. The tree is the
 * same for any team. bins->start stays NULL. HS_ERR_MEMORY, HS_ERR_INTERRUPTED; on failure bins and
 * tree are to be freed as well.
 */
hs_status hs_tree_build(hs_call *call, hs_scene *scene, int32_t leaf_points, hs_bins *bins,
                        hs_tree *tree);

/* Idempotent; does nothing to a tree of zeros. */
void hs_tree_free(hs_account *account, hs_tree *tree);

#endif
