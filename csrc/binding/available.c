/* SPDX-License-Identifier: BSD-3-Clause */
/* available.c: Linux tells in /proc and in its control groups what memory is left; other systems
 * report free or physical memory. */
#include "available.h"

#include "groups.h"

#include <math.h>

#if defined(_WIN32)

#include <windows.h>

double
hs_available_memory(void *ignored)
{
    MEMORYSTATUSEX status = {.dwLength = sizeof status};
    (void)ignored;
    return GlobalMemoryStatusEx(&status) ? (double)status.ullAvailPhys : INFINITY;
}

#else

#include <sys/resource.h>
#include <unistd.h>

static double
left_in_address_space(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
        return INFINITY;
    }
    const double used = hs_number_in_file("/proc/self/statm", "") * (double)sysconf(_SC_PAGESIZE);
    return (double)limit.rlim_cur - fmax(used, 0.0);
}

double
hs_available_memory(void *ignored)
{
    (void)ignored;
    double left = hs_number_in_file("/proc/meminfo", "MemAvailable:") * 1024.0;
    if (left < 0.0) {
        left = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    }
    left = fmin(left, hs_group_memory(""));
    return fmax(0.0, fmin(left, left_in_address_space()));
}

#endif
