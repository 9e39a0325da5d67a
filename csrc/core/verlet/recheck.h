/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * recheck.h: the pairs of a list that are within the cutoff now, decided as a search decides them:
 * in float32 (sift.h), and by the exact metric where float32 cannot tell. A slab of the list at a
 * time; a team works on several, and what they find is written in the order of the list.
 */
#ifndef HS_RECHECK_H
#define HS_RECHECK_H

#include "../collect/columns.h"
#include "../collect/result.h"
#include "../scene/scene.h"
#include "../threads/call.h"
#include "sift.h"
#include "pair_list.h"

/*
 * Everything that slabs share, read only while they work. Points are those of the list: in the cell
 * order of the step it was built for.
 */
typedef struct hs_recheck {
    const hs_verlet *list;   /* borrowed */
    const hs_frame  *now;    /* the list's */
    hs_call         *call;   /* borrowed */
    hs_output       *output; /* borrowed */
    int              d, m;
    int              vector_of_row[HS_MAX_DIM];
    hs_metric        given;  /* decides, on points and box vectors as given */
    int64_t         *counts; /* owned; m a point, as those of the list, jumps included; or NULL */
    double           most_counts;    /* the largest of them, of either sign */
    float           *y;              /* owned; sift.h */
    float           *offset;         /* owned; stride for each image */
    hs_thresholds    plain, shifted; /* for pairs without and with an image */
    bool             measures;       /* d or D are wanted. Then: */
    hs_scene         scene;
    double          *x;       /* owned; d a point: what the scene's metric measures between */
    int64_t         *image;   /* owned; m for each image: its shift is image + lag_j - lag_i */
    int64_t         *lag;     /* owned; m a point */
    uint8_t         *lagging; /* owned; whether those are not all zero */
} hs_recheck;

/* The hits of one slab. */
typedef struct hs_sifted {
    int64_t   first; /* pair of the list */
    int32_t   n;     /* pairs, all with or all without an image */
    int32_t   n_hits, n_unsure;
    int64_t   at; /* their place in the output */
    hs_status status;
    int64_t   failed_point;
    hs_stages stages;
    uint16_t  hits[HS_SIFT + 4], unsure[HS_SIFT + 4];
} hs_sifted;

/* Writes all pairs within the cutoff to the output. */
hs_status hs_recheck_run(hs_recheck *recheck, hs_failure *failure);

/* The points as floats, their counts and thresholds. In recheck_points.c. */
hs_status hs_recheck_prepare(hs_recheck *recheck);

/* Decides the unsure hits of a slab, of which there are some, and takes those that are beyond the
 * cutoff from the hits. */
void hs_recheck_settle(const hs_recheck *recheck, int32_t n_unsure, hs_sifted *slab);

/* Writes the hits. */
void hs_recheck_put(const hs_recheck *recheck, hs_sifted *slab);

/* Makes the scene ready that d and D are measured in, so that they have the bits that a search
 * finds, and writes them. In recheck_measure.c. */
hs_status hs_recheck_open_scene(hs_recheck *recheck, hs_failure *failure);
void      hs_recheck_measure(const hs_recheck *recheck, const hs_sifted *slab);

/* Room in the column of this HS_WANT_ bit for pair `at` of the output; NULL where not kept. */
HS_ALWAYS_INLINE void *
hs_recheck_column(const hs_recheck *recheck, unsigned bit, int64_t at)
{
    char *column = hs_output_column(recheck->output, bit);
    return column == NULL ? NULL : column + (size_t)at * hs_output_width(recheck->output, bit);
}

/* S of pair e over the box vectors that repeat. */
HS_ALWAYS_INLINE void
hs_recheck_shift(const hs_recheck *recheck, int64_t e, int64_t *shift)
{
    const hs_listing *listing = &recheck->list->listing;
    const int         m = recheck->m;
    for (int r = 0; r < m; r++) {
        shift[r] = e < listing->n_plain
                       ? 0
                       : listing->images.of[(int64_t)listing->code[e - listing->n_plain] * m + r];
        if (recheck->counts != NULL) { /* modulo 2^64: exact, for the sum fits */
            shift[r] = (int64_t)((uint64_t)shift[r] +
                                 (uint64_t)recheck->counts[(int64_t)listing->i[e] * m + r] -
                                 (uint64_t)recheck->counts[(int64_t)listing->j[e] * m + r]);
        }
    }
}

/* The pairs of the last step, into a result whose call has begun. Its options are checked and have
 * the cutoff of the list. Any status of hs_verlet_find. In recheck_find.c. */
hs_status hs_recheck_find(const hs_verlet *list, hs_pairs *pairs, hs_failure *failure);

#endif
