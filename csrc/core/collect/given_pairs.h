/* SPDX-License-Identifier: BSD-3-Clause */
/* given_pairs.h: d, D and S of pairs that the caller gives, in their order. */
#ifndef HS_GIVEN_PAIRS_H
#define HS_GIVEN_PAIRS_H

#include "../box/near_image.h"
#include "../scene/points.h"
#include "columns.h"
#include "../threads/call.h"

/* What pairs are measured between; all borrowed. */
typedef struct hs_given_pairs {
    const hs_pair_numbers *pairs;
    const hs_cloud        *cloud;
    const hs_image_box    *box;
    hs_output             *output; /* with room for them */
} hs_given_pairs;

/*
 * Fills the output's columns of d, D and S. HS_ERR_ARGUMENT for a number that is no point's, or a
 * shift along an axis that does not repeat or beyond 2^62; HS_ERR_SHIFT_RANGE and HS_ERR_BOX_SKEWED
 * as hs_near_image, the former also for an S that does not fit its column; HS_ERR_FAR for a vector
 * that float64 does not hold. failure->row is the number of the first such pair in its part of
 * them. HS_ERR_INTERRUPTED.
 */
hs_status hs_given_pairs_measure(const hs_given_pairs *given, hs_call *call, hs_failure *failure);

#endif
