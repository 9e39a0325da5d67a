/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * failing_malloc.c: an allocator that refuses on demand, to be preloaded on Linux. Every allocation
 * of the process counts: of the interpreter, of NumPy, of the core, on any thread.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/types.h>

void refuse_from(long first, long last);
long live_blocks(void);

static atomic_long n_calls, first_refused, last_refused; /* first 0: none is */
static atomic_long n_live;

/* What dlsym itself takes before calloc is known; never given back. */
static char   early[4096];
static size_t early_used;

#define NEXT(type, name, ...)                                \
    static type (*next)(__VA_ARGS__);                        \
    if (next == NULL) {                                      \
        next = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, name); \
    }

/* Refuses allocations number `first` to `last`, counted from 1 from now on. */
void
refuse_from(long first, long last)
{
    n_calls = 0;
    last_refused = last;
    first_refused = first;
}

/* Blocks and mapped pages, less those that were given back. */
long
live_blocks(void)
{
    return n_live;
}

static int
refuses(void)
{
    const long first = first_refused, number = ++n_calls;
    return first > 0 && number >= first && number <= last_refused;
}

static void *
counted(void *block)
{
    n_live += block != NULL;
    return block;
}

static long
pages(size_t size)
{
    return (long)((size + 4095) / 4096);
}

static void *
refused(void)
{
    errno = ENOMEM;
    return NULL;
}

void *
malloc(size_t size)
{
    NEXT(void *, "malloc", size_t)
    return refuses() ? refused() : counted(next(size));
}

void *
calloc(size_t n, size_t size)
{
    static int finding;
    if (finding) {
        char *block = early + early_used;
        early_used += (n * size + 15) / 16 * 16;
        return early_used <= sizeof early ? block : NULL;
    }
    finding = 1;
    NEXT(void *, "calloc", size_t, size_t)
    finding = 0;
    return refuses() ? refused() : counted(next(n, size));
}

void *
realloc(void *block, size_t size)
{
    NEXT(void *, "realloc", void *, size_t)
    if (refuses()) {
        return refused();
    }
    void *moved = next(block, size);
    n_live += block == NULL && moved != NULL;
    return moved;
}

int
posix_memalign(void **block, size_t alignment, size_t size)
{
    NEXT(int, "posix_memalign", void **, size_t, size_t)
    if (refuses()) {
        return ENOMEM;
    }
    const int error = next(block, alignment, size);
    n_live += error == 0;
    return error;
}

void *
aligned_alloc(size_t alignment, size_t size)
{
    NEXT(void *, "aligned_alloc", size_t, size_t)
    return refuses() ? refused() : counted(next(alignment, size));
}

void
free(void *block)
{
    NEXT(void, "free", void *)
    if ((char *)block < early || (char *)block >= early + sizeof early) {
        n_live -= block != NULL;
        next(block);
    }
}

void *
mmap(void *where, size_t size, int protection, int flags, int file, off_t offset)
{
    NEXT(void *, "mmap", void *, size_t, int, int, int, off_t)
    if (refuses()) {
        (void)refused();
        return MAP_FAILED;
    }
    void *mapped = next(where, size, protection, flags, file, offset);
    n_live += mapped != MAP_FAILED ? pages(size) : 0;
    return mapped;
}

int
munmap(void *where, size_t size)
{
    NEXT(int, "munmap", void *, size_t)
    const int error = next(where, size);
    n_live -= error == 0 ? pages(size) : 0;
    return error;
}

void *
mremap(void *where, size_t before, size_t size, int flags, ...)
{
    NEXT(void *, "mremap", void *, size_t, size_t, int, ...)
    va_list more;
    va_start(more, flags);
    void *to = flags & MREMAP_FIXED ? va_arg(more, void *) : NULL;
    va_end(more);
    if (size > before && refuses()) {
        (void)refused();
        return MAP_FAILED;
    }
    void *moved = next(where, before, size, flags, to);
    n_live += moved != MAP_FAILED ? pages(size) - pages(before) : 0;
    return moved;
}
