/* SPDX-License-Identifier: BSD-3-Clause */
/* test_parallel_memory.c: a search that is left half way needs room to the last pair that it leaves
 * with: with one byte less it fails, and takes nothing with it. */
#include "../../../csrc/core/collect/parallel.h"
#include "../support/search_unit.h"

#include <math.h>

void test_parallel_memory(void);

enum { N = 2000, ENOUGH = 200000 };

static search_unit unit;

/* Records some pairs, with so much memory beyond what is held, and returns how many. */
static hs_status
record(double room, int64_t *n_pairs)
{
    hs_search    *search = &unit.search;
    hs_bookmark   bookmark = {.point = 0};
    hs_failure    failure = HS_NO_FAILURE;
    hs_output     pairs;
    const int64_t held = search->call->account.held;
    search->call->account.limit = (double)held + room;
    hs_output_init(&search->call->account, 2, HS_WANT_I | HS_WANT_J, 8, &pairs);
    const hs_status status = hs_parallel_record_on(search, &pairs, ENOUGH, &bookmark, &failure);
    CHECK((bookmark.point > 0 || bookmark.blocks > 0) == (status == HS_OK));
    CHECK(bookmark.point < N);
    *n_pairs = pairs.n_pairs;
    hs_output_free(&pairs);
    CHECK(search->call->account.held == held);
    return status;
}

static void
the_last_pairs_need_their_room(void)
{
    int64_t n_pairs, n_all;
    double  low = 0.0, high = 0x1p30;
    search_unit_points(3, N, 2, 1.0, &unit);
    search_unit_open(NULL, 2.0, false, HS_WANT_I | HS_WANT_J, &unit);
    CHECK(record(high, &n_all) == HS_OK && n_all >= ENOUGH && n_all < N * (N - 1) / 2);
    while (high - low > 1.0) {
        const double    middle = floor(0.5 * (low + high));
        const hs_status status = record(middle, &n_pairs);
        CHECK(status == HS_OK || status == HS_ERR_MEMORY);
        CHECK(status != HS_OK || n_pairs == n_all);
        if (status == HS_OK)
            high = middle;
        else
            low = middle;
    }
    CHECK(high >= 16.0 * (double)n_all);
    CHECK(record(low, &n_pairs) == HS_ERR_MEMORY && n_pairs < n_all && n_pairs > 0);
    search_unit_close(&unit);
}

void
test_parallel_memory(void)
{
    RUN(the_last_pairs_need_their_room);
}
