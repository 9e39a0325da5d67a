/* SPDX-License-Identifier: BSD-3-Clause */
/* pages.c: see pages.h. Linux only; elsewhere, and under the address sanitizer, which watches
 * malloc, there are no such blocks. */
#if defined(__linux__)
#define _DEFAULT_SOURCE /* madvise, MAP_ANONYMOUS */
#endif
#include "pages.h"

#if defined(__SANITIZE_ADDRESS__)
#define HAS_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define HAS_SANITIZER 1
#endif
#endif

#if defined(__linux__) && !defined(HAS_SANITIZER)

#include <sys/mman.h>

#define PAGE ((size_t)65536) /* a multiple of the page size of every Linux */

void *
hs_pages_alloc(size_t bytes, void **mapping, size_t *length)
{
    if (bytes > PTRDIFF_MAX - HS_PAGES_FROM - 2 * PAGE) {
        return NULL;
    }
    const size_t rounded = (bytes + PAGE - 1) / PAGE * PAGE;
    const size_t reserved = rounded + HS_PAGES_FROM + PAGE;
    char        *start =
        mmap(NULL, reserved, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (start == MAP_FAILED) {
        return NULL;
    }
    /* The first huge-page boundary that leaves a page for the headroom; the rest goes back. */
    const uintptr_t boundary =
        ((uintptr_t)start + PAGE + HS_PAGES_FROM - 1) / HS_PAGES_FROM * HS_PAGES_FROM;
    char  *block = (char *)boundary;
    char  *first = block - PAGE;
    size_t before = (size_t)(first - start);
    size_t after = reserved - before - PAGE - rounded;
    if (before > 0) {
        munmap(start, before);
    }
    if (after > 0) {
        munmap(block + rounded, after);
    }
#ifdef MADV_HUGEPAGE
    (void)madvise(block, rounded, MADV_HUGEPAGE); /* a wish: small pages hold the same */
#endif
    *mapping = first;
    *length = PAGE + rounded;
    return block;
}

void
hs_pages_free(void *mapping, size_t length)
{
    munmap(mapping, length);
}

#else

void *
hs_pages_alloc(size_t bytes, void **mapping, size_t *length)
{
    (void)bytes;
    (void)mapping;
    (void)length;
    return NULL;
}

void
hs_pages_free(void *mapping, size_t length)
{
    (void)mapping;
    (void)length;
}

#endif
