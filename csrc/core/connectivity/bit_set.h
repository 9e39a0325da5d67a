/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * bit_set.h: a set of numbers that is filled in any order and emptied in ascending order, again and
 * again. A bit for each number, and two levels above that tell which words have any: emptying takes
 * time by the words that were touched, and a little by the size of the set.
 */
#ifndef HS_BIT_SET_H
#define HS_BIT_SET_H

#include "../exact/limbs.h"
#include "../memory/account.h"

#define HS_BIT_LEVELS 3

typedef struct hs_bit_set {
    uint64_t *word[HS_BIT_LEVELS]; /* parts of one block, owned by word[0] */
    int64_t   n_words[HS_BIT_LEVELS];
} hs_bit_set;

/* An empty set of numbers below n. False when memory is short. */
HS_ALWAYS_INLINE bool
hs_bit_set_make(hs_account *account, int64_t n, hs_bit_set *set)
{
    int64_t all = 0, words = n;
    for (int l = 0; l < HS_BIT_LEVELS; l++) {
        words = (words + 63) / 64;
        set->n_words[l] = words;
        all += words;
    }
    set->word[0] = hs_alloc(account, HS_FOR_SORTING, all, sizeof(uint64_t));
    if (set->word[0] == NULL) {
        return false;
    }
    memset(set->word[0], 0, (size_t)all * sizeof(uint64_t));
    for (int l = 1; l < HS_BIT_LEVELS; l++) {
        set->word[l] = set->word[l - 1] + set->n_words[l - 1];
    }
    return true;
}

HS_ALWAYS_INLINE void
hs_bit_set_free(hs_account *account, hs_bit_set *set)
{
    hs_free(account, set->word[0]);
    set->word[0] = NULL;
}

/* Adds numbers from 64 * word on, one for each bit. */
HS_ALWAYS_INLINE void
hs_bit_set_add_word(hs_bit_set *set, int32_t word, uint64_t bits)
{
    const uint64_t before = set->word[0][word];
    set->word[0][word] = before | bits;
    if (before == 0) {
        set->word[1][word >> 6] |= UINT64_C(1) << (word & 63);
        set->word[2][word >> 12] |= UINT64_C(1) << (word >> 6 & 63);
    }
}

HS_ALWAYS_INLINE void
hs_bit_set_add(hs_bit_set *set, int32_t number)
{
    hs_bit_set_add_word(set, number >> 6, UINT64_C(1) << (number & 63));
}

HS_ALWAYS_INLINE bool
hs_bit_set_has(const hs_bit_set *set, int32_t number)
{
    return set->word[0][number >> 6] >> (number & 63) & 1u;
}

/* Writes all numbers, ascending, and forgets them; returns how many there were. */
HS_ALWAYS_INLINE int64_t
hs_bit_set_drain(hs_bit_set *set, int32_t *to)
{
    const int32_t *const first = to;
    for (int64_t high = 0; high < set->n_words[2]; high++) {
        for (uint64_t top = set->word[2][high]; top != 0; top &= top - 1) {
            const int64_t middle = high * 64 + hs_trailing_zeros(top);
            for (uint64_t mid = set->word[1][middle]; mid != 0; mid &= mid - 1) {
                const int64_t low = middle * 64 + hs_trailing_zeros(mid);
                for (uint64_t bits = set->word[0][low]; bits != 0; bits &= bits - 1) {
                    *to++ = (int32_t)(low * 64 + hs_trailing_zeros(bits));
                }
                set->word[0][low] = 0;
            }
            set->word[1][middle] = 0;
        }
        set->word[2][high] = 0;
    }
    return to - first;
}

#endif
