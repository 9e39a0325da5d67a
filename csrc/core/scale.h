/* SPDX-License-Identifier: BSD-3-Clause */
/* scale.h: the power of two that a scene is scaled by, so that the search has ordinary numbers. */
#ifndef HS_SCALE_H
#define HS_SCALE_H

#include "points.h"

/* Sizes of the periodic box entries. */
typedef struct hs_box_size {
    double largest;   /* 0 without rows */
    double smallest;  /* not counting zeros; infinity without rows */
    double short_row; /* the least of the rows' largest entries; infinity without rows */
} hs_box_size;

/* box: NULL for none. */
hs_box_size hs_box_size_of(const hs_box *box);

/* The cutoff, or a smaller one if that is beyond all distances as well. */
double hs_enough_cutoff(const hs_cloud *cloud, const hs_box_size *box, double cutoff);

/* The exponent of the length that a scene goes by: its cutoff, or with cutoff 0 its box, or where
 * its points are. A very small number if all is 0. */
int hs_unit_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff);

/* The exponent to scale by; *extreme: whether that loses digits. unit: as hs_unit_exponent. */
int hs_choose_exponent(const hs_cloud *cloud, const hs_box_size *box, double cutoff, int unit,
                       bool *extreme);

#endif
