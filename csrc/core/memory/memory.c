/* SPDX-License-Identifier: BSD-3-Clause */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "memory.h"
#include "results.h"
#include "../base/os_thread.h"

#include <math.h>

/* memory.c: accounts, blocks and arenas. Each block is a chunk (results.h), or lies in the arena
 * behind a header like one, of which `bytes`, `raw` (NULL) and `length` (0) are set. */

#ifdef HS_TESTING
#include <stdatomic.h>

static _Atomic int64_t fail_countdown;
static _Atomic int64_t live_blocks;
bool                   hs_test_uses_arena;

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
#else
enum { hs_test_uses_arena = true };
#endif

/* In tests new blocks are not zero by chance, unless a sanitizer watches them. */
#if defined(HS_TESTING) && !HS_WATCHED_MALLOC
#define hs_test_fill(block, bytes) memset(block, 0x7f, bytes)
#else
#define hs_test_fill(block, bytes) ((void)0)
#endif

/* Larger blocks fill an arena too soon. */
#define LARGEST_IN_ARENA (HS_POOL_SCRATCH / 2)

/* How far one block of the arena is from the next: that one's header lies between them. */
HS_ALWAYS_INLINE size_t
arena_step(size_t bytes)
{
    return (bytes + sizeof(hs_chunk) + HS_ALIGNMENT - 1) & ~(size_t)(HS_ALIGNMENT - 1);
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

/* Small arenas are not kept, nor others where the pool is switched off or in use. */
static void
give_arena(void *data)
{
    hs_chunk_of(data)->is_arena = true;
    if (hs_chunk_of(data)->capacity < HS_POOL_SCRATCH || !hs_pool_give(data)) {
        hs_chunk_free(data);
    }
}

void
hs_account_close(hs_account *account)
{
    if (account->arena != NULL) {
        hs_test_count_block(-1);
        give_arena(account->arena);
    }
    if (account->arena_was_small) {
        /* One in the pool that the next call may have room enough in. */
        void *larger = hs_chunk_new(HS_POOL_SCRATCH), *other = hs_chunk_new(HS_POOL_SCRATCH);
        if (other != NULL) {
            /* From then on glibc keeps twice as much free memory at the top of the heap, where
             * results are copied to arrays, instead of giving that back to the system each time. */
            hs_chunk_free(other);
        }
        if (larger != NULL) {
            give_arena(larger);
        }
    }
    account->arena = account->arena_first = account->arena_next = account->arena_end = NULL;
    account->arena_was_small = false;
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
    if (hs_test_allocation_fails()) {
        return NULL;
    }
    void *block = NULL;
    if (HS_HAVE_ARENA && hs_test_uses_arena && account != NULL && bytes < LARGEST_IN_ARENA) {
        if (account->arena == NULL) {
            account->arena = account->is_kept ? NULL : hs_pool_take(HS_POOL_SCRATCH, true);
            account->arena = account->arena != NULL ? account->arena : hs_chunk_new(HS_ARENA_BYTES);
            if (account->arena != NULL) {
                hs_test_count_block(1);
                account->arena_end = account->arena + hs_chunk_of(account->arena)->capacity;
                account->arena_first = account->arena_next = account->arena + arena_step(0);
            }
        }
        if (arena_step(bytes) <= (size_t)(account->arena_end - account->arena_next)) {
            block = account->arena_next;
            account->arena_next += arena_step(bytes);
            hs_chunk_of(block)->raw = NULL;
            hs_chunk_of(block)->length = 0;
        } else if (account->arena != NULL && !account->is_kept) {
            account->arena_was_small = hs_chunk_of(account->arena)->capacity < HS_POOL_SCRATCH;
        }
    }
    if (block == NULL) {
        /* A tail of a quarter and more becomes a whole huge page: quicker to fill than small
         * ones. */
        const size_t tail = bytes % HS_PAGES_FROM;
        const bool   fills_tail = bytes >= HS_PAGES_FROM && tail >= HS_PAGES_FROM / 4;
        const size_t room = bytes + (fills_tail ? HS_PAGES_FROM - tail : 0);
        block = hs_chunk_new(room);
        if (block == NULL) {
            return NULL;
        }
        if (hs_chunk_of(block)->length > 0) {
            hs_chunk_expect(block, room);
        } else {
            hs_test_fill(block, bytes);
        }
    }
    hs_test_count_block(1);
    hs_chunk_of(block)->bytes = (int64_t)bytes;
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

void *
hs_reserve(void **block, hs_purpose purpose, int64_t count, size_t size)
{
    if (*block == NULL || (double)count * (double)size > (double)hs_chunk_of(*block)->bytes) {
        /* An eighth more: the next one is likely to be a little larger. */
        void *larger = hs_alloc(NULL, purpose, count + count / 8, size);
        if (larger == NULL) {
            return NULL;
        }
        hs_free(NULL, *block);
        *block = larger;
    }
    return *block;
}

void
hs_trim(hs_account *account, void *block, size_t bytes)
{
    hs_chunk *header = hs_chunk_of(block);
    if (header->length == 0 || (int64_t)bytes >= header->bytes) {
        return;
    }
    (void)hs_chunk_cut(block, bytes, NULL);
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
    const hs_chunk *header = hs_chunk_of(block);
    if (account != NULL) {
        account->held -= header->bytes;
    }
    hs_test_count_block(-1);
    if (header->raw == NULL) {
        /* The last block makes room for another; the others wait for hs_account_close. */
        if (account->arena_next == (char *)block + arena_step((size_t)header->bytes)) {
            account->arena_next = block;
        }
        return;
    }
    hs_chunk_free(block);
}

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

void *
hs_parts_alloc(hs_account *account, hs_purpose purpose, const hs_parts *parts)
{
    char *block = hs_alloc(account, purpose, (int64_t)parts->bytes, 1);
    for (int p = 0; block != NULL && p < parts->n; p++) {
        *parts->part[p].to = block + parts->part[p].at;
    }
    return block;
}
