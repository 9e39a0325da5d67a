/* SPDX-License-Identifier: BSD-3-Clause */
/* pool.c: an array of chunks, oldest first. Chunks are freed after the lock is released, because
 * freeing is a system call. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "pool.h"

#include "../../halfshell.h"
#include "../base/os_thread.h"
#include "chunk.h"

#include <string.h>

static struct {
    size_t limit, held;
    int    n;
    void  *data[HS_POOL_CHUNKS]; /* oldest first */
} pool = {.limit = HS_POOL_LIMIT};

static volatile int64_t lock; /* 0: free; else a thread has it, after lock - 1 forks */

/* A thread that had the lock when this process was forked off left the pool in any state. */
static bool
try_lock(void)
{
    const int64_t was = hs_atomic_load(&lock), now = hs_atomic_load(&hs_n_forks) + 1;
    if (was == now || !hs_atomic_swap_if(&lock, was, now)) {
        return false;
    }
    if (was != 0) {
        pool.held = 0;
        pool.n = 0;
    }
    return true;
}

static void
unlock(void)
{
    hs_atomic_store(&lock, 0);
}

/* For work that should not be skipped. A thread holds the lock for some hundred instructions: it is
 * free again as soon as that thread has a processor. Naps bound the wait: a quarter of a second, or
 * up to four on Windows. Yields do not, since each may last a time slice of every busy thread. */
static bool
lock_patiently(void)
{
    enum { NAPS = 250 };
    bool has_lock = try_lock();
    for (int nap = 0; nap < NAPS && !has_lock; nap++) {
        hs_nap();
        has_lock = try_lock();
    }
    return has_lock;
}

#ifdef HS_TESTING
void
hs_test_pool_hold(bool hold)
{
    if (!hold) {
        unlock();
    } else {
        (void)lock_patiently();
    }
}
#endif

/* Takes entry k out. The lock is held. */
static void *
remove_entry(int k)
{
    void *data = pool.data[k];
    pool.held -= hs_chunk_of(data)->touched;
    pool.n--;
    memmove(&pool.data[k], &pool.data[k + 1], (size_t)(pool.n - k) * sizeof pool.data[0]);
    return data;
}

/* Takes the oldest entries out until `more` bytes in `chunks` more chunks fit. Returns how many;
 * the caller frees them. The lock is held. */
static int
remove_oldest(size_t more, int chunks, void **removed)
{
    int n = 0;
    while (pool.n > 0 && (pool.n + chunks > HS_POOL_CHUNKS || more > pool.limit ||
                          pool.held > pool.limit - more)) {
        removed[n++] = remove_entry(0);
    }
    return n;
}

static void
free_all(void **chunks, int n)
{
    for (int k = 0; k < n; k++) {
        hs_chunk_free(chunks[k]);
    }
}

size_t
hs_pool_limit(void)
{
    if (!lock_patiently()) {
        return 0;
    }
    const size_t limit = pool.limit;
    unlock();
    return limit;
}

size_t
hs_pool_held(void)
{
    if (!lock_patiently()) {
        return 0;
    }
    const size_t held = pool.held;
    unlock();
    return held;
}

void
hs_pool_set_limit(size_t bytes)
{
    void *removed[HS_POOL_CHUNKS];
    if (!lock_patiently()) {
        return;
    }
    pool.limit = bytes;
    /* Limit 0 is off: then not even a chunk without touched memory stays. */
    const int n = remove_oldest(bytes == 0 ? 1 : 0, 0, removed);
    unlock();
    free_all(removed, n);
}

void
hs_pool_clear(void)
{
    void *removed[HS_POOL_CHUNKS];
    if (!lock_patiently()) {
        return;
    }
    /* Room for as many chunks as there can be: those without touched memory go as well. */
    const int n = remove_oldest(0, HS_POOL_CHUNKS, removed);
    unlock();
    free_all(removed, n);
}

/*
 * Pages can be added to a chunk and given back from its end, so that any chunk in pages suits any
 * request. A chunk from malloc must have the room, and not twice what is wanted: it cannot be
 * shrunk for sure. For scratch, which is given back whole and at once, that does not matter.
 */
static bool
suits(const hs_chunk *chunk, size_t expected)
{
    return !chunk->is_arena && (chunk->length > 0 ||
                                (chunk->capacity >= expected &&
                                 (expected <= HS_POOL_SCRATCH || chunk->capacity / 2 <= expected)));
}

/* Bytes that a request would waste, or twice those that it would lack. Lists are expected to be a
 * little longer than they are, so the best chunk is the one that this list had before, and not the
 * next larger one, which another column had. */
static uint64_t
misfit(const hs_chunk *chunk, size_t expected)
{
    return chunk->touched >= expected ? chunk->touched - expected
                                      : (uint64_t)2 * (expected - chunk->touched);
}

void *
hs_pool_take(size_t expected)
{
    int      best = -1;
    uint64_t least = UINT64_MAX;
    if (!try_lock()) {
        return NULL;
    }
    for (int k = 0; k < pool.n; k++) {
        const hs_chunk *chunk = hs_chunk_of(pool.data[k]);
        const uint64_t  waste = misfit(chunk, expected);
        if (suits(chunk, expected) && waste < least) {
            best = k;
            least = waste;
        }
    }
    void *data = best >= 0 ? remove_entry(best) : NULL;
    unlock();
    return data;
}

void *
hs_pool_take_arena(void)
{
    void *data = NULL;
    if (!try_lock()) {
        return NULL;
    }
    for (int k = pool.n - 1; k >= 0 && data == NULL; k--) { /* the last one is still in caches */
        if (hs_chunk_of(pool.data[k])->is_arena) {
            data = remove_entry(k);
        }
    }
    unlock();
    return data;
}

bool
hs_pool_give(void *data)
{
    void        *removed[HS_POOL_CHUNKS];
    int          n = 0;
    const size_t touched = hs_chunk_of(data)->touched;
    if (HS_WATCHED_MALLOC || !try_lock()) { /* the sanitizer must see writes to freed memory */
        return false;
    }
    const bool keep = pool.limit > 0 && touched <= pool.limit;
    if (keep) {
        n = remove_oldest(touched, 1, removed);
        pool.data[pool.n++] = data;
        pool.held += touched;
    }
    unlock();
    free_all(removed, n);
    return keep;
}
