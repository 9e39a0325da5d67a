/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * kernel.h: the contract of the scan kernels, and the table of them.
 *
 * A scan compares one point with a run of gathered candidates in float32 and lists those that are
 * not surely beyond the cutoff. All kernels list the same candidates in the same order, except that
 * they may differ on those between the two thresholds of filter.h; every such hit is decided again
 * by the caller, so results do not depend on the kernel. A kernel may fuse and reorder
 * the sum of squares unless it is asked not to (`unfused`).
 */
#ifndef HS_KERNEL_H
#define HS_KERNEL_H

#include "../core/base.h"
#include "../core/filter.h"
#include "../halfshell.h"

/* A scan may read, and write to hits, this many entries past the last candidate. */
#define HS_SCAN_PADDING 32

/* Borrowed arrays of the gathered candidates, each n + HS_SCAN_PADDING entries that may be read. */
typedef struct hs_candidates {
    const float   *y[HS_MAX_DIM];  /* coordinates, one array per axis */
    const int32_t *label; /* what a hit is listed as: point number, or place in the buffer */
} hs_candidates;

/*
 * Lists label[c] for every c in [first, last) with !(s > thresholds.out), ascending, where
 * s = sum_k fl(y_k[c] - q_k)^2, accumulated from axis 0 on.
 *
 * q           ndim floats
 * hits        receives the labels; room for last - first + HS_SCAN_PADDING
 * ambiguous   set to true if any listed c has !(s < thresholds.in); never set to false
 *
 * Returns the number of hits. NaN counts as listed and ambiguous.
 */
typedef int32_t (*hs_scan_fn)(const hs_candidates *candidates, int32_t first, int32_t last,
                              const float *q, hs_thresholds thresholds, int ndim,
                              int32_t *hits, bool *ambiguous);

typedef struct hs_kernel {
    const char *name;
    bool (*supported)(void);
    hs_scan_fn scan;    /* may fuse */
    hs_scan_fn unfused; /* s as plain rounded float32 operations, in the order given above */
} hs_kernel;

/* The best kernel of this CPU, or the one of that name; NULL if it is unknown or cannot run
 * here. */
const hs_kernel *hs_kernel_select(const char *name);

/* scan_scalar.c: plain C, any CPU; the specification of the others. */
int32_t hs_scan_scalar(const hs_candidates *candidates, int32_t first, int32_t last,
                       const float *q, hs_thresholds thresholds, int ndim, int32_t *hits,
                       bool *ambiguous);

/* scan_avx2.c, scan_avx512.c: x86-64 only. */
int32_t hs_scan_avx2(const hs_candidates *candidates, int32_t first, int32_t last,
                     const float *q, hs_thresholds thresholds, int ndim, int32_t *hits,
                     bool *ambiguous);
int32_t hs_scan_avx2_unfused(const hs_candidates *candidates, int32_t first, int32_t last,
                             const float *q, hs_thresholds thresholds, int ndim, int32_t *hits,
                             bool *ambiguous);
int32_t hs_scan_avx512(const hs_candidates *candidates, int32_t first, int32_t last,
                       const float *q, hs_thresholds thresholds, int ndim, int32_t *hits,
                       bool *ambiguous);
int32_t hs_scan_avx512_unfused(const hs_candidates *candidates, int32_t first, int32_t last,
                               const float *q, hs_thresholds thresholds, int ndim, int32_t *hits,
                               bool *ambiguous);

#endif
