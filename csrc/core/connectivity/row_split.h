/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * row_split.h: rows over the numbers of points, taken apart by lists: what a search of all
 * neighbours finds becomes the rows of nodes, without being sorted again.
 */
#ifndef HS_ROW_SPLIT_H
#define HS_ROW_SPLIT_H

#include "../collect/result.h"

#include "node_map.h"

/* Rows of point numbers, ascending, as of hs_neighbors_find; borrowed. That of point p is
 * index[first[p]] ... index[end[p] - 1]. */
typedef struct hs_rows_view {
    const int64_t *first, *end;
    const int32_t *index;
    const int32_t *shift; /* ndim for each entry; NULL: none */
    int            ndim;
} hs_rows_view;

/* Fills offsets and columns J and S of `rows`, empty, as hs_node_rows_fill does, from rows of all
 * points of the map. */
hs_status hs_row_split_fill(hs_call *call, const hs_node_map *map, const hs_rows_view *from,
                            hs_pairs *rows);

/* The half list of these rows, in an empty output: of each row what is above its point, and of its
 * own images those that are forward. */
hs_status hs_row_split_half(hs_call *call, int64_t n, const hs_rows_view *from, hs_output *half);

#endif
