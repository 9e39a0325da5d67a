/* SPDX-License-Identifier: BSD-3-Clause */
/* test_radix_sort.c: keys come out ascending, each with its own number, equal ones in their
 * order. */
#include "../../../csrc/core/base/radix_sort.h"
#include "../support/harness.h"

void test_radix_sort(void);

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

void
test_radix_sort(void)
{
    RUN(keys_ascend_and_equal_ones_keep_their_order);
}
