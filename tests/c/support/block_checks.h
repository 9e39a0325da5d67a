/* SPDX-License-Identifier: BSD-3-Clause */
/* block_checks.h: pairs that come bit by bit, compared with those of one search. */
#ifndef HS_BLOCK_CHECKS_H
#define HS_BLOCK_CHECKS_H

#include "harness.h"
#include "pair_checks.h"

/* Entry e on of an array of the pairs is so many bytes of this one. */
static inline bool
same_part(const hs_pairs *whole, unsigned which, size_t width, int64_t at, const void *part,
          int64_t n)
{
    const char *array = hs_pairs_array(whole, which);
    return n == 0 || memcmp(array + (size_t)at * width, part, (size_t)n * width) == 0;
}

/* The pairs of a block, WANT_ALL and int64, are those from number `at` on. */
static inline bool
block_matches(const hs_pairs *whole, const hs_pairs *block, int64_t at, int ndim)
{
    const int64_t n = hs_pairs_length(block);
    const size_t  d = (size_t)ndim;
    return at + n <= hs_pairs_length(whole) &&
           same_part(whole, HS_WANT_I, 8, at, hs_pairs_array(block, HS_WANT_I), n) &&
           same_part(whole, HS_WANT_J, 8, at, hs_pairs_array(block, HS_WANT_J), n) &&
           same_part(whole, HS_WANT_DISTANCE, 8, at, hs_pairs_array(block, HS_WANT_DISTANCE), n) &&
           same_part(whole, HS_WANT_VECTOR, 8 * d, at, hs_pairs_array(block, HS_WANT_VECTOR), n) &&
           same_part(whole, HS_WANT_SHIFT, 4 * d, at, hs_pairs_array(block, HS_WANT_SHIFT), n);
}

#endif
