/* SPDX-License-Identifier: BSD-3-Clause */
/* wide_avx2.c: the batch kernels and the writer for x86-64 CPUs with AVX2 and FMA, from their
 * templates. */
#include "kernel.h"
#include "target.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if HS_X86_64
#include <immintrin.h>
HS_TARGET_BEGIN("avx2,fma,popcnt")
#include "places_avx2.h"
#define DECIDE_BATCH hs_decide_batch_avx2
#define MEASURE      hs_measure_avx2
#include "batch_template.h"
#define WRITE hs_write_avx2
#include "write_template.h"
HS_TARGET_END
#else
typedef int hs_wide_avx2_is_for_x86_64; /* a translation unit must not be empty */
#endif
