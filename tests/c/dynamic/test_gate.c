/* SPDX-License-Identifier: BSD-3-Clause */
/* test_gate.c: a writer is alone, readers are not, and no thread waits for ever, in a child neither. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "../../../csrc/core/base/os_thread.h"
#include "../../../csrc/core/dynamic/gate.h"
#include "../support/harness.h"

#if !defined(_WIN32)
#include <sys/wait.h>
#include <unistd.h>
#endif

void test_gate(void);

enum { ROUNDS = 20000 };

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
            hs_gate_write(&of->gate);
            of->one++;
            of->other++;
            hs_gate_write_end(&of->gate);
        } else {
            hs_gate_read(&of->gate);
            const bool same = of->one == of->other;
            hs_gate_read_end(&of->gate);
            if (!same) {
                hs_gate_write(&of->gate);
                of->differed = true;
                hs_gate_write_end(&of->gate);
            }
        }
    }
    return (hs_thread_result)0;
}

static void
writers_are_alone(void)
{
    enum { THREADS = 4 };
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
    hs_gate_read(&of->gate);
    of->differed = of->one != of->other;
    hs_gate_read_end(&of->gate);
    return (hs_thread_result)0;
}

/* It sleeps until the writer leaves, and sees all that was written. */
static void
a_reader_waits_for_a_writer(void)
{
    shared    of = {.differed = true};
    hs_thread reader;
    hs_gate_init(&of.gate);
    hs_gate_write(&of.gate);
    of.one = 1;
    CHECK(hs_thread_start(&reader, read_one, &of));
    while (hs_atomic_load(&hs_n_waiting) == 0)
        hs_nap();
    CHECK(hs_atomic_load(&of.gate.state) == WRITER && of.differed);
    of.other = 1;
    hs_gate_write_end(&of.gate);
    hs_thread_join(reader);
    CHECK(!of.differed && of.gate.state == EMPTY && hs_n_waiting == 0);
}

static void
readers_are_many(void)
{
    hs_gate gate;
    hs_gate_init(&gate);
    hs_gate_read(&gate);
    hs_gate_read(&gate);
    CHECK(gate.state == EMPTY + 2);
    hs_gate_read_end(&gate);
    hs_gate_read_end(&gate);
    hs_gate_write(&gate);
    CHECK(gate.state == WRITER);
    hs_gate_write_end(&gate);
}

#if !defined(_WIN32) && !defined(HS_COVERAGE) && !defined(__SANITIZE_THREAD__)
/* A thread of the parent that was inside, or waited, does not exist in a child, whose own threads
 * wait for each other. */
static int
enter_in_child(hs_gate *gate)
{
    shared    of = {.gate = *gate};
    hs_thread threads[2];
    hs_gate_write(gate);
    hs_gate_write_end(gate);
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
    hs_gate_write(context);
    hs_gate_write_end(context);
    return (hs_thread_result)0;
}

static void
children_do_not_wait_for_the_parent(void)
{
    hs_gate   gate;
    hs_thread writer;
    int       status = 1;
    hs_gate_init(&gate);
    hs_gate_read(&gate);
    CHECK(hs_thread_start(&writer, write_nothing, &gate));
    while (hs_atomic_load(&hs_n_waiting) == 0)
        hs_nap();
    for (int k = 0; k < 5; k++) { /* the writer is asleep, or just looks again */
        const pid_t child = fork();
        if (child == 0)
            _exit(enter_in_child(&gate));
        CHECK(waitpid(child, &status, 0) == child && status == 0);
    }
    hs_gate_read_end(&gate);
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
    hs_gate_read(&gate);
    hs_test_fork();
    hs_gate_read(&gate);
    CHECK(gate.state == EMPTY + 1);
    hs_gate_read_end(&gate);
    hs_gate_write(&gate);
    hs_test_fork();
    hs_gate_write(&gate);
    CHECK(gate.state == WRITER);
    hs_gate_write_end(&gate);
    CHECK(gate.state == EMPTY);
}

/* Threads that try to go in while another one holds the gate. */
static hs_thread_result HS_THREAD_CALL
write_one(void *context)
{
    shared *of = context;
    CHECK(!hs_gate_is_mine(&of->gate) && hs_gate_write(&of->gate));
    of->one = of->other;
    hs_gate_write_end(&of->gate);
    return (hs_thread_result)0;
}

static void
who_holds_the_gate_is_inside_and_others_wait(void)
{
    shared    of = {.one = 1, .other = 2};
    hs_thread reader, writer;
    hs_gate_init(&of.gate);
    CHECK(!hs_gate_is_mine(&of.gate) && hs_gate_hold(&of.gate) && hs_gate_is_mine(&of.gate));
    CHECK(!hs_gate_hold(&of.gate) && !hs_gate_read(&of.gate) && !hs_gate_write(&of.gate));
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
    (void)hs_fetch_increment(&n_pauses);
    return &token;
}

static void
count_resume(void *paused)
{
    CHECK(paused == &token);
    (void)hs_fetch_increment(&n_resumes);
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
    hs_gate_write(&of.gate);
    hs_gate_write_end(&of.gate);
    CHECK(hs_atomic_load(&n_pauses) == 0);
    hs_gate_read(&of.gate);
    CHECK(hs_thread_start(&thread, write_one, &of));
    while (hs_atomic_load(&n_pauses) == 0)
        hs_nap();
    hs_gate_read_end(&of.gate);
    hs_thread_join(thread);
    CHECK(hs_atomic_load(&n_pauses) == hs_atomic_load(&n_resumes));
    hs_gate_write(&of.gate);
    const int64_t before = hs_atomic_load(&n_pauses);
    CHECK(hs_thread_start(&thread, read_one, &of)); /* readers do not */
    while (hs_atomic_load(&hs_n_waiting) == 0)
        hs_nap();
    hs_gate_write_end(&of.gate);
    hs_thread_join(thread);
    CHECK(hs_atomic_load(&n_pauses) == before);
}

void
test_gate(void)
{
    RUN(who_holds_the_gate_is_inside_and_others_wait);
    RUN(writers_that_wait_pause);
    RUN(writers_are_alone);
    RUN(a_reader_waits_for_a_writer);
    RUN(readers_are_many);
#if !defined(_WIN32) && !defined(HS_COVERAGE) && !defined(__SANITIZE_THREAD__)
    RUN(children_do_not_wait_for_the_parent);
#endif
    RUN(those_inside_another_process_are_forgotten);
}
