/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_keys.c: few keys are placed by counting the smaller ones, many are merged; the nearest of
 * many come by partitioning. */
#include "nearest_keys.h"

HS_ALWAYS_INLINE bool
is_smaller(void *context, const hs_nearest_key *b, const hs_nearest_key *a)
{
    (void)context;
    return b->square < a->square;
}

/*
 * Each key goes to the place that is the number of smaller ones: as integers of 16 bits, the square
 * in some hundreds of steps followed by the key's own number, so that no two are equal. Insertion
 * puts in order what these cannot tell: on average less than one among thirty.
 */
static void
sort_by_counting(hs_nearest_key **keys, hs_nearest_key **spare, int64_t n, double largest)
{
    const int32_t padded = ((int32_t)n + 7) / 8 * 8;
    const int32_t numbers = n <= HS_NEAREST_COUNTED / 2 ? HS_NEAREST_COUNTED / 2
                                                        : HS_NEAREST_COUNTED;
    const double  steps = largest > 0x1p-1000 ? (double)(INT16_MAX / numbers) / largest : 0.0;
    int16_t       rough[HS_NEAREST_COUNTED];
    for (int32_t e = 0; e < n; e++) {
        rough[e] = (int16_t)((int32_t)((*keys)[e].square * steps) * numbers + e);
    }
    for (int32_t e = (int32_t)n; e < padded; e++) {
        rough[e] = INT16_MAX;
    }
    for (int32_t e = 0; e < n; e++) {
        const int16_t own = rough[e];
        int16_t       smaller = 0;
        for (int32_t f = 0; f < padded; f++) {
            smaller = (int16_t)(smaller + (rough[f] < own));
        }
        (*spare)[smaller] = (*keys)[e];
    }
    hs_nearest_key *sorted = *spare;
    *spare = *keys;
    *keys = sorted;
    hs_nearest_insert(NULL, *keys, n, is_smaller);
}

void
hs_nearest_sort(hs_nearest_pace *pace, hs_nearest_key **keys, hs_nearest_key **spare, int64_t n,
                double largest)
{
    if (n <= HS_NEAREST_COUNTED) {
        sort_by_counting(keys, spare, n, largest);
    } else {
        hs_nearest_merge(pace, NULL, *keys, *spare, n, is_smaller);
    }
}

void
hs_nearest_select(hs_nearest_key *keys, int64_t n, int64_t wanted)
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
                const hs_nearest_key key = keys[i];
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
