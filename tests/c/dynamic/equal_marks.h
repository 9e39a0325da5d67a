/* SPDX-License-Identifier: BSD-3-Clause */
/* equal_marks.h: different keys whose hashes have the same 32 bits. */
#ifndef HS_EQUAL_MARKS_H
#define HS_EQUAL_MARKS_H

#include "../../../csrc/core/dynamic/key_map.h"
#include "../support/harness.h"

#include <stdlib.h>

static int
compare_marks(const void *one, const void *other)
{
    const uint64_t a = *(const uint64_t *)one, b = *(const uint64_t *)other;
    return (a > b) - (a < b);
}

/* Among 2^18 keys that differ in their ids, and in the tags of one id. */
static void
each_pair_of_equal_marks(void (*check)(hs_key one, hs_key other))
{
    enum { MANY = 1 << 18 };
    static uint64_t marks[MANY];
    for (int tagged = 0; tagged <= 1; tagged++) {
        int met = 0;
        for (int64_t x = 0; x < MANY; x++) {
            const hs_key key = {tagged ? 0 : x, tagged ? (int32_t)x : 0};
            marks[x] = (uint64_t)hs_key_mark(key) << 32 | (uint64_t)x;
        }
        qsort(marks, MANY, sizeof *marks, compare_marks);
        for (int m = 1; m < MANY; m++) {
            const int64_t one = (int64_t)(marks[m] & UINT32_MAX);
            const int64_t other = (int64_t)(marks[m - 1] & UINT32_MAX);
            if (marks[m] >> 32 == marks[m - 1] >> 32) {
                check((hs_key){tagged ? 0 : one, tagged ? (int32_t)one : 0},
                      (hs_key){tagged ? 0 : other, tagged ? (int32_t)other : 0});
                met++;
            }
        }
        CHECK(met > 0);
    }
}

#endif
