/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * target.h: code for an instruction set beyond the baseline, without compiler flags of its own.
 * Between HS_TARGET_BEGIN("avx2,fma") and HS_TARGET_END functions are compiled for these features;
 * system headers stay outside. MSVC needs no flag for intrinsics.
 */
#ifndef HS_TARGET_H
#define HS_TARGET_H

/* -DHS_X86_64=0: no kernels but plain C, for tools that do not follow vectors. */
#if !defined(HS_X86_64)
#if defined(__x86_64__) || defined(_M_X64)
#define HS_X86_64 1
#else
#define HS_X86_64 0
#endif
#endif

/* Little-endian only: simd_neon.h numbers bytes within lanes. */
#if (defined(__aarch64__) && defined(__AARCH64EL__)) || defined(_M_ARM64)
#define HS_AARCH64 1
#else
#define HS_AARCH64 0
#endif

/* cpu.c, x86-64 only: what this CPU can run and its operating system keeps across context switches.
 */
#define HS_CPU_AVX2   1 /* with FMA and POPCNT */
#define HS_CPU_AVX512 2 /* F, BW, DQ and VL */
int hs_cpu_features(void);

#define HS_PRAGMA(text) _Pragma(#text)
#if defined(__clang__)
#define HS_TARGET_BEGIN(features) \
    HS_PRAGMA(clang attribute push(__attribute__((target(features))), apply_to = function))
#define HS_TARGET_END HS_PRAGMA(clang attribute pop)
#elif defined(__GNUC__)
#define HS_TARGET_BEGIN(features) HS_PRAGMA(GCC push_options) HS_PRAGMA(GCC target(features))
#define HS_TARGET_END             HS_PRAGMA(GCC pop_options)
#else
#define HS_TARGET_BEGIN(features)
#define HS_TARGET_END
#endif

#endif
