/* SPDX-License-Identifier: BSD-3-Clause */
/* poll_checks.h: polls that stop a search, and calls whose memory is refused: one allocation after
 * the other, by a limit, or what an arena should have given back. */
#ifndef HS_POLL_CHECKS_H
#define HS_POLL_CHECKS_H

#include "../../../csrc/core/memory/memory.h"
#include "harness.h"

#include <math.h>

/* The context is how many polls there may still be. */
static inline bool
stop_after(void *context, double fraction)
{
    int64_t *left = context;
    CHECK(fraction >= 0.0 && fraction <= 1.0);
    return --*left >= 0;
}

typedef struct refusal {
    int64_t n, nth; /* polls so far; the only one that says no */
    double  done;   /* as the last one said */
    bool    twice;  /* the search counts first: its fractions begin anew */
} refusal;

static inline bool
refuse_once(void *context, double fraction)
{
    refusal *once = context;
    CHECK((fraction >= once->done || once->twice) && fraction >= 0.0 && fraction <= 1.0);
    once->done = fraction;
    return ++once->n != once->nth;
}

/* The account of a call without a limit. */
static inline hs_account
new_account(void)
{
    const hs_options options = hs_options_default();
    hs_account       account;
    hs_account_init(&account, &options);
    return account;
}

/* Calls the function, which frees what it is given, while its first, second, ... allocation is
 * refused, until it has no more: each call succeeds or says that memory is short, and nothing is
 * left. Returns which allocation there was not; 0 if `most` were not enough. */
static inline int
fail_each_allocation(hs_status (*run)(void *), void *context, int most)
{
    const int64_t before = hs_test_live_blocks();
    for (int nth = 1; nth <= most; nth++) {
        hs_test_fail_allocation(nth);
        const hs_status status = run(context);
        const bool      ended = hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == HS_OK || (status == HS_ERR_MEMORY && !ended));
        CHECK(hs_test_live_blocks() == before);
        if (ended)
            return nth;
    }
    CHECK(!"an allocation was left");
    return 0;
}

/* Calls the function, which frees what it is given, with small blocks cut from an arena, where the
 * build has one: that is given back, too. */
static inline void
check_arena(hs_status (*run)(void *), void *context)
{
    const int64_t before = hs_test_live_blocks();
    hs_test_uses_arena = true;
    CHECK(run(context) == HS_OK);
    hs_test_uses_arena = false;
    CHECK(hs_test_live_blocks() == before);
}

/* Calls the function, which frees what it is given and heeds *limit, under limits of memory from 0
 * bytes on until one is enough: each call before says that memory is short, and nothing is left.
 * Returns how many there were. */
static inline int
raise_memory_limit(hs_status (*run)(void *), void *context, double *limit)
{
    const int64_t before = hs_test_live_blocks();
    hs_status     status = HS_ERR_MEMORY;
    int           refused = -1;
    for (*limit = 0.0; status == HS_ERR_MEMORY; *limit = 1.02 * *limit + 16.0) {
        status = run(context);
        refused++;
        CHECK(hs_test_live_blocks() == before);
    }
    CHECK(status == HS_OK);
    *limit = HUGE_VAL;
    return refused;
}

#endif
