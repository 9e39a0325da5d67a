/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "memory.h"
#include "pool.h"
#include "../base/os_thread.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* memory.c: accounts, blocks and arenas. Each block has a header in front of it, which remembers
 * its size. */

#ifdef HS_TESTING
#include <stdatomic.h>
#endif

typedef struct block_header {
    void   *raw;    /* what malloc returned, or the mapping */
    size_t  length; /* of the mapping; 0 for malloc and for the arena */
    int64_t bytes;  /* usable, as requested */
} block_header;     /* raw == NULL: in the arena */

_Static_assert(sizeof(block_header) <= HS_PAGES_HEADROOM, "the header lies in the headroom");
_Static_assert(sizeof(block_header) <= HS_ALIGNMENT, "and in front of an aligned block");

#ifdef HS_TESTING
static _Atomic int64_t fail_countdown;
static _Atomic int64_t live_blocks;
static bool            arena_is_used;

void
hs_test_fail_allocation(int64_t nth)
{
    fail_countdown = nth;
}

bool
hs_test_failure_is_due(void)
{
    return fail_countdown > 0 || fail_countdown < -1;
}

int64_t
hs_test_live_blocks(void)
{
    return live_blocks;
}

bool
hs_test_allocation_fails(void)
{
    if (fail_countdown < -1) {
        fail_countdown++;
        return false;
    }
    return fail_countdown == -1 || (fail_countdown > 0 && --fail_countdown == 0);
}

void
hs_test_count_block(int change)
{
    live_blocks += change;
}
void
hs_test_use_arena(bool on)
{
    arena_is_used = on;
}
#else
enum { arena_is_used = 1 };
#endif

/* Larger blocks fill an arena too soon. */
#define LARGEST_IN_ARENA (HS_POOL_SCRATCH / 2)

/* How far one block of the arena is from the next: that one's header lies between them. */
HS_ALWAYS_INLINE size_t
arena_step(size_t bytes)
{
    return (bytes + sizeof(block_header) + HS_ALIGNMENT - 1) & ~(size_t)(HS_ALIGNMENT - 1);
}

HS_ALWAYS_INLINE char *
align(char *at)
{
    return at + (-(uintptr_t)at % HS_ALIGNMENT);
}

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

void
hs_account_take(hs_account *account, hs_purpose purpose, int64_t bytes)
{
    account->held += bytes;
    account->total.bytes[purpose] += bytes;
    if (account->held > account->total.bytes_peak) {
        account->total.bytes_peak = account->held;
    }
}

void
hs_account_give(hs_account *account, int64_t bytes)
{
    account->held -= bytes;
}

static void
give_arena(void *data)
{
    if (!hs_pool_give(data)) { /* it is switched off, or in use */
        hs_chunk_free(data);
    }
}

/* Leaves an arena in the pool that the next call may have room enough in. */
static void
leave_larger_arena(void)
{
    void *data = hs_chunk_new(HS_POOL_SCRATCH), *other = hs_chunk_new(HS_POOL_SCRATCH);
    if (other != NULL) {
        /* From then on glibc keeps twice as much free memory at the top of the heap, where results
         * are copied to arrays, instead of giving that back to the system each time. */
        hs_chunk_free(other);
    }
    if (data != NULL) {
        hs_chunk_of(data)->is_arena = true;
        give_arena(data);
    }
}

void
hs_account_close(hs_account *account)
{
#ifdef HS_TESTING
    live_blocks -= account->arena != NULL;
#endif
    if (account->arena_is_pooled) {
        give_arena(account->arena);
    } else {
        free(account->arena);
    }
    if (account->arena_was_small) {
        leave_larger_arena();
    }
    account->arena = account->arena_first = account->arena_next = account->arena_end = NULL;
    account->arena_is_pooled = account->arena_was_small = false;
}

void
hs_account_reset(hs_account *account)
{
    account->arena_next = account->arena_first;
}

void
hs_account_keep(hs_account *account)
{
    account->arena_first = account->arena_next;
}

/* An arena, of the pool if it has one. */
static bool
take_arena(hs_account *account)
{
    account->arena = account->is_kept ? NULL : hs_pool_take_arena();
    account->arena_is_pooled = account->arena != NULL;
    if (account->arena == NULL) {
        account->arena = malloc(HS_ARENA_BYTES);
    }
    if (account->arena == NULL) {
        return false;
    }
    account->arena_end =
        account->arena + (account->arena_is_pooled ? HS_POOL_SCRATCH : (size_t)HS_ARENA_BYTES);
    account->arena_first = account->arena_next = align(account->arena + sizeof(block_header));
#ifdef HS_TESTING
    live_blocks++;
#endif
    return true;
}

/* The next block of the arena, or NULL when it has no room for that. */
static void *
take_from_arena(hs_account *account, size_t bytes)
{
    if (account->arena == NULL && !take_arena(account)) {
        return NULL;
    }
    char *block = account->arena_next;
    if (arena_step(bytes) > (size_t)(account->arena_end - block)) {
        account->arena_was_small = !account->arena_is_pooled && !account->is_kept;
        return NULL;
    }
    account->arena_next = block + arena_step(bytes);
    ((block_header *)block)[-1] = (block_header){.raw = NULL};
    return block;
}

/* An aligned block with its header filled, but for the bytes. NULL when refused. */
static void *
take_block(hs_account *account, size_t bytes)
{
    void  *raw;
    size_t length;
    if (HS_HAVE_ARENA && arena_is_used && account != NULL && bytes < LARGEST_IN_ARENA) {
        void *block = take_from_arena(account, bytes);
        if (block != NULL) {
            return block;
        }
    }
    if (bytes >= HS_PAGES_FROM) {
        void *block = hs_pages_alloc(bytes, &raw, &length);
        if (block != NULL) {
            ((block_header *)block)[-1] = (block_header){.raw = raw, .length = length};
            return block;
        }
    }
    raw = malloc(bytes + sizeof(block_header) + HS_ALIGNMENT + HS_GUARD_BYTES);
    if (raw == NULL) {
        return NULL;
    }
    void *block = align((char *)raw + sizeof(block_header));
    ((block_header *)block)[-1] = (block_header){.raw = raw};
    hs_guard_new(block, bytes);
    return block;
}

void *
hs_alloc(hs_account *account, hs_purpose purpose, int64_t count, size_t size)
{
    if (count < 0) {
        return NULL;
    }
    /* Dividing takes longer than all the rest where both are small. */
    if (((uint64_t)count | size) >> 31 != 0 && (uint64_t)count > (PTRDIFF_MAX / 2) / size) {
        return NULL;
    }
    const size_t bytes = (size_t)count * size;
    if (account != NULL && !hs_account_allows(account, (double)bytes)) {
        return NULL;
    }
#ifdef HS_TESTING
    if (hs_test_allocation_fails()) {
        return NULL;
    }
#endif
    void *block = take_block(account, bytes);
    if (block == NULL) {
        return NULL;
    }
#ifdef HS_TESTING
    hs_test_count_block(1);
#endif
    ((block_header *)block)[-1].bytes = (int64_t)bytes;
    if (account != NULL) {
        hs_account_take(account, purpose, (int64_t)bytes);
    }
    return block;
}

void *
hs_grow(hs_account *account, hs_purpose purpose, void *block, int64_t held, int64_t count,
        size_t size)
{
    void *larger = hs_alloc(account, purpose, count, size);
    if (larger != NULL && block != NULL) {
        HS_ASSERT(held <= count);
        memcpy(larger, block, (size_t)held * size);
        hs_free(account, block);
    }
    return larger;
}

void
hs_trim(hs_account *account, void *block, size_t bytes)
{
    block_header *header = (block_header *)block - 1;
    if (header->length == 0 || (int64_t)bytes >= header->bytes) {
        return;
    }
    header->length = hs_pages_trim(header->raw, header->length, block, bytes);
    if (account != NULL) {
        account->held -= header->bytes - (int64_t)bytes;
    }
    header->bytes = (int64_t)bytes;
}

void
hs_account_reassign(hs_account *account, hs_purpose from, hs_purpose to, int64_t bytes)
{
    if (account != NULL) {
        account->total.bytes[from] -= bytes;
        account->total.bytes[to] += bytes;
    }
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
    hs_test_count_block(-1);
#endif
    if (header.raw == NULL) {
        /* The last block makes room for another; the others wait for hs_account_close. */
        if (account->arena_next == (char *)block + arena_step((size_t)header.bytes)) {
            account->arena_next = block;
        }
    } else if (header.length > 0) {
        hs_pages_free(header.raw, header.length);
    } else {
        hs_guard_check(block, (size_t)header.bytes);
        free(header.raw);
    }
}

/* A mutex around each change of the account. */

struct hs_shared {
    hs_account *account;
    hs_purpose  purpose;
    hs_mutex    mutex; /* guards the account */
};

hs_shared *
hs_shared_new(hs_account *account, hs_purpose purpose)
{
    hs_shared *shared = hs_alloc(account, purpose, 1, sizeof *shared);
    if (shared != NULL) {
        shared->account = account;
        shared->purpose = purpose;
        hs_mutex_init(&shared->mutex);
    }
    return shared;
}

void
hs_shared_free(hs_shared *shared)
{
    if (shared != NULL) {
        hs_mutex_destroy(&shared->mutex);
        hs_free(shared->account, shared);
    }
}

bool
hs_shared_resize(hs_shared *shared, void **block, int64_t held, int64_t count, size_t size)
{
    hs_mutex_lock(&shared->mutex);
    void *larger = hs_grow(shared->account, shared->purpose, *block, held, count, size);
    if (larger != NULL) {
        *block = larger;
    }
    hs_mutex_unlock(&shared->mutex);
    return larger != NULL;
}

void
hs_shared_release(hs_shared *shared, void **block)
{
    hs_mutex_lock(&shared->mutex);
    hs_free(shared->account, *block);
    *block = NULL;
    hs_mutex_unlock(&shared->mutex);
}

/* Every array begins on a cache line of the block. */

void *
hs_parts_alloc(hs_account *account, hs_purpose purpose, const hs_parts *parts)
{
    char *block = hs_alloc(account, purpose, (int64_t)parts->bytes, 1);
    for (int p = 0; block != NULL && p < parts->n; p++) {
        *parts->part[p].to = block + parts->part[p].at;
    }
    return block;
}
