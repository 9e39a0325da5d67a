/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * gather.h: the neighbourhood of one group of points, copied once into contiguous float32 arrays
 * relative to a common centre, with the shift of its periodic image already added. All points of
 * the group are then tested against it in long, predictable loops: no ghosts, no minimum image per
 * pair.
 */
#ifndef HS_GATHER_H
#define HS_GATHER_H

#include "bins.h"
#include "filter.h"

#include "../kernels/kernel.h"

#define HS_GROUP_POINTS 64         /* points tested against one neighbourhood, at most */
#define HS_BLOCK_CANDIDATES 4096   /* candidates held at a time: 64 kB in three dimensions */
#define HS_BLOCK_RUNS 1024         /* runs held at a time */

/* Consecutive candidates that are consecutive points in cell order, in one image. */
typedef struct hs_run {
    int32_t at;                 /* place of the first in the block */
    int32_t si;                 /* its number in cell order */
    int32_t image[HS_MAX_DIM];  /* shift over the rows of B */
} hs_run;

/* The buffers; one block of candidates at a time. */
typedef struct hs_block {
    float   *y[HS_MAX_DIM];  /* owned; HS_BLOCK_CANDIDATES + padding each */
    int32_t *id;             /* owned; point numbers of the candidates */
    int32_t *place;          /* owned; 0, 1, 2, ... */
    int32_t *hits;           /* owned; what a scan lists */
    hs_run  *runs;           /* owned; runs[n_runs].at is the number of candidates */
    int32_t  n;              /* candidates */
    int32_t  n_runs;
} hs_block;

/* The points whose neighbourhood it is: [first, last) in cell order. */
typedef struct hs_group {
    int32_t first, last;
    double  centre[HS_MAX_DIM];
    float   q[HS_GROUP_POINTS][HS_MAX_DIM]; /* relative to the centre */
    float   extent;                          /* largest |q_k|; NaN if one is */
} hs_group;

hs_status hs_block_init(hs_account *account, int ndim, hs_block *block);
void      hs_block_free(hs_account *account, int ndim, hs_block *block);

/* Chooses the centre and converts the points of the group. */
void hs_group_set(const hs_bins *bins, int32_t first, int32_t last, hs_group *group);

/*
 * Appends points [si, end) of one image to the block, as many as there is room for; returns how
 * many. shift: the image's displacement, ndim doubles; image: the same in rows of B. A run of
 * candidates of the image 0 that starts at the group's first point must come first.
 */
int32_t hs_block_append(const hs_bins *bins, const hs_group *group, int32_t si, int32_t end,
                        const double *shift, const int32_t *image, hs_block *block);

/* Largest |y_k| of the block plus largest |q_k| of the group; NaN or infinite if one is. */
double hs_block_extent(const hs_group *group, const hs_block *block, int ndim);

HS_ALWAYS_INLINE bool
hs_block_is_full(const hs_block *block)
{
    return block->n == HS_BLOCK_CANDIDATES || block->n_runs == HS_BLOCK_RUNS;
}

#endif
