/* SPDX-License-Identifier: BSD-3-Clause */
/* test_pool_lock.c: where the lock of the pool is taken, memory comes from the system; a child that
 * is forked off meanwhile begins with an empty pool. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "../../../csrc/core/base/os_thread.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/pool_checks.h"

#if !defined(_WIN32)
#include <sys/wait.h>
#include <unistd.h>
#endif

void test_pool_lock(void);

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
    void *left = hs_pool_take(4 * MB); /* what is in the pool is lost below */
    hs_test_pool_hold(true);
    hs_test_fork();
    CHECK(hs_pool_held() == 0 && hs_pool_limit() == HS_POOL_LIMIT);
    CHECK(left != NULL && hs_pool_give(left) && hs_pool_held() == 4 * MB);
    reset_pool();
}

/* As a thread that loses its processor while it has the lock. */
static hs_thread_result HS_THREAD_CALL
hold_for_a_while(void *context)
{
    hs_test_pool_hold(true);
    hs_atomic_store(context, 1);
    for (int nap = 0; nap < 10; nap++)
        hs_nap();
    hs_test_pool_hold(false);
    return (hs_thread_result)0;
}

/* What would be skipped otherwise is done late. */
static void
a_lock_that_comes_free_is_waited_for(void)
{
    volatile int64_t has_lock = 0;
    hs_thread        holder;
    reset_pool();
    CHECK(hs_thread_start(&holder, hold_for_a_while, (void *)&has_lock));
    while (hs_atomic_load(&has_lock) == 0)
        hs_nap();
    CHECK(hs_pool_limit() == HS_POOL_LIMIT);
    hs_thread_join(holder);
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

void
test_pool_lock(void)
{
#if !HS_WATCHED_MALLOC
    RUN(without_the_lock);
    RUN(a_lock_that_comes_free_is_waited_for);
#endif
#if !defined(_WIN32)
    RUN(fork_in_the_middle);
#endif
}
