/* SPDX-License-Identifier: BSD-3-Clause */
/* cpu.c: see cpu.h. A feature counts when cpuid reports it and xgetbv shows that the operating
 * system saves its registers. */
#include "cpu.h"

#include "target.h"

#if HS_X86_64

#include <stdint.h>

#if defined(_MSC_VER)
#include <immintrin.h>
#include <intrin.h>
#else
#include <cpuid.h>
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

bool
hs_cpu_has_avx2(void)
{
    const uint32_t fma_popcnt_avx = 1u << 12 | 1u << 23 | 1u << 28; /* leaf 1, ecx */
    return has_bits(saved_registers(), 0x6) &&                      /* xmm, ymm */
           has_bits(cpuid(1).c, fma_popcnt_avx) && has_bits(cpuid(7).b, 1u << 5);
}

bool
hs_cpu_has_avx512(void)
{
    const uint32_t f_dq_bw_vl = 1u << 16 | 1u << 17 | 1u << 30 | 1u << 31; /* leaf 7, ebx */
    return hs_cpu_has_avx2() && has_bits(saved_registers(), 0xe6) && /* and opmask, zmm */
           has_bits(cpuid(7).b, f_dq_bw_vl);
}

#else

bool
hs_cpu_has_avx2(void)
{
    return false;
}

bool
hs_cpu_has_avx512(void)
{
    return false;
}

#endif
