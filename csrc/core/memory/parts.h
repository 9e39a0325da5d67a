/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * parts.h: several arrays that live and die together, in one memory block: one allocation, one
 * failure, one release. Small searches take some thirty arrays, most of which are seldom used.
 */
#ifndef HS_PARTS_H
#define HS_PARTS_H

#include "account.h"

/* Arrays of one block: seven for each dimension and some more. */
#define HS_MOST_PARTS (7 * HS_MAX_DIM)

typedef struct hs_parts {
    size_t bytes; /* so far, whole cache lines */
    int    n;
    struct {
        void **to; /* where the array's address goes */
        size_t at;
    } part[HS_MOST_PARTS]; /* n are set */
} hs_parts;

HS_ALWAYS_INLINE void
hs_parts_begin(hs_parts *parts)
{
    parts->bytes = 0;
    parts->n = 0;
}

/* One more array, whose address hs_parts_alloc writes to *to. Counts are those of one walker, far
 * from what overflows. */
HS_ALWAYS_INLINE void
hs_parts_add(hs_parts *parts, void **to, int64_t count, size_t size)
{
    HS_ASSERT(count >= 0 && parts->n < HS_MOST_PARTS);
    parts->part[parts->n].to = to;
    parts->part[parts->n++].at = parts->bytes;
    parts->bytes += ((size_t)count * size + HS_ALIGNMENT - 1) & ~(size_t)(HS_ALIGNMENT - 1);
}

/* The memory block of all arrays, uninitialised, for hs_free. NULL when refused: then no address
 * has been written. */
void *hs_parts_alloc(hs_account *account, hs_purpose purpose, const hs_parts *parts);

#endif
