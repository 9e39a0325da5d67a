/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * pages.h: large blocks straight from the operating system. They are given back the moment they
 * are freed, which malloc does not promise, and on Linux they ask for huge pages, which fill
 * several times faster than small ones.
 */
#ifndef HS_PAGES_H
#define HS_PAGES_H

#include "base.h"

/* Blocks from here on are worth pages of their own: the size of a huge page. */
#define HS_PAGES_FROM ((size_t)2 << 20)

/*
 * Room for `bytes` bytes, zeroed, aligned to a huge page, with at least HS_PAGES_HEADROOM writable
 * bytes in front of it. *mapping and *length are for hs_pages_free. NULL when refused, and always
 * where there is no such service: then use malloc.
 */
#define HS_PAGES_HEADROOM 64
void *hs_pages_alloc(size_t bytes, void **mapping, size_t *length);
void  hs_pages_free(void *mapping, size_t length);

#endif
