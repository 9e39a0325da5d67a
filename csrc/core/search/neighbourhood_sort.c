/* SPDX-License-Identifier: BSD-3-Clause */
/* neighbourhood_sort.c: a radix sort from the least digit, stable, of numbers that share few bits:
 * those of some hundred candidates. */
#include "neighbourhood_sort.h"

#include "../base/poll.h"

#include <string.h>

#define DIGIT_BITS 10 /* of a digit, at most: four kB of counts stay in the first-level cache */
#define LEAD_BITS  8  /* of the only digit that few candidates are sorted by; one more for others */
#define FEW        24 /* candidates that are quicker sorted by insertion */
#define MANY       160 /* from here on two digits are quicker than one and insertion */
#define CROWD      12 /* entries with the same leading digit, beyond which insertion does not pay */

hs_status
hs_order_init(hs_account *account, hs_block *block, hs_order *order)
{
    const int64_t n = (int64_t)block->capacity + HS_PADDING;
    order->entries = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(uint64_t));
    order->spare = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(uint64_t));
    order->column = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(float));
    order->shifts = hs_alloc(account, HS_FOR_CANDIDATES,
                             ((int64_t)block->most_runs + 1) * HS_MAX_DIM, sizeof(int64_t));
    block->origin = hs_alloc(account, HS_FOR_CANDIDATES, n, sizeof(int32_t));
    const bool complete = order->entries != NULL && order->spare != NULL && order->column != NULL &&
                          order->shifts != NULL && block->origin != NULL;
    if (complete) { /* padding of labels may be read */
        memset(block->origin, 0, (size_t)n * sizeof(int32_t));
    }
    return complete ? HS_OK : HS_ERR_MEMORY;
}

void
hs_order_free(hs_account *account, hs_block *block, hs_order *order)
{
    hs_free(account, block->origin);
    block->origin = NULL;
    hs_free(account, order->shifts);
    hs_free(account, order->column);
    hs_free(account, order->spare);
    hs_free(account, order->entries);
    *order = (hs_order){0};
}

static void
sort_few(uint64_t *entries, int32_t n)
{
    for (int32_t c = 1; c < n; c++) {
        const uint64_t entry = entries[c];
        int32_t        to = c;
        for (; to > 0 && entries[to - 1] >> 32 > entry >> 32; to--) {
            entries[to] = entries[to - 1];
        }
        entries[to] = entry;
    }
}

/* Turns the number of entries with each digit into the place of the first of them. Returns the
 * largest number. */
HS_ALWAYS_INLINE uint32_t
sum_digits(uint32_t *start, uint32_t mask)
{
    uint32_t most = 0;
    for (uint32_t digit = 0, sum = 0; digit <= mask; digit++) {
        const uint32_t count = start[digit];
        start[digit] = sum;
        sum += count;
        most = count > most ? count : most;
    }
    return most;
}

/* Distributes the entries to the spare ones, which become the entries. */
HS_ALWAYS_INLINE void
deal_out(hs_order *order, int32_t n, int shift, uint32_t mask, uint32_t *start)
{
    const uint64_t *from = order->entries;
    uint64_t       *to = order->spare;
    for (int32_t c = 0; c < n; c++) {
        to[start[(uint32_t)(from[c] >> shift) & mask]++] = from[c];
    }
    order->spare = order->entries;
    order->entries = to;
}

/* Sorts by one digit of the key. Returns the largest number of entries that agree in it. */
static uint32_t
sort_digit(hs_order *order, int32_t n, int shift, int bits)
{
    uint32_t       start[1 << DIGIT_BITS];
    const uint32_t mask = (UINT32_C(1) << bits) - 1;
    memset(start, 0, ((size_t)mask + 1) * sizeof *start);
    for (int32_t c = 0; c < n; c++) {
        start[(uint32_t)(order->entries[c] >> shift) & mask]++;
    }
    const uint32_t most = sum_digits(start, mask);
    deal_out(order, n, shift, mask, start);
    return most;
}

/* Sorts by two digits of `low` and `high` bits, which are the key: one pass counts both. */
static void
sort_two_digits(hs_order *order, int32_t n, int low, int high)
{
    uint32_t       start[1 << DIGIT_BITS], start_high[1 << DIGIT_BITS];
    const uint32_t mask = (UINT32_C(1) << low) - 1, mask_high = (UINT32_C(1) << high) - 1;
    memset(start, 0, ((size_t)mask + 1) * sizeof *start);
    memset(start_high, 0, ((size_t)mask_high + 1) * sizeof *start_high);
    for (int32_t c = 0; c < n; c++) {
        const uint32_t key = (uint32_t)(order->entries[c] >> 32);
        start[key & mask]++;
        start_high[key >> low & mask_high]++;
    }
    (void)sum_digits(start, mask);
    (void)sum_digits(start_high, mask_high);
    deal_out(order, n, 32, mask, start);
    deal_out(order, n, 32 + low, mask_high, start_high);
}

/* Sorts by the keys, stable. `any` has every bit that a key has. */
static void
sort_entries(hs_order *order, int32_t n, uint32_t any)
{
    int bits = 0;
    while (bits < 32 && any >> bits != 0) {
        bits++;
    }
    if (n <= FEW) {
        sort_few(order->entries, n);
        return;
    }
    /* The leading digit alone tells nearly all apart, when keys are spread evenly. Where two tell
     * all of them apart, they do so without the branches of an insertion. */
    const int digits = (bits + DIGIT_BITS - 1) / DIGIT_BITS;
    if (n < MANY || digits > 2) {
        const int most = n < 1 << LEAD_BITS ? LEAD_BITS : LEAD_BITS + 1;
        const int lead = bits < most ? bits : most;
        if (sort_digit(order, n, 32 + bits - lead, lead) <= CROWD) {
            sort_few(order->entries, n);
            return;
        }
    }
    if (digits == 2) {
        sort_two_digits(order, n, (bits + 1) / 2, bits / 2);
        return;
    }
    for (int digit = 0, from = 0; digit < digits; digit++) {
        const int width = (bits - from + digits - digit - 1) / (digits - digit);
        (void)sort_digit(order, n, 32 + from, width);
        from += width;
    }
}

/* Whether two neighbouring entries have equal keys. */
static bool
has_twice(const hs_order *order, int32_t n)
{
    uint32_t twice = 0;
    for (int32_t c = 1; c < n; c++) {
        twice |= (order->entries[c] >> 32) == (order->entries[c - 1] >> 32);
    }
    return twice != 0;
}

/* Sorts by the candidates' numbers, stable. Returns whether a number occurs twice. */
static bool
sort_by_number(const hs_block *block, hs_order *order)
{
    const int32_t n = block->n;
    uint32_t      any = 0;
    for (int32_t c = 0; c < n; c++) {
        const uint32_t key = (uint32_t)block->id[c];
        order->entries[c] = (uint64_t)key << 32 | (uint32_t)c;
        any |= key;
    }
    sort_entries(order, n, any);
    return has_twice(order, n);
}

/* Sorts entries that are in some order by the candidates' numbers, stable. */
static void
sort_again_by_number(const hs_block *block, hs_order *order)
{
    uint32_t any = 0;
    for (int32_t c = 0; c < block->n; c++) {
        const uint32_t place = (uint32_t)(order->entries[c] & UINT32_MAX);
        const uint32_t key = (uint32_t)block->id[place];
        order->entries[c] = (uint64_t)key << 32 | place;
        any |= key;
    }
    sort_entries(order, block->n, any);
}

/* Finds S of each run's image, over the box vectors as given. */
static bool
find_shifts(const hs_lattice *lattice, const hs_block *block, int64_t *shifts)
{
    for (int32_t r = 0; r < block->n_runs; r++) {
        int64_t image[HS_MAX_DIM], *given = shifts + (int64_t)r * HS_MAX_DIM;
        for (int b = 0; b < lattice->n_periodic; b++) {
            image[b] = block->runs[r].image[b];
        }
        if (!hs_lattice_shift(lattice, image, given)) {
            return false;
        }
    }
    return true;
}

/* Sorts by one component of S, stable: by its lower 32 bits, or by the bits above. */
static void
sort_by_shift(const hs_block *block, const int64_t *shifts, bool upper, hs_order *order)
{
    int64_t  least = INT64_MAX;
    uint32_t any = 0;
    for (int32_t r = 0; r < block->n_runs; r++) {
        const int64_t shift = shifts[(int64_t)r * HS_MAX_DIM];
        least = shift < least ? shift : least;
    }
    for (int32_t r = 0; r < block->n_runs; r++) {
        const uint64_t above = (uint64_t)shifts[(int64_t)r * HS_MAX_DIM] - (uint64_t)least;
        const uint32_t key = upper ? (uint32_t)(above >> 32) : (uint32_t)above;
        any |= key;
        for (int32_t c = block->runs[r].at; c < block->runs[r + 1].at; c++) {
            order->spare[c] = (uint64_t)key << 32;
        }
    }
    for (int32_t c = 0; c < block->n; c++) {
        const uint32_t place = (uint32_t)(order->entries[c] & UINT32_MAX);
        order->entries[c] = order->spare[place] | place;
    }
    if (any != 0) {
        sort_entries(order, block->n, any);
    }
}

/* Polls between passes over a large block. */
static hs_status
poll_large(const hs_options *options, const hs_block *block)
{
    return block->n > HS_POLL_CANDIDATES ? hs_poll(options, 0.0) : HS_OK;
}

/* Puts the candidates in the order of the entries. */
static hs_status
arrange(int ndim, const hs_options *options, hs_block_use use, hs_block *block,
        const hs_order *order)
{
    const int32_t        n = block->n;
    int32_t *HS_RESTRICT origin = block->origin;
    float *HS_RESTRICT   column = order->column;
    for (int32_t c = 0; c < n; c++) {
        origin[c] = (int32_t)(order->entries[c] & UINT32_MAX);
        if (use == HS_BLOCK_LISTS_IDS) {
            block->id[c] = (int32_t)(order->entries[c] >> 32);
        }
    }
    for (int k = 0; k <= ndim; k++) {
        float *values = k < ndim ? block->y[k] : block->norm;
        for (int32_t c = 0; c < n; c++) {
            column[c] = values[origin[c]];
        }
        memcpy(values, column, (size_t)n * sizeof *values);
        if (poll_large(options, block) != HS_OK) {
            return HS_ERR_INTERRUPTED;
        }
    }
    return HS_OK;
}

/* Whether each number is above the one before, as in one cell, or where points are numbered as they
 * lie. */
static bool
is_ascending(const int32_t *numbers, int32_t n)
{
    int32_t descents = 0;
    for (int32_t c = 1; c < n; c++) {
        descents += numbers[c] <= numbers[c - 1];
    }
    return descents == 0;
}

hs_status
hs_order_block(const hs_lattice *lattice, const hs_options *options, hs_block_use use,
               hs_block *block, hs_order *order)
{
    if (poll_large(options, block) != HS_OK) { /* it was gathered */
        return HS_ERR_INTERRUPTED;
    }
    if (is_ascending(block->id, block->n)) {
        for (int32_t c = 0; c < block->n; c++) {
            block->origin[c] = c;
        }
        return HS_OK;
    }
    const bool twice = sort_by_number(block, order);
    if (twice && use == HS_BLOCK_LISTS_PLACES) {
        if (!find_shifts(lattice, block, order->shifts)) {
            return HS_ERR_SHIFT_RANGE;
        }
        for (int l = lattice->n_periodic - 1; l >= 0; l--) {
            sort_by_shift(block, order->shifts + l, false, order);
            sort_by_shift(block, order->shifts + l, true, order);
            if (poll_large(options, block) != HS_OK) {
                return HS_ERR_INTERRUPTED;
            }
        }
        sort_again_by_number(block, order);
    }
    return arrange(lattice->ndim, options, use, block, order);
}
