/* SPDX-License-Identifier: BSD-3-Clause */
/* dispatch.c: the table of kernels, best first, and the choice among them. */
#include "kernel.h"

#include "../halfshell.h"
#include "target.h"

#include <string.h>

static const hs_kernel *const kernels[] = {
#if HS_X86_64
    &hs_kernel_avx512,
    &hs_kernel_avx2,
#endif
#if HS_AARCH64
    &hs_kernel_neon,
#endif
    &hs_kernel_scalar,
};

enum { N_KERNELS = sizeof kernels / sizeof kernels[0] };

const hs_kernel *
hs_kernel_select(const char *name)
{
    for (int k = 0; k < N_KERNELS; k++) {
        if ((name == NULL || strcmp(kernels[k]->name, name) == 0) && kernels[k]->supported()) {
            return kernels[k];
        }
    }
    return NULL;
}

int
hs_kernel_names(const char **names, int capacity)
{
    int n = 0;
    for (int k = 0; k < N_KERNELS; k++) {
        if (kernels[k]->supported()) {
            if (names != NULL && n < capacity) {
                names[n] = kernels[k]->name;
            }
            n++;
        }
    }
    return n;
}
