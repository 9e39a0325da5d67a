/* SPDX-License-Identifier: BSD-3-Clause */
/* test_account.c: the arena of small blocks: apart, aligned, counted as any block, given back. */
#include "../support/address_space.h"

#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/memory/chunk.h"
#include "../../../csrc/core/memory/pool.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"
#include "../support/random_scenes.h"
#include "../support/among.h"

void test_account(void);

enum { BLOCKS = 40, STEPS = 20000, LARGEST = 6000 }; /* some fit the arena, some do not */

typedef struct kept_block {
    unsigned char *data; /* every byte is `mark`; NULL: none */
    int64_t        bytes;
    unsigned char  mark;
} kept_block;

static bool
is_whole(const kept_block *block)
{
    for (int64_t b = 0; b < block->bytes; b++) {
        if (block->data[b] != block->mark) {
            return false;
        }
    }
    return true;
}

static hs_account
new_account(void)
{
    const hs_options options = hs_options_default();
    hs_account       account;
    hs_account_init(&account, &options);
    return account;
}

static void
blocks_are_apart_and_counted(void)
{
    harness_random random = {771};
    kept_block     kept[BLOCKS] = {{0}};
    hs_account     account = new_account();
    const int64_t  before = hs_test_live_blocks();
    int64_t        held = 0, peak = 0;
    hs_test_use_arena(true);
    for (int step = 0; step < STEPS; step++) {
        kept_block *block = &kept[random_below(&random, BLOCKS)];
        if (block->data != NULL) {
            CHECK(is_whole(block));
            hs_free(&account, block->data);
            held -= block->bytes;
            block->data = NULL;
        } else {
            block->bytes = random_below(&random, 2) ? random_below(&random, 200)
                                                    : random_below(&random, LARGEST);
            block->mark = (unsigned char)step;
            block->data = hs_alloc(&account, HS_FOR_CELLS, block->bytes, 1);
            CHECK(block->data != NULL && (uintptr_t)block->data % HS_ALIGNMENT == 0);
            memset(block->data, block->mark, (size_t)block->bytes);
            held += block->bytes;
            peak = held > peak ? held : peak;
        }
        CHECK(account.held == held && account.total.bytes_peak == peak);
    }
    for (int k = 0; k < BLOCKS; k++) {
        hs_free(&account, kept[k].data);
    }
    CHECK(account.held <= held);
    hs_account_close(&account);
    hs_account_close(&account);
    hs_test_use_arena(false);
    CHECK(hs_test_live_blocks() == before);
}

static void
arena_is_filled_to_its_end(void)
{
    kept_block kept[3000];
    int        n = 0;
    hs_test_use_arena(true);
    for (int64_t bytes = 0; bytes < 130; bytes += 13, n = 0) {
        hs_account account = new_account();
        for (; n < (int)(sizeof kept / sizeof *kept); n++) {
            kept[n] =
                (kept_block){hs_alloc(&account, HS_FOR_CELLS, bytes, 1), bytes, (unsigned char)n};
            memset(kept[n].data, kept[n].mark, (size_t)bytes);
        }
        while (n-- > 0) {
            CHECK(is_whole(&kept[n]));
            hs_free(&account, kept[n].data);
        }
        CHECK(account.held == 0);
        hs_account_close(&account);
    }
    hs_test_use_arena(false);
}

static void
last_block_makes_room(void)
{
    hs_account account = new_account();
    hs_test_use_arena(true);
    void *first = hs_alloc(&account, HS_FOR_CELLS, 100, 1);
    void *second = hs_alloc(&account, HS_FOR_CELLS, 1000, 1);
    hs_free(&account, second);
    void *third = hs_alloc(&account, HS_FOR_CELLS, 10, 8);
    CHECK(!HS_HAVE_ARENA || third == second);
    hs_free(&account, third);
    hs_free(&account, first);
    void *fourth = hs_alloc(&account, HS_FOR_CELLS, 1, 1);
    CHECK(!HS_HAVE_ARENA || fourth == first);
    hs_free(&account, fourth);
    hs_account_close(&account);
    hs_test_use_arena(false);
}

/* Searches with and without: the same pairs and counters, and nothing left behind, also when an
 * allocation fails. */
static void
searches_are_the_same(void)
{
    static random_scene shared;
    harness_random      random = {9061};
    for (int trial = 0; trial < 120; trial++) {
        make_scene(&random, trial % SCENE_KINDS, 1 + trial % 4, 1 + random_below(&random, 90), 4.0,
                   0, &shared);
        const hs_points points = points_of(&shared.scene);
        hs_options      options = options_of(&shared.scene);
        hs_counters     counters[2];
        found_pairs     found[2];
        hs_plan         plan;
        int64_t         count = -1;
        const int64_t   before = hs_test_live_blocks();
        options.want = trial % 2 ? WANT_ALL : HS_WANT_I | HS_WANT_J;
        options.sorted = trial % 3 == 0;
        for (int arena = 0; arena < 2; arena++) {
            hs_test_use_arena(arena == 1);
            options.counters = &counters[arena];
            CHECK(search_pairs(&points, shared.scene.box, &options, &found[arena], NULL) == HS_OK);
        }
        options.counters = NULL;
        CHECK(memcmp(&counters[0], &counters[1], sizeof counters[0]) == 0);
        CHECK(found[0].n == found[1].n);
        CHECK(memcmp(found[0].i, found[1].i, (size_t)found[0].n * sizeof(int64_t)) == 0);
        CHECK(memcmp(found[0].j, found[1].j, (size_t)found[0].n * sizeof(int64_t)) == 0);
        CHECK(hs_pairs_count(AMONG(&points, shared.scene.box), &options, &count, NULL) == HS_OK);
        CHECK(count == found[0].n);
        CHECK(hs_plan_make(AMONG(&points, shared.scene.box), &options, &plan, NULL) == HS_OK);
        for (int nth = 1; nth < 12; nth++) {
            hs_pairs *pairs = NULL;
            hs_test_fail_allocation(nth);
            const hs_status status =
                hs_pairs_find(AMONG(&points, shared.scene.box), &options, &pairs, NULL);
            hs_test_fail_allocation(0);
            CHECK(status == HS_OK || status == HS_ERR_MEMORY);
            hs_pairs_free(pairs);
        }
        found_free(&found[0]);
        found_free(&found[1]);
        CHECK(hs_test_live_blocks() == before);
    }
    hs_test_use_arena(false);
}

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

/* A call for which its arena was too small leaves a larger one for the next, unless the pool is
 * off. */
static void
larger_arenas_are_left_for_later(void)
{
    const size_t limit = hs_pool_limit();
    hs_test_use_arena(true);
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
            CHECK(!HS_HAVE_ARENA || account.arena_is_pooled == has_room);
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
        CHECK(!HS_HAVE_ARENA || account.arena_is_pooled == (call == 2));
        CHECK(!HS_HAVE_ARENA || account.arena_was_small == (call == 0));
        hs_account_close(&account);
    }
    hs_pool_clear();
    hs_test_use_arena(false);
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
        CHECK(hs_pool_take_arena() == NULL);
        hs_test_pool_hold(false);
        CHECK(hs_pool_take_arena() == arena);
    }
    hs_chunk_free(arena);
}

/* A block that the arena of a pool has no room for any more is one of its own, and leaves none. */
static void
arenas_of_the_pool_are_filled_to_their_end(void)
{
    char *blocks[3];
    hs_test_use_arena(true);
    hs_pool_clear();
    for (int call = 0; call < 2; call++) {
        hs_account account = new_account();
        for (int b = 0; b < 3; b++) {
            blocks[b] = hs_alloc(&account, HS_FOR_CELLS, HS_POOL_SCRATCH / 8 * 3, 1);
            CHECK(blocks[b] != NULL);
            memset(blocks[b], b, HS_POOL_SCRATCH / 8 * 3);
        }
        CHECK(!HS_HAVE_ARENA || account.arena_was_small == (call == 0));
        for (int b = 0; b < 3; b++) {
            CHECK(blocks[b][0] == b && blocks[b][HS_POOL_SCRATCH / 8 * 3 - 1] == b);
            hs_free(&account, blocks[b]);
        }
        CHECK(account.held == 0);
        hs_account_close(&account);
    }
    hs_pool_clear();
    hs_test_use_arena(false);
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

/* A call ends well where memory is left for none, or one, of what it wants to leave behind; the next
 * one gets no arena and no block. */
static void
calls_end_without_any_memory(void)
{
    hs_test_use_arena(true);
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
        void *block = hs_alloc(&next, HS_FOR_CELLS, 100, 1);
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
    hs_test_use_arena(false);
}

#endif

/* A new start for the arena: the same block comes first again. */
static void
arenas_are_used_again(void)
{
    hs_account account = new_account();
    hs_account_reset(&account); /* there is none */
    hs_test_use_arena(true);
    char *first = hs_alloc(&account, HS_FOR_CELLS, 100, 1);
    char *second = hs_alloc(&account, HS_FOR_CELLS, 100, 1);
    hs_free(&account, first);
    hs_free(&account, second);
    hs_account_reset(&account);
    char *again = hs_alloc(&account, HS_FOR_CELLS, 100, 1);
    CHECK(!HS_HAVE_ARENA || again == first);
    hs_account_keep(&account);
    hs_account_reset(&account);
    char *next = hs_alloc(&account, HS_FOR_CELLS, 100, 1);
    CHECK(next != again && (!HS_HAVE_ARENA || next == second));
    hs_free(&account, next);
    hs_free(&account, again);
    hs_test_use_arena(false);
    hs_account_close(&account);
    CHECK(account.held == 0);
}

void
test_account(void)
{
    RUN(blocks_are_apart_and_counted);
    RUN(arena_is_filled_to_its_end);
    RUN(last_block_makes_room);
    RUN(searches_are_the_same);
    RUN(impossible_sizes_are_refused);
    RUN(large_blocks_are_trimmed);
    RUN(arenas_are_used_again);
    RUN(larger_arenas_are_left_for_later);
    RUN(arenas_are_not_waited_for);
    RUN(arenas_of_the_pool_are_filled_to_their_end);
#if CAN_LIMIT_ADDRESSES
    RUN(calls_end_without_any_memory);
#endif
}
