/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * slab_template.h: the vector test of listed pairs, once for each instruction set. Include it after
 * a vocabulary (simd_<isa>.h), inside that instruction set's target region. Defines slab
 * (hs_recheck_fn).
 *
 * LANES neighbours are loaded as one short vector each and transposed: instructions that gather
 * take one access for each number, this takes one for each point. What is read behind the end of a
 * bundle are neighbours of the next one, which are masked out.
 */

/* A list is too long for the caches, and one bundle too short for hardware to read ahead enough. */
#define NUMBERS_AHEAD 512

/* Notes the lanes of m. */
static HS_NO_INLINE void
note_open(hs_slab *slab, int32_t bundle, int32_t pair, unsigned near, unsigned m, int32_t at)
{
    for (; m != 0; m &= m - 1) {
        const unsigned below = (m & (0u - m)) - 1;
        slab->open[slab->n_open++] = (hs_open_pair){bundle, pair + (int32_t)popcount(below),
                                                    at + (int32_t)popcount(near & below)};
    }
}

/* The squares of LANES pairs from `e` on; what is in the last entries of their points to *last. */
HS_ALWAYS_INLINE floats
squares_of_pairs(const hs_slab *slab, int64_t e, const floats *centre, const int ndim, floats *last)
{
    const int stride = hs_slab_stride(ndim);
    floats    p[HS_MAX_DIM];
    for (int k = 0; k < stride; k += 4) {
        load_points(slab->y + k, stride, slab->j + e, p + k);
    }
    const floats along = subtract(p[0], centre[0]);
    floats       s = multiply(along, along);
    for (int k = 1; k < ndim; k++) {
        const floats other = subtract(p[k], centre[k]);
        s = multiply_add(other, other, s);
    }
    *last = p[stride - 1];
    return s;
}

HS_ALWAYS_INLINE void
recheck_bundles(hs_slab *slab, const int ndim, const bool shifted, const bool numbers)
{
    const floats in = broadcast(slab->limit.in), out = broadcast(slab->limit.out);
    const int    stride = hs_slab_stride(ndim);
    int32_t      at = 0, t = 0;
    slab->n_open = 0;
    for (int64_t e = slab->first; e < slab->end; t++) {
        const hs_bundle *bundle = &slab->bundles[t];
        const int64_t    end = bundle->end < slab->end ? bundle->end : slab->end;
        const float     *y = slab->y + (int64_t)bundle->point * stride;
        floats           centre[HS_MAX_DIM];
        for (int k = 0; k < ndim; k++) {
            const float offset = shifted ? slab->offset[(int64_t)bundle->image * stride + k] : 0.0f;
            centre[k] = broadcast(shifted ? y[k] - offset : y[k]);
        }
        for (; e < end; e += LANES) {
            const int32_t pair = (int32_t)(e - slab->first);
            floats        last;
            HS_PREFETCH(slab->j + e + NUMBERS_AHEAD);
            const floats s = squares_of_pairs(slab, e, centre, ndim, &last);
            mask         near = not_greater(s, out);
            if (end - e < LANES) {
                near = (mask)(near & first_lanes((int32_t)(end - e)));
            }
            const mask maybe = and_not_less(near, s, in);
            if (HS_UNLIKELY(maybe != 0)) {
                note_open(slab, t, pair, near, maybe, at);
            }
            at +=
                append(slab->hits + at, numbers ? bits_of(last) : load_integers(slab->j + e), near);
        }
        e = end;
        slab->hits_end[t] = at;
        if (numbers) {
            memcpy(&slab->point[t], y + stride - 1, sizeof(int32_t));
        }
    }
    slab->n_bundles = t;
    slab->n_hits = at;
}

HS_ALWAYS_INLINE void
recheck_dimension(hs_slab *slab, const int ndim)
{
    const bool shifted = slab->offset != NULL;
    const bool numbers = slab->numbers && hs_slab_has_numbers(ndim);
    if (shifted && numbers) {
        recheck_bundles(slab, ndim, true, true);
    } else if (shifted) {
        recheck_bundles(slab, ndim, true, false);
    } else if (numbers) {
        recheck_bundles(slab, ndim, false, true);
    } else {
        recheck_bundles(slab, ndim, false, false);
    }
}

static void
recheck_slab(hs_slab *slab)
{
    switch (slab->ndim) {
    case 1: recheck_dimension(slab, 1); break;
    case 2: recheck_dimension(slab, 2); break;
    case 3: recheck_dimension(slab, 3); break;
    case 4: recheck_dimension(slab, 4); break;
    case 5: recheck_dimension(slab, 5); break;
    case 6: recheck_dimension(slab, 6); break;
    case 7: recheck_dimension(slab, 7); break;
    default: recheck_dimension(slab, 8); break;
    }
}
