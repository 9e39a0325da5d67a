/* SPDX-License-Identifier: BSD-3-Clause */
/* test_sort_numbers.c: numbers, keys and rows come out in order, those that are equal in the order
 * of before. */
#include "../../../csrc/core/base/sort.h"
#include "../support/harness.h"

#include <stdlib.h>
#include <string.h>

void test_sort_numbers(void);

/* ---- keys come out ascending, each with its own number, equal ones in their order ---- */

enum { MOST = 5000 };

static int64_t keys[MOST], given[MOST], spare_keys[MOST];
static int32_t ids[MOST], spare_ids[MOST];

static int64_t
random_key(harness_random *random, int kind)
{
    const int64_t any = (int64_t)(random_bits(random) >> 1);
    switch (kind) {
    case 0: return any;
    case 1: return any % 100;
    case 2: /* clusters far apart */ return any % 50 + (any >> 61) * (INT64_C(1) << 50);
    case 3: /* every magnitude */ return any >> (any % 63);
    case 4: return 7;
    default: /* bits far from each other */ return any & INT64_C(0x4000000100000001);
    }
}

static void
keys_ascend_and_equal_ones_keep_their_order(void)
{
    harness_random   random = {720};
    const hs_options options = hs_options_default();
    for (int trial = 0; trial < 600; trial++) {
        const int64_t n = (int64_t)(random_bits(&random) % (trial % 3 ? 200 : MOST));
        const int64_t first = n / 5, end = n - n / 7;
        hs_keys       sort = {keys, ids, spare_keys, spare_ids, &options, 0};
        for (int64_t e = 0; e < n; e++) {
            given[e] = keys[e] = trial % 11 == 10 ? e : random_key(&random, trial % 6);
            ids[e] = (int32_t)e;
        }
        CHECK(hs_keys_sort(&sort, first, end) == HS_OK);
        bool right = true;
        for (int64_t e = 0; e < n; e++) {
            right = right && ids[e] >= 0 && ids[e] < n && keys[e] == given[ids[e]];
            if (e < first || e >= end)
                right = right && ids[e] == e;
            else if (e > first)
                right = right &&
                        (keys[e - 1] < keys[e] || (keys[e - 1] == keys[e] && ids[e - 1] < ids[e]));
        }
        CHECK(right);
    }
}

/* ---- few and many numbers, spread evenly, crowded or equal, are put in order; those that agree
 * in the bits that count keep theirs ---- */

static int
compare(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* All 64 bits; a few bits high up; one crowd and some far away; all equal; digits that halve. */
static uint64_t
number(harness_random *random, int kind)
{
    const uint64_t bits = random_bits(random);
    switch (kind) {
    case 0: return bits;
    case 1: return bits % 8 << 40;
    case 2: return bits % 50 == 0 ? bits : (UINT64_C(1) << 63) + bits % 4096;
    case 3: return UINT64_MAX;
    case 4: return bits >> bits % 64;
    default: return bits % 100000;
    }
}

static void
numbers_are_put_in_order(void)
{
    static uint64_t numbers[MOST], sorted[MOST], spare[MOST];
    harness_random  random = {2718};
    for (int trial = 0; trial < 600; trial++) {
        const int64_t n = trial < 300 ? trial / 6 : (int64_t)(random_bits(&random) % MOST);
        const int     from = trial / 6 % 2 == 0 ? 0 : 32; /* then what is below goes down */
        for (int64_t e = 0; e < n; e++) {
            const uint64_t key = number(&random, trial % 6) << from;
            numbers[e] = from > 0 ? key | (uint64_t)(n - e) : key;
            sorted[e] = from > 0 ? key | (uint64_t)e : key;
        }
        qsort(sorted, (size_t)n, sizeof *sorted, compare);
        for (int64_t e = 0; e < n && from > 0; e++)
            sorted[e] = sorted[e] >> 32 << 32 | (uint64_t)(n - (int64_t)(sorted[e] & UINT32_MAX));
        hs_sort_numbers(numbers, n, from, spare);
        CHECK(memcmp(numbers, sorted, (size_t)n * sizeof *sorted) == 0);
    }
}

static void
bits_are_counted(void)
{
    CHECK(hs_count_bits(0) == 0);
    for (int bit = 0; bit < 64; bit++) {
        const uint64_t one = UINT64_C(1) << bit;
        CHECK(hs_count_bits(one) == bit + 1 && hs_count_bits(one | (one - 1)) == bit + 1);
    }
}

/* ---- parts of any lengths, filled in any order, begin where the ones before end ---- */

static void
parts_begin_where_others_end(void)
{
    int64_t       starts[] = {0, 2, 0, 3, 1};
    const int64_t expected[] = {0, 2, 2, 5, 6};
    const int     part[] = {2, 0, 3, 2, 0, 2}; /* of each entry, in the order that they come */
    int           entry[6];
    hs_starts_of_lengths(starts, 5);
    CHECK(memcmp(starts, expected, sizeof starts) == 0);
    for (int e = 0; e < 6; e++)
        entry[starts[part[e]]++] = e;
    hs_starts_of_ends(starts, 5);
    CHECK(memcmp(starts, expected, sizeof starts) == 0);
    CHECK(memcmp(entry, (int[]){1, 4, 0, 3, 5, 2}, sizeof entry) == 0);
}

static void
no_parts_have_one_end(void)
{
    int64_t starts[] = {0};
    hs_starts_of_lengths(starts, 1);
    hs_starts_of_ends(starts, 1);
    CHECK(starts[0] == 0);
}

void
test_sort_numbers(void)
{
    RUN(keys_ascend_and_equal_ones_keep_their_order);
    RUN(numbers_are_put_in_order);
    RUN(bits_are_counted);
    RUN(parts_begin_where_others_end);
    RUN(no_parts_have_one_end);
}
