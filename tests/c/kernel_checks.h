/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * kernel_checks.h: arrays between pages that may not be touched, and the kernels of this CPU. A
 * byte read or written beyond what kernel.h allows ends the test.
 */
#ifndef HS_KERNEL_CHECKS_H
#define HS_KERNEL_CHECKS_H

#include <sys/mman.h>
#include <unistd.h>

#include "../../csrc/kernels/kernel.h"
#include "harness.h"

enum { MOST_KERNELS = 16 };

/* Pages that may be used, between two that may not. */
typedef struct guarded {
    char  *pages;
    size_t bytes;
} guarded;

static inline guarded
guarded_pages(size_t needed)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const size_t bytes = (needed + page - 1) / page * page;
    char *all = mmap(NULL, bytes + 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS,
                     -1, 0);
    if (all == MAP_FAILED || mprotect(all, page, PROT_NONE) != 0 ||
        mprotect(all + page + bytes, page, PROT_NONE) != 0) {
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
