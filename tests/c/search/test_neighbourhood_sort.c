/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * test_neighbourhood_sort.c: a gathered block in the order of its numbers, and of the shifts of its
 * images, against a plain sort, for numbers with few and with all bits, few and many candidates.
 */
#include "../../../csrc/core/search/neighbourhood_sort.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

#include <math.h>

void test_neighbourhood_sort(void);

enum { MOST = 3000, RUNS = 40, D = 2 };

typedef struct entry {
    int32_t id;
    int64_t shift[D];
    int32_t place;
} entry;

static bool by_shifts;

static int
compare_entries(const void *a, const void *b)
{
    const entry *one = a, *other = b;
    if (one->id != other->id)
        return one->id < other->id ? -1 : 1;
    for (int l = 0; by_shifts && l < D; l++) {
        if (one->shift[l] != other->shift[l])
            return one->shift[l] < other->shift[l] ? -1 : 1;
    }
    return one->place < other->place ? -1 : 1;
}

/* A block of n candidates in so many runs, with numbers below `numbers`. */
static void
fill(harness_random *random, int32_t n, int32_t runs, int64_t numbers, int32_t widest,
     hs_block *block)
{
    block->n = n;
    block->n_runs = runs;
    for (int32_t r = 0; r <= runs; r++) {
        block->runs[r].at = (int32_t)((int64_t)n * r / runs);
        for (int b = 0; r < runs && b < D; b++)
            block->runs[r].image[b] =
                (int32_t)(random_bits(random) % (2 * (unsigned)widest + 1)) - widest;
    }
    for (int32_t c = 0; c < n; c++) {
        block->id[c] = (int32_t)(random_bits(random) % (uint64_t)numbers);
        for (int k = 0; k < D; k++)
            block->y[k][c] = (float)(c + k * MOST);
        block->norm[c] = (float)-c;
    }
}

/* What the block's entries are, in the right order. */
static void
sort_plainly(const hs_block *block, const hs_lattice *lattice, entry *sorted)
{
    for (int32_t r = 0; r < block->n_runs; r++) {
        for (int32_t c = block->runs[r].at; c < block->runs[r + 1].at; c++) {
            sorted[c] = (entry){.id = block->id[c], .place = c};
            for (int l = 0; l < D; l++) {
                for (int b = 0; b < D; b++)
                    sorted[c].shift[l] += block->runs[r].image[b] * (int64_t)lattice->U[b][l];
            }
        }
    }
    qsort(sorted, (size_t)block->n, sizeof *sorted, compare_entries);
}

static bool
is_sorted(const hs_block *block, const entry *sorted, hs_block_use use)
{
    for (int32_t c = 0; c < block->n; c++) {
        const int32_t place = sorted[c].place;
        if (block->origin[c] != place || block->norm[c] != (float)-place ||
            block->y[1][c] != (float)(place + MOST) ||
            (use == HS_BLOCK_LISTS_IDS && block->id[c] != sorted[c].id))
            return false;
    }
    return true;
}

static void
blocks_are_sorted_by_number_and_shift(void)
{
    static entry   sorted[MOST];
    harness_random random = {4};
    hs_account     account;
    hs_options     options = hs_options_default();
    hs_order       order = {0};
    hs_block       block;
    const double   multiples[] = {0.0, 3.0, 0x1p20, -0x1p35};
    int            wrong = 0;
    options.memory_limit = 1e9;
    hs_account_init(&account, &options);
    CHECK(hs_block_init(&account, D, HS_BLOCK_LISTS_PLACES, MOST, RUNS, &block) == HS_OK);
    CHECK(hs_order_init(&account, &block, &order) == HS_OK);
    for (int trial = 0; trial < 1600; trial++) {
        const int32_t      n = trial % 4 == 3   ? MOST / 3 * (1 + trial % 3)
                               : trial % 4 == 2 ? 400
                                                : trial % 300;
        const int          bits = 1 + trial % 31;
        const hs_box       box = {.ndim = D,
                                  .periodic = {true, true},
                                  .rows = {{1.0, 0.0}, {multiples[trial / 7 % 4], 1.0}}};
        const hs_block_use use = trial % 2 ? HS_BLOCK_LISTS_PLACES : HS_BLOCK_LISTS_IDS;
        hs_lattice         lattice;
        hs_lattice_init(&box, D, (hs_scale){.exponent = 0, .first = 1.0, .second = 1.0}, &lattice);
        fill(&random, n, 1 + trial % RUNS, INT64_C(1) << bits, 1 << trial % 11, &block);
        by_shifts = use == HS_BLOCK_LISTS_PLACES;
        sort_plainly(&block, &lattice, sorted);
        CHECK(hs_order_block(&lattice, &options, use, &block, &order) == HS_OK);
        wrong += !is_sorted(&block, sorted, use);
    }
    CHECK(wrong == 0);
    hs_order_free(&account, &block, &order);
    hs_block_free(&account, &block);
    hs_account_close(&account);
}

/* Images whose shift over the rows as given passes 2^62, and are needed; or are not. */
static void
shifts_may_pass_their_range(void)
{
    harness_random random = {5};
    hs_account     account;
    hs_options     options = hs_options_default();
    hs_order       order = {0};
    hs_block       block;
    hs_lattice     lattice;
    const hs_box   box = {.ndim = D, .periodic = {true, true}, .rows = {{1.0, 0.0}, {0x1p60, 1.0}}};
    hs_account_init(&account, &options);
    hs_lattice_init(&box, D, (hs_scale){.exponent = 0, .first = 1.0, .second = 1.0}, &lattice);
    CHECK(hs_block_init(&account, D, HS_BLOCK_LISTS_PLACES, MOST, RUNS, &block) == HS_OK);
    CHECK(hs_order_init(&account, &block, &order) == HS_OK);
    fill(&random, 50, RUNS, 4, 1000, &block);
    CHECK(hs_order_block(&lattice, &options, HS_BLOCK_LISTS_IDS, &block, &order) == HS_OK);
    fill(&random, 50, RUNS, 4, 1000, &block);
    CHECK(hs_order_block(&lattice, &options, HS_BLOCK_LISTS_PLACES, &block, &order) ==
          HS_ERR_SHIFT_RANGE);
    hs_order_free(&account, &block, &order);
    hs_block_free(&account, &block);
    hs_account_close(&account);
}

static void
whichever_allocation_fails_nothing_is_left(void)
{
    hs_account    account;
    hs_options    options = hs_options_default();
    const int64_t before = hs_test_live_blocks();
    bool          ended = false;
    int           nth = 0;
    while (!ended && nth < 50) {
        hs_order order = {0};
        hs_block block;
        hs_account_init(&account, &options);
        CHECK(hs_block_init(&account, D, HS_BLOCK_LISTS_PLACES, MOST, RUNS, &block) == HS_OK);
        hs_test_fail_allocation(++nth);
        const hs_status status = hs_order_init(&account, &block, &order);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == (ended ? HS_OK : HS_ERR_MEMORY));
        hs_order_free(&account, &block, &order);
        hs_block_free(&account, &block);
        hs_account_close(&account);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && nth == 6);
}

/* Sizes that no block of a search has. */
static void
blocks_at_the_ends_of_the_range(void)
{
    CHECK(hs_extent_bits(UINT32_C(0x7f800000)) == UINT32_C(0x7f800000));
    CHECK(hs_extent_bits(UINT32_C(0x7f7fffff)) == UINT32_C(0x7f800000));
    CHECK(hs_extent_bits(0) == 0 && hs_extent_bits(1) == UINT32_C(1) << HS_EXTENT_SHIFT);
    CHECK(hs_block_most_hits(INT32_MAX) == INT32_MAX);
    CHECK(hs_block_most_hits(1000) >= 1000);
}

void
test_neighbourhood_sort(void)
{
    RUN(blocks_are_sorted_by_number_and_shift);
    RUN(shifts_may_pass_their_range);
    RUN(blocks_at_the_ends_of_the_range);
    RUN(whichever_allocation_fails_nothing_is_left);
}
