/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_NEAREST_CANDIDATES_H
#define HS_NEAREST_CANDIDATES_H

#include "nearest.h"

/*
 * candidates.h: the points that some neighbouring groups may need: images, leaves of the tree,
 * runs of points, and their block of floats.
 */

/* The leaves that any of some neighbouring groups may need, found by one walk
 * down the tree, so that each group has only a list of boxes to go through. */

/* Owned by a thread. */
typedef struct hs_nearest_leaves {
    int32_t           n;
    float            *low[HS_MAX_DIM]; /* ranges of X, moved, less the centre, in units; clamped */
    float            *high[HS_MAX_DIM];
    hs_nearest_run   *runs;  /* their points; places are of no meaning */
    int32_t          *label; /* 0, 1, 2, ... */
    int32_t          *hits;
    hs_nearest_image *images;
    int32_t           n_images;
    int32_t          *stack;
    double            centre[HS_MAX_DIM];
    double            unit;   /* a power of two: lengths times this */
    double            extent; /* largest number of any range */
    double            error;  /* on each component of a shifted coordinate */
    double            radius; /* for groups up to this one; 0: for none */
} hs_nearest_leaves;

hs_status hs_nearest_leaves_init(const hs_nearest *near, hs_nearest_leaves *leaves);
void      hs_nearest_leaves_free(const hs_nearest *near, hs_nearest_leaves *leaves);

/* Finds leaves for groups with first guesses. Sets leaves->radius to 0 where a list would save
 * nothing. */
void hs_nearest_leaves_find(const hs_nearest *near, const hs_nearest_group *groups, int32_t n,
                            hs_nearest_leaves *leaves);

/*
 * What a group may be near to, gathered from all images as float32 relative to the
 * group.
 */

/* Owned by a thread; arrays grow as needed. Places count candidates. */
typedef struct hs_nearest_block {
    int32_t           n, capacity;
    float            *y[HS_MAX_DIM]; /* X, moved, less the centre, in units; clamped to `extent` */
    float            *norm;          /* sum of y^2 */
    int32_t          *number;        /* in tree order */
    int32_t          *image_of;      /* where there are several images */
    int32_t          *place;         /* 0, 1, 2, ... */
    int32_t          *hits;
    float            *squares; /* of the hits, in float32; where has_squares */
    hs_unsure        *unsure;
    hs_nearest_run   *runs;
    hs_nearest_image *images;
    int32_t           n_runs, run_capacity, n_images, image_capacity;
    int32_t          *stack;
    int64_t           depth; /* room on it */
    float             q[HS_MAX_DIM][HS_GROUP_POINTS];
    double            unit;         /* lengths times this: the radius is between 1 and 2 */
    double            reach;        /* the radius, times it */
    double            extent;       /* largest |y| and |q| */
    double            error;        /* of each component of X, moved, times it */
    double            flat_error;   /* of any |D|^2 from X, beside its relative rounding */
    bool              has_squares;  /* for points with few hits, which float32 may put in order */
    double            square_error; /* of these, up to the radius */
} hs_nearest_block;

hs_status hs_nearest_block_init(const hs_nearest *near, hs_nearest_block *block);
void      hs_nearest_block_free(const hs_nearest *near, hs_nearest_block *block);

/* Fills the block for a group with its radius, which may be raised a little. leaves: for some
 * groups, this among them, or NULL. HS_TRY_OTHER: there are more than `most` candidates or images,
 * or the group is far wider than its radius. */
hs_status hs_nearest_block_fill(const hs_nearest *near, const hs_options *options,
                                hs_nearest_group *group, double most, hs_nearest_leaves *leaves,
                                hs_nearest_block *block);

/* The image of the candidate at a place. */
HS_ALWAYS_INLINE const hs_nearest_image *
hs_nearest_image_of(const hs_nearest_block *block, int32_t place)
{
    return &block->images[block->n_images > 1 ? block->image_of[place] : 0];
}

/* How far |D|^2 in units, as it comes from float64, may be from the true one, for any that is not
 * beyond the radius. */
HS_ALWAYS_INLINE double
hs_nearest_error(const hs_nearest_block *block, int ndim, double square)
{
    /* Per axis: two roundings of the difference, one of the square, one of the sum; twice that. */
    return (ndim + 4) * 0x1p-51 * square + block->flat_error;
}

/* Hits of the group's points from point `first` on: !(far away), places in block->hits. Returns the
 * point to go on with; end[t]: where those of point t end. */
int32_t hs_nearest_block_scan(const hs_nearest *near, const hs_nearest_group *group,
                              hs_nearest_block *block, int32_t first, int32_t *end);

#endif
