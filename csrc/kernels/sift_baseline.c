/* SPDX-License-Identifier: BSD-3-Clause */
/* sift_baseline.c: the test of listed pairs for any CPU of the architecture: with vectors where it
 * always has some that no other kernel uses, else in plain C. */
#include "sift.h"

#include "target.h"

#if HS_X86_64
#include "../halfshell.h"
#include "simd_sse2.h"

#include "sift_template.h"

void
hs_sift_baseline(hs_sift *pairs)
{
    sift(pairs);
}
#else
void
hs_sift_baseline(hs_sift *pairs)
{
    hs_sift_scalar(pairs);
}
#endif
