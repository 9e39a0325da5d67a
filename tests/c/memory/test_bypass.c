/* SPDX-License-Identifier: BSD-3-Clause */
/* test_bypass.c: bytes that go past the caches arrive, all of them and no others, at any place. */
#include "../../../csrc/core/memory/bypass.h"
#include "../support/harness.h"

void test_bypass(void);

enum { MOST = 400, AROUND = 100 };

/* Copies n bytes from one odd place to another and looks at every byte there. */
static int64_t
wrong_bytes(size_t to, size_t from, size_t n)
{
    static _Alignas(64) unsigned char source[MOST + AROUND], place[MOST + 2 * AROUND];
    int64_t                           wrong = 0;
    for (size_t k = 0; k < sizeof source; k++)
        source[k] = (unsigned char)(k * 37 + 1);
    memset(place, 0x5a, sizeof place);
    hs_bypass_copy(place + to, source + from, n);
    for (size_t k = 0; k < sizeof place; k++)
        wrong += place[k] != (k >= to && k < to + n ? source[from + k - to] : 0x5a);
    return wrong;
}

static void
all_bytes_arrive_and_no_others(void)
{
    static const size_t counts[] = {0, 1, 8, 63, 64, 65, 127, 128, 129, 200, MOST};
    int64_t             wrong = 0;
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++)
        for (size_t to = 0; to < 70; to++)
            for (size_t from = 0; from < 70; from += 3)
                wrong += wrong_bytes(to, from, counts[c]);
    CHECK(wrong == 0);
}

void
test_bypass(void)
{
    RUN(all_bytes_arrive_and_no_others);
}
