/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#include "os_thread.h"

/* os_thread.c: what all threads of a process share, and what is new in a child. */

volatile int64_t hs_n_forks;
volatile int64_t hs_n_waiting;

static hs_mutex     mutex = HS_MUTEX_INIT;
static hs_condition changed = HS_CONDITION_INIT;

#if !defined(_WIN32) || defined(HS_TESTING)

/* By the only thread of a child: those of the parent may have been anywhere. */
static void
begin_child(void)
{
    hs_mutex_init(&mutex);
    hs_condition_init(&changed);
    hs_n_waiting = 0;
    hs_n_forks++;
}

#endif

#if !defined(_WIN32)

__attribute__((constructor)) static void
prepare_for_forks(void)
{
    (void)pthread_atfork(NULL, NULL, begin_child);
}

#endif

#ifdef HS_TESTING
void
hs_test_fork(void)
{
    begin_child();
}
#endif

void
hs_wait_for(bool (*try_enter)(void *lock), void *lock)
{
    hs_mutex_lock(&mutex);
    (void)hs_atomic_add(&hs_n_waiting, 1);
    while (!try_enter(lock)) {
        hs_condition_wait_briefly(&changed, &mutex);
    }
    (void)hs_atomic_add(&hs_n_waiting, -1);
    hs_mutex_unlock(&mutex);
}

void
hs_wake_waiting(void)
{
    hs_mutex_lock(&mutex);
    hs_condition_wake(&changed);
    hs_mutex_unlock(&mutex);
}
