/* SPDX-License-Identifier: BSD-3-Clause */
/* test_call.c: what a call takes it gives back, and teams do each piece of work once. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <signal.h>
#endif
#include "../../../csrc/core/threads/passes.h"
#include "../support/harness.h"

#include <math.h>

void test_call(void);

#define TASKS 5000

typedef struct tally {
    int  done[TASKS];
    bool rounds_to_nearest[TASKS];
    bool signals_right[TASKS];
#if !defined(_WIN32)
    pthread_t caller;
#endif
} tally;

static volatile double one = 1.0, tiny = 0x1p-60;

static void
do_task(void *context, int64_t task)
{
    tally *counts = context;
    counts->done[task]++;
    counts->rounds_to_nearest[task] = one + tiny == 1.0 && one - tiny == 1.0;
#if !defined(_WIN32)
    sigset_t blocked;
    (void)pthread_sigmask(SIG_BLOCK, NULL, &blocked);
    const bool is_caller = pthread_equal(pthread_self(), counts->caller) != 0;
    counts->signals_right[task] = (sigismember(&blocked, SIGINT) == 1) != is_caller;
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
        for (int job = 0; job < 50; job++) {
            const int64_t n_tasks = job % 7 == 0 ? TASKS : job % 5;
            bool          right = true;
            memset(&counts, 0, sizeof counts);
            hs_team_run(team, n_tasks, do_task, &counts);
            for (int64_t task = 0; task < TASKS; task++) {
                right = right && counts.done[task] == (task < n_tasks);
                right = right && (task >= n_tasks || counts.rounds_to_nearest[task]);
            }
            CHECK(right);
        }
        hs_team_free(team);
    }
}

void
test_call(void)
{
    RUN(every_task_is_done_once);
}
