/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_MEMORY_RESULTS_H
#define HS_MEMORY_RESULTS_H

#include "../base/base.h"
#include "memory.h"

/*
 * results.h: memory of results: a chunk that is being written, cut to size at the end; and stores
 * that pass by the caches.
 */

/*
 * The memory that results are written to. A region is reserved for what is expected,
 * written from the front, grown if that was too little, and at the end either detached, with what
 * was not needed given back, or released. Memory that is no longer used goes to the pool (pool.h).
 *
 * Where the system can reserve pages (pool.h), the room beyond what is written costs nothing.
 *
 * Usage:
 *     hs_region region = {0};
 *     if (!hs_region_reserve(&region, expected)) { ... }
 *     ... write to region.data, keep region.used; hs_region_grow when capacity is reached ...
 *     array = hs_region_detach(&region, region.used);      (freed by hs_buffer_free)
 *     or hs_region_release(&region);
 */

/* Owned by one thread at a time. All zero: empty. */
typedef struct hs_region {
    char  *data;     /* 64-byte aligned, a large one to a huge page unless it grew; not zeroed */
    size_t capacity; /* bytes that may be written */
    size_t used;     /* bytes written so far, from the front. Kept up to date by the owner: growing
                        keeps these, releasing recycles these. The capacity is never passed. */
} hs_region;

/* An empty region gets at least `expected` writable bytes. False when refused: it is still empty,
 * and a smaller request may succeed. Implies hs_region_advise. */
bool hs_region_reserve(hs_region *region, size_t expected);

/* At least `bytes` writable bytes; the first `used` ones are kept but may move. False when
 * refused: the region is as before. Call hs_region_advise when all of it will be needed. */
bool hs_region_grow(hs_region *region, size_t bytes);

/* Advice: about this many bytes will have been written in the end. Huge pages for the whole 2 MB
 * parts of them and small pages beyond, so that no result pins up to 2 MB that it does not use:
 * rather a little too few than too many. Calling this with more later costs next to nothing.
 * It holds for pages that have not been written yet. */
void hs_region_advise(hs_region *region, size_t bytes);

/* Bytes from the front that are taken to be resident: what was recycled, or is known to be used. */
size_t hs_region_resident(const hs_region *region);

/* Gives room beyond the first `bytes` bytes, at least the used ones, back to the system where it
 * takes it. May move. */
void hs_region_shrink(hs_region *region, size_t bytes);

/* The first `bytes` bytes become the caller's, to be freed by hs_buffer_free; the rest is given
 * back. May move. The region is empty afterwards. NULL only if it was empty before. */
void *hs_region_detach(hs_region *region, size_t bytes);

/* NULL-safe; an empty region stays empty. */
void hs_region_release(hs_region *region);

/* What hs_region_detach returned; NULL-safe; from any thread. */
void hs_buffer_free(void *data);

/*
 * Stores past the caches, where the processor has them: for output that does not fit the
 * caches, and of which a store that misses them would first read what is there. Threads that share
 * one memory gain most: nothing is read, and half as much goes over its bus.
 */

#if defined(__SSE2__) || defined(_M_X64)
#include <emmintrin.h>
#define HS_HAS_BYPASS 1
#else
#define HS_HAS_BYPASS 0
#endif

/* Whole cache lines, to an aligned place. hs_bypass_end must follow. */
HS_ALWAYS_INLINE void
hs_bypass_lines(void *to, const void *from, size_t n_bytes)
{
#if HS_HAS_BYPASS
    for (size_t at = 0; at < n_bytes; at += sizeof(__m128i)) {
        _mm_stream_si128((void *)((char *)to + at),
                         _mm_loadu_si128((const void *)((const char *)from + at)));
    }
#else
    memcpy(to, from, n_bytes);
#endif
}

/* Other threads must not see later writes before those that went past the caches. */
HS_ALWAYS_INLINE void
hs_bypass_end(void)
{
#if HS_HAS_BYPASS
    _mm_sfence();
#endif
}

/* Any bytes: whole lines go past the caches, what is before and behind them does not.
 * hs_bypass_end must follow. */
HS_ALWAYS_INLINE void
hs_bypass_copy(void *to, const void *from, size_t n_bytes)
{
    const size_t before = (size_t)(-(uintptr_t)to & (HS_ALIGNMENT - 1));
    const size_t head = before < n_bytes ? before : n_bytes;
    const size_t lines = (n_bytes - head) / HS_ALIGNMENT * HS_ALIGNMENT;
    memcpy(to, from, head);
    hs_bypass_lines((char *)to + head, (const char *)from + head, lines);
    memcpy((char *)to + head + lines, (const char *)from + head + lines, n_bytes - head - lines);
}

#endif
