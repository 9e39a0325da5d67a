/* SPDX-License-Identifier: BSD-3-Clause */
/* scan_avx2.c: the scan kernel for x86-64 CPUs with AVX2 and FMA. See kernel.h. */
#include "kernel.h"
#include "target.h"

#if HS_X86_64
#include <immintrin.h>
HS_TARGET_BEGIN("avx2,fma,popcnt")
#include "simd_avx2.h"
#define NAME    hs_scan_avx2
#define UNFUSED hs_scan_avx2_unfused
#include "scan_template.h"
HS_TARGET_END
#else
typedef int hs_scan_avx2_is_for_x86_64; /* a translation unit must not be empty */
#endif
