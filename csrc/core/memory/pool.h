/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_MEMORY_POOL_H
#define HS_MEMORY_POOL_H

#include "../base/base.h"

/*
 * pool.h: memory that outlives a call: reserved pages or malloc, in chunks that can grow, which a
 * pool recycles for later results.
 */

/*
 * Large blocks straight from the operating system. They are given back the moment they
 * are freed, which malloc does not promise, and on Linux they can have huge pages, which fill
 * several times faster than small ones.
 */

/* Blocks from here on are worth pages of their own: the size of a huge page. */
#define HS_PAGES_FROM ((size_t)2 << 20)

/* Address space is given back in steps of this: a multiple of the page size of every Linux. */
#define HS_PAGES_STEP ((size_t)65536)

/*
 * Room for `bytes` bytes, zeroed, aligned to a huge page, with at least HS_PAGES_HEADROOM writable
 * bytes in front of it. *mapping and *length are for hs_pages_free. NULL when refused, and always
 * where the system cannot do this: then use malloc.
 */
#define HS_PAGES_HEADROOM 64
void *hs_pages_alloc(size_t bytes, void **mapping, size_t *length);
void  hs_pages_free(void *mapping, size_t length);

/* Room as from hs_pages_alloc, but as a reservation: address space that costs nothing until it is
 * written, in small pages unless advised. Between the mapping and the block lie exactly
 * HS_PAGES_STEP bytes. */
void *hs_pages_reserve(size_t bytes, void **mapping, size_t *length);

/* Requests huge pages, or small ones, for what is written from now on in [from, to); the system
 * need not comply. */
void hs_pages_advise(void *from, void *to, bool huge);

/* Whether a mapping can move to where there is more room. ThreadSanitizer does not see mremap:
 * where one moved away, it would take another thread's next one for a race with what lay there. */
#if !defined(__linux__) || HS_WATCHED_MALLOC || defined(__SANITIZE_THREAD__)
#define HS_MAPPINGS_MOVE 0
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define HS_MAPPINGS_MOVE 0
#endif
#endif
#if !defined(HS_MAPPINGS_MOVE)
#define HS_MAPPINGS_MOVE 1
#endif

/* The reservation with room for `bytes` bytes, more than before, contents kept, all of it advised
 * for small pages; returns the block, which may have moved off its alignment. NULL when refused:
 * all is as before, but for the advice. */
void *hs_pages_grow(size_t bytes, void **mapping, size_t *length);

/* [from, to) is the end of a huge page and will be cut off: breaks the page up, so that this part
 * is free at once. Else Linux keeps it until memory is short. Takes a third of a ms. */
void hs_pages_tear(void *from, void *to);

/* Gives [from, to) back; both are multiples of HS_PAGES_STEP from the mapping. False: the range
 * is still mapped, but empty. */
bool hs_pages_cut(void *from, void *to);
/* Gives back what lies behind the first `bytes` bytes of the block. Returns the new length. */
size_t hs_pages_trim(void *mapping, size_t length, void *block, size_t bytes);

/*
 * One chunk of memory that can grow, shrink and be told how far it will be filled. Large
 * ones are reservations of pages where there are such, the others come from malloc. Only
 * results.c, pool.c and memory.c use chunks directly.
 *
 * A chunk is known by its data pointer: 64-byte aligned, with this header right in front of it.
 */

typedef struct hs_chunk {
    void  *raw;      /* the mapping, or what malloc returned */
    size_t length;   /* of the mapping; 0 for malloc */
    size_t lead;     /* bytes before the data, for malloc */
    size_t capacity; /* bytes of data that may be written */
    size_t touched;  /* bytes of data that are taken to be resident */
    size_t huge;     /* bytes of data advised for huge pages; small ones follow */
    bool   is_arena; /* of a call that has ended (memory.h): no result takes it */
} hs_chunk;

/* The header of a chunk. */
hs_chunk *hs_chunk_of(void *data);

/* Room for `bytes` bytes, not zeroed, unadvised. NULL when refused. */
void *hs_chunk_new(size_t bytes);
void  hs_chunk_free(void *data);

/* Room for `bytes` bytes, more than before, the first `used` of them kept. May move; NULL when
 * refused: the chunk stays as it was. */
void *hs_chunk_grow(void *data, size_t bytes, size_t used);

/* About `bytes` bytes will be written: huge pages for the whole ones of them, small ones beyond. */
void hs_chunk_expect(void *data, size_t bytes);

/* The first `used` bytes have been written. */
void hs_chunk_touch(void *data, size_t used);

/*
 * Gives back what lies beyond `bytes`, if that is much; may move. *rest, if not NULL: what was
 * touched beyond, if that is large enough for a chunk of its own, else NULL.
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
 * A chunk for a request of `expected` bytes, with recycled memory in it; owned by the
 * caller. It may have less room than that if it can be grown. NULL: there is none.
 */
void *hs_pool_take(size_t expected);

/* A chunk that is an arena; owned by the caller. NULL: there is none. */
void *hs_pool_take_arena(void);

/* Keeps a chunk; the least recently kept ones make room. False: the caller still owns it. */
bool hs_pool_give(void *data);

#ifdef HS_TESTING
/* Takes the lock for good, or frees it. */
void hs_test_pool_hold(bool hold);
#endif

#endif
