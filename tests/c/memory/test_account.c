/* SPDX-License-Identifier: BSD-3-Clause */
/* test_account.c: the arena of small blocks: apart, aligned, counted as any block, given back. */
#include "../../../csrc/core/memory/account.h"
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
}
