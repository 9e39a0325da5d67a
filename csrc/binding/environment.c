/* SPDX-License-Identifier: BSD-3-Clause */
/* environment.c: the variables are read once, when the module is imported. */
#include "environment.h"

#include "convert.h"

#include <stdlib.h>
#include <string.h>

/* A copy, because others may change the environment: one more than any name of a kernel has, so
 * that a longer one, cut off, is still none. */
static char kernel_name[32];

void
hs_environment_read(void)
{
    const char *value = getenv("HALFSHELL_KERNEL");
    if (value != NULL) {
        strncpy(kernel_name, value, sizeof kernel_name - 1);
    }
}

const char *
hs_environment_kernel(void)
{
    return kernel_name[0] != '\0' ? kernel_name : NULL;
}

bool
hs_kernel_of(PyObject *object, const char **kernel)
{
    if (object == Py_None) {
        *kernel = hs_environment_kernel();
        return true;
    }
    return hs_name_of(object, "kernel", kernel);
}
