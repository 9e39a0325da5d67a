/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * overlap.h: points that gather a common point, from the rows of what each point gathers. With G
 * the matrix of these rows and of the diagonal, for each point is in its own support, row i of the
 * pattern of G G^T has them: neighbours, where the common point is one of the two, and those
 * further apart.
 */
#ifndef HS_OVERLAP_H
#define HS_OVERLAP_H

#include "../collect/result.h"

#include "node_map.h"

/* Fills offsets and column J of `rows`, empty, as hs_node_rows_fill does; all points of the map
 * have rows. points: row after row; they only say what is near. */
hs_status hs_overlap_fill(hs_call *call, const hs_node_map *map, const hs_index_rows *gather,
                          const double *points, int ndim, hs_pairs *rows, hs_failure *failure);

#endif
