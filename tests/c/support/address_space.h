/* SPDX-License-Identifier: BSD-3-Clause */
/* address_space.h: how much of it this process has, and may have. To be included first or behind
 * _GNU_SOURCE. */
#ifndef HS_ADDRESS_SPACE_H
#define HS_ADDRESS_SPACE_H

#include "../../../csrc/core/base/base.h"
#include "harness.h"

#if defined(__linux__) && !HS_WATCHED_MALLOC
#define HAS_PAGES 1
#else
#define HAS_PAGES 0
#endif

/* The thread sanitizer has mappings of its own. */
#if HAS_PAGES && !defined(__SANITIZE_THREAD__)
#define CAN_LIMIT_ADDRESSES 1

#include <sys/resource.h>
#include <unistd.h>

/* The number in a file, 0 if there is none. */
static inline unsigned long
number_in(const char *path)
{
    unsigned long number = 0;
    FILE         *file = fopen(path, "r");
    if (file != NULL && fscanf(file, "%lu", &number) != 1)
        number = 0;
    if (file != NULL)
        fclose(file);
    return number;
}

/* Bytes of address space. */
static inline size_t
mapped(void)
{
    return number_in("/proc/self/statm") * (size_t)sysconf(_SC_PAGESIZE);
}

/* So many bytes more can be mapped, until the limit that is returned is set again. */
static inline rlim_t
limit_addresses(size_t room)
{
    struct rlimit limits;
    CHECK(getrlimit(RLIMIT_AS, &limits) == 0);
    const rlim_t before = limits.rlim_cur;
    const rlim_t wanted = mapped() + room;
    limits.rlim_cur = wanted < before ? wanted : before;
    CHECK(setrlimit(RLIMIT_AS, &limits) == 0);
    return before;
}

static inline void
set_address_limit(rlim_t limit)
{
    struct rlimit limits;
    CHECK(getrlimit(RLIMIT_AS, &limits) == 0);
    limits.rlim_cur = limit;
    CHECK(setrlimit(RLIMIT_AS, &limits) == 0);
}

#else
#define CAN_LIMIT_ADDRESSES 0
#endif

#endif
