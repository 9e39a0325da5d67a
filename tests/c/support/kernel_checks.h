/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * kernel_checks.h: arrays between pages that may not be touched, and the kernels of this CPU. A
 * byte read or written beyond what kernel.h allows ends the test.
 */
#ifndef HS_KERNEL_CHECKS_H
#define HS_KERNEL_CHECKS_H

#if defined(_WIN32)
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#undef near /* windows.h defines these as nothing */
#undef far
#else
#include <sys/mman.h>
#include <unistd.h>
#endif

#include "../../../csrc/kernels/kernel.h"
#include "harness.h"

enum { MOST_KERNELS = 16 };

/* Pages that may be used, between two that may not. */
typedef struct guarded {
    char  *pages;
    size_t bytes;
} guarded;

#if defined(_WIN32)

static inline size_t
page_size(void)
{
    SYSTEM_INFO info;
    GetSystemInfo(&info);
    return info.dwPageSize;
}

static inline char *
new_pages(size_t bytes)
{
    return VirtualAlloc(NULL, bytes, MEM_RESERVE | MEM_COMMIT, PAGE_READWRITE);
}

static inline bool
forbid(char *page, size_t bytes)
{
    DWORD before;
    return VirtualProtect(page, bytes, PAGE_NOACCESS, &before) != 0;
}

#else

static inline size_t
page_size(void)
{
    return (size_t)sysconf(_SC_PAGESIZE);
}

static inline char *
new_pages(size_t bytes)
{
    char *pages = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return pages == MAP_FAILED ? NULL : pages;
}

static inline bool
forbid(char *page, size_t bytes)
{
    return mprotect(page, bytes, PROT_NONE) == 0;
}

#endif

static inline guarded
guarded_pages(size_t needed)
{
    const size_t page = page_size();
    const size_t bytes = (needed + page - 1) / page * page;
    char        *all = new_pages(bytes + 2 * page);
    if (all == NULL || !forbid(all, page) || !forbid(all + page + bytes, page)) {
        abort();
    }
    return (guarded){all + page, bytes};
}

/* Room for n elements that starts after a guard page, or ends before one. */
static inline void *
guarded_place(guarded pages, int64_t n, size_t size, bool at_end)
{
    const size_t bytes = (size_t)n * size;
    if (bytes > pages.bytes) {
        abort();
    }
    return pages.pages + (at_end ? pages.bytes - bytes : 0);
}

/* The kernels that this CPU can run, best first; NULL after the last. */
static inline const hs_kernel *
kernel_number(int k)
{
    const char *names[MOST_KERNELS];
    const int   n = hs_kernel_names(names, MOST_KERNELS);
    return k < n ? hs_kernel_select(names[k]) : NULL;
}

#endif
