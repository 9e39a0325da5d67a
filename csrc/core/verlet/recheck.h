/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_VERLET_RECHECK_H
#define HS_VERLET_RECHECK_H

#include "../collect/columns.h"
#include "../scene/scene.h"
#include "../threads/call.h"
#include "pair_list.h"

/*
 * recheck.h: the pairs of a list that are within the cutoff now, decided as a search decides them:
 * in float32 (kernels/slab.h), and by the exact metric where float32 cannot tell. A slab of the
 * list at a time; threads work on one each, and what they find is written in the order of the list.
 */

/* The points a of the bundles of a slab, as kernels/write.h wants them. */
typedef struct hs_bundle_points {
    int32_t number[HS_SLAB];
    double  p[HS_WRITE_MOST_DIM][HS_SLAB];
    int32_t turns[HS_WRITE_MOST_DIM][HS_SLAB];
} hs_bundle_points;

/*
 * Everything that slabs share, read only while they work, but for `output` and `of_a`: each thread
 * has a copy with its own. Points are those of the list: in the cell order of the step it was built
 * for.
 */
typedef struct hs_recheck {
    const hs_verlet  *list;   /* borrowed */
    const hs_frame   *now;    /* the list's */
    hs_call          *call;   /* borrowed */
    bool              shared; /* by threads, each of which has an output of its own first */
    hs_output        *output; /* borrowed; the thread's, where it is shared */
    int               d, m;
    int               vector_of_row[HS_MAX_DIM];
    hs_metric         given;  /* decides, on points and box vectors as given */
    int64_t          *counts; /* owned; m a point, as those of the list, jumps included; or NULL */
    double            most_counts;    /* the largest of them, of either sign */
    float            *y;              /* owned; kernels/slab.h */
    float            *offset;         /* owned; of each image */
    hs_thresholds     plain, shifted; /* for pairs without and with an image */
    bool              numbers;        /* point numbers are all that is wanted of a hit */
    bool              measures;       /* d or D are wanted. Then: */
    hs_scene          scene;
    int               width;   /* entries of x a point: d, or if it `writes` HS_RECORD */
    double           *x;       /* owned; what the scene's metric measures between */
    int64_t          *image;   /* owned; m for each image: its shift is image + lag_j - lag_i */
    int64_t          *lag;     /* owned; m a point */
    uint8_t          *lagging; /* owned; whether those are not all zero */
    bool              writes;  /* d and D are written by the kernel's writer. Then: */
    int32_t          *few;     /* owned; records of lags; NULL: all are zero */
    hs_bundle_points *of_a;    /* each thread has its own */
} hs_recheck;

/* The hits of one slab: consecutive pairs, all with or all without an image. */
typedef struct hs_slab_hits {
    int64_t          first; /* pair of the list */
    int32_t          n;
    const hs_bundle *bundles; /* the first is that of pair `first` */
    int32_t          n_bundles;
    int32_t          n_hits, n_open;
    int64_t          at; /* their place in the output */
    hs_status        status;
    int64_t          failed_point;
    hs_stages        stages;
    /* Places b, or where recheck->numbers says so the caller's numbers of them, and those of a for
     * each bundle; and where the hits of each bundle end. */
    int32_t      hits[HS_SLAB + HS_PADDING], point[HS_SLAB], hits_end[HS_SLAB];
    hs_open_pair open[HS_SLAB + 1];
    int32_t      number[HS_SLAB + HS_PADDING];                     /* of b */
    int32_t      i[HS_SLAB + HS_PADDING], j[HS_SLAB + HS_PADDING]; /* ... and what is copied */
} hs_slab_hits;

/* Makes the scene ready that d and D are measured in, so that they have the bits that a search
 * finds, and writes them. */
hs_status hs_recheck_open_scene(hs_recheck *recheck, hs_failure *failure);

/* Whether hits can be measured while they are written, and what that needs. */
hs_status hs_recheck_plan_write(hs_recheck *recheck);

/* The pairs of the last step, into a result whose call has begun. Its options are checked and have
 * the cutoff of the list. Any status of hs_verlet_find. */
hs_status hs_recheck_find(const hs_verlet *list, hs_pairs *pairs, hs_failure *failure);

#endif
