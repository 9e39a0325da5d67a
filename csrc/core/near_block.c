/* SPDX-License-Identifier: BSD-3-Clause */
/* near_block.c: see near_block.h. */
#include "near_block.h"

#include "bounds.h"
#include "poll.h"

#include <math.h>

/* Relative room, far more than roundings take. */
#define ROOM 0x1p-30
/* A group that is so many times as wide as its radius is searched point by point: floats relative
 * to its centre would not tell distances apart. */
#define WIDEST 512.0
/* Least radius, in errors of shifted coordinates. */
#define LEAST_IN_ERRORS 1024.0
/* Candidates for which there is room at first. */
#define FIRST_CAPACITY 1024
/* With more to be found there are more hits than a kernel puts in order. */
#define MOST_BY_SQUARES (HS_ORDER_MOST / 2)
#define LARGEST_SQUARE 0x1p60 /* far from where float32 ends */
/* Images between two polls. */
#define POLL_IMAGES 4096

/* After a step that every candidate took part in. */
static hs_status
poll_if_large(const hs_options *options, const hs_near_block *block)
{
    return block->n > HS_POLL_POINTS ? hs_poll(options, 0.0) : HS_OK;
}

/* Room for n candidates, and what kernels read and write beyond. */
static bool
reserve(const hs_near *near, hs_near_block *block, int64_t n)
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
hs_near_block_init(const hs_near *near, hs_near_block *block)
{
    *block = (hs_near_block){.depth = near->tree.depth + 2};
    return hs_shared_resize(near->shared, (void **)&block->stack, 0, block->depth,
                            sizeof *block->stack) &&
                   reserve(near, block, 0)
               ? HS_OK
               : HS_ERR_MEMORY;
}

void
hs_near_block_free(const hs_near *near, hs_near_block *block)
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

static bool
add_image(const hs_near *near, const hs_near_image *image, hs_near_block *block)
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

/* Points si, ..., si + n - 1 in that image. */
static bool
add_points(const hs_near *near, int32_t si, int32_t n, int32_t image, hs_near_block *block)
{
    hs_near_run *last = block->n_runs > 0 ? &block->runs[block->n_runs - 1] : NULL;
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
    block->runs[block->n_runs++] = (hs_near_run){block->n, n, si, image};
    block->n += n;
    return true;
}

/* Points of a leaf, in the last image. */
static bool
add_leaf(const hs_near *near, const hs_tree_node *node, hs_near_block *block)
{
    const int32_t n = node->end - node->first;
    return add_points(near, node->first, node->is_spot && n > near->of_spot ? near->of_spot : n,
                      block->n_images - 1, block);
}

/* Leaves of the last image that are in reach: runs in ascending order. low, high: the group, less
 * the image's displacement. */
HS_ALWAYS_INLINE hs_status
find_runs(const hs_near *near, const double *low, const double *high, double most, double reach,
          hs_near_block *block, const int ndim)
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
        bool                is_near[2] = {false, false};
        if (left != 0) {
            double gap[2];
            hs_tree_gaps(hs_tree_bounds(tree, left, ndim), low, high, block->unit, ndim, gap);
            is_near[0] = gap[0] <= limit;
            is_near[1] = gap[1] <= limit;
        } else if (!add_leaf(near, node, block) || block->n >= INT32_MAX / 8) {
            return HS_ERR_MEMORY;
        } else if (block->n > most) {
            return HS_STATUS_END;
        }
        if (is_near[0]) {
            block->stack[n_waiting] = left + 1;
            n_waiting += is_near[1];
            number = left;
        } else if (is_near[1]) {
            number = left + 1;
        } else if (n_waiting > 0) {
            number = block->stack[--n_waiting];
        } else {
            return HS_OK;
        }
    }
}

static hs_status
find_in_image(const hs_near *near, const hs_near_group *group, const double *moved, double most,
              double reach, hs_near_block *block)
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

/* Images in reach. A radius that is nothing beside the errors of shifted coordinates is raised to
 * some of these: a unit as small as that would be of no use. */
static hs_status
start_images(const hs_near *near, hs_near_group *group, hs_near_images *images)
{
    hs_status    status = hs_near_images_start(near, group, images);
    const double least = LEAST_IN_ERRORS * images->error;
    if (status == HS_OK && group->radius < least) {
        group->radius = least;
        status = hs_near_images_start(near, group, images);
    }
    return status;
}

/* Unit and errors, for the group's radius. */
static void
settle_unit(const hs_near *near, const hs_near_group *group, double error, hs_near_block *block)
{
    block->unit = hs_power_of_two(-hs_near_exponent(group->radius));
    block->reach = group->radius * block->unit;
    block->error = error * block->unit;
    /* 2 e |D| + e^2, and what underflow may lose. */
    const double along = sqrt(near->tree.ndim) * block->error;
    block->flat_error = 2.1 * along * (block->reach + along) + 0x1p-1000;
}

/* Runs of all images. */
static hs_status
find_candidates(const hs_near *near, const hs_options *options, const hs_near_group *group,
                double most, hs_near_images *images, hs_near_block *block)
{
    const double reach =
        block->reach * (1.0 + ROOM) + 4.0 * sqrt(near->tree.ndim) * block->error;
    int       since_poll = 0;
    hs_status status = HS_OK;
    block->n = block->n_runs = block->n_images = 0;
    while (status == HS_OK && hs_near_images_next(images)) {
        const int32_t n = block->n;
        hs_near_image image;
        hs_near_image_set(near, images, &image);
        if (!add_image(near, &image, block)) {
            return HS_ERR_MEMORY;
        }
        status = find_in_image(near, group, images->moved, most, reach, block);
        block->n_images -= block->n == n; /* nothing there */
        if (++since_poll == POLL_IMAGES && status == HS_OK) {
            since_poll = 0;
            status = hs_poll(options, 0.0);
        }
    }
    return status;
}

/* Number x in units, from the centre, and no further than the extent, which nothing in reach is. */
HS_ALWAYS_INLINE float
relative(double x, double centre, double unit, double extent)
{
    const double y = (x - centre) * unit;
    return (float)hs_larger(hs_smaller(y, extent), -extent);
}

static void
relate(const hs_near *near, const double *centre, hs_near_block *block)
{
    hs_relate relate = {.ndim = near->tree.ndim,
                        .images = block->images,
                        .unit = block->unit,
                        .extent = block->extent,
                        .norm = block->norm,
                        .number = block->number};
    for (int k = 0; k < near->tree.ndim; k++) {
        relate.x[k] = near->search->bins.x[k];
        relate.y[k] = block->y[k];
        relate.centre[k] = centre[k];
    }
    near->search->kernel->relate(&relate, block->runs, block->n_runs);
    for (int32_t r = 0; block->n_images > 1 && r < block->n_runs; r++) {
        int32_t *image_of = block->image_of + block->runs[r].at;
        for (int32_t c = 0; c < block->runs[r].n; c++) {
            image_of[c] = block->runs[r].image;
        }
    }
}

static hs_status
gather(const hs_near *near, const hs_options *options, const hs_near_group *group,
       hs_near_block *block)
{
    const hs_bins *asking = hs_search_asking(near->search);
    double         centre[HS_MAX_DIM];
    for (int k = 0; k < near->tree.ndim; k++) {
        centre[k] = group->lower[k] + 0.5 * (group->upper[k] - group->lower[k]);
        for (int32_t t = 0; t < group->last - group->first; t++) {
            block->q[k][t] =
                relative(asking->x[k][group->first + t], centre[k], block->unit, block->extent);
        }
    }
    relate(near, centre, block);
    return poll_if_large(options, block);
}

/* Largest |y| and |q| together, as floats, which round up. */
static double
scan_extent(const hs_near_block *block)
{
    return 2.0 * block->extent * (1.0 + 0x1p-20);
}

/* Whether squares in float32 may do: where there are hits enough for all that are wanted, but not
 * more than a kernel puts in order. */
static void
choose_squares(const hs_near *near, const hs_near_group *group, hs_near_block *block)
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
    block->has_squares = in > 0.0 && out < LARGEST_SQUARE;
    block->square_error = hs_larger(square - in, out - square) * (1.0 + ROOM);
}

/* Points of the leaves that some groups have in common. */
static hs_status
take_leaves(const hs_near *near, const hs_near_group *group, double most, hs_near_leaves *leaves,
            hs_near_block *block)
{
    const int32_t n = hs_near_leaves_list(near, group, group->radius, leaves);
    int32_t       first = 0;
    bool          is_one = true;
    block->n = block->n_runs = block->n_images = 0;
    for (int32_t l = 0; l < n; l++) {
        const hs_near_run *leaf = &leaves->runs[leaves->hits[l]];
        first = l == 0 ? leaf->image : first;
        is_one = is_one && leaf->image == first;
        if (!add_points(near, leaf->si, leaf->n, leaf->image, block)) {
            return HS_ERR_MEMORY;
        }
    }
    for (int32_t i = is_one ? first : 0; i < (is_one ? first + 1 : leaves->n_images); i++) {
        if (i < leaves->n_images && !add_image(near, &leaves->images[i], block)) {
            return HS_ERR_MEMORY;
        }
    }
    for (int32_t r = 0; is_one && r < block->n_runs; r++) {
        block->runs[r].image = 0;
    }
    return block->n > most ? HS_STATUS_END : HS_OK;
}

/* Unit, errors and extent; HS_STATUS_END: the group is too wide. */
static hs_status
settle_frame(const hs_near *near, const hs_near_group *group, double error, hs_near_block *block)
{
    double widest = 0.0;
    settle_unit(near, group, error, block);
    for (int k = 0; k < near->tree.ndim; k++) {
        widest = hs_larger((group->upper[k] - group->lower[k]) * block->unit, widest);
    }
    /* Beyond the group and the radius, by more than roundings take. */
    block->extent = 0.5 * widest + 4.0;
    return widest > WIDEST ? HS_STATUS_END : HS_OK;
}

/* Runs and images. */
static hs_status
find(const hs_near *near, const hs_options *options, hs_near_group *group, double most,
     hs_near_leaves *leaves, hs_near_block *block)
{
    hs_near_images images;
    if (leaves != NULL && group->radius <= leaves->radius &&
        group->radius >= LEAST_IN_ERRORS * leaves->error) {
        const hs_status status = settle_frame(near, group, leaves->error, block);
        return status == HS_OK ? take_leaves(near, group, most, leaves, block) : status;
    }
    if (start_images(near, group, &images) != HS_OK || images.count > most) {
        return most < INFINITY ? HS_STATUS_END : HS_ERR_MEMORY;
    }
    const hs_status status = settle_frame(near, group, images.error, block);
    return status == HS_OK ? find_candidates(near, options, group, most, &images, block) : status;
}

hs_status
hs_near_block_fill(const hs_near *near, const hs_options *options, hs_near_group *group,
                   double most, hs_near_leaves *leaves, hs_near_block *block)
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
hs_near_block_scan(const hs_near *near, const hs_near_group *group, hs_near_block *block,
                   int32_t first, int32_t *end)
{
    const hs_kernel *kernel = near->search->kernel;
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
    /* Nothing is decided here: no hit is unsure. */
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
