/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_NEAREST_CANDIDATES_H
#define HS_NEAREST_CANDIDATES_H

#include "nearest.h"

/*
 * candidates.h: the points that a group of asking points may need: a first radius, the images of
 * the points within it, leaves of the tree in these, and their block of floats.
 */

/* Asking points, or one of them, and how far they look. Lengths are the scene's. */
typedef struct hs_nearest_group {
    int32_t first, last;       /* in the order of their tree */
    double  lower[HS_MAX_DIM]; /* range of X */
    double  upper[HS_MAX_DIM];
    double  t_lower[HS_MAX_DIM]; /* range of t_k along periodic axes */
    double  t_upper[HS_MAX_DIM];
    double  away;        /* no point is nearer than this, for the open axes alone */
    double  radius;      /* everything up to here is looked at */
    double  more;        /* points there that are too near to count, about */
    bool    is_complete; /* and beyond there is nothing that could be wanted */
} hs_nearest_group;

/* Smallest radius of a group, in the scene's unit: shorter distances get no finer unit. */
#define HS_NEAREST_LEAST_RADIUS 0x1p-1000

/* Sets the group to these points and the range of their X; must come first. */
void hs_nearest_group_set(const hs_nearest *near, int32_t first, int32_t last,
                          hs_nearest_group *group);

/* Sets the radius, so many times one within which about as many points are expected as are wanted,
 * and a few more; in any case not more than can be of use. */
void hs_nearest_guess(const hs_nearest *near, double scale, hs_nearest_group *group);

/* A distance beyond which nothing is of use: that of all points, or the largest distance. In
 * periodic boxes infinity, unless there is a largest distance. */
double hs_nearest_farthest(const hs_nearest *near, const hs_nearest_group *group);

/* Whether its points lie so far apart, by how far they look, that they are no group. */
bool hs_nearest_is_scattered(const hs_nearest *near, const hs_nearest_group *group);

/* Measures the drift of the rows of B and, of points that are in tree order, their range along open
 * axes. */
void hs_nearest_measure(hs_nearest *near);

/* Images of all points, within `reach` of a group along each periodic axis. */
typedef struct hs_nearest_images {
    const hs_lattice *lattice;
    int64_t           low[HS_MAX_DIM], high[HS_MAX_DIM]; /* shifts over each row of B */
    hs_nearest_image  next;                              /* the present one */
    double            error; /* on each component of (X_j + moved) - X_i, but for the last
                              * rounding */
    double            count; /* of images */
    int64_t           n_met; /* of them, the present one as well */
} hs_nearest_images;

/* Those that are near a group; of NULL, the points where they are. HS_TRY_OTHER when there are more
 * than a search could look at. */
hs_status hs_nearest_images_start(const hs_nearest *near, const hs_nearest_group *group,
                                  hs_nearest_images *images);

/* The next image, as images->next; false when there is none. */
bool hs_nearest_images_next(hs_nearest_images *images);

/* In which unit squares of distances are computed, and how far they may be from the true ones. */
typedef struct hs_nearest_frame {
    double unit;       /* lengths times this; a power of two */
    double error;      /* of each component of X, moved, times it */
    double reach;      /* no distance is longer, times it */
    double flat_error; /* of any |D|^2 from X, beside its relative rounding */
} hs_nearest_frame;

void hs_nearest_frame_set(int ndim, double unit, double error, double reach,
                          hs_nearest_frame *frame);

/* How far |D|^2 in units, as it comes from float64, may be from the true one, for any that is not
 * beyond the reach. */
HS_ALWAYS_INLINE double
hs_nearest_error(const hs_nearest_frame *frame, int ndim, double square)
{
    /* Per axis: two roundings of the difference, one of the square, one of the sum; twice that. */
    return (ndim + 4) * 0x1p-51 * square + frame->flat_error;
}

/* The leaves that a group may need, found by one walk down the tree. Groups that are parts of it
 * and look no further have only a list of boxes to go through. Owned by a thread, zeros at
 * first. */
typedef struct hs_nearest_leaves {
    void             *memory; /* owned: of all arrays */
    int32_t           n;
    int64_t           n_points;
    float            *low[HS_MAX_DIM]; /* ranges of X, moved, less the centre, in units; clamped */
    float            *high[HS_MAX_DIM];
    hs_nearest_run   *runs;   /* their points; places are of no meaning */
    hs_nearest_run   *joined; /* room for those of a group */
    int32_t          *label;  /* 0, 1, 2, ... */
    int32_t          *hits;
    hs_nearest_image *images;
    int32_t           n_images;
    int32_t          *stack;
    double            centre[HS_MAX_DIM];
    double            unit;   /* a power of two: lengths times this */
    double            extent; /* largest number of any range */
    double            error;  /* on each component of a shifted coordinate */
    double            radius; /* for groups up to this one; 0: for none */
} hs_nearest_leaves;

/* Finds the leaves of a group, unless they hold more than `most` points. Sets leaves->radius to 0
 * where there are none to be used. HS_ERR_MEMORY. */
hs_status hs_nearest_leaves_find(const hs_nearest *near, const hs_nearest_group *group, double most,
                                 hs_nearest_leaves *leaves);

/* What a group may be near to, gathered from all images as float32 relative to the group. Owned by
 * a thread, zeros at first; arrays grow as needed. Places count candidates. */
typedef struct hs_nearest_block {
    void                   *memory; /* owned: of all arrays but runs and images */
    int32_t                 n, capacity;
    float                  *y[HS_MAX_DIM]; /* X, moved, less the centre, in units; clamped */
    int32_t                *number;        /* in tree order */
    int32_t                *image_of;      /* which of the images */
    int32_t                *place;         /* 0, 1, 2, ... */
    int32_t                *hits;
    float                  *squares; /* of the hits, in float32; where has_squares */
    hs_unsure              *unsure;
    hs_nearest_run         *runs; /* borrowed from the leaves, as are images */
    int32_t                 n_runs;
    const hs_nearest_image *images;
    float                   q[HS_MAX_DIM][HS_GROUP_POINTS];
    hs_nearest_frame        frame;        /* the radius is the reach, between 1 and 2 */
    double                  extent;       /* largest |y| and |q| */
    bool                    has_squares;  /* for points with few hits, which float32 may put in
                                           * order */
    double                  square_error; /* of these, up to the radius */
} hs_nearest_block;

/* Fills the block for a group from leaves that were found for it. HS_TRY_OTHER: leaves do not serve
 * it, or there are more than `most` candidates. */
hs_status hs_nearest_block_fill(const hs_nearest *near, const hs_options *options,
                                const hs_nearest_group *group, double most,
                                const hs_nearest_leaves *leaves, hs_nearest_block *block);

/* Hits of the group's points from point `first` on: !(far away), places in block->hits. Returns the
 * point to go on with; end[t]: where those of point t end. */
int32_t hs_nearest_block_scan(const hs_nearest *near, const hs_nearest_group *group,
                              hs_nearest_block *block, int32_t first, int32_t *end);

#endif
