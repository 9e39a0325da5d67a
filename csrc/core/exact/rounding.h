/* SPDX-License-Identifier: BSD-3-Clause */
/* rounding.h: the floats next to a float, for bounds that must not be rounded the wrong way. */
#ifndef HS_ROUNDING_H
#define HS_ROUNDING_H

#include <string.h>

#include "../base/base.h"

/* The next double above x >= 0; infinity stays. Not below what x was rounded from. */
HS_ALWAYS_INLINE double
hs_next_up(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits += x <= 0x1.fffffffffffffp1023; /* not for infinity and NaN */
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* The next double below x > 0; 0 and infinity stay. Not above what x was rounded from. */
HS_ALWAYS_INLINE double
hs_next_down(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits -= x > 0.0 && x <= 0x1.fffffffffffffp1023;
    memcpy(&x, &bits, sizeof x);
    return x;
}

#endif
