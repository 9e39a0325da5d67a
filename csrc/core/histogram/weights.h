/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * weights.h: exact sums of products of two floats, rounded once at the end, so that neither the
 * order of the terms nor the threads that add them can change a bit.
 *
 * A weight is an integer times a power of two. Each sum is a long integer in steps of 32 bits, kept
 * in limbs of 64: what is carried stays where it arose until 2^30 products have been added.
 */
#ifndef HS_WEIGHTS_H
#define HS_WEIGHTS_H

#include "../exact/limbs.h"
#include "../memory/account.h"

/* The weights of a set of points: value[i] * 2^(place[i] + exponent). */
typedef struct hs_weights {
    int64_t *value; /* owned, n; below 2^62 in size. NULL: all weights are 1 */
    int32_t *place; /* owned, n; from 0 on. NULL: all 0 */
    int      exponent;
    int      bits;       /* at least the number of bits of every value, ... */
    int      most_place; /* ... and the largest place */
} hs_weights;

/* Weight order[i] of the caller, finite or HS_ERR_WEIGHTS, becomes number i. NULL: all are 1. */
hs_status hs_weights_init(hs_account *account, const double *weights, const int32_t *order,
                          int64_t n, hs_weights *taken, hs_failure *failure);
void      hs_weights_free(hs_account *account, hs_weights *weights);

/* n sums; owned by one thread. */
typedef struct hs_sums {
    int64_t  n;
    int32_t  n_limbs;
    int      exponent; /* of their lowest bit */
    int64_t *limbs;    /* owned; n_limbs of each, lowest first */
    int64_t  n_added;  /* products added since carries were last passed on */
} hs_sums;

/* Zeros, for products of these two. */
hs_status hs_sums_init(hs_account *account, int64_t n, const hs_weights *a, const hs_weights *b,
                       hs_sums *sums);
void      hs_sums_free(hs_account *account, hs_sums *sums);

/* Adds *more, of the same form, to *sums. */
void hs_sums_join(hs_sums *sums, hs_sums *more);

/* Sum k, rounded to nearest, ties to even; infinite beyond the range of float64. Call hs_sums_carry
 * first. */
double hs_sums_round(const hs_sums *sums, int64_t k);

/* Passes on what was carried in every sum. */
void hs_sums_carry(hs_sums *sums);

#define HS_SUMS_MOST_ADDED (INT64_C(1) << 30)

/* Call before n products are added: passes on carries in time. */
HS_ALWAYS_INLINE void
hs_sums_expect(hs_sums *sums, int64_t n)
{
    if (HS_UNLIKELY(sums->n_added + n > HS_SUMS_MOST_ADDED)) {
        hs_sums_carry(sums);
    }
    sums->n_added += n;
}

/* Adds a * b * 2^place to a sum, given by its limbs; below 2^62 in size each. */
HS_ALWAYS_INLINE void
hs_sums_add(int64_t *limbs, int64_t a, int64_t b, const int32_t place)
{
    const int64_t  sign = (a ^ b) >> 63; /* 0 or -1 */
    const uint64_t size_a = a < 0 ? 0 - (uint64_t)a : (uint64_t)a;
    const uint64_t size_b = b < 0 ? 0 - (uint64_t)b : (uint64_t)b;
    const int      shift = place & 31;
    uint64_t       high = 0;
    const uint64_t low = hs_multiply_add(size_a, size_b, 0, &high);
    const uint64_t lowest = low << shift, middle = high << shift | (low >> 1) >> (63 - shift);
    const uint64_t highest = (high >> 1) >> (63 - shift);
    limbs += place >> 5;
    limbs[0] += ((int64_t)(lowest & UINT32_MAX) ^ sign) - sign;
    limbs[1] += ((int64_t)(lowest >> 32) ^ sign) - sign;
    limbs[2] += ((int64_t)(middle & UINT32_MAX) ^ sign) - sign;
    limbs[3] += ((int64_t)(middle >> 32) ^ sign) - sign;
    if (place > 0) {
        limbs[4] += ((int64_t)highest ^ sign) - sign;
    }
}

/* What the caller knows of each point beside its place: types and weights, copied once. */

/* Types and weights of one set of points, in cell order. */
typedef struct hs_marked {
    int32_t   *type; /* owned; NULL: all 0 */
    hs_weights weights;
} hs_marked;

/* Point i of the set has the caller's number order[i]. HS_ERR_TYPES or HS_ERR_WEIGHTS set
 * failure->row. */
hs_status hs_marked_init(hs_account *account, const hs_marks *marks, const int32_t *order,
                         int64_t n, int32_t n_types, hs_marked *marked, hs_failure *failure);
void      hs_marked_free(hs_account *account, hs_marked *marked);

#endif
