/* SPDX-License-Identifier: BSD-3-Clause */
/* neighbourhood.c: candidates are appended as runs of point numbers; then the kernel copies all
 * runs at once. */
#include "neighbourhood.h"

#include "../base/poll.h"
#include "../memory/parts.h"

#include <math.h>
#include <string.h>

int32_t
hs_block_most_hits(int32_t capacity)
{
    if (capacity < HS_BURST) {
        return capacity + HS_BURST;
    }
    return capacity < INT32_MAX / HS_HITS_PER_CANDIDATE ? HS_HITS_PER_CANDIDATE * capacity
                                                        : capacity;
}

hs_status
hs_block_init(hs_account *account, int ndim, hs_block_use use, int32_t most, int32_t most_runs,
              hs_block *block)
{
    const int64_t capacity = (int64_t)most + HS_PADDING;
    const int64_t hits = (int64_t)hs_block_most_hits(most) + HS_PADDING;
    const bool    has_squares = use == HS_BLOCK_LISTS_SQUARES;
    hs_parts      parts;
    *block = (hs_block){.capacity = most, .most_runs = most_runs};
    block->most_hits = hs_block_most_hits(most);
    hs_parts_begin(&parts);
    for (int k = 0; k < ndim; k++) {
        hs_parts_add(&parts, (void **)&block->y[k], capacity, sizeof(float));
    }
    hs_parts_add(&parts, (void **)&block->norm, capacity, sizeof(float));
    hs_parts_add(&parts, (void **)&block->id, capacity, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->number, capacity, sizeof(int32_t));
    hs_parts_add(&parts, (void **)&block->unsure, capacity, sizeof(hs_unsure));
    hs_parts_add(&parts, (void **)&block->runs, (int64_t)most_runs + 1, sizeof(hs_run));
    if (use != HS_BLOCK_COUNTS) {
        hs_parts_add(&parts, (void **)&block->hits, hits, sizeof(int32_t));
    }
    if (has_squares) {
        hs_parts_add(&parts, (void **)&block->squares, hits, sizeof(float));
    }
    if (has_squares || use == HS_BLOCK_LISTS_PLACES) {
        hs_parts_add(&parts, (void **)&block->place, capacity, sizeof(int32_t));
    }
    block->memory = hs_parts_alloc(account, HS_FOR_CANDIDATES, &parts);
    return block->memory != NULL ? HS_OK : HS_ERR_MEMORY;
}

hs_status
hs_block_add_radii(hs_account *account, int32_t n_rows, hs_block *block)
{
    block->pitch = (int64_t)block->capacity + HS_PADDING;
    block->radius = hs_alloc(account, HS_FOR_CANDIDATES, n_rows * block->pitch, sizeof(float));
    return block->radius != NULL ? HS_OK : HS_ERR_MEMORY;
}

void
hs_block_free(hs_account *account, hs_block *block)
{
    hs_free(account, block->radius);
    block->radius = NULL;
    hs_free(account, block->memory);
    block->memory = NULL;
}

void
hs_group_start(const hs_bins *bins, int32_t first, int32_t last, hs_group *group)
{
    group->first = first;
    group->last = last;
    group->largest = 0;
    group->near.out = INFINITY;
    /* Any double will do as a centre; one of the points is near all of them. */
    const int32_t middle = first + (last - first) / 2;
    for (int k = 0; k < bins->ndim; k++) {
        group->centre[k] = bins->x[k][middle];
    }
}

void
hs_group_load(const hs_bins *bins, hs_group *group)
{
    for (int k = 0; k < bins->ndim; k++) {
        const double *x = bins->x[k] + group->first;
        for (int32_t t = 0; t < group->last - group->first; t++) {
            const float    q = (float)(x[t] - group->centre[k]);
            const uint32_t bits = hs_bits_of_float(q) & UINT32_C(0x7fffffff);
            group->q[k][t] = q;
            group->largest = bits > group->largest ? bits : group->largest;
        }
    }
}

float
hs_group_bound(const hs_bins *bins, hs_group *group)
{
    float largest = 0.0f;
    hs_group_load(bins, group);
    for (int k = 0; k < bins->ndim; k++) {
        float low = group->q[k][0], high = low;
        for (int32_t t = 1; t < group->last - group->first; t++) {
            low = group->q[k][t] < low ? group->q[k][t] : low;
            high = group->q[k][t] > high ? group->q[k][t] : high;
        }
        group->near.low[k] = low;
        group->near.high[k] = high;
        largest = fmaxf(largest, fmaxf(-low, high));
    }
    return largest;
}

int32_t
hs_block_append(hs_block *block, int32_t si, int32_t end, int ndim, const double *shift,
                const int32_t *image, const hs_group *group)
{
    const int32_t room = block->capacity - block->n;
    const int32_t n = end - si < room ? end - si : room;
    hs_run       *run = &block->runs[block->n_runs++];
    run->at = block->n;
    run->si = si;
    memcpy(run->image, image, sizeof run->image);
    for (int k = 0; k < ndim; k++) {
        /* One rounding here and one for the sum: hs_grid.shift_error bounds the first, filter.h
         * counts on the second. */
        run->moved[k] = shift[k] - group->centre[k];
    }
    block->n += n;
    return n;
}

/* Some candidates after others where there are very many. */
static hs_status
gather_in_parts(const hs_kernel *kernel, const hs_options *options, const hs_block *block,
                hs_gather *gather)
{
    for (int32_t first = 0, end; first < block->n_runs; first = end) {
        hs_run       *runs = block->runs + first;
        const int32_t left = block->n_runs - first;
        if (first > 0 && hs_poll(options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
        end = first + (left < HS_RUNS_PER_POLL ? left : HS_RUNS_PER_POLL);
        kernel->gather(gather, runs, end - first);
    }
    return HS_OK;
}

/* Those that there are candidates for, and the padding. */
static void
set_places(hs_block *block)
{
    const int32_t end = block->n + HS_PADDING;
    int32_t      *place = block->place;
    for (int32_t c = block->n_places; c < end; c++) {
        place[c] = c;
    }
    block->n_places = end > block->n_places ? end : block->n_places;
}

hs_status
hs_block_gather(const hs_bins *bins, const hs_kernel *kernel, const hs_options *options,
                bool is_first, hs_block *block, hs_group *group)
{
    hs_gather gather;
    gather.ndim = bins->ndim;
    for (int k = 0; k < bins->ndim; k++) {
        gather.x[k] = bins->x[k];
        gather.y[k] = block->y[k];
    }
    gather.order = bins->order;
    gather.norm = block->norm;
    gather.id = block->id;
    gather.number = block->number;
    gather.near = group->near;
    gather.n = 0;
    gather.largest = group->largest;
    block->runs[block->n_runs].at = block->n;
    const hs_status status = gather_in_parts(kernel, options, block, &gather);
    if (status != HS_OK) {
        return status;
    }
    group->largest = gather.largest;
    block->n = block->runs[block->n_runs].at = gather.n;
    for (int k = 0; k < bins->ndim; k++) {
        hs_pad_lanes(block->y[k], block->n);
    }
    hs_pad_lanes(block->norm, block->n);
    if (block->place != NULL) {
        set_places(block);
    }
    if (is_first) {
        HS_ASSERT(block->runs[0].si == group->first && block->n >= group->last - group->first);
        const size_t bytes = (size_t)(group->last - group->first) * sizeof(float);
        for (int k = 0; k < bins->ndim; k++) {
            memcpy(group->q[k], block->y[k], bytes);
        }
    }
    return HS_OK;
}
