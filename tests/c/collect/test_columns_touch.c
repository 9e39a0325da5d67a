/* SPDX-License-Identifier: BSD-3-Clause */
/* test_columns_touch.c: every page of a large column is written to, by parts, and small ones are
 * left alone. */
#include "../../../csrc/core/memory/account.h"
#include "../../../csrc/core/collect/columns.h"
#include "../support/harness.h"

void test_columns_touch(void);

enum { PAGE = 4096, PART = 4 * PAGE, PAIRS = 6000 };

typedef struct asked {
    int polls, most; /* times that it goes on */
} asked;

static bool
go_on(void *context, double fraction)
{
    asked *counts = context;
    CHECK(fraction >= 0.0 && fraction <= 1.0);
    return ++counts->polls <= counts->most;
}

/* Bytes of a column that are other than 0x5a, if all of these are the first of their page and among
 * the first `end`, else -1. */
static int64_t
touched_pages(const hs_output *output, unsigned bit, int64_t end)
{
    const unsigned char *bytes = hs_output_column(output, bit);
    const int64_t        n = PAIRS * (int64_t)hs_output_width(output, bit);
    int64_t              touched = 0;
    for (int64_t b = 0; b < n; b++) {
        if (bytes[b] != 0x5a) {
            touched = touched < 0 || b % PAGE != 0 || b >= end ? -1 : touched + 1;
        }
    }
    return touched;
}

/* Touches an output of j (8 bytes a pair) and D (24) whose first n pairs count. */
static hs_status
touch(int threads, int64_t n, asked *counts, int64_t *of_j, int64_t *of_vector)
{
    hs_options options = hs_options_default();
    hs_output  output;
    hs_team   *team = hs_team_create(threads);
    options.poll = go_on;
    options.poll_context = counts;
    counts->polls = 0;
    hs_output_init(NULL, 3, HS_WANT_J | HS_WANT_VECTOR, 8, &output);
    CHECK(hs_output_reserve(&output, PAIRS, 0.0) == HS_OK);
    memset(hs_output_column(&output, HS_WANT_J), 0x5a, PAIRS * 8);
    memset(hs_output_column(&output, HS_WANT_VECTOR), 0x5a, PAIRS * 24);
    output.n_pairs = n;
    const hs_status status = hs_touch_output(team, &options, &output);
    *of_j = touched_pages(&output, HS_WANT_J, n * 8);
    *of_vector = touched_pages(&output, HS_WANT_VECTOR, n * 24);
    hs_output_free(&output);
    hs_team_free(team);
    return status;
}

static int64_t
pages_of(int64_t bytes)
{
    return bytes >= 8 * PART ? (bytes + PAGE - 1) / PAGE : 0;
}

static void
each_page_is_written_to_once(void)
{
    static const int64_t sizes[] = {0, 100, 5461, 5462, 5500, PAIRS};
    const size_t         before = hs_test_touch_parts(PART);
    for (int threads = 1; threads <= 6; threads++) {
        for (int s = 0; s < 6; s++) {
            asked         counts = {.most = 1000};
            int64_t       of_j, of_vector;
            const int64_t parts = (sizes[s] * 24 + PART - 1) / PART;
            CHECK(touch(threads, sizes[s], &counts, &of_j, &of_vector) == HS_OK);
            CHECK(of_j == pages_of(sizes[s] * 8) && of_vector == pages_of(sizes[s] * 24));
            CHECK(counts.polls == (of_vector == 0 ? 0 : (parts + threads - 1) / threads));
        }
    }
    CHECK(hs_test_touch_parts(before) == PART);
}

static void
the_caller_may_stop_it(void)
{
    const size_t before = hs_test_touch_parts(PART);
    asked        counts = {.most = 2};
    int64_t      of_j, of_vector;
    CHECK(touch(1, PAIRS, &counts, &of_j, &of_vector) == HS_ERR_INTERRUPTED);
    CHECK(counts.polls == 3 && of_vector == 3 * PART / PAGE && of_j == 0);
    (void)hs_test_touch_parts(before);
}

/* Of each huge page that begins in the room of some pairs the first byte is written to, and no
 * other; what the caller's array has no room for is left alone. */
static void
huge_pages_are_written_to_where_they_begin(void)
{
    enum { HUGE_PAGE = 2 << 20, IN_PAGE = HUGE_PAGE / 4, FIRST = 100, END = 2 * IN_PAGE + 5 };
    static _Alignas(64) int32_t column[4 * IN_PAGE];
    const uintptr_t             begin = (uintptr_t)column;
    for (int trial = 0; trial < 4; trial++) {
        const bool           has_room = trial / 2;
        const unsigned       bit = trial % 2 ? HS_WANT_J : HS_WANT_I;
        hs_output            output;
        const int            end = has_room ? END : END - IN_PAGE;
        int64_t              wrong = 0;
        const size_t         n_bytes = sizeof column;
        const hs_pair_arrays arrays = {.capacity = end, .index_bytes = 4, .i = column, .j = column};
        hs_output_init(NULL, 3, bit, 4, &output);
        hs_output_fix(&output, &arrays);
        memset(column, 0x5a, n_bytes);
        hs_output_touch(&output, FIRST, END - FIRST);
        for (size_t at = 0; at < n_bytes; at++) {
            const bool is_first = (begin + at) % HUGE_PAGE == 0 && at >= 4 * (size_t)FIRST &&
                                  at < 4 * (size_t)end;
            wrong += ((const char *)column)[at] != (is_first ? 0 : 0x5a);
        }
        CHECK(wrong == 0);
        hs_output_free(&output);
    }
}

void
test_columns_touch(void)
{
    RUN(each_page_is_written_to_once);
    RUN(the_caller_may_stop_it);
    RUN(huge_pages_are_written_to_where_they_begin);
}
