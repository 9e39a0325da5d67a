/* SPDX-License-Identifier: BSD-3-Clause */
/* available.c: see available.h. Linux reads /proc and the control groups (versions 1 and 2); other
 * systems use what physical memory they report. */
#include "available.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

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

/* The number after `key` at the start of a line of the file; -1 when there is none. */
static double
number_in_file(const char *path, const char *key)
{
    char         line[256];
    double       value = -1.0;
    const size_t length = strlen(key);
    FILE        *file = fopen(path, "r");
    if (file == NULL) {
        return -1.0;
    }
    while (value < 0.0 && fgets(line, sizeof line, file) != NULL) {
        if (strncmp(line, key, length) == 0 && sscanf(line + length, "%lf", &value) != 1) {
            value = -1.0; /* "max", or another key that begins alike */
        }
    }
    fclose(file);
    return value;
}

/* What the control group in `folder` still allows; file pages that it can drop count as free. */
static double
left_in_group(const char *folder, const char *limit_name, const char *usage_name,
              const char *inactive_key, const char *active_key)
{
    char path[4352];
    snprintf(path, sizeof path, "%s/%s", folder, limit_name);
    const double limit = number_in_file(path, "");
    snprintf(path, sizeof path, "%s/%s", folder, usage_name);
    const double usage = number_in_file(path, "");
    if (limit < 0.0 || usage < 0.0) {
        return INFINITY;
    }
    snprintf(path, sizeof path, "%s/memory.stat", folder);
    const double inactive = number_in_file(path, inactive_key);
    const double active = number_in_file(path, active_key);
    return limit - usage + fmax(inactive, 0.0) + fmax(active, 0.0);
}

/* The least over this process's group and all groups above it (version 2). */
static double
left_in_unified_groups(void)
{
    char   line[4096], folder[4224];
    double left = INFINITY;
    FILE  *file = fopen("/proc/self/cgroup", "r");
    if (file == NULL) {
        return INFINITY;
    }
    line[0] = '\0';
    while (fgets(line, sizeof line, file) != NULL && strncmp(line, "0::", 3) != 0) {
        line[0] = '\0';
    }
    fclose(file);
    if (line[0] == '\0') {
        return INFINITY;
    }
    line[strcspn(line, "\n")] = '\0';
    for (char *path = line + 3;;) {
        snprintf(folder, sizeof folder, "/sys/fs/cgroup%s", path);
        left = fmin(left, left_in_group(folder, "memory.max", "memory.current",
                                        "inactive_file ", "active_file "));
        char *slash = strrchr(path, '/');
        if (slash == NULL || path[0] == '\0') {
            return left;
        }
        *slash = '\0';
    }
}

static double
left_in_address_space(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
        return INFINITY;
    }
    const double used = number_in_file("/proc/self/statm", "") * (double)sysconf(_SC_PAGESIZE);
    return (double)limit.rlim_cur - fmax(used, 0.0);
}

double
hs_available_memory(void *ignored)
{
    (void)ignored;
    double left = number_in_file("/proc/meminfo", "MemAvailable:") * 1024.0;
    if (left < 0.0) {
        left = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    }
    left = fmin(left, left_in_unified_groups());
    left = fmin(left, left_in_group("/sys/fs/cgroup/memory", "memory.limit_in_bytes",
                                    "memory.usage_in_bytes", "total_inactive_file ",
                                    "total_active_file "));
    return fmax(0.0, fmin(left, left_in_address_space()));
}

#endif
