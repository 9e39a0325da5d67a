/* SPDX-License-Identifier: BSD-3-Clause */
/* test_record.c: each hit becomes a pair once, with i and j in columns of any shape. */
#include "../support/record_unit.h"

void test_record(void);

enum { N = 300 };

static search_unit unit;
static record_unit recorded;

static int64_t
count_pairs(double cutoff)
{
    int64_t n = 0;
    for (int i = 0; i < N; i++) {
        for (int j = i + 1; j < N; j++)
            n += hypot(unit.x[2 * i] - unit.x[2 * j], unit.x[2 * i + 1] - unit.x[2 * j + 1]) <=
                 cutoff;
    }
    return n;
}

/* Each pair once, both being i and j side by side, whichever other columns there are: i < j, or all
 * that the asking point i meets, itself too. */
static void
check_shape(int shape, bool is_full)
{
    static uint8_t met[N][N];
    const unsigned columns = HS_WANT_I | HS_WANT_J | HS_WANT_BOTH |
                             (shape & 1 ? HS_WANT_DISTANCE : 0);
    const int index_bytes = shape & 2 ? 8 : 4;
    int32_t   failed;
    int64_t   wrong = 0;
    memset(met, 0, sizeof met);
    search_unit_open(NULL, 0.5, is_full, columns, &unit);
    CHECK(record_all(&unit, columns, index_bytes, &failed, &recorded) == HS_OK);
    CHECK(recorded.output.n_pairs == (is_full ? 2 * count_pairs(0.5) + N : count_pairs(0.5)));
    const char *both = hs_output_column(&recorded.output, HS_WANT_BOTH);
    for (int64_t e = 0; e < recorded.output.n_pairs; e++) {
        const int64_t i = recorded_index(&recorded, HS_WANT_I, e);
        const int64_t j = recorded_index(&recorded, HS_WANT_J, e);
        int64_t       pair[2];
        memcpy(pair, both + e * 2 * index_bytes, 2 * (size_t)index_bytes);
        if (index_bytes == 4) {
            int32_t narrow[2];
            memcpy(narrow, pair, sizeof narrow);
            pair[0] = narrow[0];
            pair[1] = narrow[1];
        }
        wrong += i < 0 || i >= N || j < 0 || j >= N || (!is_full && i >= j);
        wrong += pair[0] != i || pair[1] != j || met[i][j]++;
    }
    CHECK(wrong == 0);
    record_unit_free(&unit, &recorded);
    search_unit_close(&unit);
}

static void
pairs_come_once_in_every_shape(void)
{
    search_unit_points(111, N, 2, 4.0, &unit);
    for (int shape = 0; shape < 8; shape++)
        check_shape(shape, shape & 4);
}

/* Where there is no room for more, what was recorded stays. */
static void
no_room_for_hits_is_told(void)
{
    int32_t failed;
    search_unit_points(112, N, 2, 1.0, &unit);
    search_unit_open(NULL, 0.75, false, HS_WANT_I | HS_WANT_J, &unit);
    unit.call.account.limit = 100e3;
    CHECK(record_all(&unit, HS_WANT_I | HS_WANT_J, 8, &failed, &recorded) == HS_ERR_MEMORY);
    CHECK(recorded.output.n_pairs < count_pairs(0.75));
    record_unit_free(&unit, &recorded);
    search_unit_close(&unit);
}

void
test_record(void)
{
    RUN(pairs_come_once_in_every_shape);
    RUN(no_room_for_hits_is_told);
}
