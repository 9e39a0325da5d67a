/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_prepare.h: what a search for the nearest points begins with: a scene and trees, made
 * anew or borrowed from cells that keep them. */
#ifndef HS_NEAREST_PREPARE_H
#define HS_NEAREST_PREPARE_H

#include "nearest.h"

/*
 * Everything of `near` but k, of_spot, omits_self and rows, which are set already, as is its search
 * but for scene, bins, kernel and threads. sets->trees: NULL, or what keeps a tree of the points.
 * `limit`: the largest distance. hs_near_release in any case.
 */
hs_status hs_near_prepare(hs_near *near, const hs_sets *sets, const hs_box *box, double limit,
                          hs_failure *failure);

void hs_near_release(hs_near *near);

#endif
