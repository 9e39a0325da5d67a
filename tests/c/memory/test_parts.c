/* SPDX-License-Identifier: BSD-3-Clause */
/* test_parts.c: the arrays of one block are aligned, have room and do not overlap; refused, nothing
 * has been written. */
#include "../../../csrc/core/memory/parts.h"
#include "../support/harness.h"

#include <string.h>

void test_parts(void);

enum { MOST = 7 };

/* Arrays of `trial` lengths, each filled with its number. */
static void
arrays_lie_beside_each_other(void)
{
    for (int trial = 0; trial < 60; trial++) {
        hs_options options = hs_options_default();
        hs_account account;
        hs_parts   parts;
        char      *array[MOST];
        int64_t    count[MOST];
        hs_account_init(&account, &options);
        hs_parts_begin(&parts);
        for (int p = 0; p < MOST; p++) {
            count[p] = (trial * (p + 1) * 7) % 41;
            hs_parts_add(&parts, (void **)&array[p], count[p], (size_t)(1 + p % 3) * 4);
            array[p] = NULL;
        }
        hs_test_fail_allocation(1);
        CHECK(hs_parts_alloc(&account, HS_FOR_CANDIDATES, &parts) == NULL && array[0] == NULL);
        char *block = hs_parts_alloc(&account, HS_FOR_CANDIDATES, &parts);
        CHECK(block != NULL && array[0] == block);
        CHECK(account.held == (int64_t)parts.bytes && parts.bytes % HS_ALIGNMENT == 0);
        for (int p = 0; p < MOST; p++) {
            CHECK((uintptr_t)array[p] % HS_ALIGNMENT == 0);
            memset(array[p], p + 1, (size_t)count[p] * (size_t)(1 + p % 3) * 4);
        }
        for (int p = 0; p < MOST; p++) {
            for (int64_t c = 0; c < count[p] * (1 + p % 3) * 4; c++) {
                CHECK(array[p][c] == p + 1);
            }
        }
        hs_free(&account, block);
        CHECK(account.held == 0);
        hs_account_close(&account);
    }
}

/* As many as there may be, all empty. */
static void
there_is_room_for_the_most(void)
{
    hs_parts parts;
    void    *array[HS_MOST_PARTS];
    hs_parts_begin(&parts);
    for (int p = 0; p < HS_MOST_PARTS; p++) {
        hs_parts_add(&parts, &array[p], 0, sizeof(double));
    }
    void *block = hs_parts_alloc(NULL, HS_FOR_CANDIDATES, &parts);
    CHECK(block != NULL && array[0] == block && array[HS_MOST_PARTS - 1] == block);
    hs_free(NULL, block);
}

void
test_parts(void)
{
    RUN(arrays_lie_beside_each_other);
    RUN(there_is_room_for_the_most);
}
