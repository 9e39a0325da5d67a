/* SPDX-License-Identifier: BSD-3-Clause */
/* guard.h: in tests, bytes behind each small block that must stay as they are, and new blocks that
 * are not zero by chance. Sanitizers that watch malloc see more than that: then there is none. */
#ifndef HS_GUARD_H
#define HS_GUARD_H

#include "../base/base.h"

#if defined(HS_TESTING) && !HS_WATCHED_MALLOC

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define HS_GUARD_BYTES 64

enum { HS_GUARD = 0x5a, HS_NEW = 0x7f }; /* as floats and integers, large numbers */

/* What a new block has, and the guard behind it. */
static inline void
hs_guard_new(void *block, size_t bytes)
{
    memset(block, HS_NEW, bytes);
    memset((char *)block + bytes, HS_GUARD, HS_GUARD_BYTES);
}

/* Ends the program if the guard was written to. */
static inline void
hs_guard_check(const void *block, size_t bytes)
{
    const unsigned char *guard = (const unsigned char *)block + bytes;
    for (int b = 0; b < HS_GUARD_BYTES; b++) {
        if (guard[b] != HS_GUARD) {
            fprintf(stderr, "byte %d behind a block of %zu was written to\n", b, bytes);
            abort();
        }
    }
}

#else

#define HS_GUARD_BYTES 0

static inline void
hs_guard_new(void *block, size_t bytes)
{
    (void)block;
    (void)bytes;
}

static inline void
hs_guard_check(const void *block, size_t bytes)
{
    (void)block;
    (void)bytes;
}

#endif

#endif
