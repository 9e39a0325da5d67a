/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * sort_numbers.c: one digit, of about as many values as there are numbers, tells nearly all of them
 * apart when they are spread evenly; insertion does the rest. Where many agree in it, these are
 * sorted by the digits below.
 */
#include "sort_numbers.h"

#include <string.h>

#define FEW        24 /* numbers that are quicker sorted by insertion */
#define CROWD      12 /* numbers with the same digit, beyond which insertion does not pay */
#define LEAST_BITS 5  /* of a digit */
#define MOST_BITS  10 /* its counts stay in the first-level cache */

static void
insert(uint64_t *numbers, int64_t n)
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

/* Bits of the digit for so many numbers. */
static int
digit_bits(int64_t n)
{
    int bits = LEAST_BITS;
    while (bits < MOST_BITS && n > INT64_C(1) << bits) {
        bits++;
    }
    return bits;
}

/* Turns counts into where each digit ends; returns the largest count. */
static int64_t
sum_counts(int64_t *end, int bits)
{
    int64_t most = 0, sum = 0;
    for (int digit = 0; digit < 1 << bits; digit++) {
        most = end[digit] > most ? end[digit] : most;
        sum += end[digit];
        end[digit] = sum;
    }
    return most;
}

/* Sorts what agrees in the digit; end[]: where each one begins now. */
static void
sort_digits(uint64_t *numbers, int64_t n, const int64_t *begin, int bits, uint64_t *spare)
{
    for (int digit = 0; digit < 1 << bits; digit++) {
        const int64_t end = digit + 1 < 1 << bits ? begin[digit + 1] : n;
        if (end - begin[digit] > 1) {
            hs_sort_numbers(numbers + begin[digit], end - begin[digit], spare);
        }
    }
}

void
hs_sort_numbers(uint64_t *numbers, int64_t n, uint64_t *spare)
{
    int64_t place[1 << MOST_BITS];
    if (n <= FEW) {
        insert(numbers, n);
        return;
    }
    uint64_t low = numbers[0], high = numbers[0];
    for (int64_t e = 1; e < n; e++) {
        low = numbers[e] < low ? numbers[e] : low;
        high = numbers[e] > high ? numbers[e] : high;
    }
    const int bits = digit_bits(n), range = hs_count_bits(high - low);
    const int shift = range > bits ? range - bits : 0;
    memset(place, 0, sizeof *place << bits);
    for (int64_t e = 0; e < n; e++) {
        place[(numbers[e] - low) >> shift]++;
    }
    const int64_t most = sum_counts(place, bits);
    for (int64_t e = n; e-- > 0;) {
        spare[--place[(numbers[e] - low) >> shift]] = numbers[e];
    }
    memcpy(numbers, spare, (size_t)n * sizeof *numbers);
    if (most <= CROWD) {
        insert(numbers, n);
    } else if (shift > 0) {
        sort_digits(numbers, n, place, bits, spare);
    }
}
