/* SPDX-License-Identifier: BSD-3-Clause */
/* test_region.c: regions keep their contents, cost what is written to them, and give the rest
 * back; and when memory is refused nothing is lost. */
#if defined(__linux__)
#define _GNU_SOURCE /* fork, setrlimit */
#endif
#include "../../../csrc/core/memory/chunk.h"
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/memory/pages.h"
#include "../../../csrc/core/memory/pool.h"
#include "../../../csrc/core/memory/region.h"
#include "../support/address_space.h"
#include "../support/harness.h"

#if defined(__linux__)
#include <sys/wait.h>
#endif

void test_region(void);

#define MB ((size_t)1 << 20)
#define GB ((size_t)1 << 30)

static uint64_t
word_at(size_t k)
{
    return (uint64_t)k * UINT64_C(0x9e3779b97f4a7c15) + 1;
}

/* Writes words from the used bytes on, up to `bytes`. */
static void
fill(hs_region *region, size_t bytes)
{
    uint64_t *words = (uint64_t *)region->data;
    for (size_t k = region->used / 8; k < bytes / 8; k++)
        words[k] = word_at(k);
    region->used = bytes;
}

static bool
holds(const void *data, size_t bytes)
{
    const uint64_t *words = data;
    for (size_t k = 0; k < bytes / 8; k++)
        if (words[k] != word_at(k))
            return false;
    return true;
}

static bool
is_aligned(const void *data, size_t alignment)
{
    return (uintptr_t)data % alignment == 0;
}

static void
reserve_gives_room(void)
{
    hs_region none = {0};
    hs_region_expect(&none, GB); /* advice for what is not there */
    CHECK(none.data == NULL && none.capacity == 0);
    static const size_t sizes[] = {0, 1, 64, 4096, 100000, 1 * MB, 2 * MB - 1, 2 * MB, 5 * MB + 3};
    hs_pool_clear();
    for (int k = 0; k < 9; k++) {
        hs_region region = {0};
        CHECK(hs_region_reserve(&region, sizes[k]));
        CHECK(region.data != NULL && region.used == 0 && region.capacity >= sizes[k]);
        CHECK(is_aligned(region.data, HS_ALIGNMENT));
        CHECK(!HAS_PAGES || sizes[k] < HS_PAGES_FROM || is_aligned(region.data, HS_PAGES_FROM));
        memset(region.data, 0x5a, region.capacity);
        region.used = region.capacity;
        hs_region_release(&region);
        CHECK(region.data == NULL && region.capacity == 0 && region.used == 0);
        hs_region_release(&region); /* harmless */
        hs_pool_clear();
    }
    hs_region_release(NULL);
    hs_buffer_free(NULL);
}

/* From malloc to pages and on, with advice that changes on the way. */
static void
contents_survive_growth(void)
{
    for (int advice = 0; advice < 3; advice++) {
        hs_region region = {0};
        hs_pool_clear();
        CHECK(hs_region_reserve(&region, 1000));
        for (size_t bytes = 1000; bytes < 25 * MB; bytes += bytes / 2 / 8 * 8) {
            CHECK(hs_region_grow(&region, bytes));
            CHECK(region.capacity >= bytes && is_aligned(region.data, HS_ALIGNMENT));
            CHECK(holds(region.data, region.used));
            if (advice > 0)
                hs_region_expect(&region, advice == 1 ? bytes : advice == 2 ? bytes / 3 : 20 * MB);
            fill(&region, bytes);
        }
        const size_t used = region.used;
        void        *data = hs_region_detach(&region, used);
        CHECK(region.data == NULL && holds(data, used));
        hs_buffer_free(data);
    }
}

/* Small steps after advice has split the mapping, with another mapping in the way each time. */
static void
growth_in_small_steps(void)
{
    hs_region region = {0}, others[100] = {{0}};
    hs_pool_clear();
    CHECK(hs_region_reserve(&region, 5 * MB));
    fill(&region, 5 * MB);
    for (int k = 0; k < 100; k++) {
        CHECK(hs_region_reserve(&others[k], 2 * MB));
        CHECK(hs_region_grow(&region, region.capacity + 1));
        hs_region_expect(&region, region.capacity);
        fill(&region, region.capacity / 8 * 8);
    }
    CHECK(holds(region.data, region.used));
    hs_region_release(&region);
    for (int k = 0; k < 100; k++)
        hs_region_release(&others[k]);
}

/* From malloc and from pages; what is left can be written to and grown again. */
static void
shrinking_keeps_what_is_used(void)
{
    static const size_t sizes[] = {4000, 900000, 3 * MB, 30 * MB};
    for (int k = 0; k < 4; k++) {
        hs_region region = {0};
        hs_pool_clear();
        CHECK(hs_region_reserve(&region, sizes[k]));
        fill(&region, sizes[k] / 16 * 8);
        const size_t used = region.used;
        hs_region_shrink(&region, used + 512);
        CHECK(region.used == used && region.capacity >= used + 512);
        CHECK(holds(region.data, used) && is_aligned(region.data, HS_ALIGNMENT));
        fill(&region, region.capacity / 8 * 8);
        CHECK(hs_region_grow(&region, 2 * sizes[k]) && holds(region.data, region.used));
        hs_region_release(&region);
    }
}

static void
detach_keeps_the_front(void)
{
    static const size_t kept[] = {0, 8, 1000, 65536, 1 * MB, 2 * MB, 3 * MB, 9 * MB, 12 * MB};
    for (int from = 0; from < 2; from++) {
        for (int k = 0; k < 9; k++) {
            hs_region region = {0};
            CHECK(hs_region_reserve(&region, from * 10 * MB));
            CHECK(hs_region_grow(&region, 12 * MB));
            fill(&region, 12 * MB);
            void *data = hs_region_detach(&region, kept[k]);
            CHECK(data != NULL && holds(data, kept[k]) && is_aligned(data, HS_ALIGNMENT));
            CHECK(region.data == NULL && hs_region_detach(&region, 0) == NULL);
            /* What the pool got of it is another's to write to. */
            hs_region other = {0};
            CHECK(hs_region_reserve(&other, 8 * MB));
            memset(other.data, 0x77, 8 * MB);
            CHECK(holds(data, kept[k]));
            hs_region_release(&other);
            hs_buffer_free(data);
        }
    }
}

/* The smallest steps, from malloc, which returns blocks at any multiple of 16 bytes. */
static void
chunks_stay_aligned(void)
{
    enum { CHUNKS = 40, STEPS = 30 };
    char *chunks[CHUNKS];
    for (int k = 0; k < CHUNKS; k++)
        chunks[k] = hs_chunk_new(8);
    for (size_t step = 1; step <= STEPS; step++) {
        for (int k = 0; k < CHUNKS; k++) {
            const size_t bytes = step * 8 * (size_t)(k + 1);
            if (step == 1)
                chunks[k] = hs_chunk_grow(chunks[k], bytes + 1, 0);
            for (size_t word = 0; word < bytes / 8; word++)
                ((uint64_t *)chunks[k])[word] = word_at(word);
            chunks[k] = hs_chunk_grow(chunks[k], bytes + 8 * (size_t)(k + 2), bytes);
            CHECK(is_aligned(chunks[k], HS_ALIGNMENT) && holds(chunks[k], bytes));
        }
    }
    for (int k = 0; k < CHUNKS; k++)
        hs_chunk_free(chunks[k]);
}

/* Whichever request is refused, the region stays as it was. */
/* New memory is not, recycled memory is. */
static void
what_was_written_is_resident(void)
{
    enum { BYTES = 5 << 20 };
    hs_region region = {0};
    hs_pool_clear();
    CHECK(hs_region_resident(&region) == 0);
    CHECK(hs_region_reserve(&region, BYTES));
    CHECK(HS_WATCHED_MALLOC || hs_region_resident(&region) == 0); /* malloc may have used it */
    memset(region.data, 1, BYTES);
    region.used = BYTES;
    hs_region_expect(&region, BYTES);
    CHECK(hs_region_resident(&region) >= BYTES);
    hs_region_release(&region);
    CHECK(hs_region_reserve(&region, BYTES));
    CHECK(HS_WATCHED_MALLOC || hs_region_resident(&region) >= BYTES);
    hs_region_release(&region);
}

static void
failures_lose_nothing(void)
{
    const int64_t before = hs_test_live_blocks();
    hs_region     region = {0};
    hs_test_fail_allocation(1);
    CHECK(!hs_region_reserve(&region, 3 * MB));
    CHECK(region.data == NULL && hs_test_live_blocks() == before);
    CHECK(hs_region_reserve(&region, 3 * MB));
    CHECK(hs_test_live_blocks() == before + 1);
    fill(&region, 3 * MB);
    const hs_region unchanged = region;
    hs_test_fail_allocation(1);
    CHECK(!hs_region_grow(&region, region.capacity + 1));
    hs_test_fail_allocation(0);
    CHECK(memcmp(&region, &unchanged, sizeof region) == 0 && holds(region.data, 3 * MB));
    CHECK(!hs_region_grow(&region, PTRDIFF_MAX)); /* the system refuses */
    CHECK(!hs_region_grow(&region, SIZE_MAX));
    CHECK(memcmp(&region, &unchanged, sizeof region) == 0 && holds(region.data, 3 * MB));
    hs_test_fail_allocation(1);
    void *data = hs_region_detach(&region, 1000); /* asks for nothing */
    hs_buffer_free(data);
    hs_test_fail_allocation(0);
    CHECK(hs_test_live_blocks() == before);
    CHECK(!hs_region_reserve(&region, SIZE_MAX));
    CHECK(!hs_region_reserve(&region, PTRDIFF_MAX));
    CHECK(hs_test_live_blocks() == before);
}

#if CAN_LIMIT_ADDRESSES

/* Resident bytes of this process, exactly. -1: not told. */
static int64_t
resident(void)
{
    char  line[256];
    long  kilobytes = -1;
    FILE *file = fopen("/proc/self/smaps_rollup", "r");
    while (file != NULL && fgets(line, sizeof line, file) != NULL)
        if (sscanf(line, "Rss: %ld", &kilobytes) == 1)
            break;
    if (file != NULL)
        fclose(file);
    return kilobytes < 0 ? -1 : (int64_t)kilobytes * 1024;
}

/* Whether far more can be reserved than the machine has. */
static bool
room_is_free(void)
{
    struct rlimit limit;
    return getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY &&
           number_in("/proc/sys/vm/overcommit_memory") != 2;
}

enum { NOISE = 600000 }; /* bytes that the test itself may cost meanwhile */

static void
only_what_is_written_costs(void)
{
    hs_region region = {0};
    hs_pool_clear();
    const int64_t start = resident();
    if (start < 0 || !room_is_free())
        return;
    /* More than the machine has; 8 MB of it may become huge pages. */
    CHECK(hs_region_reserve(&region, 2048 * GB));
    hs_region_expect(&region, 9 * MB);
    CHECK(region.capacity >= 2048 * GB);
    CHECK(resident() - start < NOISE);
    fill(&region, 64);
    CHECK(resident() - start < (int64_t)(2 * MB) + NOISE);
    fill(&region, 10 * MB);
    CHECK(resident() - start < (int64_t)(10 * MB) + NOISE);
    void *data = hs_region_detach(&region, 10 * MB);
    CHECK(resident() - start < (int64_t)(10 * MB) + NOISE);
    hs_buffer_free(data);
    CHECK(hs_pool_held() >= 10 * MB && hs_pool_held() < 11 * MB);
    hs_pool_clear();
    const size_t mapped_before = mapped();
    CHECK(hs_region_reserve(&region, 8 * GB));
    hs_region_release(&region);
    CHECK(mapped() < mapped_before + GB); /* nor does the pool hoard address space */
    hs_pool_clear();
    CHECK(resident() - start < NOISE);
}

static void
the_tail_is_given_back(void)
{
    hs_region region = {0};
    hs_pool_clear();
    const int64_t start = resident();
    if (start < 0)
        return;
    CHECK(hs_region_reserve(&region, 100 * MB));
    hs_region_expect(&region, 40 * MB);
    fill(&region, 40 * MB);
    void        *data = hs_region_detach(&region, 5 * MB + 8);
    const size_t recycled = hs_pool_held(); /* huge pages from 6 MB on */
    CHECK(recycled == 34 * MB);
    CHECK(resident() - start < (int64_t)(40 * MB) + NOISE);
    hs_pool_clear();
    CHECK(resident() - start < (int64_t)(5 * MB) + NOISE);
    CHECK(holds(data, 5 * MB + 8));
    hs_buffer_free(data);
    CHECK(hs_pool_held() >= 5 * MB && hs_pool_held() < 6 * MB);
    hs_pool_clear();
    CHECK(hs_region_reserve(&region, 40 * MB));
    fill(&region, 40 * MB);
    data = hs_region_detach(&region, 4 * MB); /* to the end of a huge page */
    CHECK(holds(data, 4 * MB) && hs_pool_held() == 34 * MB);
    hs_buffer_free(data);
    hs_pool_clear();
}

/* In a child with address space for `room` bytes more. Returns what the child returns. */
static int
with_little_room(size_t room, int (*work)(void))
{
    int status = -1;
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        const rlim_t        limit = mapped() + room;
        const struct rlimit limits = {limit, limit};
        _exit(setrlimit(RLIMIT_AS, &limits) == 0 ? work() : 98);
    }
    CHECK(child > 0 && waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status));
    return WEXITSTATUS(status);
}

/* Grows as far as it gets. 0 if all is as it should be, else the number of the step. */
static int
grow_to_the_limit(void)
{
    hs_region region = {0};
    if (hs_region_reserve(&region, 2 * GB))
        return 1;
    hs_region other = {0};
    if (region.data != NULL || !hs_region_reserve(&region, 21 * MB) ||
        !hs_region_reserve(&other, 60 * MB))
        return 2;
    hs_region_release(&other);     /* the pool must let go of this below */
    if (region.capacity > 22 * MB) /* nothing is hoarded */
        return 3;
    fill(&region, 21 * MB);
    while (hs_region_grow(&region, region.capacity + 3 * MB)) {
        hs_region_expect(&region, region.capacity - MB / 2); /* splits the mapping */
        fill(&region, region.capacity / 8 * 8);
    }
    if (region.used < 120 * MB || !holds(region.data, region.used)) /* with copies: 100 of 200 */
        return 4;
    const size_t half = region.used / 16 * 8;
    void        *data = hs_region_detach(&region, half);
    if (data == NULL || !holds(data, half))
        return 5;
    if (!hs_region_reserve(&region, 60 * MB)) /* the other half is there again */
        return 6;
    hs_region_release(&region);
    hs_buffer_free(data);
    if (!hs_region_reserve(&region, 180 * MB)) /* if only the pool lets go of it */
        return 7;
    hs_region_release(&region);
    return 0;
}

static void
limited_address_space(void)
{
    hs_pool_clear();
    CHECK(with_little_room(200 * MB, grow_to_the_limit) == 0);
}

#endif

void
test_region(void)
{
    RUN(reserve_gives_room);
    RUN(contents_survive_growth);
    RUN(growth_in_small_steps);
    RUN(shrinking_keeps_what_is_used);
    RUN(detach_keeps_the_front);
    RUN(chunks_stay_aligned);
    RUN(what_was_written_is_resident);
    RUN(failures_lose_nothing);
#if CAN_LIMIT_ADDRESSES
    RUN(only_what_is_written_costs);
    RUN(the_tail_is_given_back);
    RUN(limited_address_space);
#endif
    hs_pool_clear();
}
