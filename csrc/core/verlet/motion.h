/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * motion.h: how far points have moved since a list was built, and what that leaves of its skin.
 * docs/verlet.md derives the inequality.
 */
#ifndef HS_MOTION_H
#define HS_MOTION_H

#include "displacement.h"

/*
 * *margin: by how much pairs may still come closer, in the unit of points, rounded down. At least
 * 0: every pair within the cutoff now is in the list. Below 0: it may not be; -infinity where
 * nothing is known. *jumped: some point has jumped by whole box vectors, and `jumps` says by how
 * many of each that repeats, int64 (n, m); else `jumps` has no meaning. HS_ERR_MEMORY,
 * HS_ERR_INTERRUPTED.
 */
hs_status hs_motion_margin(const hs_motion *motion, const hs_options *options, double *margin,
                           bool *jumped, hs_store *jumps);

#endif
