/* SPDX-License-Identifier: BSD-3-Clause */
/* thread_limit.h: a system that starts only so many threads. On Linux: the Makefile has the linker
 * send calls of pthread_create here. To be included by one file. */
#ifndef HS_THREAD_LIMIT_H
#define HS_THREAD_LIMIT_H

#if defined(__linux__)
#define HAS_THREAD_LIMIT 1

#include <errno.h>
#include <pthread.h>

int __real_pthread_create(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
int __wrap_pthread_create(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);

static int threads_left = -1;

/* So many more can be started; -1: as many as the system likes. */
static inline void
limit_threads(int n)
{
    threads_left = n;
}

int
__wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                      void *context)
{
    if (threads_left == 0) {
        return EAGAIN;
    }
    threads_left -= threads_left > 0;
    return __real_pthread_create(thread, attributes, run, context);
}

#else
#define HAS_THREAD_LIMIT 0
#endif

#endif
