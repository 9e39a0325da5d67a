/* SPDX-License-Identifier: BSD-3-Clause */
/* test_memory.c: what a call takes is charged, limited and given back. */
#include "../../../csrc/core/memory/memory.h"
#include "../../../csrc/core/memory/results.h"
#include "../support/address_space.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/poll_checks.h"

void test_memory(void);

static void
impossible_sizes_are_refused(void)
{
    static const int64_t counts[] = {-1, INT64_MIN, INT64_MAX, INT64_C(1) << 61, INT64_C(1) << 32};
    static const size_t  sizes[] = {1, 8, 8, 1, (size_t)1 << 31};
    const int64_t        before = hs_test_live_blocks();
    hs_account           account = new_account();
    for (int c = 0; c < 5; c++) {
        if (HS_WATCHED_MALLOC && c == 3) {
            continue; /* it ends a program that wants so much of malloc */
        }
        CHECK(hs_alloc(NULL, HS_FOR_CELLS, counts[c], sizes[c]) == NULL);
        CHECK(hs_alloc(&account, HS_FOR_CELLS, counts[c], sizes[c]) == NULL);
    }
    CHECK(account.held == 0 && hs_test_live_blocks() == before);
    void *large = hs_alloc(&account, HS_FOR_CELLS, 3, (size_t)1 << 31); /* virtual */
    CHECK(large == NULL || account.held == INT64_C(3) << 31);
    hs_free(&account, large);
    CHECK(account.held == 0 && hs_test_live_blocks() == before);
}

/* What is kept stays, what is given back is no longer held; where blocks are the system's. */
static void
large_blocks_are_trimmed(void)
{
    enum { MB = 1 << 20 };
    for (int counted = 0; counted < 2; counted++) {
        hs_account     account = new_account();
        hs_account    *of = counted ? &account : NULL;
        unsigned char *block = hs_alloc(of, HS_FOR_CELLS, 9 * MB, 1);
        unsigned char *small = hs_alloc(of, HS_FOR_CELLS, 100, 1);
        memset(block, 7, 9 * MB);
        hs_trim(of, small, 10);
        hs_trim(of, block, 10 * MB); /* no less than it has */
        CHECK(!counted || account.held == 9 * MB + 100);
        hs_trim(of, block, 4 * MB);
        CHECK(!counted || account.held == 4 * MB + 100 || account.held == 9 * MB + 100);
        CHECK(block[0] == 7 && block[4 * MB - 1] == 7);
        hs_free(of, block);
        hs_free(of, small);
        CHECK(account.held == 0);
        hs_account_close(&account);
    }
}

static bool
has_pooled_arena(const hs_account *account)
{
    return account->arena != NULL && hs_chunk_of(account->arena)->capacity == HS_POOL_SCRATCH;
}

/* A call for which its arena was too small leaves a larger one for the next, unless the pool is
 * off. */
static void
larger_arenas_are_left_for_later(void)
{
    const size_t limit = hs_pool_limit();
    hs_test_uses_arena = true;
    for (int off = 0; off < 2; off++) {
        hs_pool_clear();
        hs_pool_set_limit(off ? 0 : limit);
        for (int call = 0; call < 3; call++) {
            hs_account account = new_account();
            char      *first = hs_alloc(&account, HS_FOR_CELLS, 100, 1);
            char      *large = hs_alloc(&account, HS_FOR_CELLS, 3 * HS_ARENA_BYTES, 1);
            char      *last = hs_alloc(&account, HS_FOR_CELLS, HS_POOL_SCRATCH, 1);
            const bool has_room = call > 0 && !off;
            CHECK(first != NULL && large != NULL && last != NULL);
            memset(large, 7, 3 * HS_ARENA_BYTES);
            CHECK(!HS_HAVE_ARENA || has_pooled_arena(&account) == has_room);
            CHECK(!HS_HAVE_ARENA || account.arena_was_small == !has_room);
            CHECK(!HS_HAVE_ARENA || (large > first && large < first + 256) == has_room);
            hs_free(&account, last);
            hs_free(&account, large);
            hs_free(&account, first);
            hs_account_close(&account);
            hs_account_close(&account);
            CHECK(!HS_HAVE_ARENA || hs_pool_held() == (off ? 0 : HS_POOL_SCRATCH));
        }
    }
    hs_pool_set_limit(limit);
    for (int call = 0; call < 3; call++) { /* the arena of what is kept is no other call's */
        hs_account account = new_account();
        account.is_kept = call == 1;
        hs_free(&account, hs_alloc(&account, HS_FOR_CELLS, 3 * HS_ARENA_BYTES, 1));
        CHECK(!HS_HAVE_ARENA || has_pooled_arena(&account) == (call == 2));
        CHECK(!HS_HAVE_ARENA || account.arena_was_small == (call == 0));
        hs_account_close(&account);
    }
    hs_pool_clear();
    hs_test_uses_arena = false;
}

/* While another thread has the lock of the pool. */
static void
arenas_are_not_waited_for(void)
{
    void *arena = hs_chunk_new(HS_POOL_SCRATCH);
    hs_chunk_of(arena)->is_arena = true;
    hs_pool_clear();
    if (hs_pool_give(arena)) {
        hs_test_pool_hold(true);
        CHECK(hs_pool_take(HS_POOL_SCRATCH, true) == NULL);
        hs_test_pool_hold(false);
        CHECK(hs_pool_take(HS_POOL_SCRATCH, true) == arena);
    }
    hs_chunk_free(arena);
}

#if CAN_LIMIT_ADDRESSES
/* All memory there is, in ever smaller blocks, each of which knows the one before. */
static void *
take_all(void)
{
    void *last = NULL;
    for (size_t bytes = HS_POOL_SCRATCH; bytes >= 2 * sizeof last; bytes /= 2) {
        for (void **block; (block = malloc(bytes)) != NULL; last = block)
            *block = last;
    }
    return last;
}

static void
give_all(void *last)
{
    while (last != NULL) {
        void *before = *(void **)last;
        free(last);
        last = before;
    }
}

/* A call ends well where memory is left for none, or one, of what it wants to leave behind; the
 * next one gets no arena and no block. */
static void
calls_end_without_any_memory(void)
{
    hs_test_uses_arena = true;
    for (int n_left = 0; n_left < 2; n_left++) {
        hs_pool_clear();
        hs_account account = new_account(), next = new_account();
        hs_free(&account, hs_alloc(&account, HS_FOR_CELLS, 3 * HS_ARENA_BYTES, 1));
        CHECK(!HS_HAVE_ARENA || account.arena_was_small);
        void        *left = hs_chunk_new(HS_POOL_SCRATCH);
        const rlim_t before = limit_addresses((size_t)16 << 20);
        void        *taken = take_all();
        if (n_left == 1)
            hs_chunk_free(left);
        hs_account_close(&account);
        const size_t held = hs_pool_held();
        void        *rest = take_all();
        hs_pool_clear();
        void *last = take_all();
        void *block = hs_alloc(&next, HS_FOR_CELLS, 5000, 1); /* more than malloc keeps apart */
        give_all(last);
        give_all(rest);
        give_all(taken);
        set_address_limit(before);
        CHECK(!HS_HAVE_ARENA || held == (n_left == 1 ? HS_POOL_SCRATCH : 0));
        CHECK(block == NULL && next.held == 0 && next.arena == NULL);
        if (n_left == 0)
            hs_chunk_free(left);
        hs_account_close(&next);
    }
    hs_pool_clear();
    hs_test_uses_arena = false;
}

#endif

void
test_memory(void)
{
    RUN(impossible_sizes_are_refused);
    RUN(large_blocks_are_trimmed);
    RUN(larger_arenas_are_left_for_later);
    RUN(arenas_are_not_waited_for);
#if CAN_LIMIT_ADDRESSES
    RUN(calls_end_without_any_memory);
#endif
}
