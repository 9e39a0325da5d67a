/* SPDX-License-Identifier: BSD-3-Clause */
/* test_want.c: bytes and purpose of each quantity. */
#include "../../../csrc/core/base/want.h"
#include "../support/harness.h"

void test_want(void);

static void
quantities_have_the_widths_of_their_arrays(void)
{
    for (int ndim = 1; ndim <= HS_MAX_DIM; ndim++) {
        for (int bytes = 4; bytes <= 8; bytes += 4) {
            const size_t index = (size_t)bytes, d = (size_t)ndim;
            const size_t widths[] = {index, index, 8, 8 * d, 4 * d, 2 * index, 4};
            for (unsigned want = 0; want < 1u << HS_QUANTITIES; want++) {
                size_t sum = 0;
                for (int k = 0; k < HS_QUANTITIES; k++)
                    sum += want >> k & 1u ? widths[k] : 0;
                CHECK(hs_want_bytes(want, ndim, bytes) == (int64_t)sum);
            }
            for (int k = 0; k < HS_QUANTITIES; k++)
                CHECK(hs_want_width(1u << k, ndim, bytes) == widths[k]);
        }
    }
}

static void
bits_have_numbers_and_purposes(void)
{
    static const struct {
        unsigned   bit;
        hs_purpose purpose;
    } of[] = {{HS_WANT_I, HS_FOR_INDICES},          {HS_WANT_J, HS_FOR_INDICES},
              {HS_WANT_DISTANCE, HS_FOR_DISTANCES}, {HS_WANT_VECTOR, HS_FOR_VECTORS},
              {HS_WANT_SHIFT, HS_FOR_SHIFTS},       {HS_WANT_BOTH, HS_FOR_INDICES},
              {HS_WANT_SHELL, HS_FOR_INDICES}};
    for (int k = 0; k < HS_QUANTITIES; k++) {
        CHECK(of[k].bit == 1u << k && hs_want_number(of[k].bit) == k);
        CHECK(hs_want_purpose(k) == of[k].purpose);
    }
    CHECK(hs_want_number(0) == HS_QUANTITIES && hs_want_number(3) == HS_QUANTITIES);
    CHECK(hs_want_number(1u << HS_QUANTITIES) == HS_QUANTITIES);
    CHECK(HS_WANT_ALL == (HS_WANT_SHELL - 1));
}

void
test_want(void)
{
    RUN(quantities_have_the_widths_of_their_arrays);
    RUN(bits_have_numbers_and_purposes);
}
