/* SPDX-License-Identifier: BSD-3-Clause */
/* kernel_avx512.c: the kernels for x86-64 CPUs with AVX-512, from the templates. */
#include "kernel.h"

#include "target.h"

#if HS_X86_64
#include <immintrin.h>
HS_TARGET_BEGIN("avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,popcnt")
#include "simd_avx512.h"

#include "copy_template.h"
#include "nearest_template.h"
#include "scan_template.h"
#include "slab_template.h"

static HS_NO_INLINE bool
sound(void)
{
    return hs_rounds_products();
}
HS_TARGET_END

static bool
supported(void)
{
    /* In this order: sound() needs the instructions. */
    return (hs_cpu_features() & HS_CPU_AVX512) != 0 && sound();
}

const hs_kernel hs_kernel_avx512 = {
    .name = "avx512",
    .supported = supported,
    HS_KERNEL_LOOPS,
    .recheck = recheck_slab,
    .decide_batch = hs_decide_batch_avx512,
    .measure = hs_measure_avx512,
    .write = hs_write_avx512,
    .candidates = hs_candidates_avx2,
};
#else
typedef int hs_kernel_avx512_is_for_x86_64; /* a translation unit must not be empty */
#endif
