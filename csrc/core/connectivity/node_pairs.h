/* SPDX-License-Identifier: BSD-3-Clause */
/* node_pairs.h: the table of pairs of nodes, each once, from a half list. */
#ifndef HS_NODE_PAIRS_H
#define HS_NODE_PAIRS_H

#include "../collect/result.h"

#include "half_list.h"
#include "node_map.h"

/*
 * Whether a pair of points is one of the table: not if both are ghosts, unless these are wanted.
 * *turned: whether the second point comes first, as it does where it is internal and the other one
 * is a ghost; not where points have an order of their own.
 */
HS_ALWAYS_INLINE bool
hs_node_pair_counts(const hs_node_map *map, bool ghost_pairs, int32_t i, int32_t j, bool *turned)
{
    *turned = map->is_plain && map->is_ghost[i] && !map->is_ghost[j];
    return ghost_pairs || !map->is_ghost[i] || !map->is_ghost[j];
}

/* The columns of the table; shift: NULL where there are none. */
typedef struct hs_node_columns {
    int32_t *i_node, *j_node, *i_list, *j_list;
    int32_t *shift;
} hs_node_columns;

/* Room for so many pairs: numbers, and shifts of ndim components where there are any, in `nodes`,
 * and lists in `lists`, both empty, whose n_pairs stay 0. HS_OK or HS_ERR_MEMORY. */
hs_status hs_node_columns_open(hs_call *call, bool has_shift, int ndim, int64_t room,
                               hs_pairs *nodes, hs_pairs *lists, hs_node_columns *to);

/* How many pairs the table has. */
int64_t hs_node_pairs_count(const hs_node_map *map, bool ghost_pairs, const hs_output *half);

/* Fills columns I, J and, where the half list has shifts, S of `nodes`, and I and J of `lists`,
 * both empty: numbers of nodes in their lists, and the lists. Pairs keep their order. */
hs_status hs_node_pairs_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs,
                             const hs_output *half, hs_pairs *nodes, hs_pairs *lists);

#endif
