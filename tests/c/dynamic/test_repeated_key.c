/* SPDX-License-Identifier: BSD-3-Clause */
/* test_repeated_key.c: keys of any order, of equal hashes, with and without tags. */
#include "../../../csrc/core/dynamic/repeated_key.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "equal_marks.h"

void test_repeated_key(void);

/* The first key that was there before, of any keys; without one there is none. */
static void
any_repeated_key_is_found(void)
{
    enum { MOST = 600 };
    static int64_t ids[MOST];
    static int32_t tags[MOST];
    harness_random random = {91};
    for (int trial = 0; trial < TRIALS(400); trial++) {
        const int n = 2 + (int)(random_bits(&random) % (MOST - 2)), kinds = trial % 3 ? 100000 : 40;
        int64_t   first = -1;
        for (int i = 0; i < n; i++) {
            ids[i] = (int64_t)(random_bits(&random) % (uint64_t)kinds) << (trial % 5 * 8);
            tags[i] = (int32_t)(random_bits(&random) % 3);
        }
        for (int i = 1; i < n && first < 0; i++) {
            for (int j = 0; j < i && first < 0; j++) {
                first = ids[i] == ids[j] && tags[i] == tags[j] ? i : -1;
            }
        }
        CHECK(hs_repeated_key(ids, tags, n) == first);
    }
}

static void
ascending_keys_are_not_repeated(void)
{
    const int64_t ids[5] = {-7, 0, 0, 0, 9};
    const int32_t tags[5] = {5, -2, 3, 4, 1}, same[5] = {5, -2, 3, 3, 1};
    CHECK(hs_repeated_key(ids, tags, 5) == -1 && hs_repeated_key(ids, tags, 0) == -1);
    CHECK(hs_repeated_key(ids, NULL, 5) == 2 && hs_repeated_key(ids, same, 5) == 3);
    hs_test_fail_allocation(1);
    CHECK(hs_repeated_key(ids, tags, 5) == -1); /* without a table */
    CHECK(hs_repeated_key(ids, same, 5) == -2);
    hs_test_fail_allocation(0);
}

/* Descending, so that it takes a table to see that none is repeated. */
static void
check_not_repeated(hs_key one, hs_key other)
{
    const int64_t ids[2] = {one.id, other.id};
    const int32_t tags[2] = {one.tag, other.tag};
    CHECK(hs_repeated_key(ids, tags, 2) == -1);
    CHECK(one.id == other.id || hs_repeated_key(ids, NULL, 2) == -1);
}

static void
keys_of_equal_marks_are_not_repeated(void)
{
    each_pair_of_equal_marks(check_not_repeated);
}

static void
refused_memory_is_said(void)
{
    const int64_t ids[3] = {3, 1, 2};
    hs_test_fail_allocation(1);
    CHECK(hs_repeated_key(ids, NULL, 3) == -2);
    hs_test_fail_allocation(0);
    CHECK(hs_repeated_key(ids, NULL, 3) == -1);
}

void
test_repeated_key(void)
{
    RUN(any_repeated_key_is_found);
    RUN(ascending_keys_are_not_repeated);
    RUN(keys_of_equal_marks_are_not_repeated);
    RUN(refused_memory_is_said);
}
