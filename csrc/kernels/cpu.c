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

/* Register sets that the operating system saves; 0 when it does not say. */
static uint64_t
saved_registers(void)
{
    if (!(cpuid(1).c >> 27 & 1)) { /* OSXSAVE: xgetbv may be used */
        return 0;
    }
#if defined(_MSC_VER)
    return _xgetbv(0);
#else
    uint32_t low, high;
    __asm__ __volatile__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (uint64_t)high << 32 | low;
#endif
}

static bool
has_bits(uint64_t word, uint64_t bits)
{
    return (word & bits) == bits;
}

static int
detect_features(void)
{
    const uint32_t fma_popcnt_avx = 1u << 12 | 1u << 23 | 1u << 28;        /* leaf 1, ecx */
    const uint32_t avx2 = 1u << 5;                                         /* leaf 7, ebx */
    const uint32_t f_dq_bw_vl = 1u << 16 | 1u << 17 | 1u << 30 | 1u << 31; /* leaf 7, ebx */
    const uint64_t saved = saved_registers();
    const uint32_t extended = cpuid(7).b;
    int            found = DETECTED;
    if (has_bits(saved, 0x6) && /* xmm, ymm */
        has_bits(cpuid(1).c, fma_popcnt_avx) && has_bits(extended, avx2)) {
        found |= HS_CPU_AVX2;
        found |= has_bits(saved, 0xe6) && /* and opmask, zmm */
                         has_bits(extended, f_dq_bw_vl)
                     ? HS_CPU_AVX512
                     : 0;
    }
    return found;
}

/* Found once in a process: in a virtual machine every cpuid calls the host, which takes tens of
 * microseconds. Threads that come here together find and write equal values. */
int
hs_cpu_features(void)
{
    static ATOMIC_INT known;
    if (known == 0) {
        known = detect_features();
    }
    return (int)known;
}

#else
typedef int hs_cpu_is_for_x86_64; /* a translation unit must not be empty */
#endif
