/* SPDX-License-Identifier: BSD-3-Clause */
/* account_shared.c: a mutex around each change of the account. */
#if !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L /* for os_thread.h */
#endif
#include "account_shared.h"

#include "../base/os_thread.h"

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
