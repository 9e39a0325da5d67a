/* SPDX-License-Identifier: BSD-3-Clause */
/* test_pool.c: memory comes back, within the limit, from many threads. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/memory/pages.h"
#include "../support/pool_checks.h"

#if !defined(_WIN32)
#include <pthread.h>
#endif

void test_pool(void);

#if !HS_WATCHED_MALLOC

static void
results_are_recycled(void)
{
    reset_pool();
    char *first = make_result(20 * MB, 1);
    CHECK(hs_pool_held() == 0);
    hs_buffer_free(first);
    CHECK(hs_pool_held() == 20 * MB);
    hs_region region = {0};
    CHECK(hs_region_reserve(&region, 20 * MB));
    CHECK(region.data == first && is_all(first, 20 * MB, 1));
    CHECK(hs_pool_held() == 0);
    region.used = 0;
    hs_region_release(&region);
    CHECK(hs_pool_held() == 20 * MB); /* it knows what had been touched before */
    hs_pool_clear();
    CHECK(hs_pool_held() == 0);
}

/* More is expected than there is: the touched pages are still used. */
static void
recycled_memory_gets_more_room(void)
{
    reset_pool();
    hs_buffer_free(make_result(20 * MB, 1));
    hs_region region = {0};
    CHECK(hs_region_reserve(&region, 30 * MB));
#if HS_MAPPINGS_MOVE
    CHECK(hs_pool_held() == 0 && is_all(region.data, 20 * MB, 1));
#endif
    CHECK(region.capacity >= 30 * MB);
    memset(region.data, 2, 30 * MB);
    region.used = 30 * MB;
    hs_region_release(&region);
    CHECK(hs_pool_held() >= 30 * MB);
    hs_pool_clear();
}

static void
scratch_is_always_found(void)
{
    reset_pool();
    hs_region region = {0};
    for (int k = 0; k < 200; k++) {
        const size_t bytes = (size_t)(k * 7919 % 1000 + 1) * 1024;
        CHECK(hs_region_reserve(&region, bytes));
        const char *data = region.data;
        memset(region.data, 1, bytes);
        region.used = bytes;
        hs_region_release(&region);
        CHECK(hs_region_reserve(&region, 1 * MB));
        CHECK(k > 0 || region.data == data);
        hs_region_release(&region);
        CHECK(hs_pool_held() == 1 * MB);
    }
    hs_pool_clear();
    /* A large block serves, and comes back whole. */
    hs_buffer_free(make_result(50 * MB, 3));
    const size_t held = hs_pool_held();
    CHECK(hs_region_reserve(&region, 1000));
    CHECK(hs_pool_held() == 0);
    hs_region_release(&region);
    CHECK(hs_pool_held() == held);
    hs_pool_clear();
}

/* Chunks that nothing was written to take no memory, but they take address space. */
static void
clearing_takes_untouched_chunks_too(void)
{
    reset_pool();
    hs_pool_set_limit(SIZE_MAX);
    for (int k = 0; k < 3; k++) {
        hs_region region = {0};
        CHECK(hs_region_reserve(&region, 20 * MB));
        hs_region_expect(&region, 20 * MB);
        hs_region_release(&region);
    }
    hs_pool_clear();
    CHECK(hs_pool_take(20 * MB) == NULL);
    reset_pool();
}

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
    CHECK(hs_pool_held() == 0 && hs_pool_take(10) == NULL);
    for (int off = 0; off < 2; off++) { /* memory that nobody has touched is not kept either */
        hs_region region = {0};
        hs_pool_set_limit(off ? 0 : 5 * MB);
        CHECK(hs_region_reserve(&region, 3 * MB));
        hs_region_release(&region);
        if (!off)
            hs_pool_set_limit(0);
        CHECK(hs_pool_take(10) == NULL);
    }
    reset_pool();
}

static void
few_blocks_are_kept(void)
{
    enum { MANY = 50 };
    char *results[MANY];
    reset_pool();
    for (int k = 0; k < MANY; k++)
        results[k] = make_result(2 * MB, k);
    for (int k = 0; k < MANY; k++)
        hs_buffer_free(results[k]);
    CHECK(hs_pool_held() == HS_POOL_CHUNKS * 2 * MB);
    hs_pool_set_limit(HS_POOL_CHUNKS * 2 * MB); /* removes nothing that it allows */
    CHECK(hs_pool_held() == HS_POOL_CHUNKS * 2 * MB);
    /* The oldest ones went. */
    for (int k = 0; k < HS_POOL_CHUNKS; k++) {
        hs_region region = {0};
        CHECK(hs_region_reserve(&region, 2 * MB));
        CHECK(region.data[0] >= MANY - HS_POOL_CHUNKS);
        results[k] = hs_region_detach(&region, 2 * MB);
    }
    CHECK(hs_pool_held() == 0);
    for (int k = 0; k < HS_POOL_CHUNKS; k++)
        hs_buffer_free(results[k]);
    reset_pool();
}

static void
the_best_fit_is_taken(void)
{
    static const size_t sizes[] = {32, 8, 12, 5}, wanted[] = {6, 40, 4, 7};
    static const size_t found[] = {8, 32, 5, 12};
    char               *results[4];
    hs_region           regions[4] = {{0}};
    reset_pool();
    for (int k = 0; k < 4; k++)
        results[k] = make_result(sizes[k] * MB, 1);
    for (int k = 0; k < 4; k++)
        hs_buffer_free(results[k]);
    for (int k = 0; k < 4; k++) {
        const size_t before = hs_pool_held();
        CHECK(hs_region_reserve(&regions[k], wanted[k] * MB));
#if defined(__linux__)
        CHECK(before - hs_pool_held() == found[k] * MB);
#else
        CHECK(before >= hs_pool_held() && found[k] > 0);
#endif
    }
    for (int k = 0; k < 4; k++)
        hs_region_release(&regions[k]);
    reset_pool();
}

/* A small result from a large block pins nothing: the rest of the block is recycled. */
static void
small_results_take_little(void)
{
    char *results[8];
    reset_pool();
    hs_buffer_free(make_result(64 * MB, 1));
    for (int k = 0; k < 8; k++)
        results[k] = make_result(3 * MB, k);
#if defined(__linux__)
    CHECK(hs_pool_held() == 32 * MB); /* each takes two huge pages' place */
#endif
    for (int k = 0; k < 8; k++)
        CHECK(is_all(results[k], 3 * MB, k));
    for (int k = 0; k < 8; k++)
        hs_buffer_free(results[k]);
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

void
test_pool(void)
{
#if !HS_WATCHED_MALLOC
    RUN(results_are_recycled);
    RUN(recycled_memory_gets_more_room);
    RUN(scratch_is_always_found);
    RUN(clearing_takes_untouched_chunks_too);
    RUN(the_limit_holds);
    RUN(few_blocks_are_kept);
    RUN(the_best_fit_is_taken);
    RUN(small_results_take_little);
#endif
#if !defined(_WIN32)
    RUN(many_threads);
#endif
}
