/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * scan_template.h: the vector scan, once for each instruction set. Include it after a vocabulary
 * (simd_<isa>.h), inside that instruction set's target region.
 *
 *   NAME      name of the scan that may fuse, an hs_scan_fn (kernel.h)
 *   UNFUSED   name of the scan that may not
 *
 * Each has one loop for every number of axes, made by inlining scan_loop with constants. The
 * vocabulary: floats, mask, LANES, broadcast, load, subtract, square, square_add, add,
 * not_greater, not_less, first_lanes, append. Undefines both parameters at its end.
 */
#if !defined(NAME) || !defined(UNFUSED)
#error "define NAME and UNFUSED before including scan_template.h"
#endif

HS_ALWAYS_INLINE int32_t
scan_loop(const hs_candidates *candidates, int32_t first, int32_t last, const float *q,
          hs_thresholds thresholds, const int ndim, const bool fused, int32_t *hits,
          bool *ambiguous)
{
    const floats   out = broadcast(thresholds.out);
    const floats   in = broadcast(thresholds.in);
    const int32_t *label = candidates->label;
    const float   *y[HS_MAX_DIM];
    floats         centre[HS_MAX_DIM];
    mask           unsure = 0;
    int32_t       *hit = hits;
    for (int k = 0; k < ndim; k++) {
        y[k] = candidates->y[k];
        centre[k] = broadcast(q[k]);
    }
    for (int32_t c = first; c < last; c += LANES) {
        floats along = subtract(load(y[0] + c), centre[0]);
        floats s = square(along);
        for (int k = 1; k < ndim; k++) {
            along = subtract(load(y[k] + c), centre[k]);
            s = fused ? square_add(along, s) : add(s, square(along));
        }
        mask near = not_greater(s, out);
        if (HS_UNLIKELY(last - c < LANES)) {
            near &= first_lanes(last - c);
        }
        unsure |= near & not_less(s, in);
        hit += append(hit, label + c, near);
    }
    *ambiguous = *ambiguous || unsure != 0;
    return (int32_t)(hit - hits);
}

#define SCAN(ndim, fused) \
    scan_loop(candidates, first, last, q, thresholds, ndim, fused, hits, ambiguous)

int32_t
NAME(const hs_candidates *candidates, int32_t first, int32_t last, const float *q,
     hs_thresholds thresholds, int ndim, int32_t *hits, bool *ambiguous)
{
    switch (ndim) {
    case 1: return SCAN(1, true);
    case 2: return SCAN(2, true);
    case 3: return SCAN(3, true);
    default: return SCAN(ndim, true);
    }
}

int32_t
UNFUSED(const hs_candidates *candidates, int32_t first, int32_t last, const float *q,
        hs_thresholds thresholds, int ndim, int32_t *hits, bool *ambiguous)
{
    switch (ndim) {
    case 1: return SCAN(1, false);
    case 2: return SCAN(2, false);
    case 3: return SCAN(3, false);
    default: return SCAN(ndim, false);
    }
}

#undef SCAN
#undef NAME
#undef UNFUSED
