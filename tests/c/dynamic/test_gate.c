/* SPDX-License-Identifier: BSD-3-Clause */
/* test_gate.c: a writer is alone, readers are not, and no thread waits for ever, in a child neither;
 * lists that threads share; a thread that holds a list is alone, and polls end long queries. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "../../../csrc/core/base/os_thread.h"
#include "../../../csrc/core/dynamic/dynamic.h"
#include "../support/harness.h"

#if !defined(_WIN32)
#include <sys/wait.h>
#include <unistd.h>
#endif

void test_gate(void);

enum { ROUNDS = 20000, THREADS = 4 };

#define EMPTY  (hs_n_forks * (INT64_C(1) << 32))
#define WRITER (EMPTY + (INT64_C(1) << 31))

typedef struct shared {
    hs_gate gate;
    int64_t one, other; /* equal, but while a writer is inside */
    bool    differed;
} shared;

static hs_thread_result HS_THREAD_CALL
read_and_write(void *context)
{
    shared *of = context;
    for (int round = 0; round < ROUNDS; round++) {
        if (round % 4 == 0) {
            hs_gate_enter(&of->gate, true);
            of->one++;
            of->other++;
            hs_gate_leave(&of->gate, true);
        } else {
            hs_gate_enter(&of->gate, false);
            const bool same = of->one == of->other;
            hs_gate_leave(&of->gate, false);
            if (!same) {
                hs_gate_enter(&of->gate, true);
                of->differed = true;
                hs_gate_leave(&of->gate, true);
            }
        }
    }
    return (hs_thread_result)0;
}

static void
writers_are_alone(void)
{
    shared    of = {.differed = false};
    hs_thread threads[THREADS];
    hs_gate_init(&of.gate);
    for (int t = 0; t < THREADS; t++)
        CHECK(hs_thread_start(&threads[t], read_and_write, &of));
    for (int t = 0; t < THREADS; t++)
        hs_thread_join(threads[t]);
    CHECK(of.one == THREADS * ROUNDS / 4 && of.one == of.other && !of.differed);
    CHECK(of.gate.state == EMPTY && hs_n_waiting == 0);
}

static hs_thread_result HS_THREAD_CALL
read_one(void *context)
{
    shared *of = context;
    hs_gate_enter(&of->gate, false);
    of->differed = of->one != of->other;
    hs_gate_leave(&of->gate, false);
    return (hs_thread_result)0;
}

/* It sleeps until the writer leaves, and sees all that was written. */
static void
a_reader_waits_for_a_writer(void)
{
    shared    of = {.differed = true};
    hs_thread reader;
    hs_gate_init(&of.gate);
    hs_gate_enter(&of.gate, true);
    of.one = 1;
    CHECK(hs_thread_start(&reader, read_one, &of));
    while (hs_atomic_load(&hs_n_waiting) == 0)
        hs_nap();
    CHECK(hs_atomic_load(&of.gate.state) == WRITER && of.differed);
    of.other = 1;
    hs_gate_leave(&of.gate, true);
    hs_thread_join(reader);
    CHECK(!of.differed && of.gate.state == EMPTY && hs_n_waiting == 0);
}

static void
readers_are_many(void)
{
    hs_gate gate;
    hs_gate_init(&gate);
    hs_gate_enter(&gate, false);
    hs_gate_enter(&gate, false);
    CHECK(gate.state == EMPTY + 2);
    hs_gate_leave(&gate, false);
    hs_gate_leave(&gate, false);
    hs_gate_enter(&gate, true);
    CHECK(gate.state == WRITER);
    hs_gate_leave(&gate, true);
}

#if !defined(_WIN32) && !defined(HS_COVERAGE) && !defined(__SANITIZE_THREAD__) && \
    !defined(HS_EMULATED)
/* A thread of the parent that was inside, or waited, does not exist in a child, whose own threads
 * wait for each other. (QEMU ends a child that is forked off while threads run.) */
static int
enter_in_child(hs_gate *gate)
{
    shared    of = {.gate = *gate};
    hs_thread threads[2];
    hs_gate_enter(gate, true);
    hs_gate_leave(gate, true);
    for (int t = 0; t < 2; t++)
        if (!hs_thread_start(&threads[t], read_and_write, &of))
            return 1;
    for (int t = 0; t < 2; t++)
        hs_thread_join(threads[t]);
    return of.one != ROUNDS / 2 || of.other != of.one || of.differed || gate->state != EMPTY;
}

static hs_thread_result HS_THREAD_CALL
write_nothing(void *context)
{
    hs_gate_enter(context, true);
    hs_gate_leave(context, true);
    return (hs_thread_result)0;
}

static void
children_do_not_wait_for_the_parent(void)
{
    hs_gate   gate;
    hs_thread writer;
    int       status = 1;
    hs_gate_init(&gate);
    hs_gate_enter(&gate, false);
    CHECK(hs_thread_start(&writer, write_nothing, &gate));
    while (hs_atomic_load(&hs_n_waiting) == 0)
        hs_nap();
    for (int k = 0; k < 5; k++) { /* the writer is asleep, or just looks again */
        const pid_t child = fork();
        if (child == 0)
            _exit(enter_in_child(&gate));
        CHECK(waitpid(child, &status, 0) == child && status == 0);
    }
    hs_gate_leave(&gate, false);
    hs_thread_join(writer);
    CHECK(gate.state == EMPTY && hs_n_waiting == 0);
}

#endif

/* As if the process had been forked off while a thread was inside: readers too, which come before
 * any writer, count as those of the child. */
static void
those_inside_another_process_are_forgotten(void)
{
    hs_gate gate;
    hs_gate_init(&gate);
    hs_gate_enter(&gate, false);
    hs_test_fork();
    hs_gate_enter(&gate, false);
    CHECK(gate.state == EMPTY + 1);
    hs_gate_leave(&gate, false);
    hs_gate_enter(&gate, true);
    hs_test_fork();
    hs_gate_enter(&gate, true);
    CHECK(gate.state == WRITER);
    hs_gate_leave(&gate, true);
    CHECK(gate.state == EMPTY);
}

/* Threads that try to go in while another one holds the gate. */
static hs_thread_result HS_THREAD_CALL
write_one(void *context)
{
    shared *of = context;
    CHECK(!hs_gate_is_mine(&of->gate) && hs_gate_enter(&of->gate, true));
    of->one = of->other;
    hs_gate_leave(&of->gate, true);
    return (hs_thread_result)0;
}

static void
who_holds_the_gate_is_inside_and_others_wait(void)
{
    shared    of = {.one = 1, .other = 2};
    hs_thread reader, writer;
    hs_gate_init(&of.gate);
    CHECK(!hs_gate_is_mine(&of.gate) && hs_gate_hold(&of.gate) && hs_gate_is_mine(&of.gate));
    CHECK(!hs_gate_hold(&of.gate) && !hs_gate_enter(&of.gate, false) &&
          !hs_gate_enter(&of.gate, true));
    CHECK(hs_thread_start(&writer, write_one, &of));
    CHECK(hs_thread_start(&reader, read_one, &of));
    while (hs_atomic_load(&hs_n_waiting) < 2)
        hs_nap();
    CHECK(of.one == 1 && !of.differed);
    of.other = 1;
    hs_gate_release(&of.gate);
    hs_thread_join(writer);
    hs_thread_join(reader);
    CHECK(of.one == 1 && !of.differed && of.gate.state == EMPTY && hs_n_waiting == 0);
    CHECK(!hs_gate_is_mine(&of.gate));
}

static volatile int64_t n_pauses, n_resumes;
static int              token;

static void *
count_pause(void)
{
    (void)hs_atomic_add(&n_pauses, 1);
    return &token;
}

static void
count_resume(void *paused)
{
    CHECK(paused == &token);
    (void)hs_atomic_add(&n_resumes, 1);
}

/* Around each wait, and not when it goes in. */
static void
writers_that_wait_pause(void)
{
    shared    of = {.one = 1, .other = 1};
    hs_thread thread;
    hs_gate_init(&of.gate);
    of.gate.pause = count_pause;
    of.gate.resume = count_resume;
    hs_gate_enter(&of.gate, true);
    hs_gate_leave(&of.gate, true);
    CHECK(hs_atomic_load(&n_pauses) == 0);
    hs_gate_enter(&of.gate, false);
    CHECK(hs_thread_start(&thread, write_one, &of));
    while (hs_atomic_load(&n_pauses) == 0)
        hs_nap();
    hs_gate_leave(&of.gate, false);
    hs_thread_join(thread);
    CHECK(hs_atomic_load(&n_pauses) == hs_atomic_load(&n_resumes));
    hs_gate_enter(&of.gate, true);
    const int64_t before = hs_atomic_load(&n_pauses);
    CHECK(hs_thread_start(&thread, read_one, &of)); /* readers do not */
    while (hs_atomic_load(&hs_n_waiting) == 0)
        hs_nap();
    hs_gate_leave(&of.gate, true);
    hs_thread_join(thread);
    CHECK(hs_atomic_load(&n_pauses) == before);
}

/* Queries of many threads while others change the list: points that stay are always found, and each
 * thread's own are where it put them. */

enum { LASTING = 100, CHANGES = 400 };

typedef struct task {
    hs_dynamic *list;
    int64_t     first; /* key of its own points */
    int         failures;
} task;

static void
fixed_position(int64_t id, double *x)
{
    x[0] = (double)(id % 10);
    x[1] = (double)(id / 10);
}

static int
count_fixed(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)position, (void)shift;
    *(int *)user += key.id < LASTING;
    return 0;
}

static hs_thread_result HS_THREAD_CALL
ask_and_change(void *context)
{
    task          *of = context;
    harness_random random = {(uint64_t)of->first};
    for (int round = 0; round < CHANGES; round++) {
        const hs_key own = {of->first + round % 7, 0};
        double       x[2] = {10.0 * random_unit(&random), 10.0 * random_unit(&random)}, back[2];
        int          n = 0;
        of->failures += hs_dynamic_insert(of->list, own, x, NULL) != HS_OK;
        of->failures += hs_dynamic_position(of->list, own, back) != HS_OK || back[0] != x[0];
        fixed_position((int64_t)(random_bits(&random) % LASTING), x);
        of->failures +=
            hs_dynamic_within(of->list, x, 1.0, false, count_fixed, &n, NULL) != HS_OK || n != 5;
        if (round % 3 == 0)
            of->failures += !hs_dynamic_remove(of->list, own);
        if (round % 100 == 99)
            of->failures += hs_dynamic_shrink_to_fit(of->list) != HS_OK;
    }
    return (hs_thread_result)0;
}

static void
queries_and_changes_take_turns(void)
{
    const hs_box box = {.ndim = 2, .periodic = {true, true}, .rows = {{10, 0}, {0, 10}}};
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic_options options = hs_dynamic_options_default();
        task               tasks[THREADS];
        hs_thread          threads[THREADS];
        hs_dynamic        *list = NULL;
        options.ndim = 2;
        options.box = &box;
        options.storage = (hs_storage)storage;
        CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
        for (int64_t id = 0; id < LASTING; id++) {
            double x[2];
            fixed_position(id, x);
            CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, x, NULL) == HS_OK);
        }
        for (int t = 0; t < THREADS; t++) {
            tasks[t] = (task){.list = list, .first = 1000 * (t + 1)};
            CHECK(hs_thread_start(&threads[t], ask_and_change, &tasks[t]));
        }
        for (int t = 0; t < THREADS; t++) {
            hs_thread_join(threads[t]);
            CHECK(tasks[t].failures == 0);
        }
        hs_dynamic_free(list);
    }
}

static hs_thread_result HS_THREAD_CALL
insert_one(void *context)
{
    hs_dynamic *list = context;
    hs_dynamic_release(list); /* not held by this thread: nothing happens */
    CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, (double[]){1.0, 1.0, 1.0}, NULL) == HS_OK);
    return (hs_thread_result)0;
}

/* The holder changes and asks meanwhile; what another thread does comes after all of it. */
static void
who_holds_a_list_keeps_others_out(void)
{
    hs_dynamic_options options = hs_dynamic_options_default();
    hs_dynamic        *list = NULL;
    hs_thread          other;
    CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
    hs_dynamic_hold(list);
    hs_dynamic_hold(list); /* once is enough */
    CHECK(hs_thread_start(&other, insert_one, list));
    while (hs_atomic_load(&hs_n_waiting) == 0)
        hs_nap();
    for (int64_t id = 2; id < 40; id++) {
        CHECK(hs_dynamic_insert(list, (hs_key){id, 0}, (double[]){0.0, 0.0, 0.0}, NULL) == HS_OK);
        CHECK(hs_dynamic_length(list) == id - 1 && !hs_dynamic_has(list, (hs_key){1, 0}));
    }
    hs_dynamic_release(list);
    hs_thread_join(other);
    CHECK(hs_dynamic_has(list, (hs_key){1, 0}) && list->gate.state == hs_n_forks << 32);
    hs_dynamic_free(list);
}

/* No to the first one. */
static bool
not_at_first(void *user, double fraction)
{
    int *polls = user;
    CHECK(fraction == 0.0);
    return ++*polls > 1;
}

static int
go_on(hs_key key, const double *position, const int64_t *shift, void *user)
{
    (void)key;
    (void)position;
    (void)shift;
    (void)user;
    return 0;
}

/* Through images, through cells, and through the points of one cell. */
static void
polls_end_long_queries(void)
{
    const hs_box           box = {.ndim = 2, .periodic = {true}, .rows = {{1.0, 0.0}, {0.0, 1.0}}};
    const double           centre[2] = {0.5, 0.5};
    const hs_dynamic_hooks hooks = {.poll = not_at_first};
    for (int storage = 0; storage < 3; storage++) {
        hs_dynamic_options options = hs_dynamic_options_default();
        hs_dynamic        *list = NULL;
        int                polls = 0;
        options.ndim = 2;
        options.box = &box;
        options.storage = (hs_storage)storage;
        options.max_radius = 200000.0;
        CHECK(hs_dynamic_new(&options, &list, NULL) == HS_OK);
        CHECK(hs_dynamic_insert(list, (hs_key){1, 0}, centre, NULL) == HS_OK);
        hs_dynamic_hook(list, &hooks);
        CHECK(hs_dynamic_within(list, centre, 200000.0, false, go_on, &polls, NULL) ==
              HS_ERR_INTERRUPTED);
        CHECK(polls == 1);
        CHECK(hs_dynamic_near(list, centre, 200000.0, go_on, &polls, NULL) == HS_OK && polls == 1);
        CHECK(hs_dynamic_within(list, centre, 200000.0, false, go_on, &polls, NULL) == HS_OK);
        CHECK(polls > 1);
        hs_dynamic_hook(list, NULL);
        CHECK(hs_dynamic_within(list, centre, 200000.0, false, go_on, &polls, NULL) == HS_OK);
        hs_dynamic_free(list);
    }
    hs_dynamic_hook(NULL, &hooks);
}

void
test_gate(void)
{
    RUN(who_holds_the_gate_is_inside_and_others_wait);
    RUN(writers_that_wait_pause);
    RUN(writers_are_alone);
    RUN(a_reader_waits_for_a_writer);
    RUN(readers_are_many);
#if !defined(_WIN32) && !defined(HS_COVERAGE) && !defined(__SANITIZE_THREAD__) && \
    !defined(HS_EMULATED)
    RUN(children_do_not_wait_for_the_parent);
#endif
    RUN(those_inside_another_process_are_forgotten);
    RUN(who_holds_a_list_keeps_others_out);
    RUN(polls_end_long_queries);
    RUN(queries_and_changes_take_turns);
}
