/* SPDX-License-Identifier: BSD-3-Clause */
/* system.c: what the machine and the environment say. */
#if defined(__linux__)
#define _GNU_SOURCE /* sched_getaffinity */
#endif
#include "system.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#include <windows.h>
#else
#include <sys/resource.h>
#include <unistd.h>
#if defined(__linux__)
#include <sched.h>
#endif
#endif

/* ---- threads: looked up anew for each large search, as it may change ---------------------- */

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

static int
most_threads(long cores)
{
    const long most = HS_THREADS_PER_CORE * (cores < 1 ? 1 : cores);
    return most > MOST_USEFUL ? MOST_USEFUL : (int)most;
}

int
hs_most_threads(void)
{
    return most_threads(count_cores());
}

int
hs_default_threads(void)
{
    const char *text = getenv("OMP_NUM_THREADS");
    char       *end = NULL;
    long        n = text != NULL ? strtol(text, &end, 10) : 0;
    const long  cores = count_cores();
    if (n < 1 || end == text) {
        n = cores;
    }
    const int most = most_threads(cores);
    return n < 1 ? 1 : n > most ? most : (int)n;
}

/* ---- memory ------------------------------------------------------------------------------- */

/*
 * A limit may stand in any control group from that of this process up. /proc/self/cgroup names that
 * group in each hierarchy, /proc/self/mountinfo the folders where the hierarchies are mounted. In a
 * container such a folder may show but a part of the hierarchy, which begins at the `top` that
 * mountinfo tells.
 */
#define LINE 8192
#define PATH 4096
/* Version 1 writes the largest multiple of a page below 2^63 for no limit. */
#define NO_LIMIT 0x1p62

typedef struct hierarchy {
    const char *type;  /* of the file system */
    const char *place; /* where it usually is, if mountinfo cannot be read */
    const char *limit, *usage, *inactive, *active;
} hierarchy;

static const hierarchy VERSIONS[] = {
    {"cgroup2", "/sys/fs/cgroup", "memory.max", "memory.current", "inactive_file ", "active_file "},
    {"cgroup", "/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes",
     "total_inactive_file ", "total_active_file "},
};

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

static double
number_in_folder(const char *folder, const char *name, const char *key)
{
    char path[LINE + 64];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return number_in_file(path, key);
}

/* What one group still allows: file pages that it can drop count as free, a usage that cannot be
 * read as none. */
static double
left_in_group(const hierarchy *version, const char *folder)
{
    const double limit = number_in_folder(folder, version->limit, "");
    if (limit < 0.0 || limit >= NO_LIMIT) {
        return INFINITY;
    }
    const double usage = number_in_folder(folder, version->usage, "");
    const double inactive = number_in_folder(folder, "memory.stat", version->inactive);
    const double active = number_in_folder(folder, "memory.stat", version->active);
    const double kept = fmax(usage, 0.0) - fmax(inactive, 0.0) - fmax(active, 0.0);
    return fmax(limit - fmax(kept, 0.0), 0.0);
}

/* The least over the group and those above it, up to where the hierarchy is mounted. */
static double
left_in_groups(const hierarchy *version, const char *root, const char *place, const char *top,
               const char *group)
{
    char         folder[LINE];
    double       left = INFINITY;
    const size_t shortest = strlen(root) + strlen(place), n_top = strlen(top);
    if (strcmp(top, "/") != 0) {
        const bool is_below = strncmp(group, top, n_top) == 0 &&
                              (group[n_top] == '/' || group[n_top] == '\0');
        group = is_below ? group + n_top : ""; /* a container's folder shows its own group */
    }
    if (strstr(group, "/..") != NULL) { /* outside of what this process may see */
        group = "";
    }
    if (snprintf(folder, sizeof folder, "%s%s%s", root, place, group) >= (int)sizeof folder) {
        return INFINITY;
    }
    for (;;) {
        left = fmin(left, left_in_group(version, folder));
        char *slash = strrchr(folder, '/');
        if (slash == NULL || slash < folder + shortest) {
            return left;
        }
        *slash = '\0';
    }
}

/* Whether a list such as "rw,cpu,memory" has this name. */
static bool
has_name(const char *list, const char *name)
{
    const size_t n = strlen(name);
    while (strncmp(list, name, n) != 0 || (list[n] != ',' && list[n] != '\0')) {
        list = strchr(list, ',');
        if (list++ == NULL) {
            return false;
        }
    }
    return true;
}

/* The group of this process in the hierarchy that limits memory, of a line "4:cpu,memory:GROUP", or
 * "0::GROUP" in version 2; false if there is none. */
static bool
find_group(const hierarchy *version, const char *root, char *group)
{
    char line[LINE];
    bool is_found = false;
    snprintf(line, sizeof line, "%s/proc/self/cgroup", root);
    FILE *file = fopen(line, "r");
    if (file == NULL) {
        return false;
    }
    while (!is_found && fgets(line, sizeof line, file) != NULL) {
        char *names = strchr(line, ':'), *path = names != NULL ? strchr(names + 1, ':') : NULL;
        if (path != NULL) {
            *path++ = '\0';
            path[strcspn(path, "\n")] = '\0';
            is_found = version == &VERSIONS[0] ? strcmp(line, "0:") == 0
                                               : has_name(names + 1, "memory");
            snprintf(group, PATH, "%.*s", PATH - 1, path);
        }
    }
    fclose(file);
    return is_found;
}

/* mountinfo writes blanks, tabs, line ends and backslashes as three octal digits. */
static void
unescape(char *text)
{
    char *end = text;
    for (; *text != '\0'; text++, end++) {
        if (*text == '\\' && strspn(text + 1, "01234567") >= 3) {
            *end = (char)((text[1] - '0') * 64 + (text[2] - '0') * 8 + (text[3] - '0'));
            text += 3;
        } else {
            *end = *text;
        }
    }
    *end = '\0';
}

/* A line "31 23 0:28 TOP PLACE rw shared:1 - TYPE SOURCE OPTIONS" of mountinfo, of this version and
 * with memory? Version 2 does not tell: its groups have the files or not. */
static bool
is_mount_of(const hierarchy *version, const char *line, char *top, char *place)
{
    char        type[64], options[LINE];
    const char *end = strstr(line, " - ");
    if (end == NULL || sscanf(line, "%*s %*s %*s %4095s %4095s", top, place) != 2 ||
        sscanf(end, " - %63s %*s %8191s", type, options) != 2) {
        return false;
    }
    unescape(top);
    unescape(place);
    return strcmp(type, version->type) == 0 &&
           (version == &VERSIONS[0] || has_name(options, "memory"));
}

static double
left_in_version(const hierarchy *version, const char *root)
{
    char   line[LINE], group[PATH], top[PATH], place[PATH];
    double left = INFINITY;
    if (!find_group(version, root, group)) {
        return INFINITY;
    }
    snprintf(line, sizeof line, "%s/proc/self/mountinfo", root);
    FILE *file = fopen(line, "r");
    if (file == NULL) {
        return left_in_groups(version, root, version->place, "/", group);
    }
    while (fgets(line, sizeof line, file) != NULL) {
        if (is_mount_of(version, line, top, place)) {
            left = fmin(left, left_in_groups(version, root, place, top, group));
        }
    }
    fclose(file);
    return left;
}

double
hs_group_memory(const char *root)
{
    return fmin(left_in_version(&VERSIONS[0], root), left_in_version(&VERSIONS[1], root));
}

#if defined(_WIN32)

double
hs_available_memory(void *ignored)
{
    MEMORYSTATUSEX status = {.dwLength = sizeof status};
    (void)ignored;
    return GlobalMemoryStatusEx(&status) ? (double)status.ullAvailPhys : INFINITY;
}

#else

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
    left = fmin(left, hs_group_memory(""));
    return fmax(0.0, fmin(left, left_in_address_space()));
}

#endif

/* ---- the environment ---------------------------------------------------------------------- */

/* A copy, because others may change the environment: one more than any name of a kernel has, so
 * that a longer one, cut off, is still none. */
static char kernel_name[32];

void
hs_environment_read(void)
{
    const char *value = getenv("HALFSHELL_KERNEL");
    if (value != NULL) {
        strncpy(kernel_name, value, sizeof kernel_name - 1);
    }
}

const char *
hs_environment_kernel(void)
{
    return kernel_name[0] != '\0' ? kernel_name : NULL;
}
