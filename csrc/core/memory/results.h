/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_MEMORY_RESULTS_H
#define HS_MEMORY_RESULTS_H

#include "../base/base.h"

/*
 * results.h: memory that outlives a call: results as they are written, the chunks that they and
 * large scratch blocks are made of, the pool that recycles these, and stores past the caches.
 */

/*
 * One chunk of memory that can grow, shrink and be told how far it will be filled. From
 * HS_PAGES_FROM on it is a reservation of pages where the system has such: address space that costs
 * nothing until it is written, that is given back the moment it is freed, which malloc does not
 * promise, and that on Linux can have huge pages, which fill several times faster than small ones.
 * All others come from malloc. Only results.c and memory.c use chunks directly.
 *
 * A chunk is known by its data pointer: 64-byte aligned, in pages to a huge page unless it grew,
 * with this header right in front of it.
 */

/* Chunks from here on are worth pages of their own: the size of a huge page. */
#define HS_PAGES_FROM ((size_t)2 << 20)

typedef struct hs_chunk {
    void   *raw;      /* the mapping, or what malloc returned */
    size_t  length;   /* of the mapping; 0 for malloc */
    size_t  capacity; /* bytes of data that may be written */
    size_t  touched;  /* bytes of data that are taken to be resident */
    size_t  huge;     /* bytes of data advised for huge pages; small ones follow */
    int64_t bytes;    /* of a scratch block: what was wanted (memory.h) */
    bool    is_arena; /* of a call that has ended (memory.h): no result takes it */
} hs_chunk;

/* The header of a chunk. */
HS_ALWAYS_INLINE hs_chunk *
hs_chunk_of(void *data)
{
    return (hs_chunk *)data - 1;
}

/* Room for `bytes` bytes, not zeroed, unadvised. NULL when refused. */
void *hs_chunk_new(size_t bytes);
void  hs_chunk_free(void *data);

/* About `bytes` bytes will be written: huge pages for the whole ones of them, small ones beyond. */
void hs_chunk_expect(void *data, size_t bytes);

/*
 * Gives back what lies beyond `bytes`, but for an eighth of them in a chunk from malloc, which may
 * move. *rest, if not NULL: what was touched beyond, if that is large enough for a chunk of its
 * own, else NULL.
 */
void *hs_chunk_cut(void *data, size_t bytes, void **rest);

/*
 * The pool: memory of results that are gone, kept for the next ones, and that in which calls have
 * worked (memory.h): writing to memory that the process already has is several times faster than
 * writing to new pages.
 *
 * This is the one exception to the rule that nothing here keeps state between calls (halfshell.h).
 * No answer depends on it. It is bounded by a limit that the caller can set, 0 switches it off, and
 * hs_pool_clear gives everything back.
 *
 * All functions may be called from many threads at once and after fork. The pool is guarded by a
 * lock that no thread waits for. A thread that finds it taken does without the pool: it takes new
 * memory, and gives old memory straight back to the system. Only the four functions of halfshell.h
 * try again for a quarter of a second; where the lock does not come free they do nothing and return
 * 0. Where another thread had the lock at the moment of a fork, the child's pool is empty at first.
 */

#define HS_POOL_LIMIT ((size_t)512 << 20) /* bytes kept, unless set: 3e7 pairs as int64 */

/* Requests up to this size are scratch: copied and given back at once. Any chunk may serve them,
 * and no chunk is made smaller, so that the second one of them finds what the first one left. */
#define HS_POOL_SCRATCH ((size_t)1 << 20)

enum { HS_POOL_CHUNKS = 16 }; /* chunks kept; few, since all are looked at for each request */

/*
 * A chunk for a request of `expected` bytes, with recycled memory in it, or one that is an arena;
 * owned by the caller. It may have less room than that if it can be grown. NULL: there is none.
 */
void *hs_pool_take(size_t expected, bool is_arena);

/* Keeps a chunk; the least recently kept ones make room. False: the caller still owns it. */
bool hs_pool_give(void *data);

#ifdef HS_TESTING
/* Takes the lock for good, or frees it. */
void hs_test_pool_hold(bool hold);
#endif

/*
 * The memory that results are written to. A region is reserved for what is expected, written from
 * the front, grown if that was too little, and at the end either detached, with what was not needed
 * given back, or released. Memory that is no longer used goes to the pool.
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
 * Stores past the caches, where the processor has them: for output that does not fit the caches,
 * and of which a store that misses them would first read what is there. Threads that share one
 * memory gain most: nothing is read, and half as much goes over its bus. With two threads, lists of
 * 1e7 pairs take 0.90 of the time, and full rows of as many 0.89.
 */

#if defined(__SSE2__) || defined(_M_X64)
#include <emmintrin.h>
#define HS_HAS_BYPASS 1
#else
#define HS_HAS_BYPASS 0
#endif

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
#if HS_HAS_BYPASS
    for (size_t at = head; at < head + lines; at += sizeof(__m128i)) {
        _mm_stream_si128((void *)((char *)to + at),
                         _mm_loadu_si128((const void *)((const char *)from + at)));
    }
#else
    memcpy((char *)to + head, (const char *)from + head, lines);
#endif
    memcpy((char *)to + head + lines, (const char *)from + head + lines, n_bytes - head - lines);
}

#endif
