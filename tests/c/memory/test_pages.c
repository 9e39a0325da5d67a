/* SPDX-License-Identifier: BSD-3-Clause */
/* test_pages.c: blocks from the system, and what is left of them when the system refuses. */
#if defined(__linux__)
#define _GNU_SOURCE /* mmap, setrlimit */
#endif
#include "../../../csrc/core/memory/chunk.h"
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/memory/pages.h"
#include "../support/address_space.h"

void test_pages(void);

#if CAN_LIMIT_ADDRESSES
#include <sys/mman.h>
#include <sys/wait.h>

#define MB       ((size_t)1 << 20)
#define TOO_MUCH ((size_t)1 << 61)

static void
fill(char *block, size_t bytes)
{
    for (size_t b = 0; b < bytes; b += 997) {
        block[b] = (char)(b % 251);
    }
}

static bool
holds(const char *block, size_t bytes)
{
    bool same = true;
    for (size_t b = 0; b < bytes; b += 997) {
        same = same && block[b] == (char)(b % 251);
    }
    return same;
}

/* As many mappings as a process may have, in pages from `start` on; 0: more than are worth
 * making. */
static size_t
use_up_mappings(char **start)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const size_t most = number_in("/proc/sys/vm/max_map_count");
    const size_t bytes = 2 * page * most;
    if (most == 0 || most > (1 << 17)) {
        return 0;
    }
    *start = mmap(NULL, bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    CHECK(*start != MAP_FAILED);
    for (size_t p = 0; p < 2 * most; p += 2) { /* each change of protection takes two more */
        if (mprotect(*start + p * page, page, PROT_READ) != 0) {
            return bytes;
        }
    }
    return bytes;
}

static void
blocks_are_aligned_and_zero(void)
{
    static const size_t sizes[] = {2 * MB, 2 * MB + 5, 3 * MB, 5 * MB - 1};
    for (int s = 0; s < 4; s++) {
        for (int reserved = 0; reserved < 2; reserved++) {
            void  *mapping;
            size_t length;
            char  *block = reserved ? hs_pages_reserve(sizes[s], &mapping, &length)
                                    : hs_pages_alloc(sizes[s], &mapping, &length);
            bool   zero = block != NULL && (uintptr_t)block % HS_PAGES_FROM == 0;
            for (size_t b = 0; zero && b < sizes[s]; b += 4001) {
                zero = block[b] == 0;
            }
            CHECK(zero && length >= sizes[s] && (size_t)(block - (char *)mapping) < length);
            memset(block - HS_PAGES_HEADROOM, 1, HS_PAGES_HEADROOM);
            hs_pages_advise(block, block, true); /* nothing to advise */
            hs_pages_free(mapping, length);
        }
    }
}

static void
what_cannot_be_had_is_refused(void)
{
    static const size_t sizes[] = {TOO_MUCH, PTRDIFF_MAX / 2 + MB, PTRDIFF_MAX, SIZE_MAX - MB};
    void               *mapping;
    size_t              length;
    char               *block = hs_pages_reserve(3 * MB, &mapping, &length);
    fill(block, 3 * MB);
    for (int s = 0; s < 4; s++) {
        void  *other;
        size_t other_length;
        CHECK(hs_pages_alloc(sizes[s], &other, &other_length) == NULL);
        CHECK(hs_pages_reserve(sizes[s], &other, &other_length) == NULL);
        CHECK(hs_pages_grow(sizes[s], &mapping, &length) == NULL);
        CHECK(holds(block, 3 * MB));
    }
    const rlim_t before = limit_addresses(20 * MB);
    CHECK(hs_pages_grow(60 * MB, &mapping, &length) == NULL && holds(block, 3 * MB));
    set_address_limit(before);
    hs_pages_free(mapping, length);
}

/* With something behind it a block must move; with little room it does without its alignment. */
static void
growing_blocks_move(void)
{
    for (int little = 0; little < 2; little++) {
        void  *mapping;
        size_t length;
        char  *block = hs_pages_reserve(8 * MB, &mapping, &length);
        fill(block, 8 * MB);
        char        *behind = mmap((char *)mapping + length, HS_PAGES_STEP, PROT_NONE,
                                   MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED_NOREPLACE, -1, 0);
        const rlim_t before = limit_addresses(little ? 9 * MB : SIZE_MAX / 4);
        char        *grown = hs_pages_grow(16 * MB, &mapping, &length);
        set_address_limit(before);
        CHECK(grown != NULL && grown != block && length >= 16 * MB && holds(grown, 8 * MB));
        CHECK(little || (uintptr_t)grown % HS_PAGES_FROM == 0);
        memset(grown + 8 * MB, 1, 8 * MB);
        hs_pages_free(mapping, length);
        if (behind != MAP_FAILED) {
            munmap(behind, HS_PAGES_STEP);
        }
    }
}

/* Advice for a part makes two of one mapping, and the system moves only one. */
static void
blocks_of_two_kinds_of_pages_grow(void)
{
    void  *mapping;
    size_t length;
    char  *block = hs_pages_reserve(8 * MB, &mapping, &length);
    fill(block, 8 * MB);
    hs_pages_advise(block, block + 4 * MB, true);
    char *grown = hs_pages_grow(16 * MB, &mapping, &length);
    CHECK(grown != NULL && length >= 16 * MB && holds(grown != NULL ? grown : block, 8 * MB));
    hs_pages_free(mapping, length);
}

/* What the system does not take back is empty at least. */
static void
cut_without_mappings(void)
{
    void  *mapping, *rest;
    size_t length;
    char  *start, *block = hs_pages_reserve(8 * MB, &mapping, &length);
    char  *chunk = hs_chunk_new(16 * MB);
    fill(block, 8 * MB);
    fill(chunk, 16 * MB);
    hs_chunk_touch(chunk, 16 * MB);
    CHECK(hs_pages_cut(block, block));
    const size_t bytes = use_up_mappings(&start);
    const bool   cut = hs_pages_cut(block + 2 * MB, block + 4 * MB);
    const bool   is_empty = cut || (block[2 * MB] == 0 && block[3 * MB + 5] == 0);
    void *const  shorter = hs_chunk_cut(chunk, 3 * MB, &rest);
    if (bytes > 0) {
        munmap(start, bytes);
    }
    CHECK(cut == (bytes == 0) && is_empty);
    CHECK(holds(block, 2 * MB) && block[4 * MB] == 0);
    CHECK(shorter == chunk && holds(chunk, 3 * MB) && (rest == NULL || bytes == 0));
    CHECK(hs_chunk_of(chunk)->capacity >= 3 * MB && hs_chunk_of(chunk)->capacity < 4 * MB);
    CHECK(hs_pages_trim(mapping, length, block, 9 * MB) == length);
    CHECK(hs_pages_trim((char *)mapping + 1, length, block + 1, 2 * MB) == length); /* no page */
    hs_chunk_free(chunk);
    if (rest != NULL) {
        hs_chunk_free(rest);
    }
    hs_pages_free(mapping, length);
}

/* In a process of its own: other threads and the checks themselves may need mappings. */
static void
cuts_may_be_refused(void)
{
#ifdef HS_COVERAGE
    cut_without_mappings();
#else
    int         status = -1;
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        const int before = harness_failures;
        cut_without_mappings();
        _exit(harness_failures == before ? 0 : 1);
    }
    CHECK(child < 0 || waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
#endif
}

/* Chunks from malloc and from pages stay as they are when they cannot grow. */
static void
chunks_that_cannot_grow_stay(void)
{
    static const size_t sizes[] = {1000, MB, 2 * MB, 5 * MB};
    CHECK(hs_chunk_new(TOO_MUCH) == NULL && hs_chunk_new(PTRDIFF_MAX) == NULL);
    for (int s = 0; s < 4; s++) {
        char *chunk = hs_chunk_new(sizes[s]);
        fill(chunk, sizes[s]);
        hs_chunk_expect(chunk, 100 * sizes[s]); /* more than it has */
        CHECK(hs_chunk_of(chunk)->huge <= hs_chunk_of(chunk)->capacity);
        CHECK(hs_chunk_grow(chunk, TOO_MUCH, sizes[s]) == NULL && holds(chunk, sizes[s]));
        CHECK(hs_chunk_grow(chunk, PTRDIFF_MAX, sizes[s]) == NULL && holds(chunk, sizes[s]));
        chunk = hs_chunk_grow(chunk, 7 * MB, sizes[s]);
        CHECK(chunk != NULL && holds(chunk, sizes[s]));
        hs_chunk_free(chunk);
    }
}

/* A mapping in several parts, which the system does not move: it is copied. */
static void
chunks_in_parts_are_copied(void)
{
    char *chunk = hs_chunk_new(4 * MB);
    fill(chunk, 4 * MB);
    CHECK(mprotect(chunk + 2 * MB, HS_PAGES_STEP, PROT_READ) == 0);
    chunk = hs_chunk_grow(chunk, 16 * MB, 4 * MB);
    CHECK(chunk != NULL && holds(chunk, 4 * MB));
    fill(chunk, 16 * MB); /* all of it can be written */
    CHECK(holds(chunk, 16 * MB));
    hs_chunk_free(chunk);
}

#endif

void
test_pages(void)
{
#if CAN_LIMIT_ADDRESSES
    RUN(blocks_are_aligned_and_zero);
    RUN(what_cannot_be_had_is_refused);
    RUN(growing_blocks_move);
    RUN(blocks_of_two_kinds_of_pages_grow);
    RUN(cuts_may_be_refused);
    RUN(chunks_that_cannot_grow_stay);
    RUN(chunks_in_parts_are_copied);
#endif
}
