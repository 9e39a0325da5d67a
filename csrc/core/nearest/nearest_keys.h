/* SPDX-License-Identifier: BSD-3-Clause */
/* nearest_keys.h: hits put in order, by their squares or by any comparison. */
#ifndef HS_NEAREST_KEYS_H
#define HS_NEAREST_KEYS_H

#include "../base/poll.h"

/* A hit: its place in the block, and about |D|^2 in the block's units. */
typedef struct hs_nearest_key {
    double  square;
    int32_t place;
} hs_nearest_key;

/* Whether b must come before a. */
typedef bool (*hs_nearest_before_fn)(void *context, const hs_nearest_key *b,
                                     const hs_nearest_key *a);

#define HS_NEAREST_FEW     24 /* up to here keys are sorted by insertion */
#define HS_NEAREST_COUNTED 64 /* up to here each key's place is counted, without a branch */

/* Steps between two polls: some milliseconds, even of exact comparisons. */
#define HS_NEAREST_POLL_STEPS (INT64_C(1) << 15)

/* Whether what may take long goes on: once it does not, keys are in any order, some of them twice,
 * and of no use. */
typedef struct hs_nearest_pace {
    const hs_options *options; /* borrowed; polled */
    int64_t           steps;   /* since the last poll */
    hs_status         status;
} hs_nearest_pace;

/* Counts so many more steps, and polls now and then; false: stop. */
HS_ALWAYS_INLINE bool
hs_nearest_goes_on(hs_nearest_pace *pace, int64_t steps)
{
    pace->steps += steps;
    if (pace->steps >= HS_NEAREST_POLL_STEPS && pace->status == HS_OK) {
        pace->steps = 0;
        pace->status = hs_poll(pace->options, 0.0);
    }
    return pace->status == HS_OK;
}

/* Sorts by squares, none of which is above `largest`. *spare: room for n keys; the two may change
 * places. */
void hs_nearest_sort(hs_nearest_pace *pace, hs_nearest_key **keys, hs_nearest_key **spare,
                     int64_t n, double largest);

/* Brings the `wanted` keys of least squares to the front, in no order. */
void hs_nearest_select(hs_nearest_key *keys, int64_t n, int64_t wanted);

/* Stable, by insertion. */
HS_ALWAYS_INLINE void
hs_nearest_insert(void *context, hs_nearest_key *keys, int64_t n, hs_nearest_before_fn before)
{
    for (int64_t e = 1; e < n; e++) {
        const hs_nearest_key key = keys[e];
        int64_t              at = e;
        for (; at > 0 && before(context, &key, &keys[at - 1]); at--) {
            keys[at] = keys[at - 1];
        }
        keys[at] = key;
    }
}

/* Stable, by merging, with room for n keys in `left`; few calls of `before` where all is in order
 * already. */
HS_ALWAYS_INLINE void
hs_nearest_merge(hs_nearest_pace *pace, void *context, hs_nearest_key *keys, hs_nearest_key *left,
                 int64_t n, hs_nearest_before_fn before)
{
    for (int64_t begin = 0; begin < n && hs_nearest_goes_on(pace, HS_NEAREST_FEW);
         begin += HS_NEAREST_FEW) {
        hs_nearest_insert(context, keys + begin,
                          n - begin < HS_NEAREST_FEW ? n - begin : HS_NEAREST_FEW, before);
    }
    for (int64_t width = HS_NEAREST_FEW; width < n; width *= 2) {
        for (int64_t begin = 0; begin + width < n && hs_nearest_goes_on(pace, 1);
             begin += 2 * width) {
            hs_nearest_key *to = keys + begin, *right = to + width;
            const int64_t   n_right = n - begin - width < width ? n - begin - width : width;
            if (!before(context, right, right - 1)) {
                continue;
            }
            memcpy(left, to, (size_t)width * sizeof *left);
            for (int64_t l = 0, r = 0; l < width && hs_nearest_goes_on(pace, 1);) {
                const bool takes_right = r < n_right && before(context, &right[r], &left[l]);
                *to++ = takes_right ? right[r++] : left[l++];
            }
        }
    }
}

#endif
