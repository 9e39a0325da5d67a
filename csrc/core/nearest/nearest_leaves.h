/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_leaves.h: the leaves that any of some neighbouring groups may need, found by one walk
 * down the tree, so that each group has only a list of boxes to go through. */
#ifndef HS_NEAREST_LEAVES_H
#define HS_NEAREST_LEAVES_H

#include "nearest.h"

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

/* Lists the leaves within `radius` of one of these groups in leaves->hits, ascending; returns how
 * many. radius: at most leaves->radius. */
int32_t hs_nearest_leaves_list(const hs_nearest *near, const hs_nearest_group *group, double radius,
                               hs_nearest_leaves *leaves);

#endif
