/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * slab.h: the contract of the float32 test of listed pairs: that of filter.h, between
 * points that lie anywhere in memory. Pairs come in bundles, so that one point of each stays in
 * registers and the list has one number a pair; a point is one vector of four floats, the last of
 * which is its number, so that one load brings all that is needed of it.
 */
#ifndef HS_SLAB_H
#define HS_SLAB_H

#include "../core/base/base.h"
#include "../core/exact/filter.h"

/* Pairs of one call, at most. */
#define HS_SLAB 4096

/* Entries from one point to the next: 4, or 8 in more than four dimensions. */
HS_ALWAYS_INLINE int
hs_slab_stride(int ndim)
{
    return ndim <= 4 ? 4 : 8;
}

/* The last entry is the point's number, as an integer, where there is room for it; entries between
 * are zero. */
HS_ALWAYS_INLINE bool
hs_slab_has_numbers(int ndim)
{
    return ndim != 4 && ndim != 8;
}

/* Listed pairs of one point and others that are all in the same image of it. */
typedef struct hs_bundle {
    int64_t end;   /* in the list; it begins where the one before ends */
    int32_t point; /* place */
    int32_t image; /* number; none where they have no image */
} hs_bundle;

/* A pair that float32 cannot tell. */
typedef struct hs_open_pair {
    int32_t bundle; /* from slab->bundles on */
    int32_t pair;   /* from `first` on */
    int32_t at;     /* its entry of hits */
} hs_open_pair;

/* Consecutive pairs of a list; all arrays borrowed. */
typedef struct hs_slab {
    int              ndim;
    const float     *y;          /* points: hs_slab_stride entries each */
    const float     *offset;     /* of each image, as many, taken from the point; NULL: no images */
    const int32_t   *j;          /* the whole list: places. HS_PADDING more are read: places, too */
    const hs_bundle *bundles;    /* the first is that of pair `first` */
    int64_t          first, end; /* pairs of the list, at most HS_SLAB and at least one */
    bool             numbers;    /* hits are listed as point numbers, else as places */
    hs_thresholds    limit;
    int32_t         *hits;      /* receives them; HS_SLAB + HS_PADDING */
    int32_t         *point;     /* receives the number of each bundle's point, if `numbers` */
    int32_t         *hits_end;  /* receives, for each bundle, where its hits end; HS_SLAB */
    hs_open_pair    *open;      /* receives hits that are not surely within; HS_SLAB + 1 */
    int32_t          n_bundles; /* set, as are: */
    int32_t          n_hits, n_open;
} hs_slab;

/*
 * Lists all pairs with !(s > out), in their order, and notes those of them with !(s < in):
 * s = sum of (y_j - q)^2, fused or not, with q = y_i, or y_i - offset rounded once. NaN is listed,
 * and noted.
 */
typedef void (*hs_recheck_fn)(hs_slab *slab);

void hs_recheck_scalar(hs_slab *slab);   /* plain C, the specification */
void hs_recheck_baseline(hs_slab *slab); /* any CPU */

#endif
