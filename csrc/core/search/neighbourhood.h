/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * neighbourhood.h: the neighbourhood of one group of points, copied once into contiguous float32
 * arrays relative to a common centre, with the shift of its periodic image already added. All
 * points of the group are then tested against it in long, predictable loops: no ghosts, no minimum
 * image per pair.
 */
#ifndef HS_NEIGHBOURHOOD_H
#define HS_NEIGHBOURHOOD_H

#include "../cells/bins.h"

#include "../../kernels/kernel.h"

#define HS_BLOCK_RUNS 1024 /* runs held at a time, at most */

/* Hits held at a time, as a multiple of the candidates: those of a few points at least. Blocks of
 * fewer candidates than a burst have room for one hit each and a burst. */
#define HS_HITS_PER_CANDIDATE 2
/*
 * Hits after which a scan stops, so that they can be written out. Measured: the stores of a short
 * burst drain to memory while the next one is scanned; with bursts of thousands the two take turns,
 * which costs up to 0.9 ns a pair. Shorter ones cost more beside.
 */
#define HS_BURST 256

/* One block of candidates at a time, and what scans say about it. The arrays have capacity +
 * HS_PADDING entries where nothing else is said. */
typedef struct hs_block {
    void      *memory; /* owned: of all arrays but radius and origin, which have their own */
    float     *y[HS_MAX_DIM];
    float     *norm;    /* sum of y_k^2 */
    int32_t   *id;      /* point numbers of the candidates */
    int32_t   *number;  /* their numbers in cell order, as they were gathered */
    int32_t   *place;   /* 0, 1, 2, ..., set as far as needed; NULL unless hits are places */
    int32_t   *origin;  /* where candidates were before neighbourhood_sort.h put them in order; NULL
                        * when it did not */
    int32_t   *hits;    /* most_hits + HS_PADDING; NULL when only counting */
    float     *squares; /* of the hits, as many; NULL without HS_BLOCK_LISTS_SQUARES */
    float     *radius;  /* rows of the candidates' radii, owned; NULL until hs_block_add_radii */
    int64_t    pitch;   /* from one row to the next */
    hs_unsure *unsure;  /* capacity */
    hs_run    *runs;    /* most_runs + 1; runs[n_runs].at is the number of candidates */
    int32_t    capacity, most_hits, most_runs;
    int32_t    n_runs;
    int32_t    n;        /* candidates, of all runs */
    int32_t    n_places; /* entries of `place` that are set */
} hs_block;

/* What a block has room for. */
typedef enum hs_block_use {
    HS_BLOCK_SIZES, /* nothing: candidates are appended, and not looked at */
    HS_BLOCK_COUNTS,
    HS_BLOCK_LISTS_IDS,
    HS_BLOCK_LISTS_PLACES,
    HS_BLOCK_LISTS_SQUARES /* places, all that may be hits, and their float32 squares */
} hs_block_use;

/* The points whose neighbourhood it is: [first, last) in cell order. */
typedef struct hs_group {
    int32_t        first, last;
    double         centre[HS_MAX_DIM];
    float          q[HS_MAX_DIM][HS_GROUP_POINTS]; /* relative to the centre */
    hs_nearest_box near; /* its own box, and how near candidates must be; infinity: not set yet */
    uint32_t       largest; /* bits of the largest |q| or |y| gathered for it so far */
} hs_group;

/* Room for so many candidates and runs at a time. */
hs_status hs_block_init(hs_account *account, int ndim, hs_block_use use, int32_t capacity,
                        int32_t most_runs, hs_block *block);

/* Room for so many rows of radii of the candidates besides. On failure the block may be freed. */
hs_status hs_block_add_radii(hs_account *account, int32_t n_rows, hs_block *block);
void      hs_block_free(hs_account *account, hs_block *block);

/* most_hits of a block of this capacity. */
int32_t hs_block_most_hits(int32_t capacity);

#define HS_EXTENT_SHIFT 18 /* bits of the mantissa that extents do without */

/* Runs appended or gathered between two polls. Where there are so many each has few candidates. */
#define HS_RUNS_PER_POLL (1 << 16)

/* Chooses the centre. */
void hs_group_start(const hs_bins *bins, int32_t first, int32_t last, hs_group *group);

/* Its points, copied from where they are: for groups whose neighbourhood does not begin with them,
 * after hs_group_start. Rounded as candidates are. */
void hs_group_load(const hs_bins *bins, hs_group *group);

/* Its box, from its points, which it loads; returns the largest |q_k|. */
float hs_group_bound(const hs_bins *bins, hs_group *group);

/*
 * Appends points [si, end) of one image to the block, as many as there is room for; returns how
 * many. shift: the image's displacement, ndim doubles; image: that displacement over the rows of B.
 */
int32_t hs_block_append(hs_block *block, int32_t si, int32_t end, int ndim, const double *shift,
                        const int32_t *image, const hs_group *group);

/*
 * Copies what was appended, but for candidates that are not near the group. The first block of a
 * group must begin with the group's own points, in the image 0: they are kept as its q. Fails when
 * poll() stops the search; it is called now and then for a large block.
 */
hs_status hs_block_gather(const hs_bins *bins, const hs_kernel *kernel, const hs_options *options,
                          bool is_first, hs_block *block, hs_group *group);

/* The bits of a float >= 0, rounded up to the top five bits of the mantissa, which adds 1/32 at
 * most: so that few different thresholds are needed. NaN and infinity remain. */
HS_ALWAYS_INLINE uint32_t
hs_extent_bits(uint32_t bits)
{
    const uint32_t low = (UINT32_C(1) << HS_EXTENT_SHIFT) - 1;
    return bits < UINT32_C(0x7f800000) ? (bits + low) & ~low : bits;
}

HS_ALWAYS_INLINE bool
hs_block_is_full(const hs_block *block)
{
    return block->n == block->capacity || block->n_runs == block->most_runs;
}

#endif
