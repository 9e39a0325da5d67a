/* SPDX-License-Identifier: BSD-3-Clause */
/* batch_avx2.c: the batch kernels for x86-64 CPUs with AVX2 and FMA, from batch_template.h. */
#include "../core/exact/metric.h"
#include "batch.h"
#include "target.h"

#if HS_X86_64
#include <immintrin.h>
#include <string.h>
HS_TARGET_BEGIN("avx2,fma,popcnt")
#include "wide_avx2.h"
#define DECIDE_BATCH hs_decide_batch_avx2
#define MEASURE      hs_measure_avx2
#include "batch_template.h"
HS_TARGET_END
#else
typedef int hs_batch_avx2_is_for_x86_64; /* a translation unit must not be empty */
#endif
