/* SPDX-License-Identifier: BSD-3-Clause */
/* pages.c: mmap, mremap and madvise of Linux. Elsewhere, and under AddressSanitizer, which watches
 * malloc, every request is refused. */
#if defined(__linux__)
#define _GNU_SOURCE /* madvise, mremap, MAP_ANONYMOUS */
#endif
#include "pages.h"

#if defined(__linux__) && !HS_WATCHED_MALLOC

#include <sys/mman.h>

static size_t
round_up(size_t bytes)
{
    return (bytes + HS_PAGES_STEP - 1) / HS_PAGES_STEP * HS_PAGES_STEP;
}

/* A mapping of HS_PAGES_STEP bytes and then the block, which starts at a huge-page boundary. */
static void *
map_aligned(size_t bytes, int flags, void **mapping, size_t *length)
{
    if (bytes > PTRDIFF_MAX - HS_PAGES_FROM - 2 * HS_PAGES_STEP) {
        return NULL;
    }
    const size_t rounded = round_up(bytes);
    const size_t reserved = rounded + HS_PAGES_FROM + HS_PAGES_STEP;
    char        *start =
        mmap(NULL, reserved, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | flags, -1, 0);
    if (start == MAP_FAILED) {
        return NULL;
    }
    /* The first huge-page boundary that leaves a step for the headroom; the rest goes back. */
    const uintptr_t boundary =
        ((uintptr_t)start + HS_PAGES_STEP + HS_PAGES_FROM - 1) / HS_PAGES_FROM * HS_PAGES_FROM;
    char        *block = (char *)boundary;
    char        *first = block - HS_PAGES_STEP;
    const size_t before = (size_t)(first - start); /* less than a huge page: the rest lies behind */
    if (before > 0) {
        munmap(start, before);
    }
    munmap(block + rounded, HS_PAGES_FROM - before);
    *mapping = first;
    *length = HS_PAGES_STEP + rounded;
    return block;
}

void *
hs_pages_alloc(size_t bytes, void **mapping, size_t *length)
{
    /* A tail of a quarter and more becomes a whole huge page: quicker to fill than small ones. */
    const size_t tail = bytes % HS_PAGES_FROM;
    if (tail >= HS_PAGES_FROM / 4 && bytes <= PTRDIFF_MAX / 2) {
        bytes += HS_PAGES_FROM - tail;
    }
    char *block = map_aligned(bytes, 0, mapping, length);
    if (block != NULL) {
        hs_pages_advise(block, block + round_up(bytes), true);
    }
    return block;
}

void
hs_pages_free(void *mapping, size_t length)
{
    munmap(mapping, length);
}

void *
hs_pages_reserve(size_t bytes, void **mapping, size_t *length)
{
    char *block = map_aligned(bytes, MAP_NORESERVE, mapping, length);
    if (block != NULL) {
        /* The first touch comes before the first advice, which splits the mapping in two:
         * the parts then share what Linux knows about their pages, and hs_pages_grow can
         * make them one again. */
        *(volatile char *)(block - 1) = 0;
        hs_pages_advise(*mapping, block + round_up(bytes), false);
    }
    return block;
}

void
hs_pages_advise(void *from, void *to, bool huge)
{
#if defined(MADV_HUGEPAGE) && defined(MADV_NOHUGEPAGE)
    if (from < to) {
        (void)madvise(from, (size_t)((char *)to - (char *)from),
                      huge ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
    }
#else
    (void)from;
    (void)to;
    (void)huge;
#endif
}

void *
hs_pages_grow(size_t bytes, void **mapping, size_t *length)
{
    if (bytes > PTRDIFF_MAX - HS_PAGES_FROM - 2 * HS_PAGES_STEP) {
        return NULL;
    }
    const size_t wanted = HS_PAGES_STEP + round_up(bytes);
    hs_pages_advise(*mapping, (char *)*mapping + *length, false); /* mremap takes one part only */
    char *moved = mremap(*mapping, *length, wanted, 0);
    if (moved == MAP_FAILED && HS_MAPPINGS_MOVE) {
        void  *target;
        size_t target_length;
        if (map_aligned(bytes, MAP_NORESERVE, &target, &target_length) != NULL) {
            /* Aligned like the old place, so that page tables move 2 MB at a time. If this fails
             * the target may be gone and its addresses taken by others: it is left alone. */
            moved = mremap(*mapping, *length, wanted, MREMAP_MAYMOVE | MREMAP_FIXED, target);
        } else {
            moved = mremap(*mapping, *length, wanted, MREMAP_MAYMOVE);
        }
    }
    if (moved == MAP_FAILED) {
        return NULL;
    }
    *mapping = moved;
    *length = wanted;
    return moved + HS_PAGES_STEP;
}

void
hs_pages_tear(void *from, void *to)
{
#if defined(MADV_FREE)
    /* Freeing lazily makes Linux split a huge page at once; the cut frees it. */
    (void)madvise(from, (size_t)((char *)to - (char *)from), MADV_FREE);
#else
    (void)from;
    (void)to;
#endif
}

bool
hs_pages_cut(void *from, void *to)
{
    const size_t bytes = (size_t)((char *)to - (char *)from);
    if (bytes == 0 || munmap(from, bytes) == 0) {
        return true;
    }
    (void)madvise(from, bytes, MADV_DONTNEED); /* too many mappings in this process */
    return false;
}

size_t
hs_pages_trim(void *mapping, size_t length, void *block, size_t bytes)
{
    const size_t before = (size_t)((char *)block - (char *)mapping);
    const size_t kept = before + round_up(bytes);
    if (kept >= length || munmap((char *)mapping + kept, length - kept) != 0) {
        return length;
    }
    return kept;
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

void *
hs_pages_reserve(size_t bytes, void **mapping, size_t *length)
{
    return hs_pages_alloc(bytes, mapping, length);
}

void
hs_pages_advise(void *from, void *to, bool huge)
{
    (void)from;
    (void)to;
    (void)huge;
}

void *
hs_pages_grow(size_t bytes, void **mapping, size_t *length)
{
    return hs_pages_alloc(bytes, mapping, length);
}

void
hs_pages_tear(void *from, void *to)
{
    (void)from;
    (void)to;
}

bool
hs_pages_cut(void *from, void *to)
{
    (void)from;
    (void)to;
    return false;
}

size_t
hs_pages_trim(void *mapping, size_t length, void *block, size_t bytes)
{
    (void)mapping;
    (void)block;
    (void)bytes;
    return length;
}

#endif
