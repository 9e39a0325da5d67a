/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * node_rows.h: the neighbours of each node in each list, from a half list. Pair (i, j) puts j into
 * the row of i and i into that of j. As pairs come in ascending order, each row is filled in
 * ascending order too: first with the smaller ones, while these are i, then with the larger ones.
 * Nothing is sorted.
 */
#ifndef HS_NODE_ROWS_H
#define HS_NODE_ROWS_H

#include "../collect/result.h"

#include "half_list.h"
#include "node_map.h"

/*
 * Fills offsets and columns J and, where the half list has shifts, S of `rows`, an empty result:
 * entry l of row r, [offsets[r * n_lists + l], next), has the numbers in list l of neighbours of
 * the node with that row, in the order of the points; of one neighbour ascending by S. A shift
 * whose opposite is no int32 is HS_ERR_SHIFT_RANGE.
 */
hs_status hs_node_rows_fill(hs_call *call, const hs_node_map *map, const hs_output *half,
                            hs_pairs *rows, hs_failure *failure);

#endif
