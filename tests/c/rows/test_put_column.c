/* SPDX-License-Identifier: BSD-3-Clause */
/* test_put_column.c: numbers reach a column in their order, however many come at a time, and
 * nothing beyond it is written. */
#include "../../../csrc/core/rows/put_column.h"
#include "../support/harness.h"

void test_put_column(void);

enum { MOST = 5000, BEYOND = 64 };

static _Alignas(64) char column[(MOST + BEYOND) * 8];
static int32_t numbers[MOST], expected[MOST];

/* Puts n numbers, some of them repeated, in portions of up to `most` at a time. */
static void
put_all(harness_random *random, int64_t n, int64_t most, int index_bytes)
{
    hs_put_column out;
    int64_t       at = 0;
    hs_put_open(column, index_bytes, &out);
    while (at < n) {
        int64_t part = 1 + (int64_t)(random_bits(random) % (uint64_t)most);
        part = part < n - at ? part : n - at;
        const bool    repeats = random_bits(random) & 1;
        const int32_t first = (int32_t)(random_bits(random) >> 33);
        for (int64_t e = 0; e < part; e++)
            numbers[e] = expected[at + e] = repeats ? first : (first + (int32_t)e) & INT32_MAX;
        if (repeats) {
            hs_put_repeat(&out, first, part);
        } else {
            hs_put_numbers(&out, numbers, part);
        }
        at += part;
    }
    hs_put_numbers(&out, NULL, 0);
    hs_put_repeat(&out, 3, 0);
    hs_put_close(&out);
}

static int64_t
number_at(int64_t e, int index_bytes)
{
    int64_t wide;
    int32_t narrow;
    memcpy(&wide, column + e * 8 * (index_bytes == 8), sizeof wide);
    memcpy(&narrow, column + e * 4, sizeof narrow);
    return index_bytes == 8 ? wide : narrow;
}

static void
numbers_come_in_their_order(void)
{
    static const int64_t counts[] = {0, 1, 15, 16, 17, 511, 512, 513, 1023, 1024, 1025, 1100, MOST};
    static const int64_t most[] = {1, 7, 64, 1000, MOST};
    harness_random       random = {808};
    for (int trial = 0; trial < 13 * 5 * 2; trial++) {
        const int64_t n = counts[trial % 13];
        const int     index_bytes = trial % 2 ? 8 : 4;
        int64_t       wrong = 0;
        memset(column, 0x5a, sizeof column);
        put_all(&random, n, most[trial / 26], index_bytes);
        for (int64_t e = 0; e < n; e++)
            wrong += number_at(e, index_bytes) != expected[e];
        for (int64_t at = n * index_bytes; at < (int64_t)sizeof column; at++)
            wrong += column[at] != 0x5a;
        CHECK(wrong == 0);
    }
}

/* What is collected is written in whole lines, and the rest at the end. */
static void
part_of_a_column_is_not_there_before_it_is_closed(void)
{
    hs_put_column out;
    for (int e = 0; e < MOST; e++)
        numbers[e] = e;
    memset(column, 0x5a, sizeof column);
    hs_put_open(column, 4, &out);
    hs_put_numbers(&out, numbers, HS_PUT_BYTES / 4);
    CHECK(column[0] == 0x5a && out.n == HS_PUT_BYTES);
    hs_put_numbers(&out, numbers, 1);
    CHECK(out.n == 4 && out.to == column + HS_PUT_BYTES);
    hs_put_close(&out);
    CHECK(number_at(HS_PUT_BYTES / 4, 4) == 0 && number_at(5, 4) == 5);
}

void
test_put_column(void)
{
    RUN(numbers_come_in_their_order);
    RUN(part_of_a_column_is_not_there_before_it_is_closed);
}
