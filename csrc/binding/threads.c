/* SPDX-License-Identifier: BSD-3-Clause */
/* threads.c: the environment and the system are asked anew for each large search: what they say may
 * change while the process runs. */
#if defined(__linux__)
#define _GNU_SOURCE /* sched_getaffinity */
#endif
#include "threads.h"

#include <stdlib.h>

#if defined(_WIN32)
#include <windows.h>
#elif defined(__linux__)
#include <sched.h>
#else
#include <unistd.h>
#endif

#define MOST_USEFUL 256 /* more would only wait for their turn to write */

static long
count_cores(void)
{
#if defined(_WIN32)
    return (long)GetActiveProcessorCount(ALL_PROCESSOR_GROUPS);
#elif defined(__linux__)
    cpu_set_t allowed;
    return sched_getaffinity(0, sizeof allowed, &allowed) == 0 ? CPU_COUNT(&allowed) : 1;
#else
    return sysconf(_SC_NPROCESSORS_ONLN);
#endif
}

int
hs_most_threads(void)
{
    const long cores = count_cores();
    const long most = HS_THREADS_PER_CORE * (cores < 1 ? 1 : cores);
    return most > MOST_USEFUL ? MOST_USEFUL : (int)most;
}

int
hs_default_threads(void)
{
    const char *text = getenv("OMP_NUM_THREADS");
    char       *end = NULL;
    long        n = text != NULL ? strtol(text, &end, 10) : 0;
    if (n < 1 || end == text) {
        n = count_cores();
    }
    const int most = hs_most_threads();
    return n < 1 ? 1 : n > most ? most : (int)n;
}
