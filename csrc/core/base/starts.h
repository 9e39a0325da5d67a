/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * starts.h: where the parts of an array begin, of which first the lengths are counted: that of part
 * k in starts[k + 1], with 0 in front. Filling part k moves starts[k] to its end, which is where
 * part k + 1 began.
 */
#ifndef HS_STARTS_H
#define HS_STARTS_H

#include "base.h"

#include <string.h>

/* From lengths to beginnings; the last of the n numbers becomes the length of the array. n > 0. */
HS_ALWAYS_INLINE void
hs_starts_of_lengths(int64_t *starts, int64_t n)
{
    for (int64_t k = 1; k < n; k++) {
        starts[k] += starts[k - 1];
    }
}

/* From ends, once all parts are filled, back to beginnings. n > 0. */
HS_ALWAYS_INLINE void
hs_starts_of_ends(int64_t *starts, int64_t n)
{
    memmove(starts + 1, starts, (size_t)(n - 1) * sizeof *starts);
    starts[0] = 0;
}

#endif
