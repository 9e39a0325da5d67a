/* SPDX-License-Identifier: BSD-3-Clause */
/* morton.c: a slice is found by one division and one multiplication by a power of two. Rounding
 * keeps the order of numbers in both, so that a larger coordinate never has a lower slice. */
#include "morton.h"

#include <math.h>

uint64_t
hs_morton_slice(double x, double low, double high, int bits)
{
    double above = x - low, width = high - low;
    if (!(width <= 0x1.fffffffffffffp1023)) { /* the difference of two large numbers */
        above = 0.5 * x - 0.5 * low;
        width = 0.5 * high - 0.5 * low;
    }
    if (!(width > 0.0)) {
        return 0;
    }
    const double   slice = ldexp(above / width, bits); /* a quotient of at most 1 */
    const uint64_t last = (UINT64_C(1) << bits) - 1;
    return slice >= ldexp(1.0, bits) ? last : (uint64_t)slice;
}

uint64_t
hs_morton_interleave(const uint64_t *slices, int ndim)
{
    const int bits = hs_morton_bits(ndim);
    uint64_t  key = 0;
    for (int k = 0; k < ndim; k++) {
        for (int b = 0; b < bits; b++) {
            key |= (slices[k] >> b & 1u) << (b * ndim + k);
        }
    }
    return key;
}
