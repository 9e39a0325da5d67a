/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * environment.h: HALFSHELL_KERNEL, which names the kernel of every search that names none; for
 * tests and timing of programs that cannot be changed. The core reads no environment, and the
 * binding reads it once, when the module is imported: a search pays nothing for it.
 */
#ifndef HS_ENVIRONMENT_H
#define HS_ENVIRONMENT_H

#include <stdbool.h>

#include "numpy_api.h"

/* Before any of the others. */
void hs_environment_read(void);

/* A name that need not be that of any kernel, or NULL; static storage. */
const char *hs_environment_kernel(void);

/* As hs_name_of, but None is what the environment says. */
bool hs_kernel_of(PyObject *object, const char **kernel);

#endif
