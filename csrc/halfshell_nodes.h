/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * halfshell_nodes.h: nodes of several lists, as of the materials of a simulation: which of them are
 * neighbours, list by list, and each pair of them once. The words and rules of halfshell.h hold;
 * docs/systems/spheral.md explains the rest.
 *
 * A node is known by its list and its number there. Nodes of all lists are points of one search:
 * those of list 0, of list 1, and so on. The last nodes of a list may be ghosts, copies of nodes
 * that are elsewhere: pairs of two ghosts are of no interest to most.
 */
#ifndef HALFSHELL_NODES_H
#define HALFSHELL_NODES_H

#include "halfshell.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct hs_node_lists {
    int32_t        n_lists;
    const int64_t *n_nodes;     /* n_lists; their sum is the number of points */
    const int64_t *n_ghosts;    /* n_lists: how many of them; NULL: none */
    const int32_t *number;      /* n: the points come in another order, point p is node number[p]
                                 * of all; NULL: in that order */
    bool           ghost_rows;  /* ghosts have rows, too */
    bool           ghost_pairs; /* and pairs with each other */
    bool           rows_only;   /* no pairs at all */
    bool           directed;    /* the rule is HS_RULE_GATHER or HS_RULE_SCATTER: i may have j as a
                                 * neighbour and j not i. Each entry of a row is a pair */
} hs_node_lists;

/* Pairs that the caller has, each once, borrowed: ascending by (i, j, S), with i < j, or i == j and
 * the first nonzero component of S positive. Of directed lists: any i and j, but not i == j with S
 * zero. */
typedef struct hs_half_list {
    int64_t        n;
    const int32_t *i, *j; /* numbers of points */
    const int32_t *shift; /* n * ndim; NULL: none */
    int            ndim;
} hs_half_list;

/* Rows that the caller has, one for each of n points, borrowed: that of point i begins at
 * indices[offsets[i]] and ends before indices[offsets[i + 1]], ascending, without i itself; of one
 * number ascending by S. */
typedef struct hs_index_rows {
    int64_t        n;
    const int64_t *offsets; /* n + 1, from 0 to n_indices */
    int64_t        n_indices;
    const int32_t *indices;
    const int32_t *shift; /* n_indices * ndim; NULL: none */
    int            ndim;
} hs_index_rows;

/* Rows of nodes that the caller has, laid out as those of hs_connectivity_rows; borrowed. */
typedef struct hs_list_rows {
    int64_t        n;       /* rows */
    int32_t        n_lists; /* entries of each */
    const int64_t *offsets; /* n * n_lists + 1, from 0 to n_indices */
    int64_t        n_indices;
    const int32_t *indices;
    const int32_t *shift; /* n_indices * ndim; NULL: none */
    int            ndim;
} hs_list_rows;

/* What becomes of the nodes of lists of which some go; borrowed. */
typedef struct hs_node_change {
    int32_t        n_lists;
    const int64_t *n_nodes; /* n_lists; as yet */
    const int32_t *target;  /* of each node, list after list: its new number there; -1: it goes */
    const int32_t *place;   /* of each node: its place among those that stay, which entries of rows
                             * are to ascend by; NULL: they keep their order */
} hs_node_change;

/* Which nodes are neighbours: opaque, owned by the caller. */
typedef struct hs_connectivity hs_connectivity;

/*
 * Find all pairs of hs_pairs_find as neighbours in lists of nodes, to be freed with
 * hs_connectivity_free. options: sorted, want, index_bytes and out are ignored; numbers are int32,
 * and shifts are there where the box is periodic. Or make rows and pairs of a half list of theirs.
 */
hs_status hs_connectivity_build(const hs_among *among, const hs_node_lists *lists,
                                const hs_options *options, hs_connectivity **connectivity,
                                hs_failure *failure);
hs_status hs_connectivity_link(const hs_half_list *pairs, const hs_node_lists *lists,
                               const hs_options *options, hs_connectivity **connectivity,
                               hs_failure *failure);

/*
 * Rows: those of the nodes of list 0, of list 1, ...; without ghost_rows, of internal nodes alone.
 * Each has an entry for each list: entry l of row r, of which hs_pairs_offsets tells where it
 * begins as number r * n_lists + l, has in HS_WANT_J the neighbours that are of list l, in the
 * order of the points, of one neighbour ascending by S (HS_WANT_SHIFT).
 *
 * Pairs: HS_WANT_I and HS_WANT_J are node numbers, HS_WANT_SHIFT is S; those of
 * hs_connectivity_lists, of which list each of the two is. Ascending in the order of the points;
 * the lower one comes first, but an internal node before a ghost, unless `number` is given. Of
 * directed lists (i, j) for each entry j of the row of each i, of ghosts with ghost_pairs only.
 *
 * All borrow from the object and can be read by hs_pairs_array, hs_pairs_take and so on; not freed.
 */
hs_pairs *hs_connectivity_rows(hs_connectivity *connectivity);
hs_pairs *hs_connectivity_pairs(hs_connectivity *connectivity);
hs_pairs *hs_connectivity_lists(hs_connectivity *connectivity);

void hs_connectivity_free(hs_connectivity *connectivity);

/* The pairs of hs_connectivity_build, from its rows: for callers who wanted rows_only at first. The
 * object has no rows. */
hs_status hs_connectivity_pair(const hs_list_rows *rows, const hs_node_lists *lists,
                               const hs_options *options, hs_connectivity **connectivity,
                               hs_failure *failure);

/*
 * What is left of rows when nodes go, without a search: the same as of a new connectivity of the
 * nodes that stay, of which hs_connectivity_pair makes the pairs. Row k is made of row source[k],
 * each at most once; source: NULL for all rows, n of them. Of the options, those of resources
 * count. To be freed with hs_pairs_free.
 */
hs_status hs_rows_keep(const hs_list_rows *rows, const hs_node_change *change,
                       const int64_t *source, int64_t n, const hs_options *options,
                       hs_pairs **result, hs_failure *failure);

/*
 * Rows without the entries of others, which have as many rows and lists. ascend: both ascend, and
 * entries that are not in `rows` are ignored; else there must be none, and what there is must have
 * the same order. To be freed with hs_pairs_free.
 */
hs_status hs_rows_without(const hs_list_rows *rows, const hs_list_rows *without, bool ascend,
                          const hs_options *options, hs_pairs **result, hs_failure *failure);

/*
 * Rows, as those of hs_connectivity_rows but of all nodes, of points that are in each other's rows
 * or have a common number in them; to be freed with hs_pairs_free. With rows of what each point's
 * own support reaches (HS_RULE_GATHER): of points whose supports have a common point. With shifts:
 * of images, (j, S) in the row of i where i has (k, T) and j has (k, T - S), or HS_ERR_SHIFT_RANGE.
 * points: of all nodes, in the order of `gather`. They make it quick, and change nothing else.
 */
hs_status hs_connectivity_overlap(const hs_points *points, const hs_index_rows *gather,
                                  const hs_node_lists *lists, const hs_options *options,
                                  hs_pairs **rows, hs_failure *failure);

/*
 * For each pair of hs_connectivity_pairs, of a half list: the points that are neighbours of both
 * ends and whose foot on the line through these lies on the closed segment between them, in exact
 * arithmetic; all common neighbours where the ends coincide; and the ends. Entry l of pair p, as of
 * a row, has in HS_WANT_J those of list l, the ends last; with shifts, HS_WANT_SHIFT has the S of
 * each from the first end. To be freed with hs_pairs_free. points: of all nodes, in the order of
 * the half list. box: what shifts multiply, of up to HS_MAX_DIM - 2 dimensions; NULL where there
 * are none. HS_ERR_ARGUMENT for other boxes and for directed lists.
 */
hs_status hs_connectivity_intersect(const hs_points *points, const hs_box *box,
                                    const hs_half_list *pairs, const hs_node_lists *lists,
                                    const hs_options *options, hs_pairs **result,
                                    hs_failure *failure);

/* Whether the foot of each point on the line through p and q lies on the closed segment between
 * them, in exact arithmetic; always where p and q coincide. between: one for each point. */
hs_status hs_feet_between(const hs_points *points, const double *p, const double *q, bool *between,
                          hs_failure *failure);

/*
 * The place of each point on the Z curve through the box from low to high, ndim numbers each: 63 /
 * ndim bits for each coordinate, those of the first axis lowest. HS_ERR_BOX_FINITE where
 * low <= high does not hold for an axis (failure->column), HS_ERR_FAR for a point outside
 * (failure->row).
 */
hs_status hs_morton_keys(const hs_points *points, const double *low, const double *high,
                         uint64_t *keys, hs_failure *failure);

#ifdef __cplusplus
}
#endif
#endif
