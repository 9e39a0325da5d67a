/* SPDX-License-Identifier: BSD-3-Clause */
/* gather.c: see gather.h. */
#include "gather.h"

#include <math.h>
#include <string.h>

hs_status
hs_block_init(hs_account *account, int ndim, hs_block *block)
{
    const int64_t capacity = HS_BLOCK_CANDIDATES + HS_SCAN_PADDING;
    bool          complete = true;
    *block = (hs_block){0};
    for (int k = 0; k < ndim; k++) {
        block->y[k] = hs_alloc(account, HS_FOR_CANDIDATES, capacity, sizeof(float));
        complete = complete && block->y[k] != NULL;
    }
    block->id = hs_alloc(account, HS_FOR_CANDIDATES, capacity, sizeof(int32_t));
    block->place = hs_alloc(account, HS_FOR_CANDIDATES, capacity, sizeof(int32_t));
    block->hits = hs_alloc(account, HS_FOR_CANDIDATES, capacity, sizeof(int32_t));
    block->runs = hs_alloc(account, HS_FOR_CANDIDATES, HS_BLOCK_RUNS + 1, sizeof(hs_run));
    complete = complete && block->id && block->place && block->hits && block->runs;
    if (!complete) {
        hs_block_free(account, ndim, block);
        return HS_ERR_MEMORY;
    }
    for (int32_t c = 0; c < capacity; c++) {
        block->place[c] = c;
        block->id[c] = 0;
    }
    for (int k = 0; k < ndim; k++) {
        memset(block->y[k], 0, (size_t)capacity * sizeof(float));
    }
    return HS_OK;
}

void
hs_block_free(hs_account *account, int ndim, hs_block *block)
{
    for (int k = 0; k < ndim; k++) {
        hs_free(account, block->y[k]);
    }
    hs_free(account, block->id);
    hs_free(account, block->place);
    hs_free(account, block->hits);
    hs_free(account, block->runs);
    *block = (hs_block){0};
}

/* |x| as an integer that orders like the number; infinity and NaN are largest. */
HS_ALWAYS_INLINE int32_t
magnitude_of(float x)
{
    int32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits & INT32_C(0x7fffffff);
}

static float
float_of_magnitude(int32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

void
hs_group_set(const hs_bins *bins, int32_t first, int32_t last, hs_group *group)
{
    int32_t largest = 0;
    group->first = first;
    group->last = last;
    for (int k = 0; k < bins->ndim; k++) {
        const double *x = bins->x[k];
        double        low = x[first], high = x[first];
        for (int32_t si = first + 1; si < last; si++) {
            low = x[si] < low ? x[si] : low;
            high = x[si] > high ? x[si] : high;
        }
        /* Any double will do as a centre; the middle makes the float32 numbers smallest. */
        group->centre[k] = 0.5 * low + 0.5 * high;
        for (int32_t si = first; si < last; si++) {
            const float   q = (float)(x[si] - group->centre[k]);
            const int32_t magnitude = magnitude_of(q);
            group->q[si - first][k] = q;
            largest = magnitude > largest ? magnitude : largest;
        }
    }
    group->extent = float_of_magnitude(largest);
}

int32_t
hs_block_append(const hs_bins *bins, const hs_group *group, int32_t si, int32_t end,
                const double *shift, const int32_t *image, hs_block *block)
{
    const int32_t room = HS_BLOCK_CANDIDATES - block->n;
    const int32_t n = end - si < room ? end - si : room;
    const int32_t at = block->n;
    for (int k = 0; k < bins->ndim; k++) {
        const double *HS_RESTRICT x = bins->x[k] + si;
        float *HS_RESTRICT        y = block->y[k] + at;
        /* One rounding each here: hs_grid.shift_error bounds the first, filter.h the second. */
        const double moved = shift[k] - group->centre[k];
        for (int32_t c = 0; c < n; c++) {
            y[c] = (float)(x[c] + moved);
        }
    }
    memcpy(block->id + at, bins->order + si, (size_t)n * sizeof(int32_t));
    hs_run *run = &block->runs[block->n_runs++];
    run->at = at;
    run->si = si;
    memcpy(run->image, image, sizeof run->image);
    block->n += n;
    return n;
}

double
hs_block_extent(const hs_group *group, const hs_block *block, int ndim)
{
    int32_t largest = 0;
    for (int k = 0; k < ndim; k++) {
        const float *y = block->y[k];
        for (int32_t c = 0; c < block->n; c++) {
            const int32_t magnitude = magnitude_of(y[c]);
            largest = magnitude > largest ? magnitude : largest;
        }
    }
    return (double)float_of_magnitude(largest) + (double)group->extent;
}
