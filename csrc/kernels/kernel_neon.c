/* SPDX-License-Identifier: BSD-3-Clause */
/* kernel_neon.c: the kernels for AArch64 CPUs, all of which have NEON, from the templates. */
#include "kernel.h"

#include "target.h"

#if HS_AARCH64
#include <arm_neon.h>
#include "simd_neon.h"

#include "copy_template.h"
#include "nearest_template.h"
#include "scan_template.h"
#include "slab_template.h"

static bool
supported(void)
{
    return hs_rounds_products();
}

const hs_kernel hs_kernel_neon = {
    .name = "neon",
    .supported = supported,
    HS_KERNEL_LOOPS,
    .recheck = recheck_slab,
    .decide_batch = hs_decide_batch_baseline, /* NEON is the baseline */
    .measure = hs_measure_baseline,
};
#else
typedef int hs_kernel_neon_is_for_aarch64; /* a translation unit must not be empty */
#endif
