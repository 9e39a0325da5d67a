/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * pool.h: memory of results that are gone, kept for the next ones, and that in which calls have
 * worked (account.h): writing to memory that the process already has is several times faster than
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
#ifndef HS_POOL_H
#define HS_POOL_H

#include "../base/base.h"

#define HS_POOL_LIMIT ((size_t)512 << 20) /* bytes kept, unless set: 3e7 pairs as int64 */

/* Requests up to this size are scratch: copied and given back at once. Any chunk may serve them,
 * and no chunk is made smaller, so that the second one of them finds what the first one left. */
#define HS_POOL_SCRATCH ((size_t)1 << 20)

enum { HS_POOL_CHUNKS = 16 }; /* chunks kept; few, since all are looked at for each request */

/*
 * A chunk (chunk.h) for a request of `expected` bytes, with recycled memory in it; owned by the
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
