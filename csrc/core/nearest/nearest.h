/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_NEAREST_NEAREST_H
#define HS_NEAREST_NEAREST_H

#include "../collect/columns.h"
#include "../search/search.h"
#include "../memory/memory.h"
#include "tree.h"

/*
 * nearest.h: what a search for the nearest points knows, and the parts that its steps are made of:
 * images that can be near, a first radius, a radius that surely suffices.
 */

typedef struct hs_nearest {
    hs_search     *search;      /* borrowed: scene, bins, call */
    hs_tree        tree;        /* of the points; owned unless the search is borrowed */
    hs_tree        asking_tree; /* owned; of the queries, if there are any */
    const hs_tree *asking;      /* the tree of the asking points */
    int64_t        k;           /* points wanted for each */
    int32_t        of_spot;     /* of one spot, in one image, no more points than this can be of
                                 * use */
    bool           omits_self;  /* without queries: a point is not its own neighbour */
    double         limit;       /* largest distance in the scene's unit; infinity: none */
    hs_metric      within;      /* decides on the largest distance, if there is one */
    double         least;       /* and the least one that counts; 0: none */
    hs_metric      nearer;      /* decides on that */
    hs_metric      order;       /* decides which is nearer */
    double         drift[HS_MAX_DIM][HS_MAX_DIM]; /* [k][r]: how far row r of B moves t_k beyond
                                                   * whole periods */
    double         smallest_period;               /* infinity without one */
    bool           has_layer; /* some axes repeat, others, upright on them, are open: */
    double         layer_lower[HS_MAX_DIM], layer_upper[HS_MAX_DIM]; /* t_k of points along these */
    hs_output     *rows;                                             /* borrowed */
    hs_shared     *shared; /* owned; for what threads need more of */
} hs_nearest;

/* Asking points, or one of them, and how far they look. Lengths are the scene's. */
typedef struct hs_nearest_group {
    int32_t first, last;       /* in the order of their tree */
    double  lower[HS_MAX_DIM]; /* range of X */
    double  upper[HS_MAX_DIM];
    double  t_lower[HS_MAX_DIM]; /* range of t_k along periodic axes */
    double  t_upper[HS_MAX_DIM];
    double  away;        /* no point is nearer than this, for the open axes alone */
    double  radius;      /* everything up to here is looked at */
    double  more;        /* points there that do not count, by a first guess */
    bool    is_complete; /* and beyond there is nothing that could be wanted */
} hs_nearest_group;

/* Images of all points, within `reach` of a group along each periodic axis. */
typedef struct hs_nearest_images {
    const hs_nearest *near;
    int64_t           low[HS_MAX_DIM], high[HS_MAX_DIM]; /* shifts over each row of B */
    int32_t           shift[HS_MAX_DIM];                 /* the present one */
    double            moved[HS_MAX_DIM];                 /* and what it adds to X */
    double error; /* on each component of (X_j + moved) - X_i, but for the last rounding */
    double count; /* of images */
    bool   is_first;
} hs_nearest_images;

/* Number x in units, from the centre, and no further than the extent, which nothing in reach is. */
HS_ALWAYS_INLINE float
hs_nearest_relative(double x, double centre, double unit, double extent)
{
    const double y = (x - centre) * unit;
    return (float)hs_larger(hs_smaller(y, extent), -extent);
}

/* How many points of a leaf can be of use in one image. */
HS_ALWAYS_INLINE int32_t
hs_nearest_of_leaf(const hs_nearest *near, const hs_tree_node *node)
{
    const int32_t n = node->end - node->first;
    return node->is_spot && n > near->of_spot ? near->of_spot : n;
}

/* Measures `drift`, of the rows of B. */
void hs_nearest_measure_drift(hs_nearest *near);

/* Range of t_k of points [first, last), which are in order; none: from infinity to -infinity. */
void hs_nearest_range(const hs_lattice *lattice, const hs_bins *bins, int k, int64_t first,
                      int64_t last, double *lower, double *upper);

/* Measures the range of points along open axes, once they are in tree order. */
void hs_nearest_measure_layer(hs_nearest *near);

/* HS_ERR_MEMORY when there are more images than memory could hold points. */
hs_status hs_nearest_images_start(const hs_nearest *near, const hs_nearest_group *group,
                                  hs_nearest_images *images);

/* The next image, as shift and moved; false when there is none. */
bool hs_nearest_images_next(hs_nearest_images *images);

/* Sets the group to these points and the range of their X; must come first. */
void hs_nearest_group_set(const hs_nearest *near, int32_t first, int32_t last,
                          hs_nearest_group *group);

/* Sets the radius: one within which about as many points are expected as are wanted, and a few
 * more; in any case not more than can be of use. */
void hs_nearest_guess(const hs_nearest *near, hs_nearest_group *group);

/* How many times as large as for one of its points what the group looks at is, about. */
double hs_nearest_balls(const hs_nearest_group *group, int ndim);

/* The present image, as a group keeps it. */
void hs_nearest_image_set(const hs_nearest *near, const hs_nearest_images *images,
                          hs_nearest_image *image);

/* Owned by a thread: the least squares found so far, and what is left to look at. */
typedef struct hs_nearest_bounder {
    double  *least; /* a heap, the largest first */
    int64_t  n, capacity;
    int32_t *stack;
    double  *gaps;  /* of the nodes on the stack */
    int64_t  depth; /* room there */
    int64_t  work;  /* since the last poll */
} hs_nearest_bounder;

hs_status hs_nearest_bounder_init(const hs_nearest *near, hs_nearest_bounder *bounder);
void      hs_nearest_bounder_free(const hs_nearest *near, hs_nearest_bounder *bounder);

/* Sets the radius of a group of one point so that it surely suffices, and hardly more, from a first
 * guess in it. HS_ERR_MEMORY, HS_ERR_INTERRUPTED. */
hs_status hs_nearest_bound(const hs_nearest *near, const hs_options *options,
                           hs_nearest_bounder *bounder, hs_nearest_group *group);

/* Smallest radius of a group, in the scene's unit: shorter distances get no finer unit. */
#define HS_NEAREST_LEAST_RADIUS 0x1p-1000

/* Exponent of the radius: 2^-exponent is the unit in which it is between 1 and 2. */
int hs_nearest_exponent(double radius);

/*
 * A scene and trees, made anew or borrowed from cells that keep them: everything of `near` but k,
 * of_spot, omits_self and rows, which are set already, as is its search but for scene, bins, kernel
 * and threads. sets->trees: NULL, or what keeps a tree of the points. `limit`: the largest
 * distance. Which points count is the call's choice, if it has one. hs_nearest_release in any
 * case.
 */
hs_status hs_nearest_prepare(hs_nearest *near, const hs_sets *sets, const hs_box *box, double limit,
                             hs_failure *failure);
void      hs_nearest_release(hs_nearest *near);

/* Writes all rows, by all threads of the team. HS_ERR_MEMORY, HS_ERR_INTERRUPTED;
 * HS_ERR_SHIFT_RANGE sets failure->row. */
hs_status hs_nearest_search(hs_nearest *near, hs_failure *failure);

/*
 * A tree that is kept with cells. The first search for the nearest points there
 * builds it; others borrow it, any number of them at once. No call waits: one that comes while it
 * is being built makes a tree for itself alone.
 */

typedef struct hs_nearest_kept hs_nearest_kept;

/* One without a tree as yet. NULL when memory is short. */
hs_nearest_kept *hs_nearest_kept_new(void);
void             hs_nearest_kept_free(hs_nearest_kept *kept); /* NULL-safe */

/*
 * What has been built, or NULL. *room is then NULL too, or where the caller is to build it: a
 * hs_nearest of zeros but for its search, which is not begun. hs_nearest_kept_end says how that
 * went.
 */
const hs_nearest *hs_nearest_kept_get(hs_nearest_kept *kept, hs_nearest **room);

/* After a failure the room must hold nothing again. */
void hs_nearest_kept_end(hs_nearest_kept *kept, bool done);

#endif
