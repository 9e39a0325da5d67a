/* SPDX-License-Identifier: BSD-3-Clause */
#if defined(__linux__)
#define _GNU_SOURCE /* madvise, mremap, MAP_ANONYMOUS */
#endif
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "pool.h"
#include "../../halfshell.h"
#include "../base/os_thread.h"

#include <stdlib.h>
#include <string.h>

/* pool.c: pages from Linux, chunks of these or of malloc, and the pool: an array of chunks, oldest
 * first. Chunks are freed after the lock is released, because freeing is a system call. */

/* Mmap, mremap and madvise of Linux. Elsewhere, and under AddressSanitizer, which watches
 * malloc, every request is refused. */

#if defined(__linux__) && !HS_WATCHED_MALLOC

#include <sys/mman.h>

static size_t
round_up_pages(size_t bytes)
{
    return (bytes + HS_PAGES_STEP - 1) / HS_PAGES_STEP * HS_PAGES_STEP;
}

/* A mapping of HS_PAGES_STEP bytes and then the block, which starts at a huge-page boundary. */
static void *
map_aligned(size_t bytes, int flags, void **mapping, size_t *length)
{
    if (bytes > PTRDIFF_MAX - HS_PAGES_FROM - 2 * HS_PAGES_STEP) {
        return NULL;
    }
    const size_t rounded = round_up_pages(bytes);
    const size_t reserved = rounded + HS_PAGES_FROM + HS_PAGES_STEP;
    char        *start =
        mmap(NULL, reserved, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | flags, -1, 0);
    if (start == MAP_FAILED) {
        return NULL;
    }
    /* The first huge-page boundary that leaves a step for the headroom; the rest goes back. */
    const uintptr_t boundary =
        ((uintptr_t)start + HS_PAGES_STEP + HS_PAGES_FROM - 1) / HS_PAGES_FROM * HS_PAGES_FROM;
    char        *block = (char *)boundary;
    char        *first = block - HS_PAGES_STEP;
    const size_t before = (size_t)(first - start); /* less than a huge page: the rest lies behind */
    if (before > 0) {
        munmap(start, before);
    }
    munmap(block + rounded, HS_PAGES_FROM - before);
    *mapping = first;
    *length = HS_PAGES_STEP + rounded;
    return block;
}

void *
hs_pages_alloc(size_t bytes, void **mapping, size_t *length)
{
    /* A tail of a quarter and more becomes a whole huge page: quicker to fill than small ones. */
    const size_t tail = bytes % HS_PAGES_FROM;
    if (tail >= HS_PAGES_FROM / 4 && bytes <= PTRDIFF_MAX / 2) {
        bytes += HS_PAGES_FROM - tail;
    }
    char *block = map_aligned(bytes, 0, mapping, length);
    if (block != NULL) {
        hs_pages_advise(block, block + round_up_pages(bytes), true);
    }
    return block;
}

void
hs_pages_free(void *mapping, size_t length)
{
    munmap(mapping, length);
}

void *
hs_pages_reserve(size_t bytes, void **mapping, size_t *length)
{
    char *block = map_aligned(bytes, MAP_NORESERVE, mapping, length);
    if (block != NULL) {
        /* The first touch comes before the first advice, which splits the mapping in two:
         * the parts then share what Linux knows about their pages, and hs_pages_grow can
         * make them one again. */
        *(volatile char *)(block - 1) = 0;
        hs_pages_advise(*mapping, block + round_up_pages(bytes), false);
    }
    return block;
}

void
hs_pages_advise(void *from, void *to, bool huge)
{
#if defined(MADV_HUGEPAGE) && defined(MADV_NOHUGEPAGE)
    if (from < to) {
        (void)madvise(from, (size_t)((char *)to - (char *)from),
                      huge ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
    }
#else
    (void)from;
    (void)to;
    (void)huge;
#endif
}

void *
hs_pages_grow(size_t bytes, void **mapping, size_t *length)
{
    if (bytes > PTRDIFF_MAX - HS_PAGES_FROM - 2 * HS_PAGES_STEP) {
        return NULL;
    }
    const size_t wanted = HS_PAGES_STEP + round_up_pages(bytes);
    hs_pages_advise(*mapping, (char *)*mapping + *length, false); /* mremap takes one part only */
    char *moved = mremap(*mapping, *length, wanted, 0);
    if (moved == MAP_FAILED && HS_MAPPINGS_MOVE) {
        void  *target;
        size_t target_length;
        if (map_aligned(bytes, MAP_NORESERVE, &target, &target_length) != NULL) {
            /* Aligned like the old place, so that page tables move 2 MB at a time. If this fails
             * the target may be gone and its addresses taken by others: it is left alone. */
            moved = mremap(*mapping, *length, wanted, MREMAP_MAYMOVE | MREMAP_FIXED, target);
        } else {
            moved = mremap(*mapping, *length, wanted, MREMAP_MAYMOVE);
        }
    }
    if (moved == MAP_FAILED) {
        return NULL;
    }
    *mapping = moved;
    *length = wanted;
    return moved + HS_PAGES_STEP;
}

void
hs_pages_tear(void *from, void *to)
{
#if defined(MADV_FREE)
    /* Freeing lazily makes Linux split a huge page at once; the cut frees it. */
    (void)madvise(from, (size_t)((char *)to - (char *)from), MADV_FREE);
#else
    (void)from;
    (void)to;
#endif
}

bool
hs_pages_cut(void *from, void *to)
{
    const size_t bytes = (size_t)((char *)to - (char *)from);
    if (bytes == 0 || munmap(from, bytes) == 0) {
        return true;
    }
    (void)madvise(from, bytes, MADV_DONTNEED); /* too many mappings in this process */
    return false;
}

size_t
hs_pages_trim(void *mapping, size_t length, void *block, size_t bytes)
{
    const size_t before = (size_t)((char *)block - (char *)mapping);
    const size_t kept = before + round_up_pages(bytes);
    if (kept >= length || munmap((char *)mapping + kept, length - kept) != 0) {
        return length;
    }
    return kept;
}

#else

void *
hs_pages_alloc(size_t bytes, void **mapping, size_t *length)
{
    (void)bytes;
    (void)mapping;
    (void)length;
    return NULL;
}

void
hs_pages_free(void *mapping, size_t length)
{
    (void)mapping;
    (void)length;
}

void *
hs_pages_reserve(size_t bytes, void **mapping, size_t *length)
{
    return hs_pages_alloc(bytes, mapping, length);
}

void
hs_pages_advise(void *from, void *to, bool huge)
{
    (void)from;
    (void)to;
    (void)huge;
}

void *
hs_pages_grow(size_t bytes, void **mapping, size_t *length)
{
    return hs_pages_alloc(bytes, mapping, length);
}

void
hs_pages_tear(void *from, void *to)
{
    (void)from;
    (void)to;
}

bool
hs_pages_cut(void *from, void *to)
{
    (void)from;
    (void)to;
    return false;
}

size_t
hs_pages_trim(void *mapping, size_t length, void *block, size_t bytes)
{
    (void)mapping;
    (void)block;
    (void)bytes;
    return length;
}

#endif

/* Small chunks come from malloc, large ones are pages. A small one that grows large is
 * copied from the first to the second. */

_Static_assert(sizeof(hs_chunk) <= HS_PAGES_HEADROOM, "the header lies in the headroom");
_Static_assert(sizeof(hs_chunk) <= HS_ALIGNMENT, "and in front of an aligned chunk");

/* malloc's memory: the header, up to one alignment of padding, the data. */
#define OVERHEAD (sizeof(hs_chunk) + HS_ALIGNMENT)

hs_chunk *
hs_chunk_of(void *data)
{
    return (hs_chunk *)data - 1;
}

/* What malloc gave is not shrunk by less than this part of it: lists are a little shorter than was
 * foreseen, and a chunk that was cut has no room for the next such list. */
#define WORTH_CUTTING 8

static uintptr_t
round_up_chunk(uintptr_t address, size_t multiple)
{
    return (address + multiple - 1) / multiple * multiple;
}

/* How far behind the start of what malloc returned the data lie. */
static size_t
lead_of(const void *raw)
{
    const uintptr_t address = (uintptr_t)raw;
    return (size_t)(round_up_chunk(address + sizeof(hs_chunk), HS_ALIGNMENT) - address);
}

/* A chunk of `bytes` bytes in what malloc returned: its data. No part of it can be given back, so
 * all of it counts as touched. */
static void *
place(void *raw, size_t bytes)
{
    const size_t lead = lead_of(raw);
    void        *data = (char *)raw + lead;
    *hs_chunk_of(data) = (hs_chunk){.raw = raw, .lead = lead, .capacity = bytes, .touched = bytes};
    return data;
}

static void *
new_in_pages(size_t bytes)
{
    void  *raw;
    size_t length;
    char  *data = hs_pages_reserve(bytes, &raw, &length);
    if (data != NULL) {
        const size_t capacity = length - (size_t)(data - (char *)raw);
        *hs_chunk_of(data) = (hs_chunk){.raw = raw, .length = length, .capacity = capacity};
    }
    return data;
}

void *
hs_chunk_new(size_t bytes)
{
    if (bytes > PTRDIFF_MAX / 2) {
        return NULL;
    }
    void *data = bytes >= HS_PAGES_FROM ? new_in_pages(bytes) : NULL;
    if (data != NULL) {
        return data;
    }
    void *raw = malloc(bytes + OVERHEAD);
    return raw != NULL ? place(raw, bytes) : NULL;
}

void
hs_chunk_free(void *data)
{
    const hs_chunk chunk = *hs_chunk_of(data);
    if (chunk.length > 0) {
        hs_pages_free(chunk.raw, chunk.length);
    } else {
        free(chunk.raw);
    }
}

static void *
grow_in_pages(void *data, size_t bytes)
{
    hs_chunk     chunk = *hs_chunk_of(data);
    const size_t huge = chunk.huge;
    char        *grown = hs_pages_grow(bytes, &chunk.raw, &chunk.length);
    if (grown == NULL) {
        hs_chunk_of(data)->huge = 0;
        hs_chunk_expect(data, huge);
        return NULL;
    }
    chunk.capacity = chunk.length - (size_t)(grown - (char *)chunk.raw);
    chunk.huge = 0;
    *hs_chunk_of(grown) = chunk;
    hs_chunk_expect(grown, huge);
    return grown;
}

/* A chunk from malloc with another size, the first `kept` bytes of it as they were. */
static void *
resize_in_malloc(void *data, size_t bytes, size_t kept)
{
    const size_t before = hs_chunk_of(data)->lead;
    char        *raw = realloc(hs_chunk_of(data)->raw, bytes + OVERHEAD);
    if (raw == NULL) {
        return NULL;
    }
    /* The data first: the header may come to lie where they are now. */
    if (lead_of(raw) != before) {
        memmove(raw + lead_of(raw), raw + before, kept);
    }
    return place(raw, bytes);
}

void *
hs_chunk_grow(void *data, size_t bytes, size_t used)
{
    const bool in_pages = hs_chunk_of(data)->length > 0;
    if (bytes > PTRDIFF_MAX / 2) {
        return NULL;
    }
    if (in_pages) {
        void *grown = grow_in_pages(data, bytes);
        if (grown != NULL) {
            return grown;
        }
    }
    if (in_pages || bytes >= HS_PAGES_FROM) {
        /* From malloc to pages; or Linux cannot move a mapping in one piece, as in a process forked
         * from the one that made it. */
        void *copy = new_in_pages(bytes);
        if (copy != NULL) {
            memcpy(copy, data, used);
            hs_chunk_touch(copy, used);
            hs_chunk_free(data);
            return copy;
        }
    }
    return in_pages ? NULL : resize_in_malloc(data, bytes, used);
}

void
hs_chunk_expect(void *data, size_t bytes)
{
    hs_chunk *chunk = hs_chunk_of(data);
    if (chunk->length == 0) {
        return;
    }
    if (bytes > chunk->capacity) {
        bytes = chunk->capacity;
    }
    char           *start = data;
    const uintptr_t first = round_up_chunk((uintptr_t)data, HS_PAGES_FROM);
    const uintptr_t end = ((uintptr_t)data + bytes) / HS_PAGES_FROM * HS_PAGES_FROM;
    const size_t    huge = end > first ? (size_t)(end - (uintptr_t)data) : 0;
    if (huge <= chunk->touched && chunk->huge <= chunk->touched) {
        return; /* all of that has its pages already */
    }
    if (huge > chunk->huge) {
        /* From the mapping on, so that Linux keeps two mappings and not three; what lies in front
         * of the first whole huge page stays small anyway. */
        hs_pages_advise(chunk->huge > 0 ? start + chunk->huge : chunk->raw, start + huge, true);
    } else if (huge < chunk->huge) {
        hs_pages_advise(huge > 0 ? start + huge : chunk->raw, start + chunk->huge, false);
    }
    chunk->huge = huge;
}

void
hs_chunk_touch(void *data, size_t used)
{
    hs_chunk *chunk = hs_chunk_of(data);
    size_t    touched = used;
    if (used > 0 && used < chunk->huge) { /* the last page is a huge one */
        touched = (size_t)(round_up_chunk((uintptr_t)data + used, HS_PAGES_FROM) - (uintptr_t)data);
    }
    if (touched > chunk->capacity) {
        touched = chunk->capacity;
    }
    if (touched > chunk->touched) {
        chunk->touched = touched;
    }
}

/* The part of a chunk from `from` on, a multiple of HS_PAGES_STEP from the mapping, becomes a
 * chunk of its own if what was touched of it deserves that. The rest of it is unmapped. */
static void *
split(void *data, char *from)
{
    hs_chunk *chunk = hs_chunk_of(data);
    char     *end = (char *)chunk->raw + chunk->length;
    char     *rest = (char *)round_up_chunk((uintptr_t)from + HS_PAGES_STEP, HS_PAGES_FROM);
    char     *raw = rest - HS_PAGES_STEP;
    if (rest >= end || (size_t)(rest - (char *)data) + HS_PAGES_FROM > chunk->touched ||
        !hs_pages_cut(from, raw)) {
        return NULL;
    }
    const size_t before = (size_t)(rest - (char *)data);
    *hs_chunk_of(rest) = (hs_chunk){
        .raw = raw,
        .length = (size_t)(end - raw),
        .capacity = (size_t)(end - rest),
        .touched = chunk->touched - before,
        .huge = chunk->huge > before ? chunk->huge - before : 0,
    };
    chunk->length = (size_t)(from - (char *)chunk->raw);
    return rest;
}

/* A cut through a huge page pins what is cut off until memory is short. That is left so where it
 * is little, against what is kept. */
static void
tear_at(char *data, char *from)
{
    const hs_chunk *chunk = hs_chunk_of(data);
    const size_t    kept = (size_t)(from - data);
    char           *end = (char *)round_up_chunk((uintptr_t)from, HS_PAGES_FROM);
    if (kept < chunk->huge && kept < chunk->touched && (size_t)(end - from) > kept / 8) {
        hs_pages_tear(from, end);
    }
}

static void
cut_in_pages(void *data, size_t bytes, void **rest)
{
    hs_chunk    *chunk = hs_chunk_of(data);
    const size_t head = (size_t)((char *)data - (char *)chunk->raw);
    char        *end = (char *)chunk->raw + chunk->length;
    char        *from = (char *)chunk->raw + round_up_chunk(head + bytes, HS_PAGES_STEP);
    if (from >= end) {
        return;
    }
    tear_at(data, from);
    if (rest != NULL) {
        *rest = split(data, from);
    }
    if ((rest == NULL || *rest == NULL) && hs_pages_cut(from, end)) {
        chunk->length = (size_t)(from - (char *)chunk->raw);
    }
    chunk->capacity = chunk->length - head;
    const size_t kept = (size_t)(from - (char *)data);
    chunk->touched = chunk->touched < kept ? chunk->touched : kept;
    chunk->huge = chunk->huge < chunk->capacity ? chunk->huge : chunk->capacity;
}

void *
hs_chunk_cut(void *data, size_t bytes, void **rest)
{
    hs_chunk *chunk = hs_chunk_of(data);
    if (rest != NULL) {
        *rest = NULL;
    }
    if (bytes >= chunk->capacity) {
        return data;
    }
    if (chunk->length > 0) {
        cut_in_pages(data, bytes, rest);
        return data;
    }
    if (chunk->capacity - bytes <= chunk->capacity / WORTH_CUTTING) {
        return data;
    }
    void *shrunk = resize_in_malloc(data, bytes, bytes);
    return shrunk != NULL ? shrunk : data;
}

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
