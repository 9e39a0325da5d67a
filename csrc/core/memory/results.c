/* SPDX-License-Identifier: BSD-3-Clause */
#include "results.h"
#include "pool.h"

/* results.c: each region is one chunk, taken from the pool if it has one and given back to it. */

/* Address space without memory that a chunk takes along to the pool, so that the next request needs
 * no system call. More would only use up address space. */
#define KEPT_SPARE ((size_t)64 << 20)

/* What a new chunk has at least, so that it serves other calls from the pool. Where a sanitizer
 * watches malloc, none goes there, and large ones would be mapped and marked anew for each call. */
#define LEAST_NEW (HS_WATCHED_MALLOC ? (size_t)1 << 16 : HS_POOL_SCRATCH)

static bool
allocation_fails(void)
{
#ifdef HS_TESTING
    return hs_test_allocation_fails();
#else
    return false;
#endif
}

static void
count_block(int change)
{
#ifdef HS_TESTING
    hs_test_count_block(change);
#else
    (void)change;
#endif
}

/* Gives a chunk to the pool, or else to the system. */
static void
give_back(void *data)
{
    const hs_chunk *chunk = hs_chunk_of(data);
    const size_t    spare = chunk->capacity - chunk->touched;
    if (chunk->length > 0 && spare > KEPT_SPARE) {
        (void)hs_chunk_cut(data, chunk->touched, NULL);
    }
    if (!hs_pool_give(data)) {
        hs_chunk_free(data);
    }
}

static void *
take_recycled(size_t expected)
{
    void *data = hs_pool_take(expected);
    if (data == NULL || hs_chunk_of(data)->capacity >= expected) {
        return data;
    }
    void *grown = hs_chunk_grow(data, expected, 0); /* in pages: chunks from malloc come with the
                                                     * room */
    if (grown == NULL) {
        hs_chunk_free(data);
    }
    return grown;
}

static void *
take_new(size_t expected)
{
    void *data = hs_chunk_new(expected > LEAST_NEW ? expected : LEAST_NEW);
    if (data == NULL) {
        data = hs_chunk_new(expected);
    }
    if (data == NULL) { /* what the pool holds may be what is missing */
        hs_pool_clear();
        data = hs_chunk_new(expected);
    }
    return data;
}

bool
hs_region_reserve(hs_region *region, size_t expected)
{
    HS_ASSERT(region->data == NULL);
    if (allocation_fails()) {
        return false;
    }
    void *data = take_recycled(expected);
    if (data == NULL) {
        data = take_new(expected);
    }
    if (data == NULL) {
        return false;
    }
    count_block(1);
    *region = (hs_region){.data = data, .capacity = hs_chunk_of(data)->capacity};
    hs_region_advise(region, expected);
    return true;
}

bool
hs_region_grow(hs_region *region, size_t bytes)
{
    HS_ASSERT(region->data != NULL && region->used <= region->capacity);
    if (bytes <= region->capacity) {
        return true;
    }
    if (allocation_fails()) {
        return false;
    }
    hs_chunk_touch(region->data, region->used);
    void *data = hs_chunk_grow(region->data, bytes, region->used);
    if (data == NULL) {
        hs_pool_clear();
        data = hs_chunk_grow(region->data, bytes, region->used);
    }
    if (data == NULL) {
        return false;
    }
    region->data = data;
    region->capacity = hs_chunk_of(data)->capacity;
    return true;
}

void
hs_region_advise(hs_region *region, size_t bytes)
{
    if (region->data != NULL) {
        hs_chunk_touch(region->data, region->used);
        hs_chunk_expect(region->data, bytes);
    }
}

size_t
hs_region_resident(const hs_region *region)
{
    return region->data != NULL ? hs_chunk_of(region->data)->touched : 0;
}

void
hs_region_shrink(hs_region *region, size_t bytes)
{
    HS_ASSERT(region->data != NULL && region->used <= bytes);
    hs_chunk_touch(region->data, region->used);
    region->data = hs_chunk_cut(region->data, bytes, NULL);
    region->capacity = hs_chunk_of(region->data)->capacity;
}

void *
hs_region_detach(hs_region *region, size_t bytes)
{
    if (region->data == NULL) {
        return NULL;
    }
    void *rest;
    HS_ASSERT(bytes <= region->capacity);
    hs_chunk_touch(region->data, region->used > bytes ? region->used : bytes);
    void *data = hs_chunk_cut(region->data, bytes, &rest);
    if (rest != NULL) {
        give_back(rest);
    }
    *region = (hs_region){0};
    return data;
}

void
hs_region_release(hs_region *region)
{
    if (region == NULL || region->data == NULL) {
        return;
    }
    count_block(-1);
    hs_chunk_touch(region->data, region->used);
    give_back(region->data);
    *region = (hs_region){0};
}

void
hs_buffer_free(void *data)
{
    if (data != NULL) {
        count_block(-1);
        give_back(data);
    }
}
