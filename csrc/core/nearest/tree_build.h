/* SPDX-License-Identifier: BSD-3-Clause */
/* tree_build.h: makes a tree of the points of a scene. */
#ifndef HS_TREE_BUILD_H
#define HS_TREE_BUILD_H

#include "tree.h"

/*
 * Sorts the points of the scene, whose arrays the bins take over, into leaves of at most
 * leaf_points; spots may be larger. In each node points are in the caller's order. The tree is the
 * same for any team. bins->start stays NULL. HS_ERR_MEMORY, HS_ERR_INTERRUPTED; on failure bins and
 * tree are to be freed as well.
 */
hs_status hs_tree_build(hs_account *account, hs_team *team, const hs_options *options,
                        hs_scene *scene, int32_t leaf_points, hs_bins *bins, hs_tree *tree);

/* Harmless twice, and on a tree of zeros. */
void hs_tree_free(hs_account *account, hs_tree *tree);

#endif
