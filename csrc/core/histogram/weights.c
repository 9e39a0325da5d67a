/* SPDX-License-Identifier: BSD-3-Clause */
/* weights.c: weights to integers, carries between limbs, and the one rounding at the end. */
#include "weights.h"

#include <math.h>
#include <string.h>

#define VALUE_BITS 62    /* of a weight, at most */
#define SUM_BITS   64    /* that 2^62 terms and a sign add to those of a term */
#define LOWEST     -1074 /* exponent of the smallest float64 */

/* A float64 that is not zero as an odd integer times a power of two. */
static int64_t
odd_part(double x, int *exponent)
{
    const double  mantissa = frexp(x, exponent);
    const int64_t whole = (int64_t)ldexp(mantissa, 53);
    const int     zeros = hs_trailing_zeros((uint64_t)(whole < 0 ? -whole : whole));
    *exponent += zeros - 53;
    return whole / (INT64_C(1) << zeros);
}

/* Exponents of the lowest and of the highest bit of any; 0 where all are zero. */
static hs_status
find_range(const double *weights, int64_t n, int *lowest, int *highest, hs_failure *failure)
{
    bool any = false;
    *lowest = *highest = 0;
    for (int64_t i = 0; i < n; i++) {
        int exponent, above;
        if (!isfinite(weights[i])) {
            failure->row = i;
            failure->value = weights[i];
            return HS_ERR_WEIGHTS;
        }
        if (weights[i] != 0.0) {
            (void)odd_part(weights[i], &exponent);
            (void)frexp(weights[i], &above);
            *lowest = any && *lowest < exponent ? *lowest : exponent;
            *highest = any && *highest > above ? *highest : above;
            any = true;
        }
    }
    return HS_OK;
}

/* Takes weights as integers of one exponent where 62 bits hold them, else each with a place of its
 * own. Another thread may write to the weights meanwhile: places are kept in range. */
static void
take_weights(const double *weights, const int32_t *order, int64_t n, hs_weights *taken)
{
    for (int64_t i = 0; i < n; i++) {
        const double weight = weights[order[i]];
        int          exponent = taken->exponent;
        int64_t      value = 0;
        if (weight != 0.0 && isfinite(weight)) {
            value = odd_part(weight, &exponent);
        }
        int place = exponent - taken->exponent;
        place = place < 0 ? 0 : place > taken->most_place ? taken->most_place : place;
        if (taken->place != NULL) {
            taken->value[i] = value;
            taken->place[i] = place;
        } else {
            taken->value[i] = (int64_t)((uint64_t)value << place);
        }
    }
}

hs_status
hs_weights_init(hs_account *account, const double *weights, const int32_t *order, int64_t n,
                hs_weights *taken, hs_failure *failure)
{
    int lowest, highest;
    *taken = (hs_weights){.bits = 1};
    if (weights == NULL) {
        return HS_OK;
    }
    const hs_status status = find_range(weights, n, &lowest, &highest, failure);
    if (status != HS_OK) {
        return status;
    }
    const bool one_place = highest - lowest <= VALUE_BITS;
    taken->exponent = lowest;
    taken->bits = one_place ? highest - lowest : 53;
    taken->most_place = highest - lowest;
    taken->value = hs_alloc(account, HS_FOR_POINTS, n, sizeof(int64_t));
    taken->place = one_place ? NULL : hs_alloc(account, HS_FOR_POINTS, n, sizeof(int32_t));
    if (taken->value == NULL || (!one_place && taken->place == NULL)) {
        hs_weights_free(account, taken);
        return HS_ERR_MEMORY;
    }
    take_weights(weights, order, n, taken);
    if (one_place) {
        taken->most_place = 0;
    }
    return HS_OK;
}

void
hs_weights_free(hs_account *account, hs_weights *weights)
{
    hs_free(account, weights->value);
    hs_free(account, weights->place);
    weights->value = NULL;
    weights->place = NULL;
}

hs_status
hs_sums_init(hs_account *account, int64_t n, const hs_weights *a, const hs_weights *b,
             hs_sums *sums)
{
    const int most_place = a->most_place + b->most_place;
    const int for_bits = (a->bits + b->bits + most_place + SUM_BITS) / 32 + 1;
    const int for_place = most_place / 32 + 5; /* what hs_sums_add writes to */
    *sums = (hs_sums){.n = n,
                      .n_limbs = for_bits > for_place ? for_bits : for_place,
                      .exponent = a->exponent + b->exponent};
    if (n > INT64_MAX / sums->n_limbs) {
        return HS_ERR_MEMORY;
    }
    sums->limbs = hs_alloc(account, HS_FOR_CANDIDATES, n * sums->n_limbs, sizeof(int64_t));
    if (sums->limbs == NULL) {
        return HS_ERR_MEMORY;
    }
    memset(sums->limbs, 0, (size_t)(n * sums->n_limbs) * sizeof(int64_t));
    return HS_OK;
}

void
hs_sums_free(hs_account *account, hs_sums *sums)
{
    hs_free(account, sums->limbs);
    sums->limbs = NULL;
}

/* Limbs of 32 bits but for the highest one, which has the sign. */
static void
carry_one(int64_t *limbs, int32_t n)
{
    for (int32_t e = 0; e + 1 < n; e++) {
        const int64_t low = limbs[e] & INT64_C(0xffffffff);
        limbs[e + 1] += (limbs[e] - low) / (INT64_C(1) << 32);
        limbs[e] = low;
    }
}

void
hs_sums_carry(hs_sums *sums)
{
    for (int64_t k = 0; k < sums->n; k++) {
        carry_one(sums->limbs + k * sums->n_limbs, sums->n_limbs);
    }
    sums->n_added = 0;
}

void
hs_sums_join(hs_sums *sums, hs_sums *more)
{
    hs_sums_carry(sums);
    hs_sums_carry(more);
    for (int64_t e = 0; e < sums->n * sums->n_limbs; e++) {
        sums->limbs[e] += more->limbs[e];
    }
    hs_sums_carry(sums);
}

/* top * 2^exponent, 2^63 <= top, and if `more` a little more, as a float64. */
static double
round_top(uint64_t top, bool more, int exponent)
{
    const int lowest = exponent + 11 > LOWEST ? exponent + 11 : LOWEST; /* 53 bits, or fewer */
    const int shift = lowest - exponent;
    if (shift > 64) {
        return 0.0; /* below half of the smallest number */
    }
    const uint64_t half = UINT64_C(1) << (shift - 1);
    const uint64_t rest = shift < 64 ? top & (2 * half - 1) : top;
    uint64_t       kept = shift < 64 ? top >> shift : 0;
    kept += rest > half || (rest == half && (more || (kept & 1)));
    return ldexp((double)kept, lowest);
}

/* Bits [32 e, 32 e + 32) of |sum|: of two's complement, negated by `flip` and what is carried. */
static uint32_t
next_digit(int64_t limb, bool flip, uint64_t *carry)
{
    const uint64_t digit = (flip ? ~(uint32_t)limb : (uint32_t)limb) + *carry;
    *carry = digit >> 32;
    return (uint32_t)digit;
}

double
hs_sums_round(const hs_sums *sums, int64_t k)
{
    const int64_t *limbs = sums->limbs + k * sums->n_limbs;
    const bool     negative = limbs[sums->n_limbs - 1] < 0;
    uint64_t       carry = negative, high = 0, low = 0; /* the last three digits so far */
    uint64_t       top_high = 0, top_low = 0;           /* the highest one that is not zero, and the
                                                           two below it */
    bool           any = false, any_below_top = false;  /* digits below these */
    int32_t        top = 0;
    for (int32_t e = 0; e < sums->n_limbs; e++) {
        const uint32_t digit = next_digit(limbs[e], negative, &carry);
        any = any || (low & UINT32_MAX) != 0;
        low = low >> 32 | high << 32;
        high = digit;
        if (digit != 0) {
            top = e;
            top_high = high;
            top_low = low;
            any_below_top = any;
        }
    }
    if (top_high == 0) {
        return 0.0;
    }
    const int      dropped = hs_bit_length(top_high); /* of the 96 bits, to have 64 */
    const uint64_t leading = top_high << (64 - dropped) | top_low >> dropped;
    const bool     more = any_below_top || (top_low & ((UINT64_C(1) << dropped) - 1)) != 0;
    const double   size = round_top(leading, more, sums->exponent + 32 * (top - 2) + dropped);
    return negative ? -size : size;
}

hs_status
hs_marked_init(hs_account *account, const hs_marks *marks, const int32_t *order, int64_t n,
               int32_t n_types, hs_marked *marked, hs_failure *failure)
{
    *marked = (hs_marked){.type = NULL};
    hs_status status =
        hs_weights_init(account, marks->weights, order, n, &marked->weights, failure);
    if (status != HS_OK || marks->types == NULL) {
        return status;
    }
    marked->type = hs_alloc(account, HS_FOR_POINTS, n, sizeof(int32_t));
    if (marked->type == NULL) {
        return HS_ERR_MEMORY;
    }
    for (int64_t i = 0; i < n; i++) {
        marked->type[i] = marks->types[order[i]];
        if (marked->type[i] < 0 || marked->type[i] >= n_types) {
            failure->row = order[i];
            failure->value = marked->type[i];
            return HS_ERR_TYPES;
        }
    }
    return HS_OK;
}

void
hs_marked_free(hs_account *account, hs_marked *marked)
{
    hs_free(account, marked->type);
    marked->type = NULL;
    hs_weights_free(account, &marked->weights);
}
