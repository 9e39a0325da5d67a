/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_CONNECTIVITY_CONNECTIVITY_H
#define HS_CONNECTIVITY_CONNECTIVITY_H

#include "../../halfshell_nodes.h"
#include "../memory/memory.h"
#include "../collect/columns.h"
#include "../exact/metric.h"

/*
 * connectivity.h: rows and pairs of node lists. Searches and pairs number points from 0 on, in
 * whatever order they come; users of node lists know a node by its list and its number there.
 *
 * Rows are hs_list_rows: those of points have one list. Pairs are half lists of points: an output
 * of i, j and, in a box, S, of 4 bytes each, ascending by (i, j, S), with i < j, or i == j and the
 * first nonzero component of S positive; of directed lists any but (i, i, 0).
 */

/* Which list each point is of, which node of it, and which row it has. Arrays are owned. */
typedef struct hs_node_map {
    const hs_node_lists *lists; /* borrowed */
    int64_t              n;
    int32_t              n_lists;
    int64_t  n_rows;   /* nodes that have rows: of list 0, of list 1, ..., ascending in each */
    bool     is_plain; /* points come in the order of lists and nodes */
    int64_t *end;      /* n_lists: where each list ends, among all nodes */
    int32_t *list;     /* n, as all below, which are parts of this block */
    int32_t *node;
    int32_t *row;   /* -1: none */
    int32_t *point; /* of each node, list after list */
    bool    *is_ghost;
} hs_node_map;

/*
 * The map of the points that are all nodes of these lists; n >= 0: so many. HS_ERR_ARGUMENT where
 * the counts do not fit that number or each other, or `number` is no permutation; HS_ERR_TOO_MANY
 * from 2^31 nodes on. Reads each number once; on failure holds nothing.
 */
hs_status hs_node_map_make(hs_account *account, const hs_node_lists *lists, int64_t n,
                           hs_node_map *map);

/* Idempotent. */
void hs_node_map_free(hs_account *account, hs_node_map *map);

/* Sign of the first component that differs from that of `other`, or from 0. */
HS_ALWAYS_INLINE int
hs_compare_shifts(const int32_t *shift, const int32_t *other, int ndim)
{
    for (int k = 0; k < ndim; k++) {
        const int32_t with = other != NULL ? other[k] : 0;
        if (shift[k] != with) {
            return shift[k] < with ? -1 : 1;
        }
    }
    return 0;
}

/* An empty output of these columns and, if there are shifts, S. */
void hs_links_init(hs_account *account, unsigned columns, bool has_shift, int ndim,
                   hs_output *links);

/* A copy of these pairs of n points, which nothing can change. HS_ERR_ARGUMENT where they are no
 * half list, or none of directed lists: failure->row is the first pair that is wrong. On failure
 * *copy can still be freed. */
hs_status hs_half_list_copy(hs_account *account, const hs_half_list *pairs, int64_t n,
                            bool directed, hs_output *copy, hs_failure *failure);

/* Its columns; shift is NULL where there is none. */
hs_half_list hs_half_list_columns(const hs_output *half);

/* Rows of n points, ascending by number and S, in two empty outputs: where each begins, and columns
 * J and, where the half list has shifts, S. Pair (i, j) puts j into the row of i and, but for
 * directed lists, i with -S into that of j. To be freed on failure as well. */
hs_status hs_half_list_rows(hs_call *call, const hs_output *half, int64_t n, bool directed,
                            hs_output *offsets, hs_output *rows);

/* The rows of two such outputs; borrowed. */
hs_list_rows hs_rows_of(const hs_output *offsets, const hs_output *rows);

/*
 * Whether a pair of points is one of the table: not if both are ghosts, unless these are wanted.
 * *turned: whether the second point comes first, as it does where it is internal and the other one
 * is a ghost; not where points have an order of their own. Of directed lists i decides.
 */
HS_ALWAYS_INLINE bool
hs_node_pair_counts(const hs_node_map *map, int32_t i, int32_t j, bool *turned)
{
    const bool directed = map->lists->directed;
    *turned = map->is_plain && !directed && map->is_ghost[i] && !map->is_ghost[j];
    return map->lists->ghost_pairs || !map->is_ghost[i] || (!directed && !map->is_ghost[j]);
}

/*
 * Fills offsets and columns J and, where rows have shifts, S of `rows`, an empty result, from rows
 * of points, of which row place[p] is that of point p; NULL: row p. Entry l of row r,
 * [offsets[r * n_lists + l], next), has the numbers in list l of neighbours of the node with that
 * row, in the order of the points; of one neighbour ascending by S.
 */
hs_status hs_row_split_fill(hs_call *call, const hs_node_map *map, const hs_list_rows *from,
                            const int32_t *place, hs_pairs *rows);

struct hs_connectivity {
    hs_pairs rows;         /* offsets, J and S; all is charged to its call */
    hs_pairs nodes, lists; /* of the pairs: I, J and S; I and J. Empty without a table */
};

/* Fills the rows from those of all points, which become those of the object where they need no
 * change: then there are none of them any more; and the pairs, unless rows alone are wanted, from a
 * half list, which is used up, or where that is empty from the rows. */
hs_status hs_connectivity_fill(hs_connectivity *connectivity, const hs_node_map *map,
                               hs_output *half, hs_output *offsets, hs_output *rows);

/* hs_result_begin, of rows. points: NULL, or checked as well. */
hs_pairs *hs_rows_begin(bool has_input, const hs_points *points, const hs_options *options,
                        hs_pairs **result, hs_failure **failure, hs_status *status);

/*
 * The place of a point on the Z curve through a box: the bits of its coordinates, as fractions of
 * the box, in turns, those of the first axis lowest: 63 / ndim of each. Points that are close in
 * this order are close in space, and the order depends on nothing but the box. low <= x <= high,
 * finite; where the box has no width, bits are 0.
 */
uint64_t hs_morton_key(const double *x, const double *low, const double *high, int ndim);

#endif
