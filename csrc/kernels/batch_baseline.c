/* SPDX-License-Identifier: BSD-3-Clause */
/* batch_baseline.c: the batch kernels for any CPU, from batch_template.h: SSE2, NEON or plain C,
 * whichever is the baseline. */
#include "../core/exact/metric.h"
#include "batch.h"
#include "target.h"

#include <string.h>

#if HS_X86_64
#include <emmintrin.h>
#include "wide_sse2.h"
#elif HS_AARCH64
#include <arm_neon.h>
#include "wide_neon.h"
#else
#include "wide_plain.h"
#endif
#define DECIDE_BATCH hs_decide_batch_baseline
#define MEASURE      hs_measure_baseline
#include "batch_template.h"
