/* SPDX-License-Identifier: BSD-3-Clause */
/* seeds.h: inputs of fuzzing: those that are kept, which are strings of hexadecimal digits, and random
 * ones. A driver aborts where something is wrong. */
#ifndef HS_SEEDS_H
#define HS_SEEDS_H

#include "harness.h"

enum { SEED_LENGTH = 400 };

typedef int (*input_fn)(const uint8_t *data, size_t size);

static inline void
run_seed(input_fn run, const char *digits)
{
    uint8_t bytes[SEED_LENGTH];
    size_t  n = 0;
    for (; digits[2 * n] != 0 && n < SEED_LENGTH; n++) {
        const char byte[3] = {digits[2 * n], digits[2 * n + 1], 0};
        bytes[n] = (uint8_t)strtoul(byte, NULL, 16);
    }
    (void)run(bytes, n);
}

/* Up to 100 bytes, of which a half are small or repeat the one before. */
static inline void
run_random_inputs(input_fn run, uint64_t seed, int inputs)
{
    harness_random random = {seed};
    uint8_t        bytes[100];
    for (int t = 0; t < inputs; t++) {
        const size_t n = (size_t)(random_bits(&random) % sizeof bytes);
        for (size_t b = 0; b < n; b++) {
            const uint64_t bits = random_bits(&random) >> 20;
            bytes[b] = bits & 1             ? (uint8_t)(bits >> 8)
                       : bits & 2 && b >= 1 ? bytes[b - 1]
                                            : (uint8_t)(bits >> 8 & 15);
        }
        (void)run(bytes, n);
    }
}

#endif
