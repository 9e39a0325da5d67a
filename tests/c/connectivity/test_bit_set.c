/* SPDX-License-Identifier: BSD-3-Clause */
/* test_bit_set.c: numbers come out ascending, each once, and the set is empty afterwards. */
#include "../../../csrc/core/connectivity/bit_set.h"
#include "../support/harness.h"

void test_bit_set(void);

static void
numbers_come_out_ascending(void)
{
    static const int64_t sizes[] = {1, 63, 64, 65, 4096, 4097, 300000, 600001};
    harness_random       random = {2};
    static int32_t       out[5000];
    for (int s = 0; s < 8; s++) {
        const int64_t n = sizes[s];
        hs_bit_set    set;
        if (!hs_bit_set_make(NULL, n, &set)) {
            CHECK(!"there is memory");
            return;
        }
        for (int trial = 0; trial < 20; trial++) {
            const int64_t added = (int64_t)(random_bits(&random) % 200);
            int64_t       distinct = 0;
            for (int64_t k = 0; k < added; k++) {
                const uint64_t bits = random_bits(&random);
                const int32_t  number =
                    (int32_t)(k % 7 == 0 ? n - 1 : (int64_t)(bits % (uint64_t)n));
                distinct += !hs_bit_set_has(&set, number);
                hs_bit_set_add(&set, number);
                CHECK(hs_bit_set_has(&set, number));
            }
            CHECK(hs_bit_set_drain(&set, out) == distinct);
            for (int64_t k = 0; k < distinct; k++) {
                CHECK(!hs_bit_set_has(&set, out[k]) && out[k] < n);
                CHECK(k == 0 || out[k - 1] < out[k]);
            }
            CHECK(hs_bit_set_drain(&set, out) == 0);
        }
        hs_bit_set_free(NULL, &set);
    }
}

void
test_bit_set(void)
{
    RUN(numbers_come_out_ascending);
}
