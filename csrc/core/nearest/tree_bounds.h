/* SPDX-License-Identifier: BSD-3-Clause */
/* tree_bounds.h: the last step in building a tree: how far its nodes reach. */
#ifndef HS_TREE_BOUNDS_H
#define HS_TREE_BOUNDS_H

#include "tree.h"

/*
 * Fills depth, lower, upper and bounds, for which there is room, of a tree with nodes, whose points
 * are in tree order by now. begins, n_subtrees + 1 numbers: nodes begins[s] to begins[s + 1] - 1
 * are those below the root of subtree s, which is one thread's task; roots and what is above them
 * come before.
 */
void hs_tree_bound(hs_team *team, const hs_bins *bins, const int32_t *begins, int32_t n_subtrees,
                   hs_tree *tree);

#endif
