/* SPDX-License-Identifier: BSD-3-Clause */
/* test_call.c: what a call takes it gives back; teams do each task once, and passes meet every point
 * once. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <signal.h>
#endif
#include "../../../csrc/core/threads/call.h"
#include "../support/harness.h"

#include <fenv.h>

void test_call(void);

static void
what_was_done_adds_up(void)
{
    const hs_counters done = {.groups = 1,
                              .candidates = 2,
                              .ambiguous = 3,
                              .by_float64 = 4,
                              .by_double_word = 5,
                              .by_integers = 6,
                              .polls = 7};
    hs_counters       counters;
    hs_options        options = hs_options_default();
    hs_call           call;
    options.counters = &counters;
    (void)hs_call_enter(&options, NULL, &call);
    hs_call_add_counters(&call, &done);
    hs_call_add_counters(&call, &done);
    void *block = hs_alloc(&call.account, HS_FOR_CELLS, 100, 10);
    hs_free(&call.account, block);
    hs_call_leave(&call, 0);
    CHECK(counters.groups == 2 && counters.candidates == 4 && counters.ambiguous == 6);
    CHECK(counters.by_float64 == 8 && counters.by_double_word == 10 && counters.by_integers == 12);
    CHECK(counters.polls == 14 && counters.pairs == 0);
    CHECK(counters.bytes[HS_FOR_CELLS] >= 1000 && counters.bytes_peak >= 1000);
    hs_call_restart(&call);
    hs_call_leave(&call, 0);
    CHECK(counters.groups == 0 && counters.bytes[HS_FOR_CELLS] == 0 && counters.bytes_peak == 0);
    hs_account_close(&call.account);
}

/* Whether sums are rounded up now. */
static bool
rounds_up(void)
{
    volatile double one = 1.0, little = 0x1p-80;
    return one + little > 1.0;
}

static void
the_callers_environment_comes_back(void)
{
#ifdef FE_UPWARD
    hs_counters counters = {.pairs = -1};
    hs_failure  failure = {.row = 5, .column = 5, .system = 5, .value = 5.0, .in_queries = true};
    hs_options  options = hs_options_default();
    hs_call     call;
    options.counters = &counters;
    CHECK(fesetround(FE_UPWARD) == 0);
    CHECK(hs_call_enter(&options, &failure, &call) == &failure);
    CHECK(!rounds_up());
    CHECK(failure.row == -1 && failure.column == -1 && failure.system == -1);
    CHECK(failure.value == 0.0 && !failure.in_queries);
    hs_call_leave(&call, 3);
    CHECK(rounds_up() && counters.pairs == 3);
    /* A caller who does not want to know. */
    CHECK(hs_call_enter(&options, NULL, &call) == &call.entry.ignored &&
          call.entry.ignored.row == -1);
    hs_call_leave(&call, 4);
    CHECK(rounds_up() && counters.pairs == 4);
    CHECK(fesetround(FE_TONEAREST) == 0);
#endif
}

/* A number of threads is the most that are started: little work has one. */
static void
threads_are_started_where_they_are_worth_it(void)
{
    hs_options options = hs_options_default();
    hs_call    call;
    options.threads = 2;
    hs_test_worth_threads = 1000.0;
    CHECK(hs_call_threads(999.0, &options) == 1 && hs_call_threads(1000.0, &options) == 2);
    hs_call_begin(&options, &call);
    hs_call_gather(&call, 900);
    hs_call_gather_for(&call, 900, 900.0, false);
    CHECK(call.team == NULL);
    hs_call_gather_for(&call, 900, 9000.0, false);
    CHECK(call.team != NULL);
    hs_call_dismiss(&call);
    call.options.want = 0; /* less is written */
    hs_call_gather_for(&call, 900, 4000.0, false);
    CHECK(call.team == NULL);
    call.options.threads = -2; /* by points alone */
    hs_call_gather_for(&call, 900, 1e9, false);
    CHECK(call.team == NULL);
    hs_call_gather_for(&call, 900, 1e9, true); /* unless there are no others to be sorted */
    CHECK(call.team != NULL);
    hs_call_dismiss(&call);
    hs_test_worth_threads = 0.0;
}

/*
 * ---- teams ----
 *
 * The caller's own thread sees its mask of signals, the others see every signal blocked.
 */

enum { TASKS = 5000 };

typedef struct tally {
    int  done[TASKS];
    bool right[TASKS];
#if !defined(_WIN32)
    pthread_t caller;
#endif
} tally;

static void
do_task(void *context, int64_t task)
{
    tally *counts = context;
    counts->done[task]++;
    counts->right[task] = !rounds_up();
#if !defined(_WIN32)
    sigset_t blocked;
    (void)pthread_sigmask(SIG_BLOCK, NULL, &blocked);
    const bool is_caller = pthread_equal(pthread_self(), counts->caller) != 0;
    counts->right[task] &= (sigismember(&blocked, SIGINT) == 1) != is_caller;
#endif
}

static void
every_task_is_done_once(void)
{
    static tally counts;
    for (int n_threads = 0; n_threads <= 9; n_threads++) {
        hs_team *team = hs_team_create(n_threads);
        CHECK(hs_team_size(team) == (n_threads > 1 ? n_threads : 1));
        CHECK((team == NULL) == (n_threads <= 1));
        for (int job = 0; job < 20; job++) {
            const int64_t n_tasks = job % 7 == 0 ? TASKS : job % 5;
            bool          right = true;
            memset(&counts, 0, sizeof counts);
#if !defined(_WIN32)
            counts.caller = pthread_self();
#endif
            hs_team_run(team, n_tasks, do_task, &counts);
            for (int64_t task = 0; task < TASKS; task++)
                right = right && counts.done[task] == (task < n_tasks) &&
                        counts.right[task] == (task < n_tasks);
            CHECK(right);
        }
        hs_team_free(team);
    }
}

/* ---- strips and slabs, in rounds between which there is a poll ---- */

enum { MOST = 3 * HS_POLL_POINTS };

typedef struct walked {
    int64_t met, calls, failing; /* the call that fails; -1: none */
    int64_t polls, stops_at;
} walked;

static hs_status
note_range(void *context, int slab, int64_t first, int64_t last)
{
    walked *of = context;
    CHECK(slab >= 0 && slab < HS_SLABS && first <= last && first >= 0);
    of->met += last - first;
    return of->calls++ == of->failing ? HS_ERR_MEMORY : HS_OK;
}

static bool
note_poll(void *context, double fraction)
{
    walked *of = context;
    (void)fraction;
    return ++of->polls != of->stops_at;
}

/* n_strips: 0 for slabs. */
static hs_status
walk_points(int64_t n, int n_strips, int64_t failing, int64_t stops_at, walked *of)
{
    hs_options options = hs_options_default();
    *of = (walked){.failing = failing, .stops_at = stops_at};
    options.poll = note_poll;
    options.poll_context = of;
    return hs_walk_points(NULL, &options, n, n_strips, note_range, of);
}

static void
passes_end_behind_all_points_or_early(void)
{
    static const int64_t numbers[] = {
        0, 1, HS_SLAB_POINTS, HS_POLL_POINTS - 1, HS_POLL_POINTS, HS_POLL_POINTS + 1, MOST};
    walked of;
    for (int c = 0; c < 7; c++) {
        const int64_t n = numbers[c];
        for (int strips = 0; strips <= 3; strips++) {
            const int64_t rounds = (n + HS_POLL_POINTS - 1) / HS_POLL_POINTS;
            const int64_t slabs = (n + HS_SLAB_POINTS - 1) / HS_SLAB_POINTS;
            CHECK(walk_points(n, strips, -1, 0, &of) == HS_OK && of.met == n);
            CHECK(of.calls == (strips > 0 ? strips * rounds : slabs));
            CHECK(of.polls == n / HS_POLL_POINTS);
        }
    }
    CHECK(walk_points(MOST, 0, HS_SLABS + 1, 0, &of) == HS_ERR_MEMORY);
    CHECK(of.calls == 2 * HS_SLABS && of.polls == 1);
    CHECK(walk_points(MOST, 3, 2, 0, &of) == HS_ERR_MEMORY && of.calls == 3);
    CHECK(walk_points(MOST, 0, -1, 1, &of) == HS_ERR_INTERRUPTED && of.calls == HS_SLABS);
    CHECK(walk_points(MOST, 7, -1, 3, &of) == HS_ERR_INTERRUPTED && of.calls == 21);
}

void
test_call(void)
{
    RUN(what_was_done_adds_up);
    RUN(the_callers_environment_comes_back);
    RUN(threads_are_started_where_they_are_worth_it);
    RUN(every_task_is_done_once);
    RUN(passes_end_behind_all_points_or_early);
}
