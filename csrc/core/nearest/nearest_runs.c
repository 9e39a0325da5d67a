/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_runs.c: which leaves a group may be near to, as runs of points. */
#include "nearest_block.h"

#include "../base/outcome.h"
#include "../base/poll.h"

#include <math.h>

/* Relative room, far more than roundings take. */
#define ROOM 0x1p-30
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
add_leaf(const hs_nearest *near, const hs_tree_node *node, hs_nearest_block *block)
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
    const double   limit = reach * reach * (1.0 + ROOM);
    int64_t        n_waiting = 0;
    int32_t        number = 0;
    if (hs_tree_gap(tree, low, high, block->unit) > limit) {
        return HS_OK;
    }
    for (;;) {
        const hs_tree_node *node = &tree->nodes[number];
        const int32_t       left = node->left;
        double              gap[2] = {INFINITY, INFINITY};
        if (left != 0) {
            hs_tree_gaps(hs_tree_bounds(tree, left, ndim), low, high, block->unit, ndim, gap);
        } else if (!add_leaf(near, node, block) || block->n >= INT32_MAX / 8) {
            return HS_ERR_MEMORY;
        } else if (block->n > most) {
            return HS_TOO_MUCH;
        }
        if (!hs_tree_step(left, gap, limit, block->stack, &n_waiting, &number)) {
            return HS_OK;
        }
    }
}

static hs_status
find_in_image(const hs_nearest *near, const hs_nearest_group *group, const double *moved,
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

hs_status
hs_nearest_runs_find(const hs_nearest *near, const hs_options *options,
                     const hs_nearest_group *group, double most, hs_nearest_images *images,
                     hs_nearest_block *block)
{
    const double reach = block->reach * (1.0 + ROOM) + 4.0 * sqrt(near->tree.ndim) * block->error;
    int          since_poll = 0; /* images, as many as hs_nearest_images_start lets be */
    hs_status    status = HS_OK;
    block->n = block->n_runs = block->n_images = 0;
    while (status == HS_OK && hs_nearest_images_next(images)) {
        const int32_t    n = block->n;
        hs_nearest_image image;
        hs_nearest_image_set(near, images, &image);
        if (!add_image(near, &image, block)) {
            return HS_ERR_MEMORY;
        }
        status = find_in_image(near, group, images->moved, most, reach, block);
        block->n_images -= block->n == n; /* nothing there */
        if (status == HS_OK && ++since_poll == POLL_IMAGES) {
            since_poll = 0;
            status = hs_poll(options, 0.0);
        }
    }
    return status;
}

hs_status
hs_nearest_runs_take(const hs_nearest *near, const hs_nearest_group *group, double most,
                     hs_nearest_leaves *leaves, hs_nearest_block *block)
{
    const int32_t n = hs_nearest_leaves_list(near, group, group->radius, leaves);
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
    return block->n > most ? HS_TOO_MUCH : HS_OK;
}
