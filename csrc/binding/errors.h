/* SPDX-License-Identifier: BSD-3-Clause */
/* errors.h: the only place where a status of the core becomes a Python exception. */
#ifndef HS_ERRORS_H
#define HS_ERRORS_H

#include "numpy_api.h"

#include "../halfshell.h"

/* Sets the exception for a status other than HS_OK; returns NULL for convenience.
 * HS_ERR_INTERRUPTED expects that poll() has set one. options may be NULL. */
PyObject *hs_raise(hs_status status, const hs_failure *failure, const hs_options *options);

/* Of HS_ERR_MEMORY: whether what was expected is within the limit, and more was taken. */
bool hs_took_more(const hs_failure *failure);

/* Bytes in the largest unit of which there is one, such as "1.5 GB"; "no more" of infinitely many,
 * for what may be taken. Returns text, of so many bytes; 32 suffice. */
const char *hs_format_bytes(double bytes, char *text, size_t size);

#endif
