/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_MEMORY_MEMORY_H
#define HS_MEMORY_MEMORY_H

#include "../../halfshell.h"
#include "../base/base.h"

/*
 * memory.h: scratch memory of a call: overflow-checked, 64-byte aligned, counted by purpose,
 * bounded by the caller's limit, and shared by its threads. Results have theirs from results.h;
 * they are counted and bounded here too.
 */

/*
 * Small blocks of a call are cut from one larger one, its arena: a small search takes a dozen
 * blocks, and that many calls of malloc cost more than the search. Calls that find it too small
 * leave a larger one in the pool, for the next: else the C library may give the memory of each call
 * back to the system, and have it cleared for the next one, which takes several times as long as a
 * search of 1000 points. Not where tools watch over each block: sanitizers, and the tests, which
 * switch it on where they mean it.
 */
#define HS_HAVE_ARENA (!HS_WATCHED_MALLOC)

#define HS_ARENA_BYTES \
    (32 << 10) /* what 64 points with a few hundred pairs take; without the pool */

/* What one call holds. The limit is looked up only when it could matter: finding out what the
 * machine has left costs more than a small search. */
typedef struct hs_account {
    hs_counters total;      /* bytes[] and bytes_peak are kept here */
    int64_t     held;       /* bytes held now */
    double      limit;      /* bytes allowed */
    hs_limit_fn find_limit; /* called once, when held first passes HS_LIMIT_FREE; or NULL */
    void       *find_context;
    char       *arena; /* owned, a chunk (results.h) taken with the first small block; or NULL */
    char       *arena_first; /* where its next block begins after hs_account_reset */
    char       *arena_next;  /* where its next block begins */
    char       *arena_end;
    bool        is_kept;         /* for long: its arena is a small one */
    bool        arena_was_small; /* for a block that one of the pool would have had room for */
} hs_account;

#define HS_LIMIT_FREE (64 << 20) /* bytes that are handed out before the limit is looked up */

void hs_account_init(hs_account *account, const hs_options *options);

/* Gives the arena back, after the last block. Idempotent; does nothing to an account of zeros. */
void hs_account_close(hs_account *account);

/* The arena hands out anew what it has handed out since hs_account_keep: none of that may be in use
 * any more. */
void hs_account_reset(hs_account *account);

/* What the arena has handed out so far outlives hs_account_reset, what was freed of it too. */
void hs_account_keep(hs_account *account);

/* Whether `bytes` more may be held; settles the limit if it has not been needed before. */
bool hs_account_allows(hs_account *account, double bytes);

/* Charges the account for memory that is held elsewhere: ask hs_account_allows before. */
void hs_account_take(hs_account *account, hs_purpose purpose, int64_t bytes);
void hs_account_give(hs_account *account, int64_t bytes);

/* Room for count * size bytes, uninitialised. NULL when refused. count 0 gives a valid pointer.
 * account NULL: neither counted nor limited. */
void *hs_alloc(hs_account *account, hs_purpose purpose, int64_t count, size_t size);

/* A larger block with the first `held` of its entries in place of one from hs_alloc, or of NULL.
 * NULL when refused: then that one is as it was. */
void *hs_grow(hs_account *account, hs_purpose purpose, void *block, int64_t held, int64_t count,
              size_t size);

/*
 * Keeps the first `bytes` bytes of a block and gives the rest back, where the system takes it:
 * large blocks on Linux. Elsewhere nothing happens. The block stays where it is.
 */
void hs_trim(hs_account *account, void *block, size_t bytes);

/* Counts `bytes` that were allocated for one purpose as for another. NULL-safe. */
void hs_account_reassign(hs_account *account, hs_purpose from, hs_purpose to, int64_t bytes);

/* NULL-safe. The block must come from hs_alloc with the same account. */
void hs_free(hs_account *account, void *block);

#ifdef HS_TESTING
/* Make the nth allocation from now fail (1: the next), once; -n: that one and all behind it; 0
 * switches this off. */
void hs_test_fail_allocation(int64_t nth);
/* Whether that allocation is still to come; false for -1. */
bool hs_test_failure_is_due(void);
/* Blocks and arenas that are allocated and not yet freed, in the whole process. */
int64_t hs_test_live_blocks(void);
/* Whether accounts have an arena, where the build has one; off at first. */
extern bool hs_test_uses_arena;
/* For what hands out memory: asks whether this allocation is the one to fail, and counts a block
 * more (1) or less (-1). */
bool hs_test_allocation_fails(void);
void hs_test_count_block(int change);
#else
#define hs_test_allocation_fails()  false
#define hs_test_count_block(change) ((void)0)
#endif

/* One account for several threads that take memory while they work. */

typedef struct hs_shared hs_shared;

/* account: borrowed, and not to be used directly while threads share it. purpose: what it counts
 * their memory as. NULL when memory is short. */
hs_shared *hs_shared_new(hs_account *account, hs_purpose purpose);
void       hs_shared_free(hs_shared *shared); /* NULL-safe */

/*
 * *block, an array of `held` entries of `size` bytes or NULL, becomes one of `count`, with as many
 * of the first entries as there were. False when refused: then it is as before.
 */
bool hs_shared_resize(hs_shared *shared, void **block, int64_t held, int64_t count, size_t size);

/* NULL-safe; *block becomes NULL. */
void hs_shared_release(hs_shared *shared, void **block);

/*
 * Several arrays that live and die together, in one memory block: one allocation, one
 * failure, one release. Small searches take some thirty arrays, most of which are seldom used.
 */

/* Arrays of one block: seven for each dimension and some more. */
#define HS_MOST_PARTS (7 * HS_MAX_DIM)

typedef struct hs_parts {
    size_t bytes; /* so far, whole cache lines */
    int    n;
    struct {
        void **to; /* where the array's address goes */
        size_t at;
    } part[HS_MOST_PARTS]; /* n are set */
} hs_parts;

HS_ALWAYS_INLINE void
hs_parts_begin(hs_parts *parts)
{
    parts->bytes = 0;
    parts->n = 0;
}

/* One more array, whose address hs_parts_alloc writes to *to. Counts are those of one walker, far
 * from what overflows. */
HS_ALWAYS_INLINE void
hs_parts_add(hs_parts *parts, void **to, int64_t count, size_t size)
{
    HS_ASSERT(count >= 0 && parts->n < HS_MOST_PARTS);
    parts->part[parts->n].to = to;
    parts->part[parts->n++].at = parts->bytes;
    parts->bytes += ((size_t)count * size + HS_ALIGNMENT - 1) & ~(size_t)(HS_ALIGNMENT - 1);
}

/* The memory block of all arrays, uninitialised, for hs_free. NULL when refused: then no address
 * has been written. */
void *hs_parts_alloc(hs_account *account, hs_purpose purpose, const hs_parts *parts);

/* Room for count * size bytes, of any content, for an array that is used again and again: *block is
 * NULL at first, and replaced when it must grow. NULL when refused: then *block is as it was. */
void *hs_reserve(void **block, hs_purpose purpose, int64_t count, size_t size);

#endif
