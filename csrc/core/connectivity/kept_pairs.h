/* SPDX-License-Identifier: BSD-3-Clause */
/* kept_pairs.h: a table of pairs of nodes without some of them, in the order that it has. */
#ifndef HS_KEPT_PAIRS_H
#define HS_KEPT_PAIRS_H

#include "../../halfshell_nodes.h"
#include "../collect/result.h"

/*
 * Fills columns I, J and S of `nodes` and I and J of `lists`, both empty, with the pairs whose two
 * nodes stay, under their new numbers (change, or NULL: all stay), and that are kept (keep, one for
 * each pair, or NULL: all are). HS_ERR_ARGUMENT where a pair names a node that there is not.
 */
hs_status hs_kept_pairs_fill(hs_call *call, const hs_node_pairs *pairs,
                             const hs_node_change *change, const bool *keep, hs_pairs *nodes,
                             hs_pairs *lists);

#endif
