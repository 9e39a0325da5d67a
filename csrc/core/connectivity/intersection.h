/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * intersection.h: for each pair of the table, the points that are neighbours of both of its ends
 * and whose foot on the line through them lies between them, and the ends.
 */
#ifndef HS_INTERSECTION_H
#define HS_INTERSECTION_H

#include "../collect/result.h"

#include "half_list.h"
#include "node_map.h"

/*
 * Fills offsets and column J of `result`, empty: entry l of pair number p, [offsets[p * n_lists +
 * l], next), has the numbers in list l of the common neighbours, in the order of the points, and
 * then those of the first and the second end that are of this list. points: the coordinates of all
 * points of the map, row after row, finite. The half list has no shifts.
 */
hs_status hs_intersection_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs,
                               const hs_output *half, const double *points, int ndim,
                               hs_pairs *result, hs_failure *failure);

#endif
