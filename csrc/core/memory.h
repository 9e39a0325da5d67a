/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * memory.h: every byte of the core comes from here: overflow-checked, 64-byte aligned, counted by
 * purpose, and bounded by the caller's limit.
 */
#ifndef HS_MEMORY_H
#define HS_MEMORY_H

#include "../halfshell.h"
#include "base.h"

#define HS_ALIGNMENT 64 /* bytes; a cache line and the widest vector register */

/*
 * What one call holds. The limit is asked for only when it could matter: finding out what the
 * machine has left costs more than a small search.
 */
typedef struct hs_account {
    hs_counters  total;       /* bytes[] and bytes_peak are kept here */
    int64_t      held;        /* bytes held now */
    double       limit;       /* bytes allowed */
    hs_limit_fn  find_limit;  /* asked once, when held first passes HS_LIMIT_FREE; or NULL */
    void        *find_context;
} hs_account;

#define HS_LIMIT_FREE (64 << 20) /* bytes that are handed out without asking for the limit */

void hs_account_init(hs_account *account, const hs_options *options);

/* Whether `bytes` more may be held; settles the limit if it has not been needed before. */
bool hs_account_allows(hs_account *account, double bytes);

/* Room for count * size bytes, uninitialised. NULL when refused. count 0 gives a valid pointer.
 * account NULL: neither counted nor limited. */
void *hs_alloc(hs_account *account, hs_purpose purpose, int64_t count, size_t size);

/* NULL-safe. The block must come from hs_alloc with the same account. */
void hs_free(hs_account *account, void *block);

#ifdef HS_TESTING
/* Make the nth allocation from now fail (1: the next), once; 0 switches this off. */
void hs_test_fail_allocation(int64_t nth);
/* Blocks that are allocated and not yet freed, in the whole process. */
int64_t hs_test_live_blocks(void);
#endif

#endif
