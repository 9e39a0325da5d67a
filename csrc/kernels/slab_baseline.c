/* SPDX-License-Identifier: BSD-3-Clause */
/* slab_baseline.c: the test of listed pairs in plain C, the specification of slab_template.h; and
 * for any CPU of the architecture: with vectors where it always has some that no other kernel uses,
 * else in plain C. */
#include "slab.h"

#include "../halfshell.h"
#include "target.h"

#include <string.h>

void
hs_recheck_scalar(hs_slab *slab)
{
    const int     stride = hs_slab_stride(slab->ndim);
    const bool    numbers = slab->numbers && hs_slab_has_numbers(slab->ndim);
    const int32_t last = stride - 1;
    int32_t       at = 0, t = 0;
    slab->n_open = 0;
    for (int64_t e = slab->first; e < slab->end; t++) {
        const hs_bundle *bundle = &slab->bundles[t];
        const int64_t    end = bundle->end < slab->end ? bundle->end : slab->end;
        const float     *own = slab->y + (int64_t)bundle->point * stride;
        const int64_t    image = (int64_t)bundle->image * stride;
        for (; e < end; e++) {
            const float *other = slab->y + (int64_t)slab->j[e] * stride;
            float        s = 0.0f;
            for (int k = 0; k < slab->ndim; k++) {
                const float q = slab->offset != NULL ? own[k] - slab->offset[image + k] : own[k];
                s += (other[k] - q) * (other[k] - q);
            }
            const bool near = !(s > slab->limit.out);
            if (near && !(s < slab->limit.in)) {
                slab->open[slab->n_open++] = (hs_open_pair){t, (int32_t)(e - slab->first), at};
            }
            memcpy(&slab->hits[at], numbers ? (const void *)(other + last) : &slab->j[e],
                   sizeof(int32_t));
            at += near;
        }
        slab->hits_end[t] = at;
        if (numbers) {
            memcpy(&slab->point[t], own + last, sizeof(int32_t));
        }
    }
    slab->n_bundles = t;
    slab->n_hits = at;
}

#if HS_X86_64
#include "simd_sse2.h"

#include "slab_template.h"

void
hs_recheck_baseline(hs_slab *slab)
{
    recheck_slab(slab);
}
#else
void
hs_recheck_baseline(hs_slab *slab)
{
    hs_recheck_scalar(slab);
}
#endif
