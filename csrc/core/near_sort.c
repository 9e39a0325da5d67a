/* SPDX-License-Identifier: BSD-3-Clause */
/* near_sort.c: see near_sort.h. */
#include "near_sort.h"

#include <string.h>

HS_ALWAYS_INLINE bool
is_smaller(void *context, const hs_near_key *b, const hs_near_key *a)
{
    (void)context;
    return b->square < a->square;
}

/*
 * Each key goes to the place that is the number of smaller ones: as float32 squares whose last bits
 * are the keys' own numbers, so that no two are equal. Insertion puts in order what these cannot
 * tell, which is next to nothing.
 */
static void
sort_by_counting(hs_near_key **keys, hs_near_key **spare, int64_t n)
{
    const int32_t padded = ((int32_t)n + 7) / 8 * 8;
    int32_t       rough[HS_NEAR_COUNTED];
    for (int32_t e = 0; e < padded; e++) {
        const float square = e < n ? (float)(*keys)[e].square : 0.0f;
        int32_t     bits;
        memcpy(&bits, &square, sizeof bits);
        rough[e] = e < n ? (bits & ~(HS_NEAR_COUNTED - 1)) | e : INT32_MAX;
    }
    for (int32_t e = 0; e < n; e++) {
        const int32_t own = rough[e];
        int32_t       smaller = 0;
        for (int32_t f = 0; f < padded; f++) {
            smaller += rough[f] < own;
        }
        (*spare)[smaller] = (*keys)[e];
    }
    hs_near_key *sorted = *spare;
    *spare = *keys;
    *keys = sorted;
    hs_near_insert(NULL, *keys, n, is_smaller);
}

void
hs_near_sort(hs_near_key **keys, hs_near_key **spare, int64_t n)
{
    if (n <= HS_NEAR_COUNTED) {
        sort_by_counting(keys, spare, n);
    } else {
        hs_near_merge(NULL, *keys, *spare, n, is_smaller);
    }
}

void
hs_near_select(hs_near_key *keys, int64_t n, int64_t wanted)
{
    for (int64_t low = 0, high = n - 1; low < high;) {
        const double pivot = keys[low + (high - low) / 2].square;
        int64_t      i = low, j = high;
        while (i <= j) {
            while (keys[i].square < pivot) {
                i++;
            }
            while (keys[j].square > pivot) {
                j--;
            }
            if (i <= j) {
                const hs_near_key key = keys[i];
                keys[i++] = keys[j];
                keys[j--] = key;
            }
        }
        if (wanted - 1 <= j) {
            high = j;
        } else if (wanted - 1 >= i) {
            low = i;
        } else {
            return;
        }
    }
}
