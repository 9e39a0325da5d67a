/* SPDX-License-Identifier: BSD-3-Clause */
/* memory.c: see memory.h. A header in front of each block remembers its size. */
#include "memory.h"

#include "pages.h"

#include <math.h>
#include <stdlib.h>

typedef struct block_header {
    void   *raw;    /* what malloc returned, or the mapping */
    size_t  length; /* of the mapping; 0 for malloc */
    int64_t bytes;  /* what the caller asked for */
} block_header;

_Static_assert(sizeof(block_header) <= HS_PAGES_HEADROOM, "the header lies in the headroom");
_Static_assert(sizeof(block_header) <= HS_ALIGNMENT, "and in front of an aligned block");

#ifdef HS_TESTING
static int64_t fail_countdown;
static int64_t live_blocks;

void
hs_test_fail_allocation(int64_t nth)
{
    fail_countdown = nth;
}

int64_t
hs_test_live_blocks(void)
{
    return live_blocks;
}
#endif

void
hs_account_init(hs_account *account, const hs_options *options)
{
    *account = (hs_account){0};
    account->limit = options->memory_limit;
    account->find_limit = options->find_limit;
    account->find_context = options->find_context;
}

bool
hs_account_allows(hs_account *account, double bytes)
{
    const double wanted = (double)account->held + bytes;
    if (account->find_limit != NULL && wanted > HS_LIMIT_FREE) {
        /* What is free now, and what this call already holds, may be used by this call. */
        const double found = account->find_limit(account->find_context) + (double)account->held;
        account->limit = fmin(account->limit, found);
        account->find_limit = NULL;
    }
    return wanted <= account->limit;
}

/* An aligned block with its header filled, but for the bytes. NULL when refused. */
static void *
take_block(size_t bytes)
{
    void  *raw;
    size_t length;
    if (bytes >= HS_PAGES_FROM) {
        void *block = hs_pages_alloc(bytes, &raw, &length);
        if (block != NULL) {
            ((block_header *)block)[-1] = (block_header){.raw = raw, .length = length};
            return block;
        }
    }
    raw = malloc(bytes + sizeof(block_header) + HS_ALIGNMENT);
    if (raw == NULL) {
        return NULL;
    }
    const uintptr_t first = (uintptr_t)raw + sizeof(block_header);
    const uintptr_t aligned = (first + HS_ALIGNMENT - 1) & ~(uintptr_t)(HS_ALIGNMENT - 1);
    ((block_header *)aligned)[-1] = (block_header){.raw = raw};
    return (void *)aligned;
}

void *
hs_alloc(hs_account *account, hs_purpose purpose, int64_t count, size_t size)
{
    if (count < 0 || (uint64_t)count > (PTRDIFF_MAX / 2) / size) {
        return NULL;
    }
    const size_t bytes = (size_t)count * size;
    if (account != NULL && !hs_account_allows(account, (double)bytes)) {
        return NULL;
    }
#ifdef HS_TESTING
    if (fail_countdown > 0 && --fail_countdown == 0) {
        return NULL;
    }
#endif
    void *block = take_block(bytes);
    if (block == NULL) {
        return NULL;
    }
#ifdef HS_TESTING
    live_blocks++;
#endif
    ((block_header *)block)[-1].bytes = (int64_t)bytes;
    if (account != NULL) {
        account->held += (int64_t)bytes;
        account->total.bytes[purpose] += (int64_t)bytes;
        if (account->held > account->total.bytes_peak) {
            account->total.bytes_peak = account->held;
        }
    }
    return block;
}

void
hs_free(hs_account *account, void *block)
{
    if (block == NULL) {
        return;
    }
    const block_header header = ((block_header *)block)[-1];
    if (account != NULL) {
        account->held -= header.bytes;
    }
#ifdef HS_TESTING
    live_blocks--;
#endif
    if (header.length > 0) {
        hs_pages_free(header.raw, header.length);
    } else {
        free(header.raw);
    }
}
