/* SPDX-License-Identifier: BSD-3-Clause */
/* test_gaps_failures.c: while far points are drawn together, allocations may fail and polls may
 * say no; nothing is left behind, and the next search is right. */
#include "../../../csrc/core/base/poll.h"
#include "../../../csrc/core/memory/account.h"
#include "../support/harness.h"
#include "../support/among.h"
#include "../support/poll_checks.h"

#include "../../../csrc/halfshell.h"

void test_gaps_failures(void);

enum { FAR = HS_POLL_POINTS + 1000 };

/* Many cutoffs lie between any two points, but for images of the same. */
static void
check_each_allocation(double scale)
{
    double          x[] = {0.25, 0.0, 4096.25, 0.0, 0.0, 1e200, -1e9, 1e200};
    const hs_points points = {x, 4, 2, HS_FLOAT64, 16, 8};
    const hs_box    box = {.ndim = 2, .periodic = {true, false}, .rows = {{scale, 0.0}}};
    hs_options      options = hs_options_default();
    hs_status       status = HS_ERR_MEMORY;
    bool            ended = false;
    int             nth = 0, n_failed = 0;
    for (int e = 0; e < 8; e++)
        x[e] *= scale;
    options.cutoff = 1e-60 * scale;
    options.want = HS_WANT_I | HS_WANT_J | HS_WANT_SHIFT;
    options.sorted = true;
    while (!ended && nth < 200) {
        const int64_t before = hs_test_live_blocks();
        hs_pairs     *pairs = NULL;
        hs_test_fail_allocation(++nth);
        status = hs_pairs_find(AMONG(&points, &box), &options, &pairs, NULL);
        ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || (status == HS_ERR_MEMORY && pairs == NULL));
        n_failed += status != HS_OK;
        if (status == HS_OK) {
            const int32_t *shift = hs_pairs_array(pairs, HS_WANT_SHIFT);
            CHECK(hs_pairs_length(pairs) == 2);
            CHECK(hs_pairs_length(pairs) == 2 && shift[0] == -4096 && shift[2] == 1000000000);
        }
        hs_pairs_free(pairs);
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(ended && status == HS_OK && n_failed > 8);
}

/* Where the cutoff is scaled up, and where it is scaled down, so that digits may be lost. */
static void
any_allocation_may_fail(void)
{
    check_each_allocation(1.0);
    check_each_allocation(0x1p300);
}

/* So many far points that putting them in order takes a while. */
static void
any_poll_may_end_it(void)
{
    const int64_t   before = hs_test_live_blocks();
    double         *x = malloc(FAR * sizeof *x);
    const hs_points points = {x, FAR, 1, HS_FLOAT64, 8, 8};
    hs_options      options = hs_options_default();
    hs_status       status = HS_ERR_INTERRUPTED;
    int64_t         nth = 0, count = -1;
    for (int64_t p = 0; p < FAR; p++) /* but for 0, 1 and 2 each is alone */
        x[p] = p < 3 ? (double)p : 1e200 * (double)((p * 7919) % FAR + 1);
    options.cutoff = 1.0;
    options.poll_context = NULL;
    while (status != HS_OK && nth < 50) {
        refusal once = {.nth = ++nth};
        options.poll = refuse_once;
        options.poll_context = &once;
        status = hs_pairs_count(AMONG(&points, NULL), &options, &count, NULL);
        CHECK(status == (once.n >= nth ? HS_ERR_INTERRUPTED : HS_OK));
    }
    CHECK(nth > 2 && nth < 50 && count == 2);
    free(x);
    CHECK(hs_test_live_blocks() == before);
}

void
test_gaps_failures(void)
{
    RUN(any_allocation_may_fail);
    RUN(any_poll_may_end_it);
}
