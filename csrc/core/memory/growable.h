/* SPDX-License-Identifier: BSD-3-Clause */
/* growable.h: an array that is used again and again, and allocated anew only when it must grow. */
#ifndef HS_GROWABLE_H
#define HS_GROWABLE_H

#include "account.h"

typedef struct hs_store {
    void   *data;     /* owned; NULL at first */
    int64_t capacity; /* bytes */
} hs_store;

/* Room for count * size bytes, of any content, or NULL: then what it had is still there. */
HS_ALWAYS_INLINE void *
hs_store_reserve(hs_store *store, hs_purpose purpose, int64_t count, size_t size)
{
    if (store->data != NULL && (double)count * (double)size <= (double)store->capacity) {
        return store->data;
    }
    /* An eighth more: the next one is likely to be a little larger. */
    void *data = hs_alloc(NULL, purpose, count + count / 8, size);
    if (data == NULL) {
        return NULL;
    }
    hs_free(NULL, store->data);
    store->data = data;
    store->capacity = (count + count / 8) * (int64_t)size;
    return data;
}

/* Harmless twice. */
HS_ALWAYS_INLINE void
hs_store_free(hs_store *store)
{
    hs_free(NULL, store->data);
    *store = (hs_store){0};
}

#endif
