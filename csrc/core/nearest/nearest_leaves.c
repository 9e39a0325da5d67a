/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_leaves.c: one walk for the box of all groups, in float32 units around its centre; then
 * the kernel lists each group's leaves. */
#include "nearest_leaves.h"

#include <math.h>

/* Beyond these each group walks down the tree by itself: it is far smaller than all together. */
#define MOST_LEAVES        2048
#define MOST_SHARED_IMAGES 64
/* Groups that look so many times as far as others do walk by themselves. */
#define FARTHEST 2.0
/* In units, where the radius is between 1 and 2: floats tell leaves apart. */
#define WIDEST 256.0
/* Relative room, far more than roundings of floats take. */
#define ROOM 0x1p-18
/* Error on each axis as a fraction of the extent: two roundings to floats and one of their
 * difference, twice. */
#define AXIS_ERROR 0x1p-21

hs_status
hs_nearest_leaves_init(const hs_nearest *near, hs_nearest_leaves *leaves)
{
    const int64_t room = MOST_LEAVES + HS_PADDING;
    hs_shared    *shared = near->shared;
    bool          done = true;
    *leaves = (hs_nearest_leaves){.n = 0};
    for (int k = 0; done && k < near->tree.ndim; k++) {
        done = hs_shared_resize(shared, (void **)&leaves->low[k], 0, room, sizeof(float)) &&
               hs_shared_resize(shared, (void **)&leaves->high[k], 0, room, sizeof(float));
    }
    done =
        done && hs_shared_resize(shared, (void **)&leaves->runs, 0, room, sizeof *leaves->runs) &&
        hs_shared_resize(shared, (void **)&leaves->label, 0, room, sizeof(int32_t)) &&
        hs_shared_resize(shared, (void **)&leaves->hits, 0, room, sizeof(int32_t)) &&
        hs_shared_resize(shared, (void **)&leaves->images, 0, MOST_SHARED_IMAGES,
                         sizeof *leaves->images) &&
        hs_shared_resize(shared, (void **)&leaves->stack, 0, near->tree.depth + 2, sizeof(int32_t));
    for (int32_t c = 0; done && c < room; c++) {
        leaves->label[c] = c;
    }
    return done ? HS_OK : HS_ERR_MEMORY;
}

void
hs_nearest_leaves_free(const hs_nearest *near, hs_nearest_leaves *leaves)
{
    hs_shared *shared = near->shared;
    for (int k = 0; k < HS_MAX_DIM; k++) {
        hs_shared_release(shared, (void **)&leaves->low[k]);
        hs_shared_release(shared, (void **)&leaves->high[k]);
    }
    hs_shared_release(shared, (void **)&leaves->runs);
    hs_shared_release(shared, (void **)&leaves->label);
    hs_shared_release(shared, (void **)&leaves->hits);
    hs_shared_release(shared, (void **)&leaves->images);
    hs_shared_release(shared, (void **)&leaves->stack);
}

/* One group around all that do not look much further than others. */
static hs_nearest_group
unite(const hs_nearest_group *groups, int32_t n, int ndim)
{
    double least = INFINITY;
    for (int32_t g = 0; g < n; g++) {
        least = hs_smaller(groups[g].radius, least);
    }
    hs_nearest_group all = {.first = INT32_MAX, .away = INFINITY};
    for (int32_t g = 0; g < n; g++) {
        const hs_nearest_group *one = &groups[g];
        if (one->radius > FARTHEST * least) {
            continue;
        }
        const bool is_first = all.first == INT32_MAX;
        for (int k = 0; k < ndim; k++) {
            all.lower[k] = is_first ? one->lower[k] : hs_smaller(one->lower[k], all.lower[k]);
            all.upper[k] = is_first ? one->upper[k] : hs_larger(one->upper[k], all.upper[k]);
            all.t_lower[k] = is_first ? one->t_lower[k]
                                      : hs_smaller(one->t_lower[k], all.t_lower[k]);
            all.t_upper[k] = is_first ? one->t_upper[k]
                                      : hs_larger(one->t_upper[k], all.t_upper[k]);
        }
        all.first = is_first ? one->first : all.first;
        all.last = one->last;
        all.away = hs_smaller(one->away, all.away);
        all.radius = hs_larger(one->radius, all.radius);
    }
    return all;
}

/* A coordinate in units, relative to the centre of all groups. */
HS_ALWAYS_INLINE float
relative(const hs_nearest_leaves *leaves, int k, double x)
{
    return hs_nearest_relative(x, leaves->centre[k], leaves->unit, leaves->extent);
}

static void
add_leaf(const hs_nearest *near, int32_t number, hs_nearest_leaves *leaves)
{
    const hs_tree_node *node = &near->tree.nodes[number];
    const int           d = near->tree.ndim, side = (number - 1) % 2;
    const double       *bounds = hs_tree_bounds(&near->tree, number - side, d);
    const int32_t       image = leaves->n_images - 1;
    const double       *moved = leaves->images[image].moved;
    for (int k = 0; k < d; k++) {
        leaves->low[k][leaves->n] = relative(leaves, k, bounds[4 * k + side] + moved[k]);
        leaves->high[k][leaves->n] = relative(leaves, k, bounds[4 * k + 2 + side] + moved[k]);
    }
    leaves->runs[leaves->n++] =
        (hs_nearest_run){0, hs_nearest_of_leaf(near, node), node->first, image};
}

/* Adds the leaves of the last image whose squared distance is within `limit`; false when there are
 * too many. */
HS_ALWAYS_INLINE bool
find_in_image(const hs_nearest *near, const hs_nearest_group *all, double limit,
              hs_nearest_leaves *leaves, const int ndim)
{
    const hs_tree *tree = &near->tree;
    const double  *moved = leaves->images[leaves->n_images - 1].moved;
    double         low[HS_MAX_DIM] = {0.0}, high[HS_MAX_DIM] = {0.0};
    int64_t        n_waiting = 0;
    int32_t        number = 0;
    for (int k = 0; k < ndim; k++) {
        low[k] = all->lower[k] - moved[k];
        high[k] = all->upper[k] - moved[k];
    }
    if (hs_tree_gap(tree, low, high, leaves->unit) > limit) {
        return true;
    }
    for (;;) {
        const int32_t left = tree->nodes[number].left;
        double        gap[2] = {INFINITY, INFINITY};
        if (left != 0) {
            hs_tree_gaps(hs_tree_bounds(tree, left, ndim), low, high, leaves->unit, ndim, gap);
        } else if (leaves->n == MOST_LEAVES) {
            return false;
        } else {
            add_leaf(near, number, leaves);
        }
        if (!hs_tree_step(left, gap, limit, leaves->stack, &n_waiting, &number)) {
            return true;
        }
    }
}

/* Finds the leaves of all images within reach; false when there are too many. */
static bool
find_leaves(const hs_nearest *near, const hs_nearest_group *all, hs_nearest_images *images,
            hs_nearest_leaves *leaves)
{
    const int    d = near->tree.ndim;
    const double reach =
        all->radius * leaves->unit * (1.0 + ROOM) + 4.0 * sqrt(d) * images->error * leaves->unit;
    const double limit = reach * reach;
    bool         fit = true;
    leaves->n = leaves->n_images = 0;
    while (fit && hs_nearest_images_next(images)) {
        const int32_t     n = leaves->n;
        hs_nearest_image *image = &leaves->images[leaves->n_images++];
        hs_nearest_image_set(near, images, image);
        switch (d) {
        case 2: fit = find_in_image(near, all, limit, leaves, 2); break;
        case 3: fit = find_in_image(near, all, limit, leaves, 3); break;
        default: fit = find_in_image(near, all, limit, leaves, d);
        }
        leaves->n_images -= leaves->n == n; /* nothing there */
    }
    return fit;
}

void
hs_nearest_leaves_find(const hs_nearest *near, const hs_nearest_group *groups, int32_t n,
                       hs_nearest_leaves *leaves)
{
    hs_nearest_images images;
    const int         d = near->tree.ndim;
    double            widest = 0.0;
    leaves->radius = 0.0;
    if (n < 2 || near->tree.n_nodes < 2) {
        return;
    }
    const hs_nearest_group all = unite(groups, n, d);
    leaves->unit = hs_power_of_two(-hs_nearest_exponent(all.radius));
    for (int k = 0; k < d; k++) {
        const double width = all.upper[k] - all.lower[k];
        leaves->centre[k] = all.lower[k] + 0.5 * width;
        widest = hs_larger(width * leaves->unit, widest);
    }
    leaves->extent = 0.5 * widest + 4.0;
    if (!(widest < WIDEST) || hs_nearest_images_start(near, &all, &images) != HS_OK ||
        images.count > MOST_SHARED_IMAGES || images.error * leaves->unit > ROOM) {
        return;
    }
    leaves->error = images.error;
    if (find_leaves(near, &all, &images, leaves)) {
        leaves->radius = all.radius;
    }
}

int32_t
hs_nearest_leaves_list(const hs_nearest *near, const hs_nearest_group *group, double radius,
                       hs_nearest_leaves *leaves)
{
    const int    d = near->tree.ndim;
    const double reach =
        radius * leaves->unit * (1.0 + ROOM) +
        sqrt(d) * (4.0 * leaves->error * leaves->unit + AXIS_ERROR * leaves->extent);
    hs_boxes boxes = {.ndim = d,
                      .n = leaves->n,
                      .label = leaves->label,
                      .hits = leaves->hits,
                      .out = (float)(reach * reach * (1.0 + ROOM))};
    for (int k = 0; k < d; k++) {
        boxes.low[k] = leaves->low[k];
        boxes.high[k] = leaves->high[k];
        boxes.from[k] = relative(leaves, k, group->lower[k]);
        boxes.to[k] = relative(leaves, k, group->upper[k]);
    }
    return near->search->call->kernel->near_boxes(&boxes);
}
