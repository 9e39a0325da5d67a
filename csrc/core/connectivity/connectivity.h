/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_CONNECTIVITY_CONNECTIVITY_H
#define HS_CONNECTIVITY_CONNECTIVITY_H

#include "../../halfshell_nodes.h"
#include "../memory/memory.h"
#include "../collect/columns.h"

/*
 * Which list each point is of, which node of it, and which row it has. Searches and
 * pairs number points from 0 on, in whatever order they come; users of node lists know a node by
 * its list and its number there.
 */

/* Arrays are owned; all but the first have one entry for each point, as parts of one block. */
typedef struct hs_node_map {
    int64_t  n;
    int32_t  n_lists;
    int64_t  n_rows;      /* nodes that have rows: of list 0, of list 1, ..., ascending in each */
    bool     is_plain;    /* points come in the order of lists and nodes */
    bool     directed;    /* as that of the lists */
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

/* Idempotent. */
void hs_node_map_free(hs_account *account, hs_node_map *map);

/* Pairs that a caller gives, each once and in ascending order, copied so that nothing
 * can change them, and looked at so that nothing can be wrong with them. */

/* A half list is an output of i, j and, in a box, S, of 4 bytes each: ascending by (i, j, S), with
 * i < j, or i == j and the first nonzero component of S positive. */

/* A copy of these pairs of n points. HS_ERR_ARGUMENT where they are no half list, or none of
 * directed lists: failure->row is the first pair that is wrong. On failure *copy can still be
 * freed. */
hs_status hs_half_list_copy(hs_account *account, const hs_half_list *pairs, int64_t n,
                            bool directed, hs_output *copy, hs_failure *failure);

/* Its columns; shift is NULL where there is none. */
typedef struct hs_half_columns {
    int64_t        n;
    int            ndim;
    const int32_t *i, *j, *shift;
} hs_half_columns;

hs_half_columns hs_half_list_columns(const hs_output *half);

/* Rows of n points, ascending by number and S, in two empty outputs: where each begins, and columns
 * J and, where the half list has shifts, S. Pair (i, j) puts j into the row of i and, but for
 * directed lists, i with -S into that of j. To be freed on failure as well. */
hs_status hs_half_list_rows(hs_call *call, const hs_output *half, int64_t n, bool directed,
                            hs_output *offsets, hs_output *rows);

/* Whether the first component of S that is not 0 is positive; S is not 0. */
HS_ALWAYS_INLINE bool
hs_shift_is_forward(const int32_t *shift, int ndim)
{
    int k = 0;
    while (k < ndim - 1 && shift[k] == 0) {
        k++;
    }
    return shift[k] > 0;
}

/*
 * Rows over the numbers of points, taken apart by lists: what a search of all
 * neighbours finds becomes the rows of nodes, without being sorted again.
 */

/* Rows of point numbers, ascending, as of hs_neighbors_find; borrowed. That of point p is
 * index[first[p]] ... index[end[p] - 1]. */
typedef struct hs_rows_view {
    const int64_t *first, *end;
    const int32_t *index;
    const int32_t *shift; /* ndim for each entry; NULL: none */
    int            ndim;
} hs_rows_view;

/*
 * Fills offsets and columns J and, where rows have shifts, S of `rows`, an empty result, from rows
 * of all points of the map: entry l of row r, [offsets[r * n_lists + l], next), has the numbers in
 * list l of neighbours of the node with that row, in the order of the points; of one neighbour
 * ascending by S.
 */
hs_status hs_row_split_fill(hs_call *call, const hs_node_map *map, const hs_rows_view *from,
                            hs_pairs *rows);

/* The table of pairs of nodes, each once, from a half list. */

/*
 * Whether a pair of points is one of the table: not if both are ghosts, unless these are wanted.
 * *turned: whether the second point comes first, as it does where it is internal and the other one
 * is a ghost; not where points have an order of their own. Of directed lists i decides.
 */
HS_ALWAYS_INLINE bool
hs_node_pair_counts(const hs_node_map *map, bool ghost_pairs, int32_t i, int32_t j, bool *turned)
{
    *turned = map->is_plain && !map->directed && map->is_ghost[i] && !map->is_ghost[j];
    return ghost_pairs || !map->is_ghost[i] || (!map->directed && !map->is_ghost[j]);
}

/* The columns of the table; shift: NULL where there are none. */
typedef struct hs_node_columns {
    int32_t *i_node, *j_node, *i_list, *j_list;
    int32_t *shift;
} hs_node_columns;

/* How many pairs the table has. */
int64_t hs_node_pairs_count(const hs_node_map *map, bool ghost_pairs, const hs_output *half);

/* connectivity.h: rows and pairs of node lists, which the functions of api/ make and give out. */

/* All parts are charged to the call, which has ended when the caller gets the object. */
struct hs_connectivity {
    hs_call   call;
    hs_pairs *rows;          /* owned; offsets, J and S */
    hs_pairs *nodes, *lists; /* owned; of the pairs: I, J and S; I and J. Empty without a table */
};

/* An empty object, whose call must be begun next. NULL when memory is short. */
hs_connectivity *hs_connectivity_new(void);

/* Fills the rows, and the pairs unless rows alone are wanted, from a half list of n points. */
hs_status hs_connectivity_fill(hs_connectivity *connectivity, const hs_node_lists *lists, int64_t n,
                               const hs_output *half, hs_failure *failure);

/* The same of rows of all points, which become those of the object where they need no change. */
hs_status hs_connectivity_fill_rows(hs_connectivity *connectivity, const hs_node_lists *lists,
                                    hs_pairs **found);

/* Fills the pairs alone, from rows of the n nodes, which are given. HS_ERR_ARGUMENT where these are
 * none of these lists. */
hs_status hs_connectivity_fill_pairs(hs_connectivity *connectivity, const hs_node_lists *lists,
                                     int64_t n, const hs_list_rows *rows);

/*
 * Rows of nodes after a change that only takes away: nodes that go, with the numbers
 * that the others get, or entries that go. What stays is copied in one pass; nothing is searched,
 * and rows are sorted only where their nodes come in another order.
 */

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

#endif
