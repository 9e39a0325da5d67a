/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * region.h: the memory that results are written to. A region is reserved for what is expected,
 * written from the front, grown if that was too little, and at the end either detached, with what
 * was not needed given back, or released. Memory that is no longer used goes to the pool (pool.h).
 *
 * Where the system can reserve pages (pages.h), the room beyond what is written costs nothing.
 *
 * Usage:
 *     hs_region region = {0};
 *     if (!hs_region_reserve(&region, expected)) { ... }
 *     ... write to region.data, keep region.used; hs_region_grow when capacity is reached ...
 *     array = hs_region_detach(&region, region.used);      (freed by hs_buffer_free)
 *     or hs_region_release(&region);
 */
#ifndef HS_REGION_H
#define HS_REGION_H

#include "../base/base.h"

/* Owned by one thread at a time. All zero: empty. */
typedef struct hs_region {
    char  *data;     /* 64-byte aligned, a large one to a huge page unless it grew; not zeroed */
    size_t capacity; /* bytes that may be written */
    size_t used;     /* bytes written so far, from the front. Kept up to date by the owner: growing
                        keeps these, releasing recycles these. The capacity is never passed. */
} hs_region;

/* An empty region gets at least `expected` writable bytes. False when refused: it is still empty,
 * and a smaller request may succeed. Implies hs_region_expect. */
bool hs_region_reserve(hs_region *region, size_t expected);

/* At least `bytes` writable bytes; the first `used` ones are kept but may move. False when
 * refused: the region is as before. Call hs_region_expect when all of it will be needed. */
bool hs_region_grow(hs_region *region, size_t bytes);

/* Advice: about this many bytes will have been written in the end. Huge pages for the whole 2 MB
 * parts of them and small pages beyond, so that no result pins up to 2 MB that it does not use:
 * rather a little too few than too many. Calling this with more later costs next to nothing.
 * It holds for pages that have not been written yet. */
void hs_region_expect(hs_region *region, size_t bytes);

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

#endif
