/* SPDX-License-Identifier: BSD-3-Clause */
/* wide_avx512.c: the batch kernels and the writer for x86-64 CPUs with AVX-512, from their
 * templates. */
#include "kernel.h"
#include "target.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if HS_X86_64
#include <immintrin.h>
HS_TARGET_BEGIN("avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,popcnt")
#include "places_avx512.h"
#define DECIDE_BATCH hs_decide_batch_avx512
#define MEASURE      hs_measure_avx512
#include "batch_template.h"
#define WRITE hs_write_avx512
#include "write_template.h"
HS_TARGET_END
#else
typedef int hs_wide_avx512_is_for_x86_64; /* a translation unit must not be empty */
#endif
