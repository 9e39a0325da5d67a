/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_VERLET_PAIR_LIST_H
#define HS_VERLET_PAIR_LIST_H

#include "../scene/scene.h"
#include "../collect/columns.h"

/*
 * pair_list.h: a list of pairs that is used for many steps: what it holds, and how much of its skin
 * the motion of the points leaves.
 */

/* Consecutive pairs, all without an image or all with one. */
typedef struct hs_list_part {
    hs_output  pairs;   /* b of each, in its column j; counted by no account */
    hs_bundle *bundles; /* owned; ends are places in this part */
    int64_t    n_bundles, capacity;
    int64_t    first_slab; /* of all slabs: its pairs are in so many as they fill */
} hs_list_part;

/*
 * The pairs within `radius` of one step, in bundles: those of one point a with all that are in the
 * same image of it. Points are told by their places in the cell order of that step. The shift from
 * a to b is
 *
 *     S = image + count_a - count_b      over the box vectors that repeat, as given
 *
 * Points keep their image of each other while they move; their counts follow their jumps. Few pairs
 * have an image that is not 0, those that are in different ones once the points are wrapped. Which
 * of a and b is i, the lower number of the caller's, is seen when the pair is written; where both
 * are one point, image has it the right way round. All arrays are owned.
 */
typedef struct hs_listing {
    double  radius;
    int64_t n_pairs, n_slabs;
    /* Ranges of points, each by one thread: how many there are depends on the number of threads,
     * what follows from one to the next does not. */
    int64_t       n_pieces;
    hs_list_part *parts; /* of each piece the pairs with image 0, then of each the others */
    int64_t       n_images;
    int32_t      *images; /* m numbers of each, over the box vectors that repeat, as given */
    int32_t      *order;  /* the caller's number of each place */
    int64_t      *counts; /* m for each place, when it was built */
} hs_listing;

struct hs_verlet {
    bool       has_list;
    hs_listing listing;
    double     cutoff;
    double     margin;
    double     tried;      /* the margin of the last step before the list was built for it */
    hs_frame   frames[3];  /* two are in use, one is for the next step */
    int        built, now; /* numbers of frames: the step it was built for, the last step */
    void      *jumps[2];   /* owned; since it was built: those of the last step and of the next */
    int        jumps_now;  /* which of them; -1: nothing has jumped */
};

/* Pairs within `radius` of a frame. On failure *listing is as it was. */
hs_status hs_listing_build(const hs_frame *frame, const hs_options *options, double radius,
                           hs_listing *listing, hs_failure *failure);

void hs_listing_free(hs_listing *listing);

/*
 * How far points have moved since a list was built, and what that leaves of its skin.
 * docs/verlet.md derives the inequality.
 */

/*
 * From the frame that the list was built for to `now`, which hs_frames_match. *margin: by how much
 * pairs may still come closer, in the unit of points, rounded down. At least 0: every pair within
 * the cutoff now is in the list. Below 0: it may not be; -infinity where nothing is known. *jumped:
 * some point has jumped by whole box vectors, and `jumps` says by how many of each that repeats,
 * int64 (n, m); else `jumps` has no meaning. HS_ERR_MEMORY, HS_ERR_INTERRUPTED.
 */
hs_status hs_motion_margin(const hs_verlet *list, const hs_frame *now, const hs_options *options,
                           double *margin, bool *jumped, void **jumps);

/*
 * recheck.c: the pairs of a list that are within the cutoff now, decided as a search decides them:
 * in float32 (kernels/slab.h), and by the exact metric where float32 cannot tell. A slab of the
 * list at a time; threads work on one each, and what they find is written in the order of the list.
 */

/* The pairs of the last step, into a result whose call has begun. Its options are checked and have
 * the cutoff of the list. Any status of hs_verlet_find. */
hs_status hs_recheck_find(const hs_verlet *list, hs_pairs *pairs, hs_failure *failure);

#endif
