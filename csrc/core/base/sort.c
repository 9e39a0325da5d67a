/* SPDX-License-Identifier: BSD-3-Clause */
#include "sort.h"
#include "os.h"

/* sort.c: sorts from the highest digit down. Each range looks for the highest bit in which its keys
 * differ and distributes by the eight bits from there, so that clusters far apart cost one pass and
 * not one for every digit of the distance. */

#define DIGIT_BITS 8 /* 256 places to write to stay in the first-level cache */
#define BUCKETS    (1 << DIGIT_BITS)
#define FEW_KEYS   32 /* keys that insertion sorts in less time than clearing the counters takes */

static void
insert_keys(int64_t *keys, int32_t *ids, int64_t n)
{
    for (int64_t e = 1; e < n; e++) {
        const int64_t key = keys[e];
        const int32_t id = ids[e];
        int64_t       at = e;
        for (; at > 0 && keys[at - 1] > key; at--) {
            keys[at] = keys[at - 1];
            ids[at] = ids[at - 1];
        }
        keys[at] = key;
        ids[at] = id;
    }
}

/* The bits in which the keys differ; 0 when they need no sorting. */
static uint64_t
varying_bits(const int64_t *keys, int64_t n)
{
    uint64_t bits = 0;
    bool     ordered = true;
    for (int64_t e = 1; e < n; e++) {
        bits |= (uint64_t)(keys[e] ^ keys[0]);
        ordered = ordered & (keys[e - 1] <= keys[e]);
    }
    return ordered ? 0 : bits;
}

/* One stable pass by the digit at `shift`; end[b] becomes the end of bucket b. */
static void
distribute(hs_keys *sort, int64_t first, int64_t n, int shift, int32_t *end)
{
    int64_t *keys = sort->keys + first;
    int32_t *ids = sort->ids + first;
    int32_t  sum = 0;
    memset(end, 0, BUCKETS * sizeof *end);
    for (int64_t e = 0; e < n; e++) {
        end[keys[e] >> shift & (BUCKETS - 1)]++;
    }
    for (int b = 0; b < BUCKETS; b++) {
        const int32_t count = end[b];
        end[b] = sum; /* where the bucket begins; counts up to its end */
        sum += count;
    }
    for (int64_t e = 0; e < n; e++) {
        const int32_t to = end[keys[e] >> shift & (BUCKETS - 1)]++;
        sort->spare_keys[to] = keys[e];
        sort->spare_ids[to] = ids[e];
    }
    memcpy(keys, sort->spare_keys, (size_t)n * sizeof *keys);
    memcpy(ids, sort->spare_ids, (size_t)n * sizeof *ids);
}

hs_status
hs_keys_sort(hs_keys *sort, int64_t first, int64_t end)
{
    int32_t       bucket_end[BUCKETS];
    const int64_t n = end - first;
    sort->work += n;
    if (sort->work >= HS_POLL_POINTS) {
        sort->work = 0;
        if (hs_poll(sort->options, 0.0) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    if (n <= FEW_KEYS) {
        insert_keys(sort->keys + first, sort->ids + first, n);
        return HS_OK;
    }
    const uint64_t varying = varying_bits(sort->keys + first, n);
    if (varying == 0) {
        return HS_OK;
    }
    const int bits = hs_count_bits(varying), shift = bits < DIGIT_BITS ? 0 : bits - DIGIT_BITS;
    distribute(sort, first, n, shift, bucket_end);
    if ((varying & ((UINT64_C(1) << shift) - 1)) == 0) {
        return HS_OK; /* no lower digit differs */
    }
    int64_t begin = 0;
    for (int b = 0; b < BUCKETS; b++) {
        if (bucket_end[b] - begin > 1) {
            const hs_status status = hs_keys_sort(sort, first + begin, first + bucket_end[b]);
            if (status != HS_OK) {
                return status;
            }
        }
        begin = bucket_end[b];
    }
    return HS_OK;
}

/*
 * One digit, of about as many values as there are numbers, tells nearly all of them apart when they
 * are spread evenly; insertion does the rest. Where many agree in it, these are sorted by the
 * digits below.
 */

#define FEW_NUMBERS 24 /* numbers that are quicker sorted by insertion */
#define CROWD       12 /* numbers with the same digit, beyond which insertion does not pay */
#define LEAST_BITS  5  /* of a digit */
#define MOST_BITS   10 /* its counts stay in the first-level cache */

static void
insert_numbers(uint64_t *numbers, int64_t n)
{
    for (int64_t e = 1; e < n; e++) {
        const uint64_t moving = numbers[e];
        int64_t        at = e;
        for (; at > 0 && numbers[at - 1] > moving; at--) {
            numbers[at] = numbers[at - 1];
        }
        numbers[at] = moving;
    }
}

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

void
hs_sort_numbers(uint64_t *numbers, int64_t n, uint64_t *spare)
{
    int64_t place[1 << MOST_BITS];
    if (n <= FEW_NUMBERS) {
        insert_numbers(numbers, n);
        return;
    }
    int64_t ascending = 1;
    while (ascending < n && numbers[ascending - 1] <= numbers[ascending]) {
        ascending++;
    }
    if (ascending == n) { /* as rows of pairs that are given in order */
        return;
    }
    uint64_t low = numbers[0], high = numbers[0];
    for (int64_t e = 1; e < n; e++) {
        low = numbers[e] < low ? numbers[e] : low;
        high = numbers[e] > high ? numbers[e] : high;
    }
    int       bits = LEAST_BITS; /* of the digit */
    const int range = hs_count_bits(high - low);
    while (bits < MOST_BITS && n > INT64_C(1) << bits) {
        bits++;
    }
    const int shift = range > bits ? range - bits : 0;
    memset(place, 0, sizeof *place << bits);
    for (int64_t e = 0; e < n; e++) {
        place[(numbers[e] - low) >> shift]++;
    }
    int64_t most = 0, sum = 0; /* from counts to where each digit ends */
    for (int digit = 0; digit < 1 << bits; digit++) {
        most = place[digit] > most ? place[digit] : most;
        sum += place[digit];
        place[digit] = sum;
    }
    for (int64_t e = n; e-- > 0;) {
        spare[--place[(numbers[e] - low) >> shift]] = numbers[e];
    }
    memcpy(numbers, spare, (size_t)n * sizeof *numbers);
    if (most <= CROWD) {
        insert_numbers(numbers, n);
        return;
    }
    for (int digit = 0; shift > 0 && digit < 1 << bits; digit++) { /* where each begins now */
        const int64_t end = digit + 1 < 1 << bits ? place[digit + 1] : n;
        if (end - place[digit] > 1) {
            hs_sort_numbers(numbers + place[digit], end - place[digit], spare);
        }
    }
}
