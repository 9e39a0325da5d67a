/* SPDX-License-Identifier: BSD-3-Clause */
/* batch_avx512.c: the batch kernels for x86-64 CPUs with AVX-512, from batch_template.h. */
#include "../core/exact/metric.h"
#include "batch.h"
#include "target.h"

#if HS_X86_64
#include <immintrin.h>
#include <string.h>
HS_TARGET_BEGIN("avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,popcnt")
#include "wide_avx512.h"
#define DECIDE_BATCH hs_decide_batch_avx512
#define MEASURE      hs_measure_avx512
#include "batch_template.h"
HS_TARGET_END
#else
typedef int hs_batch_avx512_is_for_x86_64; /* a translation unit must not be empty */
#endif
