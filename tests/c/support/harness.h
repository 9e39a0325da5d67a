/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * harness.h: the test harness. A test file defines functions `static void property(void)` that
 * CHECK things, and one `void test_<module>(void)` that RUNs them; main.c lists the modules.
 * Silent on success; a failed check prints where and goes on.
 */
#ifndef HS_HARNESS_H
#define HS_HARNESS_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Under a sanitizer or in an emulator, which make programs four to thirty times slower. */
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__) || defined(HS_EMULATED)
#define IS_SLOW 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer) || __has_feature(address_sanitizer) || \
    __has_feature(memory_sanitizer)
#define IS_SLOW 1
#endif
#endif
#ifndef IS_SLOW
#define IS_SLOW 0
#endif

/* So many random trials, or results that they must have; a tenth of them where that is slow. */
#define TRIALS(n) (IS_SLOW ? ((n) + 9) / 10 : (n))

/* As many trials, of which a tenth would not be every kind of scene: a third where that is slow. */
#define THIRD_OF_TRIALS(n) (IS_SLOW ? ((n) + 2) / 3 : (n))

extern int         harness_failures; /* failed checks so far */
extern int         harness_tests;    /* tests run so far */
extern const char *harness_filter;   /* run only tests whose name contains this, or NULL */
extern bool        harness_times;    /* whether to print what each test took */

#define CHECK(condition)                                                                         \
    do {                                                                                         \
        if (!(condition)) {                                                                      \
            fprintf(stderr, "%s:%d: %s: CHECK(%s)\n", __FILE__, __LINE__, __func__, #condition); \
            harness_failures++;                                                                  \
        }                                                                                        \
    } while (0)

#define RUN(test)                                                      \
    do {                                                               \
        if (harness_filter == NULL || strstr(#test, harness_filter)) { \
            const clock_t begun_ = clock();                            \
            harness_tests++;                                           \
            test();                                                    \
            harness_took(#test, begun_);                               \
        }                                                              \
    } while (0)

/* Seconds of processor time, of all threads: other programs do not change them much. */
static inline void
harness_took(const char *test, clock_t begun)
{
    if (harness_times) {
        printf("%8.3f s  %s\n", (double)(clock() - begun) / CLOCKS_PER_SEC, test);
        fflush(stdout);
    }
}

/* A reproducible stream: xorshift64*, seeded per test. */
typedef struct harness_random {
    uint64_t state; /* not zero */
} harness_random;

static inline uint64_t
random_bits(harness_random *random)
{
    uint64_t x = random->state;
    x ^= x >> 12;
    x ^= x << 25;
    x ^= x >> 27;
    random->state = x;
    return x * UINT64_C(2685821657736338717);
}

/* Uniform in [0, 1). */
static inline double
random_unit(harness_random *random)
{
    return (double)(random_bits(random) >> 11) * 0x1p-53;
}

/* Zero, or of either sign and up to so many powers of two from 1. */
static inline double
random_size(harness_random *random, int spread)
{
    const int    exponent = (int)(random_bits(random) % (uint64_t)(2 * spread + 1)) - spread;
    const double size = ldexp(1.0 + random_unit(random), exponent);
    return random_bits(random) % 8 == 0 ? 0.0 : random_bits(random) & 1 ? size : -size;
}

static inline bool
same_bits(double a, double b)
{
    return memcmp(&a, &b, sizeof a) == 0;
}

#endif
