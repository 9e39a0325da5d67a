/* SPDX-License-Identifier: BSD-3-Clause */
/* test_sort_numbers.c: few and many numbers, spread evenly, crowded or equal, are put in order. */
#include "../../../csrc/core/base/sort_numbers.h"
#include "../support/harness.h"

#include <stdlib.h>
#include <string.h>

void test_sort_numbers(void);

enum { MOST = 5000 };

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
        for (int64_t e = 0; e < n; e++)
            numbers[e] = number(&random, trial % 6);
        memcpy(sorted, numbers, sizeof numbers);
        qsort(sorted, (size_t)n, sizeof *sorted, compare);
        hs_sort_numbers(numbers, n, spare);
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

void
test_sort_numbers(void)
{
    RUN(numbers_are_put_in_order);
    RUN(bits_are_counted);
}
