/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_CONNECTIVITY_OVERLAP_H
#define HS_CONNECTIVITY_OVERLAP_H

#include "../memory/memory.h"
#include "connectivity.h"
#include "../exact/arithmetic.h"
#include "../threads/call.h"
#include "../collect/columns.h"
#include "../base/base.h"

/*
 * overlap.h: points that gather a common point, from the rows of what each point gathers. With G
 * the matrix of these rows and of the diagonal, for each point is in its own support, row i of the
 * pattern of G G^T has them: neighbours, where the common point is one of the two, and those
 * further apart.
 */

/* Rows over the numbers of points, as scratch: of a caller's, of the opposite
 * direction, or of both ends of a half list. */

/* Row i is index[first[i]] ... index[first[i + 1] - 1], ascending. Both are owned. */
typedef struct hs_point_rows {
    int64_t  n;
    int64_t *first;
    int32_t *index;
} hs_point_rows;

/*
 * A copy of n rows that a caller gives, each with its own number added. HS_ERR_ARGUMENT where
 * offsets descend, or a row is not ascending, has its own number or one that is no point. On
 * failure holds nothing, as all of these.
 */
hs_status hs_point_rows_copy(hs_account *account, const hs_index_rows *given, hs_point_rows *rows);

/* Idempotent. */
void hs_point_rows_free(hs_account *account, hs_point_rows *rows);

/* Rows of numbers as bits, 64 numbers to a word. Where the numbers of a row are close
 * to each other, as those of neighbours are in the order of space, it has few words. */

/* Row k is the words [first[k], first[k + 1]): bits[w] are the numbers from 64 * word[w] on. All
 * are owned. */
typedef struct hs_word_rows {
    int64_t  *first;
    int32_t  *word; /* ascending in each row */
    uint64_t *bits;
} hs_word_rows;

/*
 * Points in the order of the Z curve through their bounding box. Work on points that
 * follow each other then finds in the caches what the last ones needed.
 */

/* Both arrays are parts of one block, owned by `order`. */
typedef struct hs_space_order {
    int32_t *order; /* n: the points, in this order */
    int32_t *place; /* n: where each of them is in it */
} hs_space_order;

/* Fills offsets and column J of `rows`, empty, as hs_node_rows_fill does; all points of the map
 * have rows. points: row after row; they only say what is near. */
hs_status hs_overlap_fill(hs_call *call, const hs_node_map *map, const hs_index_rows *gather,
                          const double *points, int ndim, hs_pairs *rows, hs_failure *failure);

/*
 * For each pair of the table, the points that are neighbours of both of its ends
 * and whose foot on the line through them lies between them, and the ends.
 */

/*
 * Fills offsets and column J of `result`, empty: entry l of pair number p, [offsets[p * n_lists +
 * l], next), has the numbers in list l of the common neighbours, in the order of the points, and
 * then those of the first and the second end that are of this list. points: the coordinates of all
 * points of the map, row after row, finite. The half list has no shifts.
 */
hs_status hs_intersection_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs,
                               const hs_output *half, const double *points, int ndim,
                               hs_pairs *result, hs_failure *failure);

/*
 * The place of a point on the Z curve through a box: the bits of its coordinates, as
 * fractions of the box, in turns. Points that are close in this order are close in space, and the
 * order depends on nothing but the box.
 */

/* Bits of each of ndim coordinates: 63, 31, 21, 15, 12, 10, 9, 7. */
HS_ALWAYS_INLINE int
hs_morton_bits(int ndim)
{
    return 63 / ndim;
}

/* The number of the slice that x is in, of 2^bits equal ones from low to high; never descends with
 * x. low <= x <= high, finite; 0 where the box has no width. */
uint64_t hs_morton_slice(double x, double low, double high, int bits);

/* The bits of the slices in turns, those of the first axis lowest. */
uint64_t hs_morton_interleave(const uint64_t *slices, int ndim);

#endif
