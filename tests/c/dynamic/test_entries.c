/* SPDX-License-Identifier: BSD-3-Clause */
/* test_entries.c: blocks do not overlap, come back by size, and stay where they are while the array
 * grows. */
#include "../../../csrc/core/dynamic/entries.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"

void test_entries(void);

static void
blocks_do_not_overlap(void)
{
    enum { BLOCKS = 200 };
    harness_random random = {1};
    hs_entries     entries;
    uint32_t       first[BLOCKS];
    int            size[BLOCKS];
    hs_entries_init(&entries, 2, true);
    for (int b = 0; b < BLOCKS; b++) {
        size[b] = (int)(random_bits(&random) % 4);
        first[b] = hs_entries_take(&entries, size[b]);
        CHECK(first[b] != HS_NO_PLACE);
        for (uint32_t e = 0; e < 1u << size[b]; e++) {
            hs_entry_at(&entries, first[b] + e)[0] = b;
            hs_entry_given(&entries, first[b] + e)[1] = b + 0.5;
            hs_entry_tail_at(&entries, first[b] + e)->id = b;
        }
    }
    for (int b = 0; b < BLOCKS; b++)
        for (uint32_t e = 0; e < 1u << size[b]; e++) {
            CHECK(hs_entry_at(&entries, first[b] + e)[0] == b);
            CHECK(hs_entry_given(&entries, first[b] + e)[1] == b + 0.5);
            CHECK(hs_entry_tail_at(&entries, first[b] + e)->id == b);
        }
    const uint32_t used = entries.n_used;
    hs_entries_give(&entries, size[3], first[3]);
    CHECK(hs_entries_take(&entries, size[3]) == first[3] && entries.n_used == used);
    hs_entries_free(&entries);
    hs_entries_free(&entries);
}

static void
copies_have_the_position_as_given(void)
{
    for (int keeps = 0; keeps <= 1; keeps++) {
        hs_entries entries;
        hs_entries_init(&entries, 3, keeps == 1);
        const uint32_t block = hs_entries_take(&entries, 1);
        hs_entry_at(&entries, block)[2] = 4.0;
        hs_entry_given(&entries, block)[2] = 5.0;
        hs_entry_tail_at(&entries, block)->tag = 9;
        hs_entries_copy(&entries, block, &entries, block + 1, 1);
        CHECK(hs_entry_at(&entries, block + 1)[2] == (keeps == 1 ? 4.0 : 5.0));
        CHECK(hs_entry_given(&entries, block + 1)[2] == 5.0);
        CHECK(hs_entry_tail_at(&entries, block + 1)->tag == 9);
        CHECK(hs_entries_bytes(&entries) >= 2 * (keeps == 1 ? 64 : 40));
        hs_entries_free(&entries);
    }
}

static void
refused_memory_leaves_blocks_as_they_are(void)
{
    for (int nth = 1; nth <= 2; nth++) {
        hs_entries entries;
        hs_entries_init(&entries, 1, true);
        const uint32_t block = hs_entries_take(&entries, 4);
        hs_entry_at(&entries, block)[0] = 7.0;
        hs_test_fail_allocation(nth);
        CHECK(hs_entries_take(&entries, 10) == HS_NO_PLACE);
        hs_test_fail_allocation(0);
        CHECK(hs_entry_at(&entries, block)[0] == 7.0);
        CHECK(hs_entries_take(&entries, 10) != HS_NO_PLACE);
        hs_entries_free(&entries);
    }
}

static void
more_than_there_are_numbers_for_is_refused(void)
{
    hs_entries entries;
    hs_entries_init(&entries, 1, false);
    CHECK(!hs_entries_reserve(&entries, INT64_C(1) << 32) && entries.capacity == 0);
    CHECK(hs_entries_take(&entries, 4) == 0 && entries.capacity == 16);
    CHECK(!hs_entries_reserve(&entries, INT64_C(0xFFFFFFF0)) && entries.capacity == 16);
    hs_entries_free(&entries);
}

void
test_entries(void)
{
    RUN(blocks_do_not_overlap);
    RUN(copies_have_the_position_as_given);
    RUN(refused_memory_leaves_blocks_as_they_are);
    RUN(more_than_there_are_numbers_for_is_refused);
}
