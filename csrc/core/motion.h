/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * motion.h: how far points have moved since a list was built, and what that leaves of its skin.
 * docs/verlet.md derives the inequality.
 */
#ifndef HS_MOTION_H
#define HS_MOTION_H

#include "frame.h"

/* Whole box vectors that a point is counted from: one for each box vector that repeats. */
typedef struct hs_counts {
    int64_t *of;       /* owned; n * m, or NULL */
    int64_t  capacity; /* entries: kept for the next step */
} hs_counts;

/* Room for n entries, unset. */
bool hs_counts_make_room(hs_counts *counts, int64_t n);
void hs_counts_free(hs_counts *counts);

/* What is compared; all borrowed. */
typedef struct hs_motion {
    const hs_frame *built;  /* the step that the list was built for */
    const hs_frame *now;    /* hs_frames_match */
    const int64_t  *counts; /* of each point when the list was built; NULL: all zero */
    double          radius; /* the list has every pair up to here */
    double          cutoff;
} hs_motion;

/*
 * *margin: by how much pairs may still come closer, in the unit of points, rounded down. At least
 * 0: every pair within the cutoff now is in the list. Below 0: it may not be. *jumped: some point
 * has jumped by whole box vectors, and `counts` has what all are counted from now, else it is of no
 * meaning. HS_ERR_MEMORY, HS_ERR_INTERRUPTED.
 */
hs_status hs_motion_margin(const hs_motion *motion, const hs_options *options, double *margin,
                           bool *jumped, hs_counts *counts);

#endif
