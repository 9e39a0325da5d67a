/* SPDX-License-Identifier: BSD-3-Clause */
#include "candidates.h"
#include "../base/status.h"
#include "../base/os.h"
#include "../exact/bounds.h"

#include <math.h>
#include <string.h>

/* candidates.c: images that can be near a group, leaves of the tree in these, and the block of
 * floats that they fill. */

/* Which images of the points can be near a group, by the range of its t_k along
 * each periodic axis. */

#define UNIT 0x1p-53
/* In periods: far more than the rounding of a quotient of ordinary size, ... */
#define SLACK 0x1p-20
/* ... and of the quotient itself where it is large. */
#define RELATIVE_SLACK 0x1p-40
/* Products of unit vectors at right angles, and the room that this takes beside squares. */
#define UPRIGHT     0x1p-40
#define LAYER_ROOM  0x1p-36
#define MOST_SHIFTS 0x1p30 /* they are int32, with room for sums of two */
/* More images than these take minutes: they are refused, unless k is so large that all neighbours
 * may be images of one point. A box around a ball in 8 dimensions is 63 times as large. */
#define MOST_IMAGES        0x1p24
#define IMAGES_A_NEIGHBOUR 1024.0

void
hs_nearest_measure_drift(hs_nearest *near)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    const int         d = lattice->ndim;
    near->smallest_period = INFINITY;
    for (int k = 0; k < d; k++) {
        if (lattice->row_of_axis[k] >= 0) {
            near->smallest_period = hs_smaller(lattice->period[k], near->smallest_period);
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            double along = 0.0, largest = 0.0;
            for (int c = 0; !lattice->aligned && c < d; c++) {
                along += lattice->normal[k][c] * lattice->rows[r][c];
                largest = hs_larger(fabs(lattice->rows[r][c]), largest);
            }
            if (!lattice->aligned && lattice->row_of_axis[k] == r) {
                along -= lattice->period[k];
            }
            near->drift[k][r] = lattice->aligned ? 0.0
                                                 : fabs(along) + (d + 2) * d * UNIT * largest +
                                                       d * lattice->row_error[r];
        }
    }
}

/* Whether unit normals of axes that repeat are at right angles to those of open ones, as nearly as
 * rounding lets them. */
static bool
is_upright(const hs_lattice *lattice)
{
    for (int k = 0; k < lattice->ndim; k++) {
        for (int open = 0; !lattice->aligned && open < lattice->ndim; open++) {
            double product = 0.0;
            for (int c = 0; c < lattice->ndim; c++) {
                product += lattice->normal[k][c] * lattice->normal[open][c];
            }
            if (lattice->row_of_axis[k] >= 0 && lattice->row_of_axis[open] < 0 &&
                fabs(product) > UPRIGHT) {
                return false;
            }
        }
    }
    return lattice->n_periodic > 0 && lattice->n_periodic < lattice->ndim;
}

void
hs_nearest_measure_layer(hs_nearest *near)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    const hs_bins    *bins = &near->search->bins;
    near->has_layer = bins->n > 0 && is_upright(lattice);
    for (int k = 0; near->has_layer && k < lattice->ndim; k++) {
        const int64_t n = lattice->row_of_axis[k] < 0 ? bins->n : 0;
        hs_nearest_range(lattice, bins, k, 0, n, &near->layer_lower[k], &near->layer_upper[k]);
    }
}

/* How far the group looks along axes that repeat: what the distance to the layer leaves of the
 * radius. */
static double
reach_along(const hs_nearest_group *group)
{
    const double ratio = hs_smaller(group->away / group->radius, 1.0); /* squares overflow */
    return group->radius * (sqrt((1.0 - ratio) * (1.0 + ratio) + LAYER_ROOM) + UPRIGHT);
}

/* Shifts along the row of B of axis k, at most most[r] of them; false when too many. */
static bool
set_range(const hs_nearest *near, const hs_nearest_group *group, int k, const double *most,
          hs_nearest_images *images)
{
    const hs_scene   *scene = &near->search->scene;
    const hs_lattice *lattice = &scene->lattice;
    const double      period = lattice->period[k];
    double            reach = reach_along(group) * (1.0 + RELATIVE_SLACK) + 2.0 * scene->t_error[k];
    for (int r = 0; r < lattice->n_periodic; r++) {
        reach += (most[r] + 1.0) * near->drift[k][r];
    }
    const double low = (group->t_lower[k] - scene->upper[k] - reach) / period;
    const double high = (group->t_upper[k] - scene->lower[k] + reach) / period;
    const double first = ceil(low - SLACK - RELATIVE_SLACK * fabs(low));
    const double last = floor(high + SLACK + RELATIVE_SLACK * fabs(high));
    if (!(fabs(first) < MOST_SHIFTS && fabs(last) < MOST_SHIFTS)) {
        return false;
    }
    const int row = lattice->row_of_axis[k];
    images->low[row] = (int64_t)first;
    images->high[row] = (int64_t)last;
    return true;
}

/* Bound on the error of X_j + moved, by the rule of docs/exactness.md for gathered candidates. */
static double
bound_error(const hs_scene *scene, const double *most)
{
    const hs_lattice *lattice = &scene->lattice;
    double            error = 0.0;
    for (int c = 0; c < scene->ndim; c++) {
        double moved = 0.0, row_errors = 0.0;
        for (int r = 0; r < lattice->n_periodic; r++) {
            moved += most[r] * fabs(lattice->rows[r][c]);
            row_errors += most[r] * lattice->row_error[r];
        }
        if (moved > 0.0) {
            const double roundings = 2 * lattice->n_periodic + 4;
            error = hs_larger(roundings * UNIT * (moved + 2.0 * scene->x_largest[c]) + row_errors,
                              error);
        }
    }
    return error + 2.0 * scene->x_error;
}

hs_status
hs_nearest_images_start(const hs_nearest *near, const hs_nearest_group *group,
                        hs_nearest_images *images)
{
    const hs_lattice *lattice = &near->search->scene.lattice;
    double            most[HS_MAX_DIM] = {0.0};
    *images = (hs_nearest_images){.near = near, .count = 1.0, .is_first = true};
    /* The drift depends on the largest shifts, and these a little on the drift. */
    for (int pass = 0; pass < 3; pass++) {
        for (int k = 0; k < lattice->ndim; k++) {
            if (lattice->row_of_axis[k] >= 0 && !set_range(near, group, k, most, images)) {
                return HS_ERR_MEMORY;
            }
        }
        for (int r = 0; r < lattice->n_periodic; r++) {
            most[r] = hs_larger(fabs((double)images->low[r]), fabs((double)images->high[r]));
        }
        pass += lattice->aligned ? 2 : 0;
    }
    for (int r = 0; r < lattice->n_periodic; r++) {
        images->shift[r] = (int32_t)images->low[r];
        images->count *= hs_larger((double)(images->high[r] - images->low[r] + 1), 0.0);
    }
    images->error = bound_error(&near->search->scene, most);
    return images->count < fmax(MOST_IMAGES, IMAGES_A_NEIGHBOUR * (double)near->k) ? HS_OK
                                                                                   : HS_ERR_MEMORY;
}

bool
hs_nearest_images_next(hs_nearest_images *images)
{
    const hs_lattice *lattice = &images->near->search->scene.lattice;
    const int         m = lattice->n_periodic;
    if (images->is_first) {
        images->is_first = false;
        if (images->count == 0.0) {
            return false;
        }
    } else {
        int r = 0;
        while (r < m && images->shift[r] == images->high[r]) {
            images->shift[r] = (int32_t)images->low[r];
            r++;
        }
        if (r == m) {
            return false;
        }
        images->shift[r]++;
    }
    for (int c = 0; c < lattice->ndim; c++) {
        double moved = 0.0;
        for (int r = 0; r < m; r++) {
            moved += images->shift[r] * lattice->rows[r][c];
        }
        images->moved[c] = moved;
    }
    return true;
}

void
hs_nearest_image_set(const hs_nearest *near, const hs_nearest_images *images,
                     hs_nearest_image *image)
{
    memcpy(image->shift, images->shift, sizeof image->shift);
    memcpy(image->moved, images->moved, sizeof image->moved);
    image->is_home = true;
    for (int r = 0; r < near->search->bins.n_periodic; r++) {
        image->is_home = image->is_home && images->shift[r] == 0;
    }
}

/* One walk for the box of all groups, in float32 units around its centre; then
 * the kernel lists each group's leaves. */

/* Beyond these each group walks down the tree by itself: it is far smaller than all together. */
#define MOST_LEAVES        2048
#define MOST_SHARED_IMAGES 64
/* Groups that look so many times as far as others do walk by themselves. */
#define FARTHEST 2.0
/* So do all, where the box around them is so many times as large as they are themselves. */
#define MOSTLY_EMPTY 4.0
/* In units, where the radius is between 1 and 2: floats tell leaves apart. */
#define WIDEST_LEAF 256.0
/* Relative room, far more than roundings of floats take. */
#define LEAF_ROOM 0x1p-18
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

double
hs_nearest_balls(const hs_nearest_group *group, int ndim)
{
    double balls = 1.0;
    for (int k = 0; k < ndim; k++) {
        balls *= 1.0 + (group->upper[k] - group->lower[k]) / (2.0 * group->radius);
    }
    return balls;
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
find_leaves_in_image(const hs_nearest *near, const hs_nearest_group *all, double limit,
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
    const double reach = all->radius * leaves->unit * (1.0 + LEAF_ROOM) +
                         4.0 * sqrt(d) * images->error * leaves->unit;
    const double limit = reach * reach;
    bool         fit = true;
    leaves->n = leaves->n_images = 0;
    while (fit && hs_nearest_images_next(images)) {
        const int32_t     n = leaves->n;
        hs_nearest_image *image = &leaves->images[leaves->n_images++];
        hs_nearest_image_set(near, images, image);
        switch (d) {
        case 2: fit = find_leaves_in_image(near, all, limit, leaves, 2); break;
        case 3: fit = find_leaves_in_image(near, all, limit, leaves, 3); break;
        default: fit = find_leaves_in_image(near, all, limit, leaves, d);
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
    double            balls = 0.0;
    leaves->radius = 0.0;
    if (n < 2 || near->tree.n_nodes < 2) {
        return;
    }
    const hs_nearest_group all = unite(groups, n, d);
    for (int32_t g = 0; g < n; g++) {
        balls += hs_nearest_balls(&groups[g], d);
    }
    if (hs_nearest_balls(&all, d) > MOSTLY_EMPTY * balls) {
        return;
    }
    leaves->unit = hs_power_of_two(-hs_nearest_exponent(all.radius));
    for (int k = 0; k < d; k++) {
        const double width = all.upper[k] - all.lower[k];
        leaves->centre[k] = all.lower[k] + 0.5 * width;
        widest = hs_larger(width * leaves->unit, widest);
    }
    leaves->extent = 0.5 * widest + 4.0;
    if (!(widest < WIDEST_LEAF) || hs_nearest_images_start(near, &all, &images) != HS_OK ||
        images.count > MOST_SHARED_IMAGES || images.error * leaves->unit > LEAF_ROOM) {
        return;
    }
    leaves->error = images.error;
    if (find_leaves(near, &all, &images, leaves)) {
        leaves->radius = all.radius;
    }
}

/* Lists the leaves within `radius` of one of these groups in leaves->hits, ascending; returns how
 * many. radius: at most leaves->radius. */
static int32_t
nearest_leaves_list(const hs_nearest *near, const hs_nearest_group *group, double radius,
                    hs_nearest_leaves *leaves)
{
    const int    d = near->tree.ndim;
    const double reach =
        radius * leaves->unit * (1.0 + LEAF_ROOM) +
        sqrt(d) * (4.0 * leaves->error * leaves->unit + AXIS_ERROR * leaves->extent);
    hs_boxes boxes = {.ndim = d,
                      .n = leaves->n,
                      .label = leaves->label,
                      .hits = leaves->hits,
                      .out = (float)(reach * reach * (1.0 + LEAF_ROOM))};
    for (int k = 0; k < d; k++) {
        boxes.low[k] = leaves->low[k];
        boxes.high[k] = leaves->high[k];
        boxes.from[k] = relative(leaves, k, group->lower[k]);
        boxes.to[k] = relative(leaves, k, group->upper[k]);
    }
    return near->search->call->kernel->near_boxes(&boxes);
}

/* Which leaves a group may be near to, as runs of points. */

/* Relative room, far more than roundings take. */
#define RUN_ROOM 0x1p-30
/* Images between two polls. */
#define POLL_IMAGES 4096

static bool
add_image(const hs_nearest *near, const hs_nearest_image *image, hs_nearest_block *block)
{
    if (block->n_images == block->image_capacity) {
        const int32_t capacity = 2 * block->image_capacity + 32;
        if (!hs_shared_resize(near->shared, (void **)&block->images, block->image_capacity,
                              capacity, sizeof *block->images)) {
            return false;
        }
        block->image_capacity = capacity;
    }
    block->images[block->n_images++] = *image;
    return true;
}

/* Adds points si, ..., si + n - 1 in that image. */
static bool
add_points(const hs_nearest *near, int32_t si, int32_t n, int32_t image, hs_nearest_block *block)
{
    hs_nearest_run *last = block->n_runs > 0 ? &block->runs[block->n_runs - 1] : NULL;
    if (last != NULL && last->image == image && last->si + last->n == si) {
        last->n += n;
        block->n += n;
        return true;
    }
    if (block->n_runs == block->run_capacity) {
        const int32_t capacity = 2 * block->run_capacity + 64;
        if (!hs_shared_resize(near->shared, (void **)&block->runs, block->run_capacity, capacity,
                              sizeof *block->runs)) {
            return false;
        }
        block->run_capacity = capacity;
    }
    block->runs[block->n_runs++] = (hs_nearest_run){block->n, n, si, image};
    block->n += n;
    return true;
}

/* Adds the points of a leaf, in the last image. */
static bool
add_leaf_runs(const hs_nearest *near, const hs_tree_node *node, hs_nearest_block *block)
{
    return add_points(near, node->first, hs_nearest_of_leaf(near, node), block->n_images - 1,
                      block);
}

/* Adds the leaves of the last image that are in reach, as runs in ascending order. low, high: the
 * group, less the image's displacement. */
HS_ALWAYS_INLINE hs_status
find_runs(const hs_nearest *near, const double *low, const double *high, double most, double reach,
          hs_nearest_block *block, const int ndim)
{
    const hs_tree *tree = &near->tree;
    const double   limit = reach * reach * (1.0 + RUN_ROOM);
    int64_t        n_waiting = 0;
    int32_t        number = 0;
    if (hs_tree_gap(tree, low, high, block->unit) > limit) {
        return HS_OK;
    }
    for (;;) {
        const hs_tree_node *node = &tree->nodes[number];
        const int32_t       left = node->left;
        double              gap[2] = {INFINITY, INFINITY};
        HS_PREFETCH(&tree->nodes[left]);
        if (left != 0) {
            hs_tree_gaps(hs_tree_bounds(tree, left, ndim), low, high, block->unit, ndim, gap);
        } else if (!add_leaf_runs(near, node, block) || block->n >= INT32_MAX / 8) {
            return HS_ERR_MEMORY;
        } else if (block->n > most) {
            return HS_TRY_OTHER;
        }
        if (!hs_tree_step(left, gap, limit, block->stack, &n_waiting, &number)) {
            return HS_OK;
        }
    }
}

static hs_status
find_runs_in_image(const hs_nearest *near, const hs_nearest_group *group, const double *moved,
                   double most, double reach, hs_nearest_block *block)
{
    double low[HS_MAX_DIM], high[HS_MAX_DIM];
    for (int k = 0; k < near->tree.ndim; k++) {
        low[k] = group->lower[k] - moved[k];
        high[k] = group->upper[k] - moved[k];
    }
    switch (near->tree.ndim) {
    case 2: return find_runs(near, low, high, most, reach, block, 2);
    case 3: return find_runs(near, low, high, most, reach, block, 3);
    default: return find_runs(near, low, high, most, reach, block, near->tree.ndim);
    }
}

/* Sets runs and images, by walking down the tree: what is within the radius of the group and a
 * little more. HS_TRY_OTHER: more than `most` candidates. */
static hs_status
nearest_runs_find(const hs_nearest *near, const hs_options *options, const hs_nearest_group *group,
                  double most, hs_nearest_images *images, hs_nearest_block *block)
{
    const double reach =
        block->reach * (1.0 + RUN_ROOM) + 4.0 * sqrt(near->tree.ndim) * block->error;
    int       since_poll = 0; /* images, as many as hs_nearest_images_start lets be */
    hs_status status = HS_OK;
    block->n = block->n_runs = block->n_images = 0;
    while (status == HS_OK && hs_nearest_images_next(images)) {
        const int32_t    n = block->n;
        hs_nearest_image image;
        hs_nearest_image_set(near, images, &image);
        if (!add_image(near, &image, block)) {
            return HS_ERR_MEMORY;
        }
        status = find_runs_in_image(near, group, images->moved, most, reach, block);
        block->n_images -= block->n == n; /* nothing there */
        if (status == HS_OK && ++since_poll == POLL_IMAGES) {
            since_poll = 0;
            status = hs_poll(options, 0.0);
        }
    }
    return status;
}

/* nearest_runs_find from leaves that were found for this group and others. */
static hs_status
nearest_runs_take(const hs_nearest *near, const hs_nearest_group *group, double most,
                  hs_nearest_leaves *leaves, hs_nearest_block *block)
{
    const int32_t n = nearest_leaves_list(near, group, group->radius, leaves);
    int32_t       first = 0;
    bool          is_one = true;
    block->n = block->n_runs = block->n_images = 0;
    for (int32_t l = 0; l < n; l++) {
        const hs_nearest_run *leaf = &leaves->runs[leaves->hits[l]];
        first = l == 0 ? leaf->image : first;
        is_one = is_one && leaf->image == first;
        if (!add_points(near, leaf->si, leaf->n, leaf->image, block)) {
            return HS_ERR_MEMORY;
        }
    }
    /* Where all leaves lie in one image, it becomes the only one. */
    const int32_t from = is_one ? first : 0;
    const int32_t to = is_one && first < leaves->n_images ? first + 1 : leaves->n_images;
    for (int32_t i = from; i < to; i++) {
        if (!add_image(near, &leaves->images[i], block)) {
            return HS_ERR_MEMORY;
        }
    }
    for (int32_t r = 0; is_one && r < block->n_runs; r++) {
        block->runs[r].image = 0;
    }
    return block->n > most ? HS_TRY_OTHER : HS_OK;
}

/* Runs and images first; then a unit for which the radius is between 1 and 2; then
 * the kernel copies. */

/* Relative room, far more than roundings take. */
#define BLOCK_ROOM 0x1p-30
/* A group that is so many times as wide as its radius is searched point by point: floats relative
 * to its centre would not tell distances apart. */
#define WIDEST_BLOCK 512.0
/* Least radius, in errors of shifted coordinates. */
#define LEAST_IN_ERRORS 1024.0
/* Candidates for which there is room at first. */
#define FIRST_CAPACITY 1024
/* With more to be found there are more hits than a kernel puts in order. */
#define MOST_BY_SQUARES (HS_ORDER_MOST / 2)
#define LARGEST_SQUARE  0x1p60 /* far from where float32 ends */

/* Polls after a pass over all candidates, if they are many. */
static hs_status
poll_if_large(const hs_options *options, const hs_nearest_block *block)
{
    return block->n > HS_POLL_POINTS ? hs_poll(options, 0.0) : HS_OK;
}

/* Makes room for n candidates, and for what kernels read and write beyond. */
static bool
reserve(const hs_nearest *near, hs_nearest_block *block, int64_t n)
{
    const int64_t capacity = n + n / 2 + FIRST_CAPACITY, room = capacity + HS_PADDING;
    hs_shared    *shared = near->shared;
    bool          done = n < INT32_MAX / 4;
    if (n <= block->capacity && block->capacity > 0) {
        return true;
    }
    block->capacity = 0;
    for (int k = 0; done && k < near->tree.ndim; k++) {
        done = hs_shared_resize(shared, (void **)&block->y[k], 0, room, sizeof(float));
    }
    done = done && hs_shared_resize(shared, (void **)&block->norm, 0, room, sizeof(float)) &&
           hs_shared_resize(shared, (void **)&block->number, 0, room, sizeof(int32_t)) &&
           hs_shared_resize(shared, (void **)&block->image_of, 0, room, sizeof(int32_t)) &&
           hs_shared_resize(shared, (void **)&block->place, 0, room, sizeof(int32_t)) &&
           hs_shared_resize(shared, (void **)&block->unsure, 0, room, sizeof(hs_unsure)) &&
           hs_shared_resize(shared, (void **)&block->hits, 0, 2 * capacity + HS_PADDING,
                            sizeof(int32_t)) &&
           hs_shared_resize(shared, (void **)&block->squares, 0, 2 * capacity + HS_PADDING,
                            sizeof(float));
    for (int64_t c = 0; done && c < room; c++) {
        block->place[c] = (int32_t)c;
    }
    block->capacity = done ? (int32_t)capacity : 0;
    return done;
}

hs_status
hs_nearest_block_init(const hs_nearest *near, hs_nearest_block *block)
{
    *block = (hs_nearest_block){.depth = near->tree.depth + 2};
    return hs_shared_resize(near->shared, (void **)&block->stack, 0, block->depth,
                            sizeof *block->stack) &&
                   reserve(near, block, 0)
               ? HS_OK
               : HS_ERR_MEMORY;
}

void
hs_nearest_block_free(const hs_nearest *near, hs_nearest_block *block)
{
    for (int k = 0; k < HS_MAX_DIM; k++) {
        hs_shared_release(near->shared, (void **)&block->y[k]);
    }
    hs_shared_release(near->shared, (void **)&block->norm);
    hs_shared_release(near->shared, (void **)&block->number);
    hs_shared_release(near->shared, (void **)&block->image_of);
    hs_shared_release(near->shared, (void **)&block->place);
    hs_shared_release(near->shared, (void **)&block->hits);
    hs_shared_release(near->shared, (void **)&block->squares);
    hs_shared_release(near->shared, (void **)&block->unsure);
    hs_shared_release(near->shared, (void **)&block->runs);
    hs_shared_release(near->shared, (void **)&block->images);
    hs_shared_release(near->shared, (void **)&block->stack);
}

/* Images in reach. A radius that is small beside the errors of shifted coordinates is raised to
 * some multiple of these: a smaller unit would be of no use. */
static hs_status
start_images(const hs_nearest *near, hs_nearest_group *group, hs_nearest_images *images)
{
    hs_status    status = hs_nearest_images_start(near, group, images);
    const double least = LEAST_IN_ERRORS * images->error;
    if (status == HS_OK && group->radius < least) {
        group->radius = least;
        status = hs_nearest_images_start(near, group, images);
    }
    return status;
}

/* Unit and errors, for the group's radius. */
static void
set_unit(const hs_nearest *near, const hs_nearest_group *group, double error,
         hs_nearest_block *block)
{
    block->unit = hs_power_of_two(-hs_nearest_exponent(group->radius));
    block->reach = group->radius * block->unit;
    block->error = error * block->unit;
    /* 2 e |D| + e^2, and what underflow may lose. */
    const double along = sqrt(near->tree.ndim) * block->error;
    block->flat_error = 2.1 * along * (block->reach + along) + 0x1p-1000;
}

static void
gather_relative(const hs_nearest *near, const double *centre, hs_nearest_block *block)
{
    hs_relative_keys keys = {.ndim = near->tree.ndim,
                             .images = block->images,
                             .unit = block->unit,
                             .extent = block->extent,
                             .norm = block->norm,
                             .number = block->number};
    for (int k = 0; k < near->tree.ndim; k++) {
        keys.x[k] = near->search->bins.x[k];
        keys.y[k] = block->y[k];
        keys.centre[k] = centre[k];
    }
    near->search->call->kernel->gather_relative(&keys, block->runs, block->n_runs);
    for (int k = 0; k < near->tree.ndim; k++) {
        hs_pad_lanes(block->y[k], block->n);
    }
    hs_pad_lanes(block->norm, block->n);
    for (int32_t r = 0; block->n_images > 1 && r < block->n_runs; r++) {
        int32_t *image_of = block->image_of + block->runs[r].at;
        for (int32_t c = 0; c < block->runs[r].n; c++) {
            image_of[c] = block->runs[r].image;
        }
    }
}

static hs_status
gather(const hs_nearest *near, const hs_options *options, const hs_nearest_group *group,
       hs_nearest_block *block)
{
    const hs_bins *asking = hs_search_asking(near->search);
    double         centre[HS_MAX_DIM];
    for (int k = 0; k < near->tree.ndim; k++) {
        centre[k] = group->lower[k] + 0.5 * (group->upper[k] - group->lower[k]);
        for (int32_t t = 0; t < group->last - group->first; t++) {
            block->q[k][t] = hs_nearest_relative(asking->x[k][group->first + t], centre[k],
                                                 block->unit, block->extent);
        }
    }
    gather_relative(near, centre, block);
    return poll_if_large(options, block);
}

/* Largest |y| and |q| together, as floats, which round up. */
static double
scan_extent(const hs_nearest_block *block)
{
    return 2.0 * block->extent * (1.0 + 0x1p-20);
}

/* Whether squares in float32 may do: where there are hits enough for all that are wanted, but not
 * more than a kernel puts in order. */
static void
choose_squares(const hs_nearest *near, const hs_nearest_group *group, hs_nearest_block *block)
{
    const double extent = scan_extent(block), limit = near->limit * block->unit;
    double       in, out;
    block->has_squares = false;
    if (group->is_complete || near->k > MOST_BY_SQUARES || limit < block->reach) {
        return;
    }
    hs_threshold_bounds(near->tree.ndim, block->reach, extent, block->error, HS_FILTER_UNIT,
                        HS_FILTER_TINY, &in, &out);
    const double square = block->reach * block->reach;
    /* The radius is 1024 errors at least, and the extent some hundred radii at most. */
    HS_ASSERT(in > 0.0 && out < LARGEST_SQUARE);
    block->has_squares = true;
    block->square_error = hs_larger(square - in, out - square) * (1.0 + BLOCK_ROOM);
}

/* Unit, errors and extent; HS_TRY_OTHER: the group is too wide. */
static hs_status
set_frame(const hs_nearest *near, const hs_nearest_group *group, double error,
          hs_nearest_block *block)
{
    double widest = 0.0;
    set_unit(near, group, error, block);
    for (int k = 0; k < near->tree.ndim; k++) {
        widest = hs_larger((group->upper[k] - group->lower[k]) * block->unit, widest);
    }
    /* Beyond the group and the radius, by more than roundings take. */
    block->extent = 0.5 * widest + 4.0;
    return widest > WIDEST_BLOCK ? HS_TRY_OTHER : HS_OK;
}

/* Runs and images. */
static hs_status
find(const hs_nearest *near, const hs_options *options, hs_nearest_group *group, double most,
     hs_nearest_leaves *leaves, hs_nearest_block *block)
{
    hs_nearest_images images;
    if (leaves != NULL && group->radius <= leaves->radius &&
        group->radius >= LEAST_IN_ERRORS * leaves->error) {
        const hs_status status = set_frame(near, group, leaves->error, block);
        return status == HS_OK ? nearest_runs_take(near, group, most, leaves, block) : status;
    }
    if (start_images(near, group, &images) != HS_OK || images.count > most) {
        return most < INFINITY ? HS_TRY_OTHER : HS_ERR_MEMORY;
    }
    const hs_status status = set_frame(near, group, images.error, block);
    return status == HS_OK ? nearest_runs_find(near, options, group, most, &images, block) : status;
}

hs_status
hs_nearest_block_fill(const hs_nearest *near, const hs_options *options, hs_nearest_group *group,
                      double most, hs_nearest_leaves *leaves, hs_nearest_block *block)
{
    hs_status status = find(near, options, group, most, leaves, block);
    if (status == HS_OK) {
        choose_squares(near, group, block);
        status = poll_if_large(options, block);
    }
    if (status == HS_OK && !reserve(near, block, block->n)) {
        status = HS_ERR_MEMORY;
    }
    return status == HS_OK ? gather(near, options, group, block) : status;
}

int32_t
hs_nearest_block_scan(const hs_nearest *near, const hs_nearest_group *group,
                      hs_nearest_block *block, int32_t first, int32_t *end)
{
    const hs_kernel *kernel = near->search->call->kernel;
    const int        d = near->tree.ndim;
    const double     extent = scan_extent(block);
    hs_scan          scan = {.ndim = d,
                             .norm = block->norm,
                             .label = block->place,
                             .n = block->n,
                             .n_points = group->last - group->first,
                             .hits = block->hits,
                             .end = end,
                             .unsure = block->unsure,
                             .most_hits = 2 * block->capacity,
                             .most_unsure = block->capacity};
    for (int k = 0; k < d; k++) {
        scan.y[k] = block->y[k];
        scan.q[k] = block->q[k];
    }
    /* rank.c decides: no hit is unsure here. */
    scan.direct = hs_thresholds_of(d, block->reach, extent, block->error);
    if (block->has_squares) {
        scan.squares = block->squares;
        return kernel->squares(&scan, first);
    }
    scan.expanded = hs_expanded_of(d, block->reach, extent, block->error);
    scan.direct.in = INFINITY;
    scan.expanded.in = INFINITY;
    return hs_expanded_pays(block->reach, extent) ? kernel->list(&scan, first)
                                                  : kernel->list_direct(&scan, first);
}
