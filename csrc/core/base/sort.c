/* SPDX-License-Identifier: BSD-3-Clause */
#include "sort.h"
#include "os.h"

/*
 * sort.c: one digit, of about as many values as there are keys, tells nearly all of them apart when
 * they are spread evenly; insertion does the rest. Where many agree in it, these are sorted by the
 * digits below, from the range of their own: clusters far apart cost one pass, and not one for
 * every digit of the distance.
 */

#define FEW_KEYS   24  /* keys that are quicker sorted by insertion */
#define MANY       160 /* from here on two digits are quicker than one and insertion */
#define CROWD      12  /* keys with the same digit, beyond which insertion does not pay */
#define LEAST_BITS 5   /* of a digit */
#define MOST_BITS  10  /* its counts stay in the first-level cache */

int
hs_count_bits(uint64_t number)
{
    int bits = 0;
    for (int step = 32; step > 0; step /= 2) {
        if (number >> step != 0) {
            number >>= step;
            bits += step;
        }
    }
    return bits + (number != 0);
}

/* Sorts keys by their bits from `from` on, and ids with them unless they are NULL; those that agree
 * in these keep their order. Inlined with constants for ids. */
HS_ALWAYS_INLINE void
insert(uint64_t *keys, int32_t *ids, int64_t n, int from)
{
    for (int64_t e = 1; e < n; e++) {
        const uint64_t key = keys[e];
        const int32_t  id = ids != NULL ? ids[e] : 0;
        int64_t        at = e;
        for (; at > 0 && keys[at - 1] >> from > key >> from; at--) {
            keys[at] = keys[at - 1];
            if (ids != NULL) {
                ids[at] = ids[at - 1];
            }
        }
        keys[at] = key;
        if (ids != NULL) {
            ids[at] = id;
        }
    }
}

/* By two digits of keys that are less than 2^bits, above the lowest: without the branches of an
 * insertion, with which sorted lists of 200 neighbours take 1.5 times as long. */
static void
sort_two_digits(uint64_t *numbers, int64_t n, int from, uint64_t lowest, int bits, uint64_t *spare)
{
    uint32_t       lower[1 << MOST_BITS], upper[1 << MOST_BITS], sums[2] = {0, 0};
    const int      width = (bits + 1) / 2;
    const uint32_t mask = (UINT32_C(1) << width) - 1;
    memset(lower, 0, sizeof *lower << width);
    memset(upper, 0, sizeof *upper << width);
    for (int64_t e = 0; e < n; e++) {
        const uint32_t key = (uint32_t)((numbers[e] >> from) - lowest);
        lower[key & mask]++;
        upper[key >> width]++;
    }
    for (uint32_t digit = 0; digit <= mask; digit++) { /* from counts to where each digit begins */
        const uint32_t in_lower = lower[digit], in_upper = upper[digit];
        lower[digit] = sums[0];
        upper[digit] = sums[1];
        sums[0] += in_lower;
        sums[1] += in_upper;
    }
    for (int64_t e = 0; e < n; e++) {
        const uint32_t key = (uint32_t)((numbers[e] >> from) - lowest);
        spare[lower[key & mask]++] = numbers[e];
    }
    for (int64_t e = 0; e < n; e++) {
        const uint32_t key = (uint32_t)((spare[e] >> from) - lowest);
        numbers[upper[key >> width]++] = spare[e];
    }
}

/* As insert, for many: by their highest digit. Returns of how many of its values the keys are still
 * to be sorted, those of value v from place[v] on; 0: all are in order. */
HS_ALWAYS_INLINE int
sort_by_digit(uint64_t *keys, int32_t *ids, int64_t n, int from, uint64_t *spare,
              int32_t *spare_ids, int64_t *place)
{
    if (n <= FEW_KEYS) {
        insert(keys, ids, n, from);
        return 0;
    }
    uint64_t lowest = keys[0] >> from, highest = lowest;
    for (int64_t e = 1; e < n; e++) {
        const uint64_t key = keys[e] >> from;
        lowest = key < lowest ? key : lowest;
        highest = key > highest ? key : highest;
    }
    const int range = hs_count_bits(highest - lowest);
    int       bits = LEAST_BITS; /* of the digit */
    while (bits < MOST_BITS && n > INT64_C(1) << bits) {
        bits++;
    }
    if (ids == NULL && n >= MANY && n <= INT32_MAX && range > bits && range <= 2 * MOST_BITS) {
        sort_two_digits(keys, n, from, lowest, range, spare);
        return 0;
    }
    const int shift = range > bits ? range - bits : 0;
    memset(place, 0, sizeof *place << bits);
    for (int64_t e = 0; e < n; e++) {
        place[((keys[e] >> from) - lowest) >> shift]++;
    }
    int64_t most = 0, sum = 0; /* from counts to where each digit ends */
    for (int digit = 0; digit < 1 << bits; digit++) {
        most = place[digit] > most ? place[digit] : most;
        sum += place[digit];
        place[digit] = sum;
    }
    for (int64_t e = n; e-- > 0;) {
        const int64_t to = --place[((keys[e] >> from) - lowest) >> shift];
        spare[to] = keys[e];
        if (ids != NULL) {
            spare_ids[to] = ids[e];
        }
    }
    memcpy(keys, spare, (size_t)n * sizeof *keys);
    if (ids != NULL) {
        memcpy(ids, spare_ids, (size_t)n * sizeof *ids);
    }
    if (shift > 0 && most <= CROWD) {
        insert(keys, ids, n, from);
    }
    return shift == 0 || most <= CROWD ? 0 : 1 << bits;
}

hs_status
hs_keys_sort(hs_keys *sort, int64_t first, int64_t end)
{
    int64_t       place[(1 << MOST_BITS) + 1];
    const int64_t n = end - first;
    hs_status     status = HS_OK;
    sort->work += n;
    if (sort->work >= HS_POLL_POINTS) {
        sort->work = 0;
        status = hs_poll(sort->options, 0.0);
    }
    if (status == HS_OK) {
        const int digits = sort_by_digit((uint64_t *)sort->keys + first, sort->ids + first, n, 0,
                                         (uint64_t *)sort->spare_keys, sort->spare_ids, place);
        place[digits] = n;
        for (int digit = 0; status == HS_OK && digit < digits; digit++) {
            if (place[digit + 1] - place[digit] > 1) {
                status = hs_keys_sort(sort, first + place[digit], first + place[digit + 1]);
            }
        }
    }
    return status;
}

void
hs_sort_numbers(uint64_t *numbers, int64_t n, int from, uint64_t *spare)
{
    int64_t   place[(1 << MOST_BITS) + 1];
    const int digits = sort_by_digit(numbers, NULL, n, from, spare, NULL, place);
    place[digits] = n;
    for (int digit = 0; digit < digits; digit++) {
        if (place[digit + 1] - place[digit] > 1) {
            hs_sort_numbers(numbers + place[digit], place[digit + 1] - place[digit], from, spare);
        }
    }
}
