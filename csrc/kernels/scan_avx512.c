/* SPDX-License-Identifier: BSD-3-Clause */
/* scan_avx512.c: the scan kernel for x86-64 CPUs with AVX-512. See kernel.h. */
#include "kernel.h"
#include "target.h"

#if HS_X86_64
#include <immintrin.h>
HS_TARGET_BEGIN("avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,popcnt")
#include "simd_avx512.h"
#define NAME    hs_scan_avx512
#define UNFUSED hs_scan_avx512_unfused
#include "scan_template.h"
HS_TARGET_END
#else
typedef int hs_scan_avx512_is_for_x86_64; /* a translation unit must not be empty */
#endif
