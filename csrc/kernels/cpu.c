/* SPDX-License-Identifier: BSD-3-Clause */
/* cpu.c: a feature counts when cpuid reports it and xgetbv shows that the operating system saves
 * its registers. */
#include "target.h"

#if HS_X86_64

#include <stdbool.h>
#include <stdint.h>

#if defined(_MSC_VER)
#include <immintrin.h>
#include <intrin.h>
#else
#include <cpuid.h>
#endif

#define DETECTED 4 /* beside the features */

#if defined(_MSC_VER)
#define ATOMIC_INT volatile long
#else
#define ATOMIC_INT _Atomic int
#endif

typedef struct registers {
    uint32_t a, b, c, d;
} registers;

static registers
cpuid(uint32_t leaf)
{
    registers r = {0, 0, 0, 0};
#if defined(_MSC_VER)
    int out[4];
    __cpuid(out, 0);
    if ((uint32_t)out[0] >= leaf) {
        __cpuidex(out, (int)leaf, 0);
        r = (registers){(uint32_t)out[0], (uint32_t)out[1], (uint32_t)out[2], (uint32_t)out[3]};
    }
#else
    __get_cpuid_count(leaf, 0, &r.a, &r.b, &r.c, &r.d);
#endif
    return r;
}

static bool
has_bits(uint64_t word, uint64_t bits)
{
    return (word & bits) == bits;
}

/* Found once in a process: in a virtual machine every cpuid calls the host, which takes tens of
 * microseconds. Threads that come here together find and write equal values. */
int
hs_cpu_features(void)
{
    static ATOMIC_INT known;
    if (known != 0) {
        return (int)known;
    }
    const uint32_t basic = cpuid(1).c, extended = cpuid(7).b;
    const uint32_t osxsave_fma_popcnt_avx = 1u << 27 | 1u << 12 | 1u << 23 | 1u << 28;
    const uint32_t avx2 = 1u << 5, f_dq_bw_vl = 1u << 16 | 1u << 17 | 1u << 30 | 1u << 31;
    int            found = DETECTED;
    if (has_bits(basic, osxsave_fma_popcnt_avx) && has_bits(extended, avx2)) {
        /* Register sets that the operating system saves. */
#if defined(_MSC_VER)
        const uint64_t saved = _xgetbv(0);
#else
        uint32_t low, high;
        __asm__ __volatile__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
        const uint64_t saved = (uint64_t)high << 32 | low;
#endif
        found |= has_bits(saved, 0x6) ? HS_CPU_AVX2 : 0;               /* xmm, ymm */
        if (has_bits(saved, 0xe6) && has_bits(extended, f_dq_bw_vl)) { /* and opmask, zmm */
            found |= HS_CPU_AVX512;
        }
    }
    known = found;
    return found;
}

#else
typedef int hs_cpu_is_for_x86_64; /* a translation unit must not be empty */
#endif
