/* SPDX-License-Identifier: BSD-3-Clause */
/* account_shared.h: one account for several threads that take memory while they work. */
#ifndef HS_ACCOUNT_SHARED_H
#define HS_ACCOUNT_SHARED_H

#include "account.h"

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

#endif
