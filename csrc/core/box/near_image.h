/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * near_image.h: the nearest image of one point to another, decided exactly, in any box. Floats with
 * a bound on their error leave few images over, nearly always one; these are compared for the real
 * numbers that the inputs are. Of images that are equally near the one with the lexicographically
 * least shift over the given box vectors counts.
 */
#ifndef HS_NEAR_IMAGE_H
#define HS_NEAR_IMAGE_H

#include "../exact/metric.h"
#include "lattice.h"

/* A box made ready; plain values, nothing owned. */
typedef struct hs_image_box {
    hs_metric  metric;  /* of the points and box vectors as given */
    hs_scale   scale;   /* of the lattice; unless the box is aligned as given, its longest entry is
                         * from 1 to 2 */
    hs_lattice lattice; /* in a short basis */
    int order[HS_MAX_DIM]; /* of the rows of B: the shortest first, unless that is aligned ... */
    /* ... when row order[r] of B is the sum of R[r][k] along[k] over k <= r. */
    double along[HS_MAX_DIM][HS_MAX_DIM]; /* unit vectors at right angles */
    double R[HS_MAX_DIM][HS_MAX_DIM];
    bool   is_spanned[HS_MAX_DIM]; /* some row of B has an entry in this coordinate */
    double rounding;               /* of a product with a unit vector, relative to its terms */
    double row_error;              /* of B, over all rows that an image is made of */
} hs_image_box;

/* box: checked (hs_box_check), or NULL. HS_OK or HS_ERR_BOX_SKEWED. */
hs_status hs_image_box_init(const hs_box *box, int ndim, hs_image_box *to);

/*
 * Sets the shift of the image of q that is nearest to p, over the periodic box vectors as given.
 * HS_ERR_SHIFT_RANGE for points too many periods away, HS_ERR_BOX_SKEWED where too many images are
 * about as near. Needs at least one periodic box vector.
 */
hs_status hs_near_image(const hs_image_box *box, const double *p, const double *q, int64_t *shift);

#endif
