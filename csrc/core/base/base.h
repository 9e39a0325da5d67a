/* SPDX-License-Identifier: BSD-3-Clause */
#ifndef HS_BASE_BASE_H
#define HS_BASE_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* base.h: compiler macros, and small arithmetic that must not become a library call. Every file of
 * the core includes it. */

/*
 * Results must not depend on the compiler: sums keep their order, and no multiply-add is fused
 * unless it is written so. Whatever the flags, the code is right, is refused here, or is refused
 * when it runs (hs_rounds_products). gcc fuses in its GNU modes unless a flag forbids it; it
 * ignores FP_CONTRACT, and __GCC_IEC_559 tells whether a flag allows fusing in a strict mode.
 */
#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0) || \
    (defined(__GCC_IEC_559) && __GCC_IEC_559 == 0) || defined(_M_FP_FAST)
#error "halfshell decides by the rules of IEEE 754; -ffast-math and the like break them"
#endif
#if defined(__clang__)
#if __clang_major__ >= 12
#pragma float_control(precise, on)
#endif
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__) && !defined(__STRICT_ANSI__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#if defined(_MSC_VER)
#define HS_ALWAYS_INLINE           static __forceinline
#define HS_NO_INLINE               __declspec(noinline)
#define HS_RESTRICT                __restrict
#define HS_UNLIKELY(x)             (x)
#define HS_PREFETCH_WRITE(address) ((void)(address))
#define HS_PREFETCH(address)       ((void)(address))
#else
#define HS_ALWAYS_INLINE           static inline __attribute__((always_inline))
#define HS_NO_INLINE               __attribute__((noinline))
#define HS_RESTRICT                restrict
#define HS_UNLIKELY(x)             __builtin_expect(!!(x), 0)
#define HS_PREFETCH_WRITE(address) __builtin_prefetch(address, 1)
#define HS_PREFETCH(address)       __builtin_prefetch(address) /* harmless for any address */
#endif

/* -DHS_HAVE_INT128=0 builds what compilers without a 128-bit integer build. */
#if !defined(HS_HAVE_INT128)
#if defined(__SIZEOF_INT128__)
#define HS_HAVE_INT128 1
#else
#define HS_HAVE_INT128 0
#endif
#endif
#if HS_HAVE_INT128
__extension__ typedef __int128          hs_int128;
__extension__ typedef unsigned __int128 hs_uint128;
#endif

/* AddressSanitizer and MemorySanitizer watch malloc: under them, all memory comes from malloc. */
#if defined(__SANITIZE_ADDRESS__)
#define HS_WATCHED_MALLOC 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(memory_sanitizer)
#define HS_WATCHED_MALLOC 1
#endif
#endif
#if !defined(HS_WATCHED_MALLOC)
#define HS_WATCHED_MALLOC 0
#endif

/* fmax and fmin without a library call. `b` must not be NaN; where `a` is, the result is `b`. */
HS_ALWAYS_INLINE double
hs_larger(double a, double b)
{
    return a > b ? a : b;
}

HS_ALWAYS_INLINE double
hs_smaller(double a, double b)
{
    return a < b ? a : b;
}

#define HS_ALIGNMENT 64 /* bytes; a cache line and the widest vector register */

/* The bits of a double; those of numbers that are not negative are in the order of the numbers. */
HS_ALWAYS_INLINE uint64_t
hs_bits_of_double(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

HS_ALWAYS_INLINE double
hs_double_of_bits(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* 2^exponent, a normal number: -1022 <= exponent <= 1023. */
HS_ALWAYS_INLINE double
hs_power_of_two(int exponent)
{
    return hs_double_of_bits((uint64_t)(exponent + 1023) << 52);
}

/* The bits of a float; those of numbers that are not negative are in the order of the numbers. */
HS_ALWAYS_INLINE uint32_t
hs_bits_of_float(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

HS_ALWAYS_INLINE float
hs_float_of_bits(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/*
 * Whether a product is rounded before something is added to it, in the code of the function that
 * this is inlined into. Not so where clang was given -ffp-contract=fast, which no pragma takes
 * back: such a kernel must not be used. Holds in any rounding mode.
 */
HS_ALWAYS_INLINE bool
hs_rounds_products(void)
{
    volatile double x = 0x1.0000002p27; /* 2^27 + 1: its square takes 55 bits */
    volatile double minus_square = -0x1p54;
    volatile double square = x * x;
    return x * x + minus_square == square + minus_square;
}

/* States what the programmer guarantees, never what a user may get wrong. */
#if defined(NDEBUG)
#define HS_ASSERT(condition) ((void)0)
#else
#include <assert.h>
#define HS_ASSERT(condition) assert(condition)
#endif

#endif
