/* SPDX-License-Identifier: BSD-3-Clause */
/* test_crew.c: each thread has a worker, every worker that was opened is closed, whatever failed
 * between; each range is searched once, and the earliest failure is told. */
#include "../../../csrc/core/collect/crew.h"
#include "../support/harness.h"
#include "../support/pair_checks.h"

void test_crew(void);

enum { RANGES = 300, MOST_THREADS = 5 };

/* What the workers share: workers do not touch it but for the ranges, one byte each. */
typedef struct counting {
    int  n_opened, n_closed, fails_at; /* the worker that is not opened; 0: none */
    int  n_searched;
    char searched[RANGES];
} counting;

typedef struct worker {
    hs_committer committer;
    counting    *job;
    hs_options   options;
    void        *block; /* owned */
    int          n_searched;
} worker;

static hs_account *account;

static hs_status
open_worker(void *context, void *place)
{
    counting *job = context;
    worker   *me = place;
    CHECK(me->job == NULL && me->n_searched == 0 && me->block == NULL);
    me->job = job;
    me->options = hs_options_default();
    me->committer.options = &me->options;
    me->block = hs_alloc(account, HS_FOR_CANDIDATES, 100, 1);
    return me->block != NULL && ++job->n_opened != job->fails_at ? HS_OK : HS_ERR_MEMORY;
}

static void
close_worker(void *context, void *place)
{
    counting *job = context;
    worker   *me = place;
    job->n_closed++;
    job->n_searched += me->n_searched;
    hs_free(account, me->block);
}

/* A hs_range_fn. */
static hs_status
search_range(void *context, int64_t range)
{
    worker *me = context;
    me->n_searched++;
    me->job->searched[range]++;
    return HS_OK;
}

/* A hs_range_fn: all but the first fail. */
static hs_status
fail_range(void *context, int64_t range)
{
    worker *me = context;
    me->committer.failure.row = range;
    return range > 0 ? HS_ERR_TOO_MANY : search_range(context, range);
}

static hs_status
search_all(counting *job, int n_threads, hs_range_fn search, hs_failure *failure)
{
    const hs_options options = hs_options_default();
    hs_call          call;
    hs_call_begin(&options, &call);
    call.team = hs_team_create(n_threads);
    account = &call.account;
    hs_crew         crew = {.call = &call,
                            .job = job,
                            .worker_size = sizeof(worker),
                            .open = open_worker,
                            .close = close_worker,
                            .n_ranges = RANGES,
                            .n_open = 7, /* of no meaning */
                            .search = search};
    const hs_status status = hs_crew_run(&crew, failure);
    CHECK(status != HS_OK || job->n_opened == hs_team_size(call.team));
    CHECK(crew.n_written == 0); /* nothing is committed */
    CHECK(call.account.held == 0);
    hs_call_dismiss(&call);
    hs_account_close(&call.account);
    return status;
}

static void
each_range_is_searched_once(void)
{
    for (int threads = 1; threads <= MOST_THREADS; threads++) {
        counting   job = {.n_opened = 0};
        hs_failure failure;
        bool       once = true;
        CHECK(search_all(&job, threads, search_range, &failure) == HS_OK);
        for (int range = 0; range < RANGES; range++) {
            once = once && job.searched[range] == 1;
        }
        CHECK(once && job.n_searched == RANGES && job.n_closed == job.n_opened);
    }
}

/* The one that could not be opened is closed as well: it may have some of its parts. */
static void
what_was_opened_is_closed(void)
{
    for (int fails_at = 1; fails_at <= MOST_THREADS; fails_at++) {
        counting   job = {.fails_at = fails_at};
        hs_failure failure;
        const bool fails = search_all(&job, MOST_THREADS, search_range, &failure) != HS_OK;
        CHECK(job.n_closed == job.n_opened);
        CHECK(!fails || (job.n_opened == fails_at && job.n_searched == 0));
        CHECK(fails || job.n_opened < fails_at); /* threads may be refused */
    }
}

static void
refused_memory_is_told(void)
{
    for (int64_t nth = 1, failed = 1; failed; nth++) {
        counting   job = {.n_opened = 0};
        hs_failure failure;
        hs_test_fail_allocation(nth);
        const hs_status status = search_all(&job, 1, search_range, &failure);
        failed = !hs_test_failure_is_due();
        hs_test_fail_allocation(0);
        CHECK(status == (failed ? HS_ERR_MEMORY : HS_OK));
    }
}

static void
the_earliest_failure_is_told(void)
{
    for (int threads = 1; threads <= MOST_THREADS; threads++) {
        counting   job = {.n_opened = 0};
        hs_failure failure;
        CHECK(search_all(&job, threads, fail_range, &failure) == HS_ERR_TOO_MANY);
        CHECK(failure.row == 1 && job.searched[0] == 1);
        CHECK(job.n_closed == job.n_opened);
    }
}

void
test_crew(void)
{
    RUN(each_range_is_searched_once);
    RUN(what_was_opened_is_closed);
    RUN(refused_memory_is_told);
    RUN(the_earliest_failure_is_told);
}
