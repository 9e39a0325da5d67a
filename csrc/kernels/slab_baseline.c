/* SPDX-License-Identifier: BSD-3-Clause */
/* slab_baseline.c: the test of listed pairs for any CPU of the architecture: with vectors where it
 * always has some that no other kernel uses, else in plain C. */
#include "slab.h"

#include "target.h"

#if HS_X86_64
#include "../halfshell.h"
#include "simd_sse2.h"

#include "slab_template.h"

void
hs_recheck_baseline(hs_slab *pairs)
{
    recheck_slab(pairs);
}
#else
void
hs_recheck_baseline(hs_slab *pairs)
{
    hs_recheck_scalar(pairs);
}
#endif
