/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * node_map.h: which list each point is of, which node of it, and which row it has. Searches and
 * pairs number points from 0 on, in whatever order they come; users of node lists know a node by
 * its list and its number there.
 */
#ifndef HS_NODE_MAP_H
#define HS_NODE_MAP_H

#include "../../halfshell_nodes.h"
#include "../memory/account.h"

/* Arrays are owned; all but the first have one entry for each point, as parts of one block. */
typedef struct hs_node_map {
    int64_t  n;
    int32_t  n_lists;
    int64_t  n_rows;      /* nodes that have rows: of list 0, of list 1, ..., ascending in each */
    bool     is_plain;    /* points come in the order of lists and nodes */
    int64_t *end;         /* n_lists: where each list ends, among all nodes */
    int64_t *first_ghost; /* n_lists, part of end: the number of its first ghost in each */
    int32_t *list;
    int32_t *node;
    int32_t *row; /* -1: none */
    bool    *is_ghost;
} hs_node_map;

/*
 * The map of n points, which are all nodes of these lists. HS_ERR_ARGUMENT where the counts do not
 * fit that number or each other, or `number` is no permutation. Reads each number once; on failure
 * holds nothing.
 */
hs_status hs_node_map_make(hs_account *account, const hs_node_lists *lists, int64_t n,
                           hs_node_map *map);

/* Harmless twice. */
void hs_node_map_free(hs_account *account, hs_node_map *map);

#endif
