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

/* The rows of two such outputs, or of a table; borrowed. */
hs_list_rows hs_rows_of(const hs_output *offsets, const hs_output *rows, int32_t n_lists);

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

/* Fills the pairs alone, from rows of the nodes, which are given. HS_ERR_ARGUMENT where these are
 * none of these lists. */
hs_status hs_connectivity_fill_pairs(hs_connectivity *connectivity, const hs_node_map *map,
                                     const hs_list_rows *rows);

/*
 * Each of these fills offsets and column J and, where `rows` has shifts, S of `result`, empty, laid
 * out as the rows that it is given. HS_ERR_ARGUMENT where these are no rows: offsets that descend
 * or end elsewhere, numbers of nodes that there are not.
 */

/* Row k is row source[k], each of them at most once: those of its nodes that stay, under their new
 * numbers. source: NULL for all rows, n of them, in their order. */
hs_status hs_kept_rows_fill(hs_call *call, const hs_list_rows *rows, const hs_node_change *change,
                            const int64_t *source, int64_t n, hs_pairs *result);

/* All rows, without the entries that are in `without`, which has as many rows and lists. `ascend`:
 * rows of both ascend, and those of `without` may have what `rows` have not; else they must have
 * them, in the same order: HS_ERR_ARGUMENT. */
hs_status hs_rows_without_fill(hs_call *call, const hs_list_rows *rows, const hs_list_rows *without,
                               bool ascend, hs_pairs *result);

/*
 * overlap.c: points that gather a common point, from the rows of what each point gathers; and what
 * is between the two of each pair.
 */

/*
 * With G the matrix of these rows and of the diagonal, for each point is in its own support, row i
 * of the pattern of G G^T has the points that gather a point that i gathers: neighbours, where this
 * is one of the two, and those further apart. With shifts, entry (k, T) of row i and (k, U) of row
 * j give (j, T - U).
 *
 * Fills offsets and columns J and S of `rows`, empty, as hs_row_split_fill does, for all points of
 * these lists. HS_ERR_ARGUMENT where `gather` has a row that is not ascending, has its own number
 * (with shifts: and S zero) or one that is no point. Coordinates only say what is near, and need
 * not be finite.
 */
hs_status hs_overlap_fill(hs_call *call, const hs_points *points, const hs_index_rows *gather,
                          const hs_node_lists *lists, hs_pairs *rows, hs_failure *failure);

/*
 * For each pair of the table the points that are neighbours of both of its ends and whose foot on
 * the line through them lies between them, and the ends.
 *
 * Fills offsets and columns J and S of `result`, empty: entry l of pair number p, [offsets[p *
 * n_lists + l], next), has the numbers in list l of the common neighbours, in the order of the
 * points, and then those of the first and the second end that are of this list; S is that of each
 * from the first end. images: the dimensions, and the rows that the half list's shifts multiply.
 * HS_ERR_NOT_FINITE for coordinates that are not.
 */
hs_status hs_intersection_fill(hs_call *call, const hs_points *points, const hs_metric *images,
                               const hs_node_lists *lists, const hs_output *half, hs_pairs *result,
                               hs_failure *failure);

/*
 * The place of a point on the Z curve through a box: the bits of its coordinates, as fractions of
 * the box, in turns, those of the first axis lowest: 63 / ndim of each. Points that are close in
 * this order are close in space, and the order depends on nothing but the box. low <= x <= high,
 * finite; where the box has no width, bits are 0.
 */
uint64_t hs_morton_key(const double *x, const double *low, const double *high, int ndim);

#endif
