/* SPDX-License-Identifier: BSD-3-Clause */
/* verlet.h: a list of pairs that is used for many steps: what it holds. */
#ifndef HS_VERLET_H
#define HS_VERLET_H

#include "frame.h"
#include "images.h"
#include "motion.h"

/*
 * The pairs within `radius` of one step, as numbers of points and images:
 *
 *     S = image + counts_i - counts_j      over the box vectors that repeat, as given
 *
 * Points keep their image of each other while they move; counts follow their jumps. The first
 * n_plain pairs have the image 0.
 */
typedef struct hs_listing {
    int64_t   n_pairs, n_plain;
    int32_t  *i, *j;  /* owned: hs_array_free; i < j, or a point and its own image */
    int32_t  *code;   /* owned; of pairs from n_plain on: the number of their image */
    hs_images images;
    hs_counts counts; /* when it was built; of == NULL: all zero */
    double    radius;
} hs_listing;

struct hs_verlet {
    bool       has_list;
    hs_listing listing;
    double     cutoff;
    double     margin;
    hs_frame   frames[3];    /* two are in use, one is for the next step */
    int        built, now;   /* numbers of frames: the step it was built for, the last step */
    hs_counts  moved[2];     /* counts of the last step and of the next */
    int        moved_now;    /* which of them; -1: they are those of the listing */
};

/* Pairs within `radius` of a frame. On failure *listing is as it was. */
hs_status hs_listing_build(const hs_frame *frame, const hs_options *options, double radius,
                           hs_listing *listing, hs_failure *failure);

void hs_listing_free(hs_listing *listing);

/* Counts of the last step; NULL: all zero. */
HS_ALWAYS_INLINE const int64_t *
hs_verlet_counts(const hs_verlet *list)
{
    return list->moved_now >= 0 ? list->moved[list->moved_now].of : list->listing.counts.of;
}

#endif
