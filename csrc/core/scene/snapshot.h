/* SPDX-License-Identifier: BSD-3-Clause */
/* snapshot.h: a copy of the caller's points and box at one step, as given: what a list that
 * outlives the call (pair_list.h) compares and decides with. */
#ifndef HS_SNAPSHOT_H
#define HS_SNAPSHOT_H

#include "../memory/growable.h"

typedef struct hs_frame {
    hs_points points; /* one point behind another, of the caller's type */
    hs_store  store;
    void     *rows;    /* in it; what points.data is */
    double    largest; /* largest |x| of all coordinates, 0 without points */
    bool      has_box;
    hs_box    box;
} hs_frame;

/*
 * Copies both, each number read once. HS_ERR_NOT_FINITE names the first bad row and column. Storage
 * is used again where it is large enough. On failure the frame holds nothing of use.
 */
hs_status hs_frame_take(const hs_points *points, const hs_box *box, const hs_options *options,
                        hs_frame *frame, hs_failure *failure);

/* Whether points of one are those of the other as far as a list goes: as many, of the same type, in
 * boxes that repeat along the same axes. */
bool hs_frames_match(const hs_frame *one, const hs_frame *other);

/* Whether all box vectors that repeat are the same numbers. */
bool hs_frames_share_box(const hs_frame *one, const hs_frame *other);

void hs_frame_free(hs_frame *frame);

/* The box, or NULL for open space. */
HS_ALWAYS_INLINE const hs_box *
hs_frame_box(const hs_frame *frame)
{
    return frame->has_box ? &frame->box : NULL;
}

/* Coordinate e, counted point after point. */
HS_ALWAYS_INLINE double
hs_frame_entry(const void *rows, hs_real real, int64_t e)
{
    return real == HS_FLOAT32 ? (double)((const float *)rows)[e] : ((const double *)rows)[e];
}

/* How many box vectors repeat. */
HS_ALWAYS_INLINE int
hs_frame_periodic(const hs_frame *frame, int *vector_of_row)
{
    int m = 0;
    for (int l = 0; frame->has_box && l < frame->box.ndim; l++) {
        if (frame->box.periodic[l]) {
            vector_of_row[m++] = l;
        }
    }
    return m;
}

#endif
