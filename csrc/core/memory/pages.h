/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * pages.h: large blocks straight from the operating system. They are given back the moment they
 * are freed, which malloc does not promise, and on Linux they can have huge pages, which fill
 * several times faster than small ones.
 */
#ifndef HS_PAGES_H
#define HS_PAGES_H

#include "../base/base.h"

/* Blocks from here on are worth pages of their own: the size of a huge page. */
#define HS_PAGES_FROM ((size_t)2 << 20)

/* Address space is given back in steps of this: a multiple of the page size of every Linux. */
#define HS_PAGES_STEP ((size_t)65536)

/*
 * Room for `bytes` bytes, zeroed, aligned to a huge page, with at least HS_PAGES_HEADROOM writable
 * bytes in front of it. *mapping and *length are for hs_pages_free. NULL when refused, and always
 * where the system cannot do this: then use malloc.
 */
#define HS_PAGES_HEADROOM 64
void *hs_pages_alloc(size_t bytes, void **mapping, size_t *length);
void  hs_pages_free(void *mapping, size_t length);

/* Room as from hs_pages_alloc, but as a reservation: address space that costs nothing until it is
 * written, in small pages unless advised. Between the mapping and the block lie exactly
 * HS_PAGES_STEP bytes. */
void *hs_pages_reserve(size_t bytes, void **mapping, size_t *length);

/* Requests huge pages, or small ones, for what is written from now on in [from, to); the system
 * need not comply. */
void hs_pages_advise(void *from, void *to, bool huge);

/* Whether a mapping can move to where there is more room. ThreadSanitizer does not see mremap:
 * where one moved away, it would take another thread's next one for a race with what lay there. */
#if !defined(__linux__) || HS_WATCHED_MALLOC || defined(__SANITIZE_THREAD__)
#define HS_MAPPINGS_MOVE 0
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define HS_MAPPINGS_MOVE 0
#endif
#endif
#if !defined(HS_MAPPINGS_MOVE)
#define HS_MAPPINGS_MOVE 1
#endif

/* The reservation with room for `bytes` bytes, more than before, contents kept, all of it advised
 * for small pages; returns the block, which may have moved off its alignment. NULL when refused:
 * all is as before, but for the advice. */
void *hs_pages_grow(size_t bytes, void **mapping, size_t *length);

/* [from, to) is the end of a huge page and will be cut off: breaks the page up, so that this part
 * is free at once. Else Linux keeps it until memory is short. Takes a third of a ms. */
void hs_pages_tear(void *from, void *to);

/* Gives [from, to) back; both are multiples of HS_PAGES_STEP from the mapping. False: the range
 * is still mapped, but empty. */
bool hs_pages_cut(void *from, void *to);
/* Gives back what lies behind the first `bytes` bytes of the block. Returns the new length. */
size_t hs_pages_trim(void *mapping, size_t length, void *block, size_t bytes);

#endif
