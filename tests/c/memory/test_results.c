/* SPDX-License-Identifier: BSD-3-Clause */
/* test_results.c: memory of results: pages of the system, what is cut off and kept, and what the
 * pool gives again. */
#if !defined(_WIN32)
#define _GNU_SOURCE /* mmap, fork, setrlimit */
#endif
#include "../../../csrc/core/base/os_thread.h"
#include "../../../csrc/core/collect/columns.h"
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/core/memory/results.h"
#include "../support/address_space.h"
#include "../support/harness.h"

#if !defined(_WIN32)
#include <pthread.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

#if CAN_LIMIT_ADDRESSES
#include <sys/mman.h>
#endif

void test_results(void);

/* ---- results that come from the pool and go back to it ---- */

#define MB ((size_t)1 << 20)

/* A result of `bytes` bytes, all of them `mark`. */
static char *
make_result(size_t bytes, int mark)
{
    hs_region region = {0};
    CHECK(hs_region_reserve(&region, bytes));
    memset(region.data, mark, bytes);
    region.used = bytes;
    return hs_region_detach(&region, bytes);
}

static bool
is_all(const char *data, size_t bytes, int mark)
{
    for (size_t k = 0; k < bytes; k++)
        if (data[k] != (char)mark)
            return false;
    return true;
}

static void
reset_pool(void)
{
    hs_pool_clear();
    hs_pool_set_limit(HS_POOL_LIMIT);
}

/* ---- memory comes back, within the limit, from many threads ---- */

#if !HS_WATCHED_MALLOC
static void
the_limit_holds(void)
{
    reset_pool();
    CHECK(hs_pool_limit() == HS_POOL_LIMIT);
    hs_pool_set_limit(30 * MB);
    CHECK(hs_pool_limit() == 30 * MB);
    char *results[5];
    for (int k = 0; k < 5; k++)
        results[k] = make_result(8 * MB, k);
    for (int k = 0; k < 5; k++) {
        hs_buffer_free(results[k]);
        CHECK(hs_pool_held() == (size_t)(k < 3 ? k + 1 : 3) * 8 * MB);
    }
    hs_buffer_free(make_result(40 * MB, 1)); /* too large: goes, and drives nothing out */
    CHECK(hs_pool_held() <= 30 * MB);
    hs_pool_set_limit(10 * MB);
    CHECK(hs_pool_held() <= 10 * MB);
    hs_pool_set_limit(0);
    CHECK(hs_pool_held() == 0);
    hs_buffer_free(make_result(100, 1));
    hs_buffer_free(make_result(3 * MB, 1));
    CHECK(hs_pool_held() == 0 && hs_pool_take(10, false) == NULL);
    for (int off = 0; off < 2; off++) { /* memory that nobody has touched is not kept either */
        hs_region region = {0};
        hs_pool_set_limit(off ? 0 : 5 * MB);
        CHECK(hs_region_reserve(&region, 3 * MB));
        hs_region_release(&region);
        if (!off)
            hs_pool_set_limit(0);
        CHECK(hs_pool_take(10, false) == NULL);
    }
    reset_pool();
}

#endif

#if !defined(_WIN32)
enum { THREADS = 6, ROUNDS = THIRD_OF_TRIALS(200) };

/* Each result is written, checked later, and kept for a few rounds. */
static void *
hammer(void *context)
{
    harness_random random = {(uint64_t)(uintptr_t)context * 77 + 1};
    char          *kept[4] = {NULL};
    size_t         sizes[4] = {0};
    intptr_t       wrong = 0;
    for (int round = 0; round < ROUNDS; round++) {
        const int    at = (int)(random_bits(&random) >> 62);
        const int    mark = (int)(intptr_t)context * 8 + at;
        const size_t bytes = (size_t)(random_bits(&random) >> (round % 4 == 0 ? 42 : 50)) + 1;
        hs_region    region = {0};
        wrong += !is_all(kept[at], sizes[at], mark);
        hs_buffer_free(kept[at]);
        kept[at] = NULL;
        sizes[at] = 0;
        if (!hs_region_reserve(&region, bytes / 2) || !hs_region_grow(&region, bytes)) {
            wrong++;
        } else {
            memset(region.data, mark, bytes);
            region.used = bytes;
            if (round % 3 == 0) {
                hs_region_release(&region);
            } else {
                sizes[at] = bytes - bytes / 4;
                kept[at] = hs_region_detach(&region, sizes[at]);
            }
        }
        if (round % 100 == 50) {
            hs_pool_clear();
            hs_pool_set_limit((size_t)(round / 50) * 4 * MB);
        }
    }
    for (int at = 0; at < 4; at++) {
        wrong += !is_all(kept[at], sizes[at], (int)(intptr_t)context * 8 + at);
        hs_buffer_free(kept[at]);
    }
    return (void *)wrong;
}

static void
many_threads(void)
{
    const int64_t before = hs_test_live_blocks();
    pthread_t     threads[THREADS];
    reset_pool();
    for (intptr_t k = 0; k < THREADS; k++)
        CHECK(pthread_create(&threads[k], NULL, hammer, (void *)k) == 0);
    for (int k = 0; k < THREADS; k++) {
        void *wrong;
        CHECK(pthread_join(threads[k], &wrong) == 0 && wrong == NULL);
    }
    CHECK(hs_test_live_blocks() == before);
    reset_pool();
}

#endif

/*
 * ---- pool lock ----
 *
 * Where the lock of the pool is taken, memory comes from the system; a child that is forked off
 * meanwhile begins with an empty pool.
 */

#if !HS_WATCHED_MALLOC
static void
without_the_lock(void)
{
    reset_pool();
    hs_buffer_free(make_result(4 * MB, 1));
    hs_test_pool_hold(true);
    char *result = make_result(4 * MB, 2);
    CHECK(is_all(result, 4 * MB, 2));
    hs_buffer_free(result);
    CHECK(hs_pool_held() == 0 && hs_pool_limit() == 0);
    hs_pool_set_limit(5);
    hs_pool_clear();
    hs_test_pool_hold(false);
    CHECK(hs_pool_held() == 4 * MB && hs_pool_limit() == HS_POOL_LIMIT);
    void *left = hs_pool_take(4 * MB, false); /* what is in the pool is lost below */
    hs_test_pool_hold(true);
    hs_test_fork();
    CHECK(hs_pool_held() == 0 && hs_pool_limit() == HS_POOL_LIMIT);
    CHECK(left != NULL && hs_pool_give(left) && hs_pool_held() == 4 * MB);
    reset_pool();
}

#endif

#if !defined(_WIN32)
/* What a child does with the pool it inherits, and with a region that was being written. */
static int
work_in_child(hs_region *region, bool held)
{
    if (hs_pool_limit() != HS_POOL_LIMIT || (held && hs_pool_held() != 0))
        return 5;
    if (!is_all(region->data, 6 * MB, 9))
        return 1;
    if (!hs_region_grow(region, region->capacity + 9 * MB) || !is_all(region->data, 6 * MB, 9))
        return 2;
    memset(region->data, 4, region->capacity);
    region->used = region->capacity;
    hs_buffer_free(hs_region_detach(region, 7 * MB));
    for (int k = 0; k < 20; k++) {
        char *result = make_result((size_t)(k + 1) * MB, k);
        if (!is_all(result, (size_t)(k + 1) * MB, k))
            return 3;
        hs_buffer_free(result);
    }
    hs_pool_clear();
    return hs_pool_held() == 0 && harness_failures == 0 ? 0 : 4;
}

static void
fork_in_the_middle(void)
{
    const int earlier = harness_failures;
    reset_pool();
    hs_buffer_free(make_result(12 * MB, 3));
    hs_region region = {0};
    CHECK(hs_region_reserve(&region, 7 * MB));
    hs_buffer_free(make_result(9 * MB, 5));
    memset(region.data, 9, 6 * MB);
    region.used = 6 * MB;
    for (int held = 0; held < 2; held++) {
        int status = -1;
        fflush(NULL);
#if !HS_WATCHED_MALLOC
        hs_test_pool_hold(held);
#endif
        const pid_t child = fork();
        if (child == 0) {
            harness_failures = 0;
            _exit(work_in_child(&region, held));
        }
#if !HS_WATCHED_MALLOC
        hs_test_pool_hold(false);
#endif
        CHECK(child > 0 && waitpid(child, &status, 0) == child);
        CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
    CHECK(is_all(region.data, 6 * MB, 9)); /* untouched by the children */
    hs_region_release(&region);
    CHECK(harness_failures == earlier);
    reset_pool();
}

#endif

#if !defined(HS_EMULATED)
static uint64_t
word_at(size_t k)
{
    return (uint64_t)k * UINT64_C(0x9e3779b97f4a7c15) + 1;
}

static void
fill(void *data, size_t bytes)
{
    uint64_t *words = data;
    for (size_t k = 0; k < bytes / 8; k++)
        words[k] = word_at(k);
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

#endif

/* ---- blocks from the system, and what is left of them when the system refuses ---- */

#if !defined(HS_EMULATED) && CAN_LIMIT_ADDRESSES
#define TOO_MUCH ((size_t)1 << 61)

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
chunks_in_pages_are_aligned_and_zero(void)
{
    static const size_t sizes[] = {2 * MB, 2 * MB + 5, 3 * MB, 5 * MB - 1};
    for (int s = 0; s < 4; s++) {
        for (int huge = 0; huge < 2; huge++) {
            char *chunk = hs_chunk_new(sizes[s]);
            bool  zero = chunk != NULL && (uintptr_t)chunk % HS_PAGES_FROM == 0;
            if (huge)
                hs_chunk_expect(chunk, sizes[s]);
            for (size_t b = 0; zero && b < sizes[s]; b += 4001)
                zero = chunk[b] == 0;
            CHECK(zero && hs_chunk_of(chunk)->length >= sizes[s]);
            CHECK(hs_chunk_of(chunk)->capacity >= sizes[s]);
            hs_chunk_free(chunk);
        }
    }
}

static void
what_cannot_be_had_is_refused(void)
{
    static const size_t sizes[] = {TOO_MUCH, PTRDIFF_MAX / 2 + MB, PTRDIFF_MAX, SIZE_MAX - MB};
    hs_region           region = {0};
    CHECK(hs_region_reserve(&region, 3 * MB));
    fill(region.data, 3 * MB);
    region.used = 3 * MB;
    for (int s = 0; s < 4; s++) {
        CHECK(hs_chunk_new(sizes[s]) == NULL);
        CHECK(!hs_region_grow(&region, sizes[s]) && holds(region.data, 3 * MB));
    }
    const rlim_t before = limit_addresses(20 * MB);
    CHECK(!hs_region_grow(&region, 60 * MB) && holds(region.data, 3 * MB));
    set_address_limit(before);
    hs_region_release(&region);
}

/* What the system does not take back is empty at least. */
static void
cut_without_mappings(void)
{
    void *rest;
    char *start, *block = hs_chunk_new(9 * MB), *chunk = hs_chunk_new(16 * MB);
    fill(block, 9 * MB);
    fill(chunk, 16 * MB);
    hs_region region = {.data = chunk, .capacity = hs_chunk_of(chunk)->capacity, .used = 16 * MB};
    hs_region_advise(&region, 16 * MB); /* all of it is resident */
    const size_t bytes = use_up_mappings(&start);
    void *const  same = hs_chunk_cut(block, 2 * MB, NULL);
    void *const  shorter = hs_chunk_cut(chunk, 3 * MB, &rest);
    if (bytes > 0) {
        munmap(start, bytes);
    }
    CHECK(same == block && holds(block, 2 * MB));
    CHECK(shorter == chunk && holds(chunk, 3 * MB) && (rest == NULL || bytes == 0));
    CHECK(hs_chunk_of(chunk)->capacity >= 3 * MB && hs_chunk_of(chunk)->capacity < 4 * MB);
    CHECK(hs_chunk_cut(block, 9 * MB, NULL) == block && holds(block, 2 * MB));
    hs_chunk_free(block);
    hs_chunk_free(chunk);
    if (rest != NULL) {
        hs_chunk_free(rest);
    }
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
        hs_region region = {.data = chunk, .capacity = sizes[s], .used = sizes[s]};
        CHECK(!hs_region_grow(&region, TOO_MUCH) && holds(region.data, sizes[s]));
        CHECK(!hs_region_grow(&region, PTRDIFF_MAX) && holds(region.data, sizes[s]));
        CHECK(hs_region_grow(&region, 7 * MB) && holds(region.data, sizes[s]));
        hs_chunk_free(region.data);
    }
}

#endif

/* ---- regions keep their contents, cost what is written to them, and give the rest back ---- */

#if !defined(HS_EMULATED)
#define GB ((size_t)1 << 30)

static bool
is_aligned(const void *data, size_t alignment)
{
    return (uintptr_t)data % alignment == 0;
}

static void
reserve_gives_room(void)
{
    hs_region none = {0};
    hs_region_advise(&none, GB); /* advice for what is not there */
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

static void
detach_keeps_the_front(void)
{
    static const size_t kept[] = {0, 8, 1000, 65536, 1 * MB, 2 * MB, 3 * MB, 9 * MB, 12 * MB};
    for (int from = 0; from < 2; from++) {
        for (int k = 0; k < 9; k++) {
            hs_region region = {0};
            CHECK(hs_region_reserve(&region, from * 10 * MB));
            CHECK(hs_region_grow(&region, 12 * MB));
            fill(region.data, 12 * MB);
            region.used = 12 * MB;
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
    hs_region_advise(&region, BYTES);
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
    fill(region.data, 3 * MB);
    region.used = 3 * MB;
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

#endif

/* ---- memory from malloc in the pool, and columns that grow where little is left ---- */

#if !defined(HS_EMULATED) && !HS_WATCHED_MALLOC
/* A chunk as hs_chunk_new makes it where there are no pages. */
static void *
chunk_from_malloc(size_t bytes)
{
    char *raw = malloc(bytes + 2 * sizeof(hs_chunk) + 64);
    CHECK(raw != NULL);
    char *data = raw + sizeof(hs_chunk);
    data += (64 - (uintptr_t)data % 64) % 64;
    *hs_chunk_of(data) = (hs_chunk){.raw = raw, .capacity = bytes, .touched = bytes};
    return data;
}

/* It cannot be shrunk for sure: what wants less than half of it gets none of it, but for scratch,
 * which comes back at once. */
static void
the_pool_wastes_no_more_than_half_of_a_chunk(void)
{
    const size_t sizes[] = {4 * MB - 64, 4 * MB, 5 * MB, 8 * MB, 8 * MB + 64, MB, MB + 64};
    const bool   suits[] = {false, true, true, true, false, true, false};
    hs_pool_clear();
    void *data = chunk_from_malloc(8 * MB);
    CHECK(hs_pool_give(data) && hs_pool_held() == 8 * MB);
    for (int s = 0; s < 7; s++) {
        void *taken = hs_pool_take(sizes[s], false);
        CHECK((taken == data) == suits[s] && (taken == NULL) == !suits[s]);
        CHECK(hs_pool_held() == (taken == NULL ? 8 * MB : 0));
        CHECK(taken == NULL || hs_pool_give(taken));
    }
    hs_pool_clear();
    CHECK(hs_pool_held() == 0);
}

#endif

#if !defined(HS_EMULATED)
/* From malloc, that is: then the next list of about this length finds room in it, also where much
 * more was cut off. */
static void
room_for_the_next_list_is_not_cut_off(void)
{
    void *data = hs_chunk_new(MB);
    CHECK(data != NULL);
    data = hs_chunk_cut(data, MB - MB / 9, NULL);
    CHECK(hs_chunk_of(data)->capacity == MB);
    data = hs_chunk_cut(data, MB / 2, NULL);
    CHECK(hs_chunk_of(data)->capacity == MB / 2 + MB / 16);
    hs_chunk_free(data);
}

#endif

#if !defined(HS_EMULATED) && CAN_LIMIT_ADDRESSES
/* What the pool has no room for is given back, oldest first. */
static void
what_is_too_much_for_the_pool_is_freed(void)
{
    hs_pool_clear();
    const size_t before = mapped();
    for (int n = 0; n < 4 * HS_POOL_CHUNKS; n++) {
        void *data = hs_chunk_new(8 * MB);
        CHECK(data != NULL && hs_pool_give(data));
    }
    CHECK(mapped() >= before + (HS_POOL_CHUNKS - 1) * 8 * MB);
    CHECK(mapped() <= before + (HS_POOL_CHUNKS + 2) * 8 * MB);
    hs_pool_clear();
    CHECK(mapped() <= before + 8 * MB);
}

/* Half as much again is refused, what is needed now is not. */
static void
columns_grow_by_little_where_little_is_left(void)
{
    hs_output output;
    hs_pool_clear();
    hs_output_init(NULL, 3, HS_WANT_I, 8, &output);
    CHECK(hs_output_reserve(&output, 4 << 20, 0.0) == HS_OK);
    const int64_t capacity = output.capacity;
    CHECK(capacity >= 4 << 20);
    output.n_pairs = capacity;
    const rlim_t before = limit_addresses(8 * MB);
    CHECK(hs_output_reserve(&output, 1, 0.0) == HS_OK);
    CHECK(output.capacity > capacity && output.capacity < capacity + capacity / 4);
    output.n_pairs = output.capacity;
    CHECK(hs_output_reserve(&output, 4 << 20, 0.0) == HS_ERR_MEMORY);
    set_address_limit(before);
    CHECK(hs_output_reserve(&output, 1, 0.0) == HS_OK);
    CHECK(output.capacity >= capacity + capacity / 2);
    output.n_pairs = 0;
    hs_output_free(&output);
    hs_pool_clear();
}

#endif

#if !defined(HS_EMULATED)
static double
no_room(void *context)
{
    ++*(int *)context;
    return 0.0;
}

/* What is charged ahead may be what makes the account ask for its limit, which then leaves no room
 * for what is needed either. */
static void
a_limit_may_be_heard_of_while_it_is_passed(void)
{
    int        asked = 0;
    hs_options options = hs_options_default();
    hs_account account;
    hs_output  output;
    options.find_limit = no_room;
    options.find_context = &asked;
    hs_account_init(&account, &options);
    hs_output_init(&account, 3, HS_WANT_I, 8, &output);
    CHECK(hs_output_reserve(&output, 4 << 20, 0.0) == HS_OK && asked == 0);
    output.n_pairs = 4 << 20;
    const int64_t left = HS_LIMIT_FREE / 8 - output.n_pairs - 100;
    CHECK(hs_output_reserve(&output, left, 0.0) == HS_ERR_MEMORY && asked == 1);
    CHECK(account.held < HS_LIMIT_FREE && account.limit == (double)account.held);
    CHECK(hs_output_reserve(&output, left, 0.0) == HS_ERR_MEMORY && asked == 1);
    output.n_pairs = 0;
    hs_output_free(&output);
    CHECK(account.held == 0);
    hs_pool_clear();
}

#endif

void
test_results(void)
{
#if !HS_WATCHED_MALLOC
    RUN(the_limit_holds);
    RUN(without_the_lock);
#endif
#if !defined(_WIN32)
    RUN(many_threads);
    RUN(fork_in_the_middle);
#endif
#if !defined(HS_EMULATED)
#if CAN_LIMIT_ADDRESSES
    RUN(chunks_in_pages_are_aligned_and_zero);
    RUN(what_cannot_be_had_is_refused);
    RUN(cuts_may_be_refused);
    RUN(chunks_that_cannot_grow_stay);
#endif
    RUN(reserve_gives_room);
    RUN(detach_keeps_the_front);
    RUN(what_was_written_is_resident);
    RUN(failures_lose_nothing);
    hs_pool_clear();
    RUN(room_for_the_next_list_is_not_cut_off);
    RUN(a_limit_may_be_heard_of_while_it_is_passed);
#if !HS_WATCHED_MALLOC
    RUN(the_pool_wastes_no_more_than_half_of_a_chunk);
#endif
#if CAN_LIMIT_ADDRESSES
    RUN(what_is_too_much_for_the_pool_is_freed);
    RUN(columns_grow_by_little_where_little_is_left);
#endif
#endif
}
