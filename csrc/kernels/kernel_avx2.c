/* SPDX-License-Identifier: BSD-3-Clause */
/* kernel_avx2.c: the kernels for x86-64 CPUs with AVX2, from the templates. */
#include "kernel.h"

#include "target.h"

#if HS_X86_64
#include <immintrin.h>
HS_TARGET_BEGIN("avx2,fma,popcnt")
#include "simd_avx2.h"

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
    return (hs_cpu_features() & HS_CPU_AVX2) != 0 && sound();
}

const hs_kernel hs_kernel_avx2 = {
    .name = "avx2",
    .supported = supported,
    HS_KERNEL_LOOPS,
    .recheck = recheck_slab,
    .decide_batch = hs_decide_batch_avx2,
    .measure = hs_measure_avx2,
    .write = hs_write_avx2,
    .candidates = hs_candidates_avx2,
};
#else
typedef int hs_kernel_avx2_is_for_x86_64; /* a translation unit must not be empty */
#endif
