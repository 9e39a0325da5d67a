/* SPDX-License-Identifier: BSD-3-Clause */
/* repeated_key.c: ascending keys are compared in turn; others are put into a table one by one. */
#include "repeated_key.h"

#include "../memory/account.h"
#include "key_map.h"

#define LEAST_ROWS 16

/* Whether each key is above the one before: then none is repeated, which no table is needed to see.
 */
static bool
ascend(const int64_t *ids, const int32_t *tags, int64_t n)
{
    bool all = true;
    for (int64_t i = 1; i < n && all; i++) {
        all = ids[i] > ids[i - 1] ||
              (ids[i] == ids[i - 1] && tags != NULL && tags[i] > tags[i - 1]);
    }
    return all;
}

int64_t
hs_repeated_key(const int64_t *ids, const int32_t *tags, int64_t n)
{
    int64_t capacity = LEAST_ROWS, repeated = -1;
    if (ascend(ids, tags, n)) {
        return -1;
    }
    while (n > capacity / 2) {
        capacity *= 2;
    }
    hs_key_row *rows = hs_alloc(NULL, HS_FOR_ORDER, capacity, sizeof *rows);
    if (rows == NULL) {
        return -2;
    }
    memset(rows, 0xFF, (size_t)capacity * sizeof *rows);
    for (int64_t i = 0; i < n && repeated < 0; i++) {
        const hs_key   key = {ids[i], tags != NULL ? tags[i] : 0};
        const uint32_t mark = hs_key_mark(key);
        int64_t        r = mark & (uint64_t)(capacity - 1);
        for (; rows[r].place != HS_NO_PLACE; r = (r + 1) & (capacity - 1)) {
            const uint32_t other = rows[r].place;
            if (rows[r].mark == mark && ids[other] == key.id &&
                (tags == NULL || tags[other] == key.tag)) {
                repeated = i;
                break;
            }
        }
        rows[r] = (hs_key_row){(uint32_t)i, mark};
    }
    hs_free(NULL, rows);
    return repeated;
}
