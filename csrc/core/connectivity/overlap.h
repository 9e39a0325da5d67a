/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_CONNECTIVITY_OVERLAP_H
#define HS_CONNECTIVITY_OVERLAP_H

#include "../exact/metric.h"
#include "connectivity.h"

/*
 * overlap.h: points that gather a common point, from the rows of what each point gathers; and what
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
