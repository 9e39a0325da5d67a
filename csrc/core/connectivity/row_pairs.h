/* SPDX-License-Identifier: BSD-3-Clause */
/* row_pairs.h: the table of pairs of nodes from rows of all of them, whose points are in the order
 * of lists and nodes: each row has the pairs that its node begins as it is, list by list. */
#ifndef HS_ROW_PAIRS_H
#define HS_ROW_PAIRS_H

#include "../collect/result.h"

#include "node_map.h"

/* Fills columns I, J and S of `nodes`, and I and J of `lists`, as hs_node_pairs_fill does. The map
 * is plain, and all of its nodes have rows. HS_ERR_ARGUMENT where offsets are none, or there are
 * more pairs than rows can have that mirror each other. */
hs_status hs_row_pairs_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs,
                            const hs_list_rows *rows, hs_pairs *nodes, hs_pairs *lists);

#endif
