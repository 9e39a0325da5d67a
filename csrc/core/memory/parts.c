/* SPDX-License-Identifier: BSD-3-Clause */
/* parts.c: every array begins on a cache line of the block. */
#include "parts.h"

void *
hs_parts_alloc(hs_account *account, hs_purpose purpose, const hs_parts *parts)
{
    char *block = hs_alloc(account, purpose, (int64_t)parts->bytes, 1);
    for (int p = 0; block != NULL && p < parts->n; p++) {
        *parts->part[p].to = block + parts->part[p].at;
    }
    return block;
}
