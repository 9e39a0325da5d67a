/* SPDX-License-Identifier: BSD-3-Clause */
/* dispatch.c: the table of kernels, best first, and the choice among them. */
#include "kernel.h"

#include "../halfshell.h"
#include "cpu.h"
#include "target.h"

#include <string.h>

static bool
always(void)
{
    return true;
}

static const hs_kernel kernels[] = {
#if HS_X86_64
    {"avx512", hs_cpu_has_avx512, hs_scan_avx512, hs_scan_avx512_unfused},
    {"avx2", hs_cpu_has_avx2, hs_scan_avx2, hs_scan_avx2_unfused},
#endif
    {"scalar", always, hs_scan_scalar, hs_scan_scalar},
};

enum { N_KERNELS = sizeof kernels / sizeof kernels[0] };

const hs_kernel *
hs_kernel_select(const char *name)
{
    for (int k = 0; k < N_KERNELS; k++) {
        if ((name == NULL || strcmp(kernels[k].name, name) == 0) && kernels[k].supported()) {
            return &kernels[k];
        }
    }
    return NULL;
}

int
hs_kernel_names(const char **names, int capacity)
{
    int n = 0;
    for (int k = 0; k < N_KERNELS; k++) {
        if (kernels[k].supported()) {
            if (n < capacity) {
                names[n] = kernels[k].name;
            }
            n++;
        }
    }
    return n;
}
