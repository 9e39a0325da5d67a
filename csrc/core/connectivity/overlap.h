/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_CONNECTIVITY_OVERLAP_H
#define HS_CONNECTIVITY_OVERLAP_H

#include "../memory/memory.h"
#include "connectivity.h"
#include "../exact/metric.h"
#include "../threads/call.h"
#include "../collect/columns.h"
#include "../base/base.h"

/* Rows over the numbers of points, as scratch: of a caller's, of the opposite
 * direction, or of both ends of a half list. */

/* Row i is index[first[i]] ... index[first[i + 1] - 1], ascending, of one number by S. All are
 * owned. */
typedef struct hs_point_rows {
    int64_t  n;
    int64_t *first;
    int32_t *index;
    int32_t *shift; /* ndim for each entry; NULL: none */
    int      ndim;
} hs_point_rows;

/*
 * A copy of n rows that a caller gives, each with its own number added. HS_ERR_ARGUMENT where
 * offsets descend, or a row is not ascending, has its own number (with shifts: and S zero) or one
 * that is no point. On failure holds nothing, as all of these.
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
 * A set of numbers that is filled in any order and emptied in ascending order, again and
 * again. A bit for each number, and two levels above that tell which words have any: emptying takes
 * time by the words that were touched, and a little by the size of the set.
 */

#define HS_BIT_LEVELS 3

typedef struct hs_bit_set {
    uint64_t *word[HS_BIT_LEVELS]; /* parts of one block, owned by word[0] */
    int64_t   n_words[HS_BIT_LEVELS];
} hs_bit_set;

/* An empty set of numbers below n. False when memory is short. */
HS_ALWAYS_INLINE bool
hs_bit_set_make(hs_account *account, int64_t n, hs_bit_set *set)
{
    int64_t all = 0, words = n;
    for (int l = 0; l < HS_BIT_LEVELS; l++) {
        words = (words + 63) / 64;
        set->n_words[l] = words;
        all += words;
    }
    set->word[0] = hs_alloc(account, HS_FOR_SORTING, all, sizeof(uint64_t));
    if (set->word[0] == NULL) {
        return false;
    }
    memset(set->word[0], 0, (size_t)all * sizeof(uint64_t));
    for (int l = 1; l < HS_BIT_LEVELS; l++) {
        set->word[l] = set->word[l - 1] + set->n_words[l - 1];
    }
    return true;
}

HS_ALWAYS_INLINE void
hs_bit_set_free(hs_account *account, hs_bit_set *set)
{
    hs_free(account, set->word[0]);
    set->word[0] = NULL;
}

/* Adds numbers from 64 * word on, one for each bit. */
HS_ALWAYS_INLINE void
hs_bit_set_add_word(hs_bit_set *set, int32_t word, uint64_t bits)
{
    const uint64_t before = set->word[0][word];
    set->word[0][word] = before | bits;
    if (before == 0) {
        set->word[1][word >> 6] |= UINT64_C(1) << (word & 63);
        set->word[2][word >> 12] |= UINT64_C(1) << (word >> 6 & 63);
    }
}

HS_ALWAYS_INLINE void
hs_bit_set_add(hs_bit_set *set, int32_t number)
{
    hs_bit_set_add_word(set, number >> 6, UINT64_C(1) << (number & 63));
}

HS_ALWAYS_INLINE bool
hs_bit_set_has(const hs_bit_set *set, int32_t number)
{
    return set->word[0][number >> 6] >> (number & 63) & 1u;
}

/* Writes all numbers, ascending, and forgets them; returns how many there were. */
HS_ALWAYS_INLINE int64_t
hs_bit_set_drain(hs_bit_set *set, int32_t *to)
{
    const int32_t *const first = to;
    for (int64_t high = 0; high < set->n_words[2]; high++) {
        for (uint64_t top = set->word[2][high]; top != 0; top &= top - 1) {
            const int64_t middle = high * 64 + hs_trailing_zeros(top);
            for (uint64_t mid = set->word[1][middle]; mid != 0; mid &= mid - 1) {
                const int64_t low = middle * 64 + hs_trailing_zeros(mid);
                for (uint64_t bits = set->word[0][low]; bits != 0; bits &= bits - 1) {
                    *to++ = (int32_t)(low * 64 + hs_trailing_zeros(bits));
                }
                set->word[0][low] = 0;
            }
            set->word[1][middle] = 0;
        }
        set->word[2][high] = 0;
    }
    return to - first;
}

/*
 * Points in the order of the Z curve through their bounding box. Work on points that
 * follow each other then finds in the caches what the last ones needed.
 */

/* Both arrays are parts of one block, owned by `order`. */
typedef struct hs_space_order {
    int32_t *order; /* n: the points, in this order */
    int32_t *place; /* n: where each of them is in it */
} hs_space_order;

/*
 * overlap.h: points that gather a common point, from the rows of what each point gathers. With G
 * the matrix of these rows and of the diagonal, for each point is in its own support, row i of the
 * pattern of G G^T has them: neighbours, where the common point is one of the two, and those
 * further apart. With shifts, entry (k, T) of row i and (k, U) of row j give (j, T - U).
 */

/* Fills offsets and columns J and S of `rows`, empty, as hs_row_split_fill does; all points of the
 * map have rows. points: row after row; they only say what is near. */
hs_status hs_overlap_fill(hs_call *call, const hs_node_map *map, const hs_index_rows *gather,
                          const double *points, int ndim, hs_pairs *rows, hs_failure *failure);

/*
 * For each pair of the table, the points that are neighbours of both of its ends
 * and whose foot on the line through them lies between them, and the ends.
 */

/*
 * Fills offsets and columns J and S of `result`, empty: entry l of pair number p, [offsets[p *
 * n_lists + l], next), has the numbers in list l of the common neighbours, in the order of the
 * points, and then those of the first and the second end that are of this list; S is that of each
 * from the first end. points: the coordinates of all points of the map, row after row, finite.
 * images: the dimensions, and the rows that the half list's shifts multiply.
 */
hs_status hs_intersection_fill(hs_call *call, const hs_node_map *map, bool ghost_pairs,
                               const hs_output *half, const double *points, const hs_metric *images,
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
