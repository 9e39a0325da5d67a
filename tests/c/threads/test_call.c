/* SPDX-License-Identifier: BSD-3-Clause */
/* test_call.c: what a call takes it gives back, and what it has done it says. */
#include "../../../csrc/core/threads/call.h"
#include "../support/harness.h"

#include <fenv.h>

void test_call(void);

/* An hs_poll_fn. */
static bool
note_poll(void *context, double fraction)
{
    *(double *)context = fraction;
    return fraction < 0.75;
}

static void
polls_are_counted_and_passed_on(void)
{
    double      seen = -1.0;
    hs_counters counters;
    hs_options  options = hs_options_default();
    hs_call     call;
    options.counters = &counters;
    options.poll = note_poll;
    options.poll_context = &seen;
    hs_call_begin(&options, &call);
    CHECK(call.options.poll(call.options.poll_context, 0.5) && seen == 0.5);
    CHECK(!call.options.poll(call.options.poll_context, 0.75) && seen == 0.75);
    hs_call_report(&call, 7);
    CHECK(counters.polls == 2 && counters.pairs == 7);
    hs_call_set_poll(NULL, NULL, &call);
    CHECK(call.options.poll == NULL);
}

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
    hs_call_begin(&options, &call);
    hs_call_note(&call, &done);
    hs_call_note(&call, &done);
    void *block = hs_alloc(&call.account, HS_FOR_CELLS, 100, 10);
    hs_free(&call.account, block);
    hs_call_report(&call, 0);
    CHECK(counters.groups == 2 && counters.candidates == 4 && counters.ambiguous == 6);
    CHECK(counters.by_float64 == 8 && counters.by_double_word == 10 && counters.by_integers == 12);
    CHECK(counters.polls == 14 && counters.pairs == 0);
    CHECK(counters.bytes[HS_FOR_CELLS] >= 1000 && counters.bytes_peak >= 1000);
    hs_call_restart(&call);
    hs_call_report(&call, 0);
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

static void
threads_come_and_go(void)
{
    hs_options options = hs_options_default();
    hs_call    call;
    options.threads = -2; /* from so many points on */
    hs_call_begin(&options, &call);
    hs_call_gather(&call, HS_POINTS_FOR_THREADS - 1);
    CHECK(call.team == NULL);
    hs_call_gather(&call, HS_POINTS_FOR_THREADS);
    const hs_team *team = call.team;
    hs_call_gather(&call, HS_POINTS_FOR_THREADS); /* they run already */
    CHECK(call.team == team && hs_team_size(team) <= 2);
    hs_call_dismiss(&call);
    hs_call_dismiss(&call);
    CHECK(call.team == NULL);
    options.threads = HS_MOST_THREADS + 1;
    CHECK(hs_call_threads(0.0, &options) == HS_MOST_THREADS);
}

/* A number of threads is the most that are started: little work has one. */
static void
threads_are_started_where_they_are_worth_it(void)
{
    hs_options options = hs_options_default();
    hs_call    call;
    options.threads = 2;
    CHECK(hs_test_worth_threads(1000.0) == 0.0);
    CHECK(hs_call_threads(999.0, &options) == 1 && hs_call_threads(1000.0, &options) == 2);
    hs_call_begin(&options, &call);
    hs_call_gather(&call, 900);
    hs_call_gather_for(&call, 900, 900.0);
    CHECK(call.team == NULL);
    hs_call_gather_for(&call, 900, 9000.0);
    CHECK(call.team != NULL);
    hs_call_dismiss(&call);
    call.options.want = 0; /* less is written */
    hs_call_gather_for(&call, 900, 4000.0);
    CHECK(call.team == NULL);
    call.options.threads = -2; /* by points alone */
    hs_call_gather_for(&call, 900, 1e9);
    CHECK(call.team == NULL);
    CHECK(hs_test_worth_threads(0.0) == 1000.0);
}

static void
a_call_that_is_kept_lets_go_of_the_callers_memory(void)
{
    double         seen;
    hs_counters    counters;
    hs_pair_arrays out = {.capacity = 0};
    hs_options     options = hs_options_default();
    hs_call        call;
    options.kernel = "scalar";
    options.counters = &counters;
    options.out = &out;
    options.poll = note_poll;
    options.poll_context = &seen;
    hs_call_begin(&options, &call);
    const hs_kernel *kernel = call.kernel;
    CHECK(kernel != NULL && strcmp(kernel->name, "scalar") == 0);
    hs_call_detach(&call);
    CHECK(call.options.kernel == NULL && call.options.counters == NULL && call.options.out == NULL);
    CHECK(call.options.poll == NULL && call.kernel == kernel);
    options.kernel = "none of that name";
    hs_call_begin(&options, &call);
    CHECK(call.kernel == NULL);
}

static void
a_limit_is_told_where_memory_was_short(void)
{
    hs_failure failure = {.limit_bytes = -1.0};
    hs_options options = hs_options_default();
    hs_call    call;
    options.memory_limit = 5e6;
    hs_call_begin(&options, &call);
    hs_call_tell_limit(&call, HS_OK, &failure);
    hs_call_tell_limit(&call, HS_ERR_CUTOFF, &failure);
    CHECK(failure.limit_bytes == -1.0);
    hs_call_tell_limit(&call, HS_ERR_MEMORY, &failure);
    CHECK(failure.limit_bytes == 5e6);
    hs_account_close(&call.account);
}

void
test_call(void)
{
    RUN(polls_are_counted_and_passed_on);
    RUN(what_was_done_adds_up);
    RUN(the_callers_environment_comes_back);
    RUN(threads_come_and_go);
    RUN(threads_are_started_where_they_are_worth_it);
    RUN(a_call_that_is_kept_lets_go_of_the_callers_memory);
    RUN(a_limit_is_told_where_memory_was_short);
}
