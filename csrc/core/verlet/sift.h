/* SPDX-License-Identifier: BSD-3-Clause */
/* sift.h: the float32 test of listed pairs: the direct form of filter.h, point by point. */
#ifndef HS_SIFT_H
#define HS_SIFT_H

#include "../exact/filter.h"

/* Pairs of one call, at most: their places are 16 bits wide. */
#define HS_SIFT 4096

/* Entries from one point to the next: 4, or 8 in more than four dimensions. The rest are zero. */
HS_ALWAYS_INLINE int
hs_sift_stride(int ndim)
{
    return ndim <= 4 ? 4 : 8;
}

/* Pairs, and points as floats; all borrowed. */
typedef struct hs_sift_pairs {
    const float   *y; /* points: `stride` floats each */
    int            stride;
    const int32_t *i, *j;
    const int32_t *code;   /* numbers of images, or NULL: nothing is added */
    const float   *offset; /* of each image: `stride` floats, added to y_j - y_i */
    int32_t        n;      /* at most HS_SIFT */
    hs_thresholds  limit;
} hs_sift_pairs;

/*
 * Lists the places of all pairs that are not surely beyond the cutoff, ascending, to hits, and of
 * these the entries that are not surely within it to unsure. Both have room for HS_SIFT + 4.
 * Returns how many hits there are.
 */
int32_t hs_sift(const hs_sift_pairs *pairs, uint16_t *hits, uint16_t *unsure, int32_t *n_unsure);

#endif
