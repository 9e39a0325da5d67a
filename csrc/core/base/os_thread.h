/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_BASE_OS_THREAD_H
#define HS_BASE_OS_THREAD_H

#include "base.h"

/* os_thread.h: the few functions of threads, and of numbers that several of them change, that the
 * core needs, on POSIX and on Windows. */

#define HS_BRIEFLY_MS 50 /* a wait that ends on its own */
#define HS_NAP_MS     1  /* or more: 16 on some Windows */

#if defined(_WIN32)

#define WIN32_LEAN_AND_MEAN
#include <process.h>
#include <windows.h>
/* windows.h defines these names as empty macros. */
#undef near
#undef far

typedef SRWLOCK            hs_mutex;
typedef CONDITION_VARIABLE hs_condition;
typedef HANDLE             hs_thread;
typedef DWORD              hs_thread_id;
typedef unsigned           hs_thread_result;
#define HS_THREAD_CALL __stdcall
typedef hs_thread_result(HS_THREAD_CALL *hs_thread_fn)(void *);

#define HS_MUTEX_INIT     SRWLOCK_INIT
#define HS_CONDITION_INIT CONDITION_VARIABLE_INIT

#define hs_mutex_init(mutex)         InitializeSRWLock(mutex)
#define hs_mutex_lock(mutex)         AcquireSRWLockExclusive(mutex)
#define hs_mutex_unlock(mutex)       ReleaseSRWLockExclusive(mutex)
#define hs_mutex_destroy(mutex)      ((void)(mutex))
#define hs_condition_init(condition) InitializeConditionVariable(condition)
#define hs_condition_wait(condition, mutex) \
    ((void)SleepConditionVariableSRW(condition, mutex, INFINITE, 0))
#define hs_condition_wait_briefly(condition, mutex) \
    ((void)SleepConditionVariableSRW(condition, mutex, HS_BRIEFLY_MS, 0))
#define hs_condition_wake(condition)    WakeAllConditionVariable(condition)
#define hs_condition_destroy(condition) ((void)(condition))

HS_ALWAYS_INLINE bool
hs_thread_start(hs_thread *thread, hs_thread_fn run, void *context)
{
    *thread = (HANDLE)_beginthreadex(NULL, 0, run, context, 0, NULL);
    return *thread != NULL;
}

HS_ALWAYS_INLINE void
hs_thread_join(hs_thread thread)
{
    (void)WaitForSingleObject(thread, INFINITE);
    (void)CloseHandle(thread);
}

#define hs_nap()           Sleep(HS_NAP_MS)
#define hs_thread_self()   GetCurrentThreadId()
#define hs_thread_is(id)   (GetCurrentThreadId() == (id))
#define HS_THREAD_NUMBER() ((int64_t)GetCurrentThreadId()) /* not 0 */

/* Windows has no signals to block. */
typedef int hs_signals;
#define hs_signals_block(saved)   ((void)(*(saved) = 0))
#define hs_signals_restore(saved) ((void)(saved))

#else

#include <pthread.h>
#include <signal.h>
#include <time.h>

typedef pthread_mutex_t hs_mutex;
typedef pthread_cond_t  hs_condition;
typedef pthread_t       hs_thread;
typedef pthread_t       hs_thread_id;
typedef void           *hs_thread_result;
#define HS_THREAD_CALL
typedef hs_thread_result (*hs_thread_fn)(void *);

#define HS_MUTEX_INIT     PTHREAD_MUTEX_INITIALIZER
#define HS_CONDITION_INIT PTHREAD_COND_INITIALIZER

#define hs_mutex_init(mutex)                ((void)pthread_mutex_init(mutex, NULL))
#define hs_mutex_lock(mutex)                ((void)pthread_mutex_lock(mutex))
#define hs_mutex_unlock(mutex)              ((void)pthread_mutex_unlock(mutex))
#define hs_mutex_destroy(mutex)             ((void)pthread_mutex_destroy(mutex))
#define hs_condition_init(condition)        ((void)pthread_cond_init(condition, NULL))
#define hs_condition_wait(condition, mutex) ((void)pthread_cond_wait(condition, mutex))
#define hs_condition_wake(condition)        ((void)pthread_cond_broadcast(condition))
#define hs_condition_destroy(condition)     ((void)pthread_cond_destroy(condition))

HS_ALWAYS_INLINE bool
hs_thread_start(hs_thread *thread, hs_thread_fn run, void *context)
{
    return pthread_create(thread, NULL, run, context) == 0;
}

HS_ALWAYS_INLINE void
hs_thread_join(hs_thread thread)
{
    (void)pthread_join(thread, NULL);
}

HS_ALWAYS_INLINE void
hs_nap(void)
{
    const struct timespec nap = {.tv_nsec = HS_NAP_MS * 1000000L};
    (void)nanosleep(&nap, NULL);
}

#define hs_thread_self()   pthread_self()
#define hs_thread_is(id)   (pthread_equal(pthread_self(), (id)) != 0)
#define HS_THREAD_NUMBER() ((int64_t)(uintptr_t)pthread_self()) /* an address: not 0 */

HS_ALWAYS_INLINE void
hs_condition_wait_briefly(hs_condition *condition, hs_mutex *mutex)
{
    struct timespec until;
    (void)clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += HS_BRIEFLY_MS * 1000000L;
    if (until.tv_nsec >= 1000000000L) {
        until.tv_nsec -= 1000000000L;
        until.tv_sec++;
    }
    (void)pthread_cond_timedwait(condition, mutex, &until);
}

/* New threads inherit the blocked signals: each signal then goes to a thread of the caller. */
typedef sigset_t hs_signals;

HS_ALWAYS_INLINE void
hs_signals_block(hs_signals *saved)
{
    sigset_t all;
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, saved);
}

HS_ALWAYS_INLINE void
hs_signals_restore(const hs_signals *saved)
{
    (void)pthread_sigmask(SIG_SETMASK, saved, NULL);
}

#endif

/*
 * How many forks lie between the process that loaded the library and this one. What outlives a call
 * and is locked says by this number in which process: threads that were inside at a fork do not
 * exist in the child, so there a lock with another number is free.
 */
extern volatile int64_t hs_n_forks;

/* Sleeps until try_enter(lock) has succeeded, which is tried whenever a thread says that it has
 * left one, and now and then: a wake-up that comes too early costs time only. All locks share a
 * queue. */
void hs_wait_for(bool (*try_enter)(void *lock), void *lock);
void hs_wake_waiting(void);

extern volatile int64_t hs_n_waiting; /* threads; hs_wake_waiting has nothing to do where it is 0 */

#ifdef HS_TESTING
void hs_test_fork(void); /* as if this process had just been forked off */
#endif

/* Numbers that several threads change, each function in one step. All threads see these steps in
 * one order. */
#if defined(_MSC_VER) && !defined(__clang__)

HS_ALWAYS_INLINE int64_t
hs_atomic_load(volatile int64_t *x)
{
    return InterlockedCompareExchange64(x, 0, 0);
}

HS_ALWAYS_INLINE void
hs_atomic_store(volatile int64_t *x, int64_t value)
{
    (void)InterlockedExchange64(x, value);
}

/* Returns what *x was. */
HS_ALWAYS_INLINE int64_t
hs_atomic_add(volatile int64_t *x, int64_t more)
{
    return InterlockedExchangeAdd64(x, more);
}

/* Whether *x was `old`, and is `value` now. */
HS_ALWAYS_INLINE bool
hs_atomic_swap_if(volatile int64_t *x, int64_t old, int64_t value)
{
    return InterlockedCompareExchange64(x, value, old) == old;
}

#else

HS_ALWAYS_INLINE int64_t
hs_atomic_load(volatile int64_t *x)
{
    return __atomic_load_n(x, __ATOMIC_SEQ_CST);
}

HS_ALWAYS_INLINE void
hs_atomic_store(volatile int64_t *x, int64_t value)
{
    __atomic_store_n(x, value, __ATOMIC_SEQ_CST);
}

/* Returns what *x was. */
HS_ALWAYS_INLINE int64_t
hs_atomic_add(volatile int64_t *x, int64_t more)
{
    return __atomic_fetch_add(x, more, __ATOMIC_SEQ_CST);
}

/* Whether *x was `old`, and is `value` now. */
HS_ALWAYS_INLINE bool
hs_atomic_swap_if(volatile int64_t *x, int64_t old, int64_t value)
{
    return __atomic_compare_exchange_n(x, &old, value, false, __ATOMIC_SEQ_CST, __ATOMIC_SEQ_CST);
}

#endif

#endif
