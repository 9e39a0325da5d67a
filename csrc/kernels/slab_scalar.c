/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * slab_scalar.c: the test of listed pairs in plain C; the specification of slab_template.h. Two
 * short loops for each tile of a bundle, as in kernel_scalar.c: one tests, one packs, neither
 * branches.
 */
#include "slab.h"

#include "../halfshell.h"

#include <string.h>

/* Pairs tested before they are packed. */
#define TILE 128

/* What the loops over the pairs of a bundle need. */
typedef struct listed {
    const float   *y;
    const int32_t *j;
    float          centre[HS_MAX_DIM];
    hs_thresholds  limit;
} listed;

HS_ALWAYS_INLINE float
square_of_pair(const float *y, const float *centre, const int ndim)
{
    float s = 0.0f;
    for (int k = 0; k < ndim; k++) {
        const float along = y[k] - centre[k];
        s += along * along;
    }
    return s;
}

/* q of a bundle. */
HS_ALWAYS_INLINE void
set_centre(const hs_slab *slab, const hs_bundle *bundle, const int ndim, float *centre)
{
    const int64_t stride = hs_slab_stride(ndim);
    for (int k = 0; k < ndim; k++) {
        const float y = slab->y[bundle->point * stride + k];
        centre[k] = slab->offset != NULL ? y - slab->offset[bundle->image * stride + k] : y;
    }
}

HS_ALWAYS_INLINE int32_t
number_of(const float *y, const int stride)
{
    int32_t number;
    memcpy(&number, y + stride - 1, sizeof number);
    return number;
}

/* Tests n pairs: squares to s, near[e] is 1 for hits, else 0. Returns whether any is open. */
HS_ALWAYS_INLINE bool
test_tile(const listed *of, int32_t n, const int ndim, float *HS_RESTRICT s,
          int32_t *HS_RESTRICT near)
{
    const int64_t  stride = hs_slab_stride(ndim);
    const float   *y = of->y;
    const int32_t *j = of->j;
    float          centre[HS_MAX_DIM];
    int32_t        open = 0;
    for (int k = 0; k < ndim; k++) {
        centre[k] = of->centre[k];
    }
    for (int32_t e = 0; e < n; e++) {
        s[e] = square_of_pair(y + j[e] * stride, centre, ndim);
    }
    for (int32_t e = 0; e < n; e++) {
        near[e] = !(s[e] > of->limit.out);
        open |= near[e] & !(s[e] < of->limit.in);
    }
    return open != 0;
}

/* Packs the hits of a tile. Returns how many there are. */
HS_ALWAYS_INLINE int32_t
pack_tile(const listed *of, int32_t n, const int stride, const bool numbers,
          const int32_t *HS_RESTRICT near, int32_t *HS_RESTRICT hits)
{
    int32_t at = 0;
    for (int32_t e = 0; e < n; e++) {
        hits[at] = numbers ? number_of(of->y + (int64_t)of->j[e] * stride, stride) : of->j[e];
        at += near[e];
    }
    return at;
}

HS_ALWAYS_INLINE void
recheck_bundles(hs_slab *slab, const int ndim, const bool numbers)
{
    const int stride = hs_slab_stride(ndim);
    listed    of = {.y = slab->y, .limit = slab->limit};
    int32_t   at = 0, t = 0;
    slab->n_open = 0;
    for (int64_t e = slab->first; e < slab->end; t++) {
        const hs_bundle *bundle = &slab->bundles[t];
        const int64_t    end = bundle->end < slab->end ? bundle->end : slab->end;
        set_centre(slab, bundle, ndim, of.centre);
        while (e < end) {
            const int32_t n = (int32_t)(end - e < TILE ? end - e : TILE);
            const int32_t pair = (int32_t)(e - slab->first);
            float         s[TILE];
            int32_t       near[TILE];
            of.j = slab->j + e;
            if (test_tile(&of, n, ndim, s, near)) {
                for (int32_t o = 0, before = at; o < n; before += near[o], o++) {
                    if (near[o] && !(s[o] < slab->limit.in)) {
                        slab->open[slab->n_open++] = (hs_open_pair){t, pair + o, before};
                    }
                }
            }
            at += pack_tile(&of, n, stride, numbers, near, slab->hits + at);
            e += n;
        }
        slab->hits_end[t] = at;
        if (numbers) {
            slab->point[t] = number_of(slab->y + (int64_t)bundle->point * stride, stride);
        }
    }
    slab->n_bundles = t;
    slab->n_hits = at;
}

void
hs_recheck_scalar(hs_slab *slab)
{
    const int  d = slab->ndim;
    const bool numbers = slab->numbers && hs_slab_has_numbers(d);
    if (d == 2) {
        numbers ? recheck_bundles(slab, 2, true) : recheck_bundles(slab, 2, false);
    } else if (d == 3) {
        numbers ? recheck_bundles(slab, 3, true) : recheck_bundles(slab, 3, false);
    } else {
        recheck_bundles(slab, d, numbers);
    }
}
