/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_block.c: runs and images first; then a unit for which the radius is between 1 and 2; then
 * the kernel copies. */
#include "nearest_block.h"

#include "../exact/bounds.h"
#include "../base/outcome.h"
#include "../base/poll.h"

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
settle_unit(const hs_nearest *near, const hs_nearest_group *group, double error,
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
relate(const hs_nearest *near, const double *centre, hs_nearest_block *block)
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
    near->search->call->kernel->relate(&relate, block->runs, block->n_runs);
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
    relate(near, centre, block);
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
    block->square_error = hs_larger(square - in, out - square) * (1.0 + ROOM);
}

/* Unit, errors and extent; HS_TOO_MUCH: the group is too wide. */
static hs_status
settle_frame(const hs_nearest *near, const hs_nearest_group *group, double error,
             hs_nearest_block *block)
{
    double widest = 0.0;
    settle_unit(near, group, error, block);
    for (int k = 0; k < near->tree.ndim; k++) {
        widest = hs_larger((group->upper[k] - group->lower[k]) * block->unit, widest);
    }
    /* Beyond the group and the radius, by more than roundings take. */
    block->extent = 0.5 * widest + 4.0;
    return widest > WIDEST ? HS_TOO_MUCH : HS_OK;
}

/* Runs and images. */
static hs_status
find(const hs_nearest *near, const hs_options *options, hs_nearest_group *group, double most,
     hs_nearest_leaves *leaves, hs_nearest_block *block)
{
    hs_nearest_images images;
    if (leaves != NULL && group->radius <= leaves->radius &&
        group->radius >= LEAST_IN_ERRORS * leaves->error) {
        const hs_status status = settle_frame(near, group, leaves->error, block);
        return status == HS_OK ? hs_nearest_runs_take(near, group, most, leaves, block) : status;
    }
    if (start_images(near, group, &images) != HS_OK || images.count > most) {
        return most < INFINITY ? HS_TOO_MUCH : HS_ERR_MEMORY;
    }
    const hs_status status = settle_frame(near, group, images.error, block);
    return status == HS_OK ? hs_nearest_runs_find(near, options, group, most, &images, block)
                           : status;
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
    /* nearest_rank.c decides: no hit is unsure here. */
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
