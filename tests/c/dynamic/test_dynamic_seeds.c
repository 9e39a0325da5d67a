/* SPDX-License-Identifier: BSD-3-Clause */
/* test_dynamic_seeds.c: dynamic lists against plain arrays: histories that fuzzing keeps, and random
 * ones. */
#define LLVMFuzzerTestOneInput test_dynamic_input
#include "../fuzz/fuzz_dynamic.c"
#include "../support/seeds.h"

void test_dynamic_seeds(void);

static const char *const seeds[] = {
#include "../fuzz/dynamic.txt"
};

enum { SEEDS = sizeof seeds / sizeof seeds[0] };

static void
even_seeds(void)
{
    for (int s = 0; s < SEEDS; s += IS_SLOW ? 4 : 2)
        run_seed(test_dynamic_input, seeds[s]);
}

static void
odd_seeds(void)
{
    for (int s = 1; s < SEEDS; s += IS_SLOW ? 4 : 2)
        run_seed(test_dynamic_input, seeds[s]);
}

static void
random_histories(void)
{
    brute_seen = 1;
    run_random_inputs(test_dynamic_input, 77, TRIALS(1000));
    if (!IS_SLOW) /* fewer histories */
        check_kept("histories of dynamic lists", 0, brute_seen);
}

void
test_dynamic_seeds(void)
{
    RUN(even_seeds);
    RUN(odd_seeds);
    RUN(random_histories);
}
