/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sift_template.h: the vector test of listed pairs, once for each instruction set. Include it after
 * a vocabulary (simd_<isa>.h), inside that instruction set's target region. Defines sift
 * (hs_sift_fn).
 *
 * LANES neighbours are loaded as one short vector each and transposed: instructions that gather
 * take one access for each number, this takes one for each point. What is read behind the end of a
 * bundle are neighbours of the next one, which are masked out.
 */

/* A list is too long for the caches, and one bundle too short for hardware to read ahead enough. */
#define NUMBERS_AHEAD 512

/* Notes the lanes of m. */
static HS_NO_INLINE void
note_open(hs_sift *sift, int32_t bundle, int32_t pair, unsigned near, unsigned m, int32_t at)
{
    for (; m != 0; m &= m - 1) {
        const unsigned below = (m & (0u - m)) - 1;
        sift->open[sift->n_open++] = (hs_open_pair){bundle, pair + (int32_t)popcount(below),
                                                    at + (int32_t)popcount(near & below)};
    }
}

/* q of a bundle. */
HS_ALWAYS_INLINE void
set_centre(const hs_sift *sift, const hs_bundle *bundle, const int ndim, const bool shifted,
           floats *centre)
{
    const int    stride = hs_sift_stride(ndim);
    const float *y = sift->y + (int64_t)bundle->point * stride;
    for (int k = 0; k < ndim; k++) {
        const float offset = shifted ? sift->offset[(int64_t)bundle->image * stride + k] : 0.0f;
        centre[k] = broadcast(shifted ? y[k] - offset : y[k]);
    }
}

/* The squares of LANES pairs from `e` on; what is in the last entries of their points to *last. */
HS_ALWAYS_INLINE floats
squares_of_pairs(const hs_sift *sift, int64_t e, const floats *centre, const int ndim, floats *last)
{
    const int stride = hs_sift_stride(ndim);
    floats    p[HS_MAX_DIM];
    for (int k = 0; k < stride; k += 4) {
        load_points(sift->y + k, stride, sift->j + e, p + k);
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
sift_bundles(hs_sift *sift, const int ndim, const bool shifted, const bool numbers)
{
    const floats in = broadcast(sift->limit.in), out = broadcast(sift->limit.out);
    const int    stride = hs_sift_stride(ndim);
    int32_t      at = 0, t = 0;
    sift->n_open = 0;
    for (int64_t e = sift->first; e < sift->end; t++) {
        const hs_bundle *bundle = &sift->bundles[t];
        const int64_t    end = bundle->end < sift->end ? bundle->end : sift->end;
        floats           centre[HS_MAX_DIM];
        set_centre(sift, bundle, ndim, shifted, centre);
        for (; e < end; e += LANES) {
            const int32_t pair = (int32_t)(e - sift->first);
            floats        last;
            HS_PREFETCH(sift->j + e + NUMBERS_AHEAD);
            const floats s = squares_of_pairs(sift, e, centre, ndim, &last);
            mask         near = not_greater(s, out);
            if (end - e < LANES) {
                near = (mask)(near & first_lanes((int32_t)(end - e)));
            }
            const mask maybe = and_not_less(near, s, in);
            if (HS_UNLIKELY(maybe != 0)) {
                note_open(sift, t, pair, near, maybe, at);
            }
            at +=
                append(sift->hits + at, numbers ? bits_of(last) : load_integers(sift->j + e), near);
        }
        e = end;
        sift->hits_end[t] = at;
        if (numbers) {
            memcpy(&sift->point[t], sift->y + (int64_t)bundle->point * stride + stride - 1,
                   sizeof(int32_t));
        }
    }
    sift->n_bundles = t;
    sift->n_hits = at;
}

HS_ALWAYS_INLINE void
sift_dimension(hs_sift *sift, const int ndim)
{
    if (sift->offset == NULL) {
        if (sift->numbers && hs_sift_has_numbers(ndim)) {
            sift_bundles(sift, ndim, false, true);
        } else {
            sift_bundles(sift, ndim, false, false);
        }
    } else if (sift->numbers && hs_sift_has_numbers(ndim)) {
        sift_bundles(sift, ndim, true, true);
    } else {
        sift_bundles(sift, ndim, true, false);
    }
}

static void
sift(hs_sift *sift)
{
    switch (sift->ndim) {
    case 1: sift_dimension(sift, 1); break;
    case 2: sift_dimension(sift, 2); break;
    case 3: sift_dimension(sift, 3); break;
    case 4: sift_dimension(sift, 4); break;
    case 5: sift_dimension(sift, 5); break;
    case 6: sift_dimension(sift, 6); break;
    case 7: sift_dimension(sift, 7); break;
    default: sift_dimension(sift, 8); break;
    }
}
