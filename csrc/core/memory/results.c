/* SPDX-License-Identifier: BSD-3-Clause */
#if defined(__linux__)
#define _GNU_SOURCE /* madvise, mremap, MAP_ANONYMOUS */
#endif
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "results.h"
#include "memory.h"
#include "../base/os_thread.h"

#include <stdlib.h>

/* results.c: pages from Linux, chunks of these or of malloc, the pool, which is an array of chunks,
 * oldest first, and regions: each is one chunk, taken from the pool if it has one and given back to
 * it. */

/* Address space is given back in steps of this: a multiple of the page size of every Linux. */
#define PAGES_STEP ((size_t)65536)

/* What malloc gave keeps this part of its data as room behind them: lists are a little shorter than
 * was foreseen, and a chunk without it could not serve the next such list. */
#define SPARE_PART 8

/* malloc's memory: the header, up to one alignment of padding, the data. */
#define OVERHEAD (sizeof(hs_chunk) + HS_ALIGNMENT)

_Static_assert(sizeof(hs_chunk) <= HS_ALIGNMENT, "it lies in front of an aligned chunk");

static uintptr_t
round_up(uintptr_t address, size_t multiple)
{
    return (address + multiple - 1) / multiple * multiple;
}

/* Chunks in pages: mmap, mremap and madvise of Linux. Elsewhere, and under AddressSanitizer, which
 * watches malloc, there are none. */

#if defined(__linux__) && !HS_WATCHED_MALLOC

#include <sys/mman.h>

/* Whether a mapping can move to where there is more room. ThreadSanitizer does not see mremap:
 * where one moved away, it would take another thread's next one for a race with what lay there. */
#if defined(__SANITIZE_THREAD__)
#define MAPPINGS_MOVE 0
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define MAPPINGS_MOVE 0
#endif
#endif
#if !defined(MAPPINGS_MOVE)
#define MAPPINGS_MOVE 1
#endif

/* A mapping of exactly PAGES_STEP bytes and then the data, which start at a huge-page boundary. */
static char *
map_aligned(size_t bytes, void **mapping, size_t *length)
{
    if (bytes > PTRDIFF_MAX - HS_PAGES_FROM - 2 * PAGES_STEP) {
        return NULL;
    }
    const size_t rounded = round_up(bytes, PAGES_STEP);
    const size_t reserved = rounded + HS_PAGES_FROM + PAGES_STEP;
    char        *start = mmap(NULL, reserved, PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (start == MAP_FAILED) {
        return NULL;
    }
    /* The first huge-page boundary that leaves a step for the header; the rest goes back. */
    char        *data = (char *)round_up((uintptr_t)start + PAGES_STEP, HS_PAGES_FROM);
    char        *first = data - PAGES_STEP;
    const size_t before = (size_t)(first - start); /* less than a huge page: the rest lies behind */
    if (before > 0) {
        munmap(start, before);
    }
    munmap(data + rounded, HS_PAGES_FROM - before);
    *mapping = first;
    *length = PAGES_STEP + rounded;
    return data;
}

/* Requests huge pages, or small ones, for what is written from now on in [from, to); the system
 * need not comply. */
static void
advise(void *from, void *to, bool huge)
{
    (void)madvise(from, (size_t)((char *)to - (char *)from),
                  huge ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
}

/* Gives [from, to) back; both are multiples of PAGES_STEP from the mapping. False: the range is
 * still mapped, but empty. */
static bool
unmap(void *from, void *to)
{
    const size_t bytes = (size_t)((char *)to - (char *)from);
    if (munmap(from, bytes) == 0) {
        return true;
    }
    (void)madvise(from, bytes, MADV_DONTNEED); /* too many mappings in this process */
    return false;
}

static void *
new_in_pages(size_t bytes)
{
    void  *raw;
    size_t length;
    char  *data = map_aligned(bytes, &raw, &length);
    if (data != NULL) {
        /* The first touch comes before the first advice, which splits the mapping in two: the parts
         * then share what Linux knows about their pages, and grow_in_pages can make them one
         * again. */
        *hs_chunk_of(data) =
            (hs_chunk){.raw = raw, .length = length, .capacity = length - PAGES_STEP};
        advise(raw, (char *)raw + length, false);
    }
    return data;
}

static void
free_pages(const hs_chunk *chunk)
{
    munmap(chunk->raw, chunk->length);
}

/* The chunk with room for `bytes` bytes, more than before, contents kept; it may have moved off its
 * alignment. NULL when refused: it stays as it was. */
static void *
grow_in_pages(void *data, size_t bytes)
{
    hs_chunk     chunk = *hs_chunk_of(data);
    const size_t huge = chunk.huge, wanted = PAGES_STEP + round_up(bytes, PAGES_STEP);
    const size_t head = (size_t)((char *)data - (char *)chunk.raw);
    advise(chunk.raw, (char *)chunk.raw + chunk.length, false); /* mremap takes one part only */
    char *moved = mremap(chunk.raw, chunk.length, wanted, 0);
    if (moved == MAP_FAILED && MAPPINGS_MOVE) {
        void  *target;
        size_t length;
        if (map_aligned(bytes, &target, &length) != NULL) {
            /* Aligned like the old place, so that page tables move 2 MB at a time. If this fails
             * the target may be gone and its addresses taken by others: it is left alone. */
            moved = mremap(chunk.raw, chunk.length, wanted, MREMAP_MAYMOVE | MREMAP_FIXED, target);
        } else {
            moved = mremap(chunk.raw, chunk.length, wanted, MREMAP_MAYMOVE);
        }
    }
    const bool has_grown = moved != MAP_FAILED;
    if (has_grown) {
        chunk.raw = moved;
        chunk.length = wanted;
        chunk.capacity = wanted - head;
        data = moved + head;
    }
    chunk.huge = 0;
    *hs_chunk_of(data) = chunk;
    hs_chunk_expect(data, huge);
    return has_grown ? data : NULL;
}

static void
expect_in_pages(void *data, size_t bytes)
{
    hs_chunk       *chunk = hs_chunk_of(data);
    char           *start = data;
    const uintptr_t first = round_up((uintptr_t)data, HS_PAGES_FROM);
    const uintptr_t end = ((uintptr_t)data + (bytes < chunk->capacity ? bytes : chunk->capacity)) /
                          HS_PAGES_FROM * HS_PAGES_FROM;
    const size_t huge = end > first ? (size_t)(end - (uintptr_t)data) : 0;
    if (huge <= chunk->touched && chunk->huge <= chunk->touched) {
        return; /* all of that has its pages already */
    }
    if (huge > chunk->huge) {
        /* From the mapping on, so that Linux keeps two mappings and not three; what lies in front
         * of the first whole huge page stays small anyway. */
        advise(chunk->huge > 0 ? start + chunk->huge : chunk->raw, start + huge, true);
    } else if (huge < chunk->huge) {
        advise(huge > 0 ? start + huge : chunk->raw, start + chunk->huge, false);
    }
    chunk->huge = huge;
}

/* The part of a chunk from `from` on, a multiple of PAGES_STEP from the mapping, becomes a
 * chunk of its own if what was touched of it deserves that. The rest of it is unmapped. Calls whose
 * lists differ in length take 1.2 times as long without that. */
static void *
split(void *data, char *from)
{
    hs_chunk *chunk = hs_chunk_of(data);
    char     *end = (char *)chunk->raw + chunk->length;
    char     *rest = (char *)round_up((uintptr_t)from + PAGES_STEP, HS_PAGES_FROM);
    char     *raw = rest - PAGES_STEP;
    if (rest >= end || (size_t)(rest - (char *)data) + HS_PAGES_FROM > chunk->touched ||
        !unmap(from, raw)) {
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

static void
cut_in_pages(void *data, size_t bytes, void **rest)
{
    hs_chunk    *chunk = hs_chunk_of(data);
    const size_t head = (size_t)((char *)data - (char *)chunk->raw);
    char        *end = (char *)chunk->raw + chunk->length;
    char        *from = (char *)chunk->raw + round_up(head + bytes, PAGES_STEP);
    const size_t kept = (size_t)(from - (char *)data);
    if (from >= end) {
        return;
    }
#if defined(MADV_FREE)
    /* A cut through a huge page pins what is cut off until memory is short. That is left so where
     * it is little, against what is kept. Else freeing lazily makes Linux split the page at once,
     * which takes a third of a ms; the cut frees it. */
    char *whole = (char *)round_up((uintptr_t)from, HS_PAGES_FROM);
    if (kept < chunk->huge && kept < chunk->touched && (size_t)(whole - from) > kept / 8) {
        (void)madvise(from, (size_t)(whole - from), MADV_FREE);
    }
#endif
    if (rest != NULL) {
        *rest = split(data, from);
    }
    if ((rest == NULL || *rest == NULL) && unmap(from, end)) {
        chunk->length = (size_t)(from - (char *)chunk->raw);
    }
    chunk->capacity = chunk->length - head;
    chunk->touched = chunk->touched < kept ? chunk->touched : kept;
    chunk->huge = chunk->huge < chunk->capacity ? chunk->huge : chunk->capacity;
}

#else

#define new_in_pages(bytes)             NULL
#define free_pages(chunk)               ((void)(chunk))
#define grow_in_pages(data, bytes)      NULL
#define expect_in_pages(data, bytes)    ((void)(data), (void)(bytes))
#define cut_in_pages(data, bytes, rest) ((void)(data))

#endif

/* Small chunks come from malloc, large ones are pages. A small one that grows large is copied from
 * the first to the second. */

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
    if (raw != NULL) { /* no part of it can be given back: all of it counts as touched */
        data = (void *)round_up((uintptr_t)raw + sizeof(hs_chunk), HS_ALIGNMENT);
        *hs_chunk_of(data) = (hs_chunk){.raw = raw, .capacity = bytes, .touched = bytes};
    }
    return data;
}

void
hs_chunk_free(void *data)
{
    const hs_chunk chunk = *hs_chunk_of(data);
    if (chunk.length > 0) {
        free_pages(&chunk);
    } else {
        free(chunk.raw);
    }
}

/* The first `used` bytes have been written. */
static void
chunk_touch(void *data, size_t used)
{
    hs_chunk *chunk = hs_chunk_of(data);
    size_t    touched = used;
    if (used > 0 && used < chunk->huge) { /* the last page is a huge one */
        touched = (size_t)(round_up((uintptr_t)data + used, HS_PAGES_FROM) - (uintptr_t)data);
    }
    if (touched > chunk->capacity) {
        touched = chunk->capacity;
    }
    if (touched > chunk->touched) {
        chunk->touched = touched;
    }
}

/* A new chunk of `bytes` bytes, of the same kind or in pages, with the first `used` of this one,
 * which is freed. NULL when refused: this one stays as it was. */
static void *
chunk_copy(void *data, size_t bytes, size_t used)
{
    const bool in_pages = hs_chunk_of(data)->length > 0;
    void      *copy = in_pages ? new_in_pages(bytes) : hs_chunk_new(bytes);
    if (copy != NULL) {
        memcpy(copy, data, used);
        chunk_touch(copy, used);
        hs_chunk_free(data);
    }
    return copy;
}

/* Room for `bytes` bytes, more than before, the first `used` of them kept. May move; NULL when
 * refused: the chunk stays as it was. */
static void *
chunk_grow(void *data, size_t bytes, size_t used)
{
    void *grown = NULL;
    if (hs_chunk_of(data)->length > 0 && bytes <= PTRDIFF_MAX / 2) {
        grown = grow_in_pages(data, bytes);
    }
    /* Linux cannot move a mapping in one piece in a process forked from the one that made it. */
    return grown != NULL ? grown : chunk_copy(data, bytes, used);
}

void
hs_chunk_expect(void *data, size_t bytes)
{
    if (hs_chunk_of(data)->length > 0) {
        expect_in_pages(data, bytes);
    }
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
    const size_t kept = bytes + bytes / SPARE_PART;
    void        *shrunk = kept < chunk->capacity ? chunk_copy(data, kept, bytes) : NULL;
    return shrunk != NULL ? shrunk : data;
}

/* The pool. Chunks are freed after the lock is released, because freeing is a system call. */

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

/* Takes the oldest entries out until `more` bytes, no more than the limit, in `chunks` more chunks
 * fit. Returns how many; the caller frees them. The lock is held. */
static int
remove_oldest(size_t more, int chunks, void **removed)
{
    int n = 0;
    while (pool.n > 0 && (pool.n + chunks > HS_POOL_CHUNKS || pool.held > pool.limit - more)) {
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

/* A number of the pool, 0 where its lock does not come free. */
static size_t
read_pool(const size_t *number)
{
    size_t found = 0;
    if (lock_patiently()) {
        found = *number;
        unlock();
    }
    return found;
}

size_t
hs_pool_limit(void)
{
    return read_pool(&pool.limit);
}

size_t
hs_pool_held(void)
{
    return read_pool(&pool.held);
}

void
hs_pool_set_limit(size_t bytes)
{
    void *removed[HS_POOL_CHUNKS];
    if (lock_patiently()) {
        pool.limit = bytes;
        /* Limit 0 is off: then not even a chunk without touched memory stays. */
        const int n = remove_oldest(0, bytes == 0 ? HS_POOL_CHUNKS : 0, removed);
        unlock();
        free_all(removed, n);
    }
}

void
hs_pool_clear(void)
{
    void *removed[HS_POOL_CHUNKS];
    if (lock_patiently()) {
        /* Room for as many chunks as there can be: those without touched memory go as well. */
        const int n = remove_oldest(0, HS_POOL_CHUNKS, removed);
        unlock();
        free_all(removed, n);
    }
}

/*
 * Pages can be added to a chunk and given back from its end, so that any chunk in pages suits any
 * request. A chunk from malloc must have the room, and not twice what is wanted: it cannot be
 * shrunk for sure. For scratch, which is given back whole and at once, that does not matter.
 *
 * What counts is the bytes that a request would waste, or twice those that it would lack. Lists are
 * expected to be a little longer than they are, so the best chunk is the one that this list had
 * before, and not the next larger one, which another column had.
 */
void *
hs_pool_take(size_t expected, bool is_arena)
{
    int      best = -1;
    uint64_t least = UINT64_MAX;
    if (!try_lock()) {
        return NULL;
    }
    for (int k = 0; k < pool.n; k++) {
        const hs_chunk *chunk = hs_chunk_of(pool.data[k]);
        const uint64_t  waste = chunk->touched >= expected
                                    ? chunk->touched - expected
                                    : (uint64_t)2 * (expected - chunk->touched);
        const bool      has_room = chunk->capacity >= expected &&
                              (expected <= HS_POOL_SCRATCH || chunk->capacity / 2 <= expected);
        if (is_arena && chunk->is_arena) {
            best = k; /* the last one is still in caches */
        } else if (is_arena == chunk->is_arena && (chunk->length > 0 || has_room) &&
                   waste < least) {
            best = k;
            least = waste;
        }
    }
    void *data = best >= 0 ? remove_entry(best) : NULL;
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

/* Address space without memory that a chunk takes along to the pool, so that the next request needs
 * no system call. More would only use up address space. */
#define KEPT_SPARE ((size_t)64 << 20)

/* What a new chunk has at least, so that it serves other calls from the pool. Where a sanitizer
 * watches malloc, none goes there, and large ones would be mapped and marked anew for each call. */
#define LEAST_NEW (HS_WATCHED_MALLOC ? (size_t)1 << 16 : HS_POOL_SCRATCH)

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

bool
hs_region_reserve(hs_region *region, size_t expected)
{
    HS_ASSERT(region->data == NULL);
    if (hs_test_allocation_fails()) {
        return false;
    }
    void *data = hs_pool_take(expected, false);
    if (data != NULL && hs_chunk_of(data)->capacity < expected) {
        /* It is in pages: those from malloc have the room. */
        void *grown = chunk_grow(data, expected, 0);
        if (grown == NULL) {
            hs_chunk_free(data);
        }
        data = grown;
    }
    if (data == NULL) {
        data = hs_chunk_new(expected > LEAST_NEW ? expected : LEAST_NEW);
    }
    if (data == NULL) { /* what the pool holds may be what is missing */
        hs_pool_clear();
        data = hs_chunk_new(expected);
    }
    if (data == NULL) {
        return false;
    }
    hs_test_count_block(1);
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
    if (hs_test_allocation_fails()) {
        return false;
    }
    chunk_touch(region->data, region->used);
    void *data = chunk_grow(region->data, bytes, region->used);
    if (data == NULL) {
        hs_pool_clear();
        data = chunk_grow(region->data, bytes, region->used);
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
        chunk_touch(region->data, region->used);
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
    chunk_touch(region->data, region->used);
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
    chunk_touch(region->data, region->used > bytes ? region->used : bytes);
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
    hs_test_count_block(-1);
    chunk_touch(region->data, region->used);
    give_back(region->data);
    *region = (hs_region){0};
}

void
hs_buffer_free(void *data)
{
    if (data != NULL) {
        hs_test_count_block(-1);
        give_back(data);
    }
}
