/* SPDX-License-Identifier: BSD-3-Clause */
/* tree_split.h: one step in building a tree: the points of a node are divided between two
 * children. */
#ifndef HS_TREE_SPLIT_H
#define HS_TREE_SPLIT_H

#include "tree.h"

/* What nodes of one tree are split with; all borrowed. */
typedef struct hs_splitter {
    const hs_bins *bins;
    int32_t       *order; /* numbers of points, of each node those from `first` to `end` */
    int32_t       *aside; /* room for as many */
    int32_t        leaf_points;
} hs_splitter;

/*
 * Divides the points of a node, which keep their order on both sides; returns where those of the
 * right child begin. 0: the node stays a leaf, and is_spot says whether that is because its points
 * are equal. Nodes that share no points can be split at the same time.
 */
int32_t hs_tree_split(const hs_splitter *splitter, hs_tree_node *node);

#endif
