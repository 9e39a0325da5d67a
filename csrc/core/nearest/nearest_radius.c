/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_radius.c: how far to look: at first by the density of points, and where that was too
 * short or would be too far, by walking down the tree. */
#include "nearest.h"

#include <math.h>

/* Relative room, far more than roundings take. */
#define ROOM 0x1p-40
/* The density is that of at least so many times the points that are wanted. */
#define POINTS_PER_WANTED 4.0
/* Standard deviations of their number that a first radius makes room for. Measured: with 3 the time
 * differs by less than the noise. */
#define SPREAD 3.5

int
hs_nearest_exponent(double radius)
{
    return ilogb(hs_larger(radius, HS_NEAREST_LEAST_RADIUS));
}

void
hs_nearest_group_set(const hs_nearest *near, int32_t first, int32_t last, hs_nearest_group *group)
{
    const hs_bins    *bins = hs_search_asking(near->search);
    const hs_lattice *lattice = &near->search->scene.lattice;
    *group = (hs_nearest_group){.first = first, .last = last};
    for (int k = 0; k < bins->ndim; k++) {
        const double *x = bins->x[k];
        double        low = x[first], high = low;
        for (int32_t si = first + 1; si < last; si++) {
            low = hs_smaller(x[si], low);
            high = hs_larger(x[si], high);
        }
        group->lower[k] = group->t_lower[k] = low;
        group->upper[k] = group->t_upper[k] = high;
    }
    for (int k = 0; !lattice->aligned && k < bins->ndim; k++) {
        double low = INFINITY, high = -INFINITY;
        for (int32_t si = first; si < last; si++) {
            double x[HS_MAX_DIM];
            for (int c = 0; c < bins->ndim; c++) {
                x[c] = bins->x[c][si];
            }
            const double t = hs_lattice_coordinate(lattice, x, k);
            low = hs_smaller(t, low);
            high = hs_larger(t, high);
        }
        group->t_lower[k] = low;
        group->t_upper[k] = high;
    }
    for (int k = 0; near->has_layer && k < bins->ndim; k++) {
        if (lattice->row_of_axis[k] < 0) {
            const double apart = hs_larger(near->layer_lower[k] - group->t_upper[k],
                                           group->t_lower[k] - near->layer_upper[k]);
            group->away =
                hs_larger(apart * (1.0 - ROOM) - 4.0 * near->search->scene.t_error[k], group->away);
        }
    }
}

double
hs_nearest_farthest(const hs_nearest *near, const hs_nearest_group *group)
{
    const hs_scene *scene = &near->search->scene;
    const double    limit = near->limit * (1.0 + ROOM);
    const hs_tree  *tree = &near->tree;
    double          all = 32.0 * scene->x_error; /* two in each of up to eight components */
    if (scene->lattice.n_periodic > 0) {
        return limit;
    }
    for (int k = 0; k < scene->ndim; k++) { /* no component is longer than this */
        all += hs_larger(fabs(tree->upper[k] - group->lower[k]),
                         fabs(group->upper[k] - tree->lower[k]));
    }
    return hs_smaller(limit, all * (1.0 + ROOM));
}

/* Sides of a region, base 2 logarithms, and what it holds. */
typedef struct near_region {
    int    ndim;
    double side[HS_MAX_DIM];
    bool   repeats[HS_MAX_DIM]; /* the region goes on along this side */
    double n_points;
} near_region;

/* log2 of the volume of a ball of radius 1. */
static double
ball_volume(int ndim)
{
    static const double volume[HS_MAX_DIM + 1] = {1.0,    2.0,    3.1416, 4.1888, 4.9348,
                                                  5.2638, 5.1677, 4.7248, 4.0587};
    return log2(volume[ndim]);
}

/*
 * log2 of the radius of a ball with `wanted` points in it, if the region is filled evenly. Sides
 * that are shorter than the ball is wide do not count: points on a line or in a plane have the
 * density of their line or plane.
 */
static double
radius_of(const near_region *region, double wanted)
{
    const double width = ball_volume(region->ndim) / region->ndim; /* of the ball, as a cube */
    bool         counts[HS_MAX_DIM];
    double       longest = -INFINITY;
    for (int k = 0; k < region->ndim; k++) {
        counts[k] = region->side[k] > -INFINITY;
        longest = hs_larger(region->side[k], longest);
    }
    for (;;) {
        double sum = log2(wanted / region->n_points);
        int    n = 0;
        for (int k = 0; k < region->ndim; k++) {
            sum += counts[k] ? region->side[k] : 0.0;
            n += counts[k];
        }
        const double radius = n > 0 ? sum / n - width : longest - width;
        bool         changed = false;
        for (int k = 0; n > 0 && k < region->ndim; k++) {
            if (counts[k] && !region->repeats[k] && region->side[k] < radius + width) {
                counts[k] = false;
                changed = true;
            }
        }
        if (!changed) {
            return radius;
        }
    }
}

/* The node around the group with at least so many points, and its sides; *away: how far from it
 * the group is. */
static int32_t
find_node(const hs_tree *tree, const hs_nearest_group *group, double least, double *sides,
          double *away)
{
    const int d = tree->ndim;
    int32_t   number = 0;
    *away = 0.0;
    for (int k = 0; k < d; k++) {
        sides[k] = tree->upper[k] - tree->lower[k];
    }
    for (;;) {
        const int32_t left = tree->nodes[number].left;
        double        gap[2] = {0.0, 0.0};
        const double *bounds = left != 0 ? hs_tree_bounds(tree, left, d) : NULL;
        for (int k = 0; left != 0 && k < d; k++) {
            const double middle = group->lower[k] + 0.5 * (group->upper[k] - group->lower[k]);
            for (int side = 0; side < 2; side++) {
                const double below = bounds[4 * k + side] - middle;
                gap[side] += hs_larger(hs_larger(below, middle - bounds[4 * k + 2 + side]), 0.0);
            }
        }
        const int     side = gap[1] < gap[0];
        const int32_t next = left + side;
        if (left == 0 || tree->nodes[next].end - tree->nodes[next].first < least) {
            return number;
        }
        *away = gap[side];
        number = next;
        for (int k = 0; k < d; k++) {
            sides[k] = bounds[4 * k + 2 + side] - bounds[4 * k + side];
        }
    }
}

/* The whole box counts as the region when points are too few for a part of it. */
static void
take_box(const hs_lattice *lattice, near_region *region)
{
    const double side =
        (log2(lattice->volume_mantissa) + lattice->volume_exponent) / lattice->n_periodic;
    for (int k = 0; k < region->ndim; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            region->side[k] = side;
            region->repeats[k] = true;
        }
    }
}

/* A ball that sticks out of all points along open axes holds fewer. */
static double
widen_at_edges(const hs_nearest *near, const hs_nearest_group *group, double radius)
{
    const hs_tree *tree = &near->tree;
    double         part = 1.0;
    for (int k = 0; k < tree->ndim; k++) {
        const double middle = group->lower[k] + 0.5 * (group->upper[k] - group->lower[k]);
        const double below = hs_smaller(middle - tree->lower[k], radius);
        const double above = hs_smaller(tree->upper[k] - middle, radius);
        const bool   repeats = near->search->scene.lattice.aligned &&
                             near->search->scene.lattice.row_of_axis[k] >= 0;
        part *= repeats ? 1.0 : fmin(fmax((below + above) / (2.0 * radius), 0.5), 1.0);
    }
    return part < 1.0 ? radius * pow(part, -1.0 / tree->ndim) : radius;
}

void
hs_nearest_guess(const hs_nearest *near, hs_nearest_group *group)
{
    const hs_tree    *tree = &near->tree;
    const hs_lattice *lattice = &near->search->scene.lattice;
    const double      k = (double)near->k + near->omits_self;
    const double      wanted = k + SPREAD * sqrt(k) + 1.0;
    double            away, sides[HS_MAX_DIM];
    const int32_t     number =
        find_node(tree, group, POINTS_PER_WANTED * hs_larger(wanted, 16.0), sides, &away);
    const hs_tree_node *node = &tree->nodes[number];
    near_region region = {.ndim = tree->ndim, .n_points = (double)(node->end - node->first)};
    for (int axis = 0; axis < tree->ndim; axis++) {
        region.side[axis] = log2(sides[axis]);
    }
    if (lattice->n_periodic > 0 && number == 0) {
        take_box(lattice, &region);
    }
    const double farthest = hs_nearest_farthest(near, group);
    const double inside = exp2(radius_of(&region, wanted));
    group->radius = hs_larger(widen_at_edges(near, group, inside) + away, HS_NEAREST_LEAST_RADIUS);
    group->is_complete = group->radius >= farthest ||
                         (lattice->n_periodic == 0 && (double)tree->nodes[0].end <= k);
    if (group->is_complete) {
        group->radius = hs_larger(farthest, HS_NEAREST_LEAST_RADIUS);
    }
}

hs_status
hs_nearest_bounder_init(const hs_nearest *near, hs_nearest_bounder *bounder)
{
    *bounder = (hs_nearest_bounder){.depth = near->tree.depth + 2};
    return hs_shared_resize(near->shared, (void **)&bounder->stack, 0, bounder->depth,
                            sizeof *bounder->stack) &&
                   hs_shared_resize(near->shared, (void **)&bounder->gaps, 0, bounder->depth,
                                    sizeof *bounder->gaps)
               ? HS_OK
               : HS_ERR_MEMORY;
}

void
hs_nearest_bounder_free(const hs_nearest *near, hs_nearest_bounder *bounder)
{
    hs_shared_release(near->shared, (void **)&bounder->least);
    hs_shared_release(near->shared, (void **)&bounder->stack);
    hs_shared_release(near->shared, (void **)&bounder->gaps);
}
