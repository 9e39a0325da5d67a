/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * radix_sort.c: sorts from the highest digit down. Each range looks for the highest bit in which
 * its keys differ and distributes by the eight bits from there, so that clusters far apart cost one
 * pass and not one for every digit of the distance.
 */
#include "radix_sort.h"

#include "poll.h"

#include <string.h>

#define DIGIT_BITS 8 /* 256 places to write to stay in the first-level cache */
#define BUCKETS    (1 << DIGIT_BITS)
#define FEW        32 /* keys that insertion sorts in less time than clearing the counters takes */

static void
insert(int64_t *keys, int32_t *ids, int64_t n)
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

/* Where the highest bit of a nonzero number is, from 0. */
static int
top_bit(uint64_t bits)
{
    int top = 0;
    for (int step = 32; step > 0; step /= 2) {
        if (bits >> step != 0) {
            bits >>= step;
            top += step;
        }
    }
    return top;
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
    if (n <= FEW) {
        insert(sort->keys + first, sort->ids + first, n);
        return HS_OK;
    }
    const uint64_t varying = varying_bits(sort->keys + first, n);
    if (varying == 0) {
        return HS_OK;
    }
    const int top = top_bit(varying);
    const int shift = top < DIGIT_BITS ? 0 : top - DIGIT_BITS + 1;
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
