/* SPDX-License-Identifier: BSD-3-Clause */
/* test_account_shared.c: blocks of several threads are counted by one account as those of one. */
#include "../../../csrc/core/memory/account_shared.h"
#include "../../../csrc/core/threads/team.h"
#include "../support/harness.h"

void test_account_shared(void);

enum { TASKS = 400, STEPS = 200 };

static hs_account
new_account(double limit)
{
    hs_options options = hs_options_default();
    hs_account account;
    options.memory_limit = limit;
    hs_account_init(&account, &options);
    return account;
}

/* What was there stays, also where more is refused; what is given back is no longer held. */
static void
blocks_keep_what_they_hold(void)
{
    hs_account    account = new_account(4000.0);
    const int64_t before = hs_test_live_blocks();
    hs_shared    *shared = hs_shared_new(&account, HS_FOR_CANDIDATES);
    const int64_t own = account.held;
    void         *block = NULL;
    CHECK(hs_shared_resize(shared, &block, 0, 10, 8) && account.held == own + 80);
    for (int e = 0; e < 10; e++)
        ((int64_t *)block)[e] = e;
    CHECK(hs_shared_resize(shared, &block, 10, 100, 8) && account.held == own + 800);
    void *const kept = block;
    CHECK(!hs_shared_resize(shared, &block, 10, 500, 8)); /* beyond the limit */
    hs_test_fail_allocation(1);
    CHECK(!hs_shared_resize(shared, &block, 10, 110, 8));
    CHECK(block == kept && account.held == own + 800);
    for (int e = 0; e < 10; e++)
        CHECK(((int64_t *)block)[e] == e);
    CHECK(account.total.bytes[HS_FOR_CANDIDATES] == own + 880);
    hs_shared_release(shared, &block);
    CHECK(block == NULL && account.held == own);
    hs_shared_release(shared, &block); /* harmless */
    hs_shared_free(shared);
    hs_shared_free(NULL);
    CHECK(account.held == 0 && hs_test_live_blocks() == before);
    hs_test_fail_allocation(1);
    CHECK(hs_shared_new(&account, HS_FOR_CANDIDATES) == NULL);
    hs_test_fail_allocation(0);
    hs_account_close(&account);
}

static void
take_and_give(void *context, int64_t task)
{
    hs_shared *shared = context;
    void      *block = NULL;
    bool       right = true;
    for (int64_t step = 0; step < STEPS; step++) {
        right = right && hs_shared_resize(shared, &block, step > 0, 1 + step % 3, 8);
        right = right && (step == 0 || *(int64_t *)block == task);
        *(int64_t *)block = task;
    }
    hs_shared_release(shared, &block);
    CHECK(right);
}

/* No byte is lost where threads meet. */
static void
threads_share_one_account(void)
{
    hs_account account = new_account(1e9);
    hs_shared *shared = hs_shared_new(&account, HS_FOR_CANDIDATES);
    hs_team   *team = hs_team_create(4);
    int64_t    wanted = account.held;
    for (int64_t step = 0; step < STEPS; step++)
        wanted += TASKS * 8 * (1 + step % 3);
    hs_team_run(team, TASKS, take_and_give, shared);
    hs_team_free(team);
    CHECK(account.total.bytes[HS_FOR_CANDIDATES] == wanted);
    hs_shared_free(shared);
    CHECK(account.held == 0);
    hs_account_close(&account);
}

void
test_account_shared(void)
{
    RUN(blocks_keep_what_they_hold);
    RUN(threads_share_one_account);
}
